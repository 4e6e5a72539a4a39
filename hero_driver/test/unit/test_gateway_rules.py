"""What the gateway counts, reports and closes: limits, departures, reboots, duplicates, and stops of late robots."""

import struct
from types import SimpleNamespace

import pytest
import rospy
from test_gateway import HELLO, HOST, OTHER_HOST, PUBLISHED, STOCK_DECLARATIONS, FakeLink, FakeRobot

from hero_driver import gateway as gateway_module
from hero_driver.commands.stop_progress import StopState
from hero_driver.config import read_config
from hero_driver.fleet.admission import GARBAGE_BURST_LENGTH
from hero_driver.gateway import Gateway
from hero_driver.peer import EARLY_EVENTS_MAX, Peer
from hero_driver.rosserial.packets import encode_packet
from hero_driver.rosserial.payloads import TopicInfo
from hero_driver.rosserial.session import Topic, TopicKind
from hero_driver.stops import delivery
from hero_driver.transport.link import READ_LENGTH
from hero_msgs.msg import Robot
from hero_test.nonempty import nonempty

ENCODER_ID = 128


class Link(FakeLink):
    """A connection on which all that is sent is acknowledged."""

    def __init__(self, gateway, host, port=50000):
        super().__init__(gateway, host)
        self.address = self.address._replace(port=port)
        self.sent, self.reason = b"", ""

    @property
    def handed_length(self):
        return len(self.sent)

    def read_unacknowledged_length(self):
        return 0

    def flush(self):
        pass

    def read(self):
        return b""

    def send_packet(self, packet):
        self.sent += packet

    def close(self, reason):
        self.reason = self.reason or reason
        super().close(reason)


class Driver:
    """A gateway with a loop whose calls a test runs, and notes of what it says."""

    def __init__(self, monkeypatch, **parameters):
        self.now_s, self.later, self.soon, self.lines, self.changes = 100.0, [], [], [], 0
        self.keys = []  # of throttled lines
        for module in (gateway_module, delivery):
            monkeypatch.setattr(module.time, "monotonic", lambda: self.now_s)
        monkeypatch.setattr(delivery.time, "sleep", self.run)
        monkeypatch.setattr(rospy.Time, "now", staticmethod(lambda: rospy.Time.from_sec(self.now_s)))
        log = SimpleNamespace(
            log_throttled=self.log_throttled, log=lambda level, text: self.lines.append((level, text))
        )
        self.lateness_s = 0.0
        loop = SimpleNamespace(
            find_lateness_s=lambda: self.lateness_s,
            call_later=lambda delay_s, call: self.later.append((self.now_s + delay_s, call)),
            call_soon=self.soon.append,
        )
        self.gateway = Gateway(
            read_config(parameters),
            loop,
            log,
            SimpleNamespace(submit=lambda job, always=False: True),
            "/hero_driver",
            lambda: int(self.now_s * 1e9),
            self.note_change,
        )

    def note_change(self):
        self.changes += 1

    def log_throttled(self, level, key, text, robot=""):
        self.lines.append((level, text))
        self.keys.append(key)

    def connect(self, host=HOST, port=50000):
        link = Link(self.gateway, host, port)
        link.refusal = self.gateway.open_link(link)
        return link

    def join(self, host=HOST, port=50000, number=0, declarations=PUBLISHED):
        link = self.connect(host, port)
        self.receive(link, FakeRobot(number, declarations).encode_declarations())
        return link

    def receive(self, link, data=HELLO):
        self.gateway.receive_data(link, data, self.now_s)

    def run_soon(self):
        calls, self.soon[:] = list(self.soon), []
        for call in calls:
            call()

    def run(self, duration_s):
        end_s = self.now_s + duration_s
        while self.later and min(self.later, key=lambda item: item[0])[0] <= end_s:
            due = min(self.later, key=lambda item: item[0])
            self.later.remove(due)
            self.now_s = due[0]
            due[1]()
        self.now_s = end_s

    def list_rows(self):
        return [status.message for status in self.gateway.list_robots(self.now_s)]

    def take_changes(self):
        changes, self.changes = self.changes, 0
        return changes


@pytest.fixture(name="driver")
def make_driver(monkeypatch):
    return Driver(monkeypatch)


