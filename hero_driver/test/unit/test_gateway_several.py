"""Several robots of one gateway: what befalls the first of them does not end what the others are due."""

import pytest
from test_gateway import HOST, OTHER_HOST, STOCK_DECLARATIONS
from test_gateway_rules import Driver

from hero_test.nonempty import nonempty


@pytest.fixture(name="driver")
def make_driver(monkeypatch):
    return Driver(monkeypatch)


def join_two(driver, **options):
    """Return the connections of hero_2 and hero_7."""
    return [driver.join(host, number=number, **options) for host, number in ((HOST, 2), (OTHER_HOST, 7))]


def test_a_bug_with_one_robot_keeps_the_programs_of_the_others_watched(driver):
    looks = []
    first, second = [driver.gateway.peers[link].bridge for link in join_two(driver)]
    first.commands.watch_commanders = lambda now_s: 1 / 0
    second.commands.watch_commanders = looks.append
    for now_s in (100.0, 100.05):
        driver.gateway.poll(now_s)
    assert looks == [100.0, 100.05] and driver.lines[-1][0] == "fatal" and "ZeroDivisionError" in driver.lines[-1][1]


def test_after_a_pause_each_robot_gets_its_stop_anew_and_no_old_motion(driver):
    links, resumed = join_two(driver, declarations=STOCK_DECLARATIONS), []
    peers = [driver.gateway.peers[link] for link in links]
    for peer in peers:
        driver.gateway.stop_robot(peer)
        peer.bridge.commands.queue.discard_motion = resumed.append
    driver.now_s += 30.0
    driver.gateway.resume(driver.now_s)
    assert resumed == [driver.now_s] * 2 == [peer.stop._began_s for peer in peers]
    for link in nonempty(links):
        driver.gateway.poll_link(link, driver.now_s + 1.0)
        assert not link.closed


def test_every_duplicate_may_try_again_when_the_robot_left_for_good(driver):
    first = driver.join()
    others = [driver.join("10.42.0.%d" % number) for number in (18, 19)]
    first.close("closed by the robot")
    assert [other.reason for other in others] == ["the robot with the same id left; this one may try again"] * 2


def test_a_robot_whose_connection_goes_for_another_is_stopped_before(monkeypatch):
    driver = Driver(monkeypatch, max_connections=3)
    first, second = [driver.join(port=port, number=port, declarations=STOCK_DECLARATIONS) for port in (2, 7)]
    for link in (first, second):
        close = link.close
        link.close = lambda reason, link=link, close=close: (setattr(link, "sent_before", link.sent), close(reason))
    driver.join("10.42.0.19", number=9)
    sent = second.sent
    assert not driver.connect(OTHER_HOST).refusal and second.closed and not first.closed
    assert len(second.sent_before) > len(sent), "the newest of the address with the most"


def test_robots_that_are_gone_are_listed_by_id_until_they_are_dismissed(monkeypatch):
    driver, answers = Driver(monkeypatch, grace_s=10.0), []
    for number in (9, 2, 4):
        driver.join(port=number, number=number).close("closed by the robot")
    driver.now_s += 10.0
    driver.gateway.poll(driver.now_s)
    assert driver.gateway.list_robots(driver.now_s) == []
    gone = driver.gateway.list_gone(driver.now_s)
    assert [status.message.id for status in gone] == [2, 4, 9]
    driver.join(port=4, number=4)
    driver.take_changes()
    driver.gateway.dismiss_gone(answers.append)
    assert sorted(answers[0]) == ["hero_2", "hero_9"] and driver.take_changes() == 1
    driver.gateway.dismiss_gone(answers.append)
    assert answers[1] == [] and driver.gateway.list_gone(driver.now_s) == []


def test_a_bug_with_one_robot_at_the_end_keeps_the_others_served(driver):
    links = join_two(driver, declarations=STOCK_DECLARATIONS)
    for link in links:
        link.reads = 0

        def read(link=link):
            link.reads += 1
            if link is links[0]:
                raise ValueError("a bug")
            return b""

        link.read = read
    driver.gateway.stop_at_end()
    assert links[1].reads > 1 and any("ValueError" in text for level, text in driver.lines if level == "fatal")


def test_problems_with_readings_are_told_robot_by_robot(driver):
    for link, problem in zip(join_two(driver), ("late stamps", "")):
        driver.gateway.peers[link].bridge.corrections.take_problem = lambda problem=problem: problem
    driver.gateway.poll(driver.now_s)
    assert driver.lines[-1] == ("warn", "hero_2: late stamps")


def test_a_robot_that_sends_nothing_any_more_is_named_once(driver):
    for link in join_two(driver):
        session = driver.gateway.peers[link].session
        session.begins_to_lack_data = iter((True, False)).__next__
        session.last_receive_s = driver.now_s
        for _ in range(2):
            driver.gateway.poll_link(link, driver.now_s)
    told = [text for level, text in driver.lines if level == "warn"]
    assert told == [
        "%s is connected, but sends none of its topics any more: reboot it" % name for name in ("hero_2", "hero_7")
    ]