def test_connections_beyond_the_limits_are_refused_and_counted(monkeypatch):
    driver = Driver(monkeypatch, max_connections=3, max_connections_per_address=2)
    links = [driver.connect(port=port) for port in (1, 2, 3)]
    assert [bool(link.refusal) for link in links] == [False, False, True] and driver.gateway.refused_connections == 1
    driver.gateway.close_link(links[2], links[2].refusal)
    assert "10.42.0.17:3: more than 2 connections of one address" in driver.gateway.last_refusal
    assert driver.lines[-1][0] == "warn" and "refused" in driver.lines[-1][1]
    assert not driver.connect(OTHER_HOST).refusal and not driver.connect("10.42.0.19").refusal
    assert links[0].reason.startswith("its address has the most of too many connections (~max_connections)")
    links[1].close("closed by the robot")
    assert not driver.connect(port=4).refusal, "places are given back"


def test_of_an_address_with_too_many_the_one_that_is_no_robot_goes(monkeypatch):
    driver = Driver(monkeypatch, max_connections=3)
    robot, stranger = driver.join(port=1), driver.connect(port=2)
    driver.join(port=3, number=1)
    driver.connect(OTHER_HOST)
    assert stranger.closed and not robot.closed


def test_who_says_nothing_or_too_much_is_closed(monkeypatch):
    driver = Driver(monkeypatch, declare_timeout_s=5.0)
    link = driver.connect()
    for after_s, is_closed in ((4.9, False), (0.2, True)):
        driver.now_s += after_s
        driver.gateway.poll_link(link, driver.now_s)
        assert link.closed == is_closed
    assert (
        link.reason
        == "did not identify itself as a robot within 5.0 s"
        == driver.gateway.last_refusal.partition(": ")[2]
    )
    noisy = driver.join()
    driver.receive(noisy, b"\x00" * (GARBAGE_BURST_LENGTH - 100))
    assert not noisy.closed
    driver.receive(noisy, b"\x00" * 200)
    assert "too many bytes outside of packets" in noisy.reason
    fast = Driver(monkeypatch, max_bytes_per_s=1000)
    link = fast.join()
    while not link.closed:
        fast.receive(link)
    assert "more than 1000 bytes per second" in link.reason and fast.gateway.peers == {}


def test_departures_are_said_by_their_cause_and_counted(driver):
    for reason, level in (("closed by the robot", "warn"), (gateway_module.THE_DRIVER_ENDS, "debug")):
        link = driver.join()
        link.received_length = 500
        driver.lines.clear()
        driver.take_changes()
        link.close(reason)
        assert driver.lines == [(level, "hero_0 left (10.42.0.17:50000): %s" % reason)] and driver.take_changes() == 1
        driver.lines.clear()
        driver.connect().close(reason)
        assert driver.lines == [(level, "unidentified connection of 10.42.0.17:50000 ended: %s" % reason)]
        assert driver.take_changes() == 0
    (status,) = driver.gateway.list_robots(driver.now_s)
    assert (status.message.state, status.received_length, status.packets) == (Robot.AWAY, 1000, 2 * len(PUBLISHED))
    assert status.message.reconnects == 1


def test_reports_add_what_connections_and_topics_have_dropped(driver):
    link = driver.join()
    link.received_length = 70
    peer = driver.gateway.peers[link]
    peer.bridge.commands.refused, peer.bridge.commands.queue.dropped = 3, 4
    peer.bridge.corrections.refused, peer.session.undeclared_messages = 5, 6
    driver.gateway.warn_robot(peer, "broken")
    (status,) = driver.gateway.list_robots(driver.now_s)
    assert status.message.dropped_messages == 19 and status.message.last_error == "broken"
    assert (status.received_length, status.packets, status.message.uptime.to_sec()) == (70, len(PUBLISHED), 0.0)
    peer.record.booted_s = driver.now_s - 12.5
    (status,) = driver.gateway.list_robots(driver.now_s)
    assert status.message.uptime.to_sec() == 12.5 and status.message.model == "hero"
    assert driver.lines[-1] == ("error", "hero_0: broken")


def test_a_duplicate_is_named_kept_and_let_in_when_its_place_is_free(driver):
    first = driver.join()
    driver.take_changes()
    second = driver.join(OTHER_HOST)
    assert not second.closed and driver.take_changes() > 0 and driver.lines[-1][0] == "error"
    peer = driver.gateway.peers[second]
    assert (
        peer.refused
        and peer.label == "hero_0 at 10.42.0.18:50000 (refused)"
        and driver.gateway.peers[first].label == "hero_0"
    )
    (status,) = driver.gateway.list_robots(driver.now_s)
    assert len(status.duplicates) == 1
    second.close("closed by the robot")
    (status,) = driver.gateway.list_robots(driver.now_s)
    assert status.duplicates == [] and driver.take_changes() > 0
    third = driver.join(OTHER_HOST)
    driver.now_s += 1.0
    driver.receive(first)
    first.close("closed by the robot")
    assert not third.closed, "the place is kept for the first one"
    driver.gateway.poll(driver.now_s + 61.0)
    assert third.reason == "the robot with the same id left; this one may try again"
    assert ("info", "hero_0 has left; its topics and services are unregistered") in driver.lines
    assert driver.gateway.bridges == {} and driver.list_rows() == []


def test_a_robot_that_comes_again_keeps_its_topics(driver, monkeypatch):
    driver.join()
    bridge = driver.gateway.bridges["/hero_0"]
    restarts = []
    monkeypatch.setattr(
        bridge.corrections.odometry, "restart", lambda rebooted, wheels: restarts.append((rebooted, wheels))
    )
    for is_booted in (False, True):
        driver.now_s += 10.0
        link = driver.connect()
        peer = driver.gateway.peers[link]
        peer.boot = object() if is_booted else None
        driver.take_changes()
        driver.receive(link)
        assert restarts[-1] == (is_booted, peer.wheels) and driver.gateway.bridges["/hero_0"] is bridge
        assert driver.take_changes() > 0 and peer.bridge is bridge
    assert driver.list_rows()[0].reconnects == 2


def test_of_events_before_the_name_the_first_ones_are_kept():
    peer = Peer(*[None] * 5)
    for number in range(EARLY_EVENTS_MAX + 3):
        peer.keep(number)
    assert peer.early == list(range(EARLY_EVENTS_MAX))


def test_transforms_declared_before_the_name_are_the_robots(driver):
    link = driver.connect()
    transforms_first = sorted(PUBLISHED, key=lambda entry: entry.name != "/tf")
    driver.receive(link, FakeRobot(0, transforms_first).encode_declarations())
    assert driver.gateway.peers[link].early == [] and not [line for line in driver.lines if line[0] == "error"]
    stranger = driver.connect(OTHER_HOST)
    driver.receive(stranger, encode_declaration(101, "/chatter", "std_msgs/String"))
    assert driver.lines[-1][1].endswith("topic '/chatter' refused: not a name below /hero_N") and not stranger.closed


def encode_declaration(topic_id, name, kind):
    texts = b"".join(struct.pack("<I", len(text)) + text for text in (name.encode(), kind.encode(), b"0" * 32))
    return encode_packet(0, struct.pack("<H", topic_id) + texts + struct.pack("<i", 512))


def test_a_robot_that_joins_while_all_are_stopped_is_stopped(driver):
    driver.gateway.set_stopped(True)
    link, _ = driver.join(declarations=STOCK_DECLARATIONS), driver.connect(OTHER_HOST)  # the second is no robot yet
    assert driver.gateway.list_stops() == [StopState.STOPPING]
    before = len(link.sent)
    driver.run_soon()
    assert len(link.sent) > before and driver.gateway.peers[link].stop is not None
    driver.gateway.set_stopped(False)
    assert not driver.gateway.stopped and driver.list_rows()[0].stop_state in (Robot.STOPPING, Robot.NOT_STOPPED)
    other = driver.join(OTHER_HOST, number=1, declarations=STOCK_DECLARATIONS)
    driver.run_soon()
    assert driver.gateway.peers[other].stop is None
    other.close("closed by the robot")
    assert driver.gateway.list_stops()[-1] is None
    driver.gateway.stop_robot(driver.gateway.peers[link])
    assert driver.gateway.peers[link].stop is not None


def test_the_end_waits_for_robots_and_names_those_that_may_move(driver):
    link, began_s = driver.join(declarations=STOCK_DECLARATIONS), driver.now_s
    driver.gateway.stop_at_end()
    assert driver.gateway.stopped and link.sent and 1.0 <= driver.now_s - began_s < 1.1
    (line,) = [text for level, text in driver.lines if level == "error"]
    assert line == ("the driver ends, and these robots are not known to be at rest: hero_0 (UNCONFIRMED)")


def test_a_pause_of_the_driver_forgives_silence_and_renews_stops(driver):
    link = driver.join(declarations=STOCK_DECLARATIONS)
    peer, resumed = driver.gateway.peers[link], []
    driver.gateway.stop_robot(peer)
    peer.bridge.commands.queue.discard_motion = resumed.append
    driver.now_s += 30.0
    driver.gateway.resume(driver.now_s)
    assert resumed == [driver.now_s] and peer.stop._next_s <= driver.now_s == peer.stop._began_s
    driver.gateway.poll_link(link, driver.now_s + 1.0)
    assert not link.closed


def test_a_bug_is_reported_with_its_place_and_costs_one_connection(driver):
    try:
        raise KeyError("ours")
    except KeyError as error:
        driver.gateway.report_bug(error)
    level, text = driver.lines[-1]
    assert level == "fatal" and "please report it: KeyError: 'ours'" in text and "test_gateway_rules" in text
    driver.gateway.warn_network("too many open files")
    assert driver.lines[-1] == ("warn", "too many open files")


def test_lines_that_differ_in_cause_address_or_robot_are_throttled_apart(driver):
    def list_keys(*acts):
        driver.keys.clear()
        for act in acts:
            act()
        return driver.keys

    gateway = driver.gateway
    for acts in (
        [lambda error=error: gateway.report_bug(error) for error in (KeyError("a"), ValueError("a"))],
        [lambda text=text: gateway.warn_network(text) for text in ("too many files", "a robot broke")],
        [lambda host=host: driver.connect(host).close("late") for host in (HOST, OTHER_HOST)],
        [lambda reason=reason: driver.connect().close(reason) for reason in ("closed by it", "silent for 6 s")],
        [lambda number=number: driver.join(number=number, port=number) for number in (1, 2)],
        [lambda number=number: gateway.bridges["/hero_%d" % number] and close(driver, number) for number in (1, 2)],
        [lambda number=number: warn_twice(driver, number) for number in (3, 4)],
    ):
        keys = list_keys(*acts)
        assert len(set(keys)) == len(keys) >= 2, keys
        assert all(len(key) < 150 for key in nonempty(keys))


def close(driver, number):
    driver.gateway.fleet.robots["/hero_%d" % number].link.close("closed by the robot")


def warn_twice(driver, number):
    peer = driver.gateway.peers[driver.join(number=number, port=number)]
    for text in ("one thing", "another thing"):
        driver.gateway.warn_robot(peer, text + "." * 500)


def test_the_end_waits_two_seconds_for_wheels_that_turn(driver):
    link, began_s = driver.join(declarations=STOCK_DECLARATIONS), driver.now_s
    (peer,) = driver.gateway.peers.values()
    link.read = lambda: peer.wheels.read_ticks(1000.0 * driver.now_s, 0.0) or b""
    driver.gateway.stop_at_end()
    assert 2.0 <= driver.now_s - began_s < 2.03
    (line,) = [text for level, text in driver.lines if level == "error" and "the driver ends" in text]
    assert line.endswith("hero_0 (MOVING)")


class TurningRobot:
    """A robot whose wheels turn, and whose readings the driver reads."""

    def __init__(self, driver, number):
        self.link = driver.join(port=number, number=number, declarations=STOCK_DECLARATIONS)
        self.driver = driver
        self.motors = FakeRobot(number).motors
        self.motors.is_pushed = True
        self.read_s = driver.now_s

    def read(self, length):
        """Let the driver read so many bytes, or a few more."""
        data = b""
        while len(data) < length:
            self.read_s += 0.034
            data += encode_packet(ENCODER_ID, self.motors.encode_encoder("hero_0", self.read_s, self.read_s))
        self.driver.receive(self.link, data)


@pytest.mark.parametrize("lateness_s", [0.0, 0.4])
def test_an_overloaded_pc_is_named_instead_of_robots_until_it_is_not(driver, monkeypatch, lateness_s):
    driver.lateness_s = lateness_s
    monkeypatch.setattr(gateway_module.os, "getloadavg", lambda: (71.26, 0.0, 0.0))
    robots = [TurningRobot(driver, number) for number in range(3)]
    driver.lines.clear()
    driver.gateway.set_stopped(True)
    for _ in range(20):
        for robot in robots:
            robot.read(READ_LENGTH)
        driver.run(0.1)
    said = [text for level, text in driver.lines if level in ("warn", "error")]
    assert bool(said) == (lateness_s > 0.0), "a network that is late says nothing of the PC"
    assert all(text.startswith("the PC is overloaded (load 71.3 on ") and "up to 0.4 s late" in text for text in said)
    assert {key for key in driver.keys if "overload" in key} <= {"overload"}, "one line for all robots"
    assert set(driver.gateway.list_stops()) == {StopState.STOPPING}
    for _ in range(40):
        for robot in robots:
            robot.read(1)
        driver.run(0.034)
    assert set(driver.gateway.list_stops()) == {StopState.MOVING}


def test_a_robot_that_has_said_who_it_is_leaves_the_unidentified_ones(driver):
    links = [driver.connect(port=port) for port in (1, 2)]
    assert len(driver.gateway._admission._unidentified) == 2
    driver.receive(links[0])
    assert len(driver.gateway._admission._unidentified) == 1
    links[1].close("closed by the robot")
    assert len(driver.gateway._admission._unidentified) == 0


def test_a_topic_keeps_its_publisher_until_its_layout_changes(driver):
    bridge, jobs, replaced = join_bridge(driver), [], []
    bridge._registrar = SimpleNamespace(submit=lambda job, **options: jobs.append(job) or True)
    bridge.endpoints.advertise = lambda name, layout, publishers, old: replaced.append(old)
    name, publishers = "/hero_0/note", []
    for md5sum in ("a" * 32, "a" * 32, "b" * 32, "b" * 32):
        bridge.declare(make_topic(name, TopicKind.PUBLISHER, md5sum), name)
        publishers.append(bridge._publishers[name])
    first, second = publishers[0], publishers[2]
    assert publishers == [first, first, second, second] and first is not second
    for job in jobs:
        job()
    assert replaced == [[], [], [first], []]


def test_what_a_robot_takes_has_an_id_once_its_layout_is_registered(driver):
    bridge, jobs = join_bridge(driver), []
    bridge._registrar = SimpleNamespace(submit=lambda job, **options: jobs.append(job) or True)
    bridge._loop = SimpleNamespace(call_soon=lambda call: call())
    usable = [True, True, False]
    bridge.endpoints.subscribe = lambda name, layout, make_subscriber: usable.pop(0)
    name = "/hero_0/note"
    for md5sum, before, after in (("a" * 32, 150, 150), ("b" * 32, None, 150), ("c" * 32, None, None)):
        bridge.declare(make_topic(name, TopicKind.SUBSCRIBER, md5sum), name)
        assert bridge.ids.get(name) == before
        jobs.pop()()
        assert bridge.ids.get(name) == after
    bridge.declare(make_topic(name, TopicKind.SUBSCRIBER, "c" * 32), name)
    bridge.detach("closed")
    jobs.pop()()
    assert bridge.ids.get(name) is None, "of a connection that has ended"


def join_bridge(driver):
    driver.join()
    return driver.gateway.bridges["/hero_0"]


def make_topic(name, kind, md5sum):
    return Topic(TopicInfo(150, name, "std_msgs/String", md5sum, 512), kind)


def test_only_new_robots_of_an_address_are_limited(monkeypatch):
    driver = Driver(monkeypatch, max_connections_per_address=2)
    for number in (0, 1, 0, 1, 0):
        link = driver.join(number=number)
        assert not link.closed
        link.close("closed by the robot")
    assert "more than 2 new robots from one address" in driver.join(number=2).reason


def test_of_an_address_with_robots_only_the_newest_goes(monkeypatch):
    driver = Driver(monkeypatch, max_connections=3)
    links = [driver.join(port=number, number=number) for number in (1, 2, 3)]
    driver.connect(OTHER_HOST)
    assert [link.closed for link in links] == [False, False, True]


def test_after_the_end_of_a_connection_nothing_of_the_same_read_counts(driver, monkeypatch):
    first = driver.join()
    second = driver.connect(OTHER_HOST)
    received = []

    def close_at_once(peer, event, now_s):
        received.append(event)
        peer.link.closed = True

    monkeypatch.setattr(driver.gateway, "_receive_event", close_at_once)
    driver.receive(second, FakeRobot(5, PUBLISHED).encode_declarations())
    assert len(received) == 1 and not first.closed


def test_calls_of_services_fail_with_the_reason_when_the_robot_leaves(driver):
    bridge, reasons = join_bridge(driver), []
    bridge._services = {name: SimpleNamespace(fail=reasons.append) for name in ("/hero_0/a", "/hero_0/b")}
    bridge.detach("silent for 6.1 s")
    assert reasons == ["silent for 6.1 s"] * 2
    bridge._registrar = SimpleNamespace(submit=lambda job, always=False: True)
    for _ in range(2):
        bridge.close()
    assert reasons == ["silent for 6.1 s"] * 2 + ["the robot left"] * 2 and not bridge._publishers
