"""The gateway's own decisions: which connection is a robot's, and which of two is refused; without sockets or time."""

from types import SimpleNamespace

import pytest

from hero_driver import gateway
from hero_driver.config import read_config
from hero_driver.gateway import Gateway
from hero_driver.rosserial.packets import ID_LOG, encode_packet
from hero_driver.rosserial.payloads import LOG_INFO, Log, encode_log
from hero_driver.transport.link import Address
from hero_test.fake_robot import PUB, STOCK_DECLARATIONS, FakeRobot, boot_line

PUBLISHED = [entry for entry in STOCK_DECLARATIONS if entry.kind == PUB]
HELLO = FakeRobot(0, PUBLISHED).encode_declarations()
HOST, OTHER_HOST = "10.42.0.17", "10.42.0.18"


class FakeLink:
    """A robot's connection."""

    def __init__(self, driver, host):
        self.address = Address(host, 50000)
        self.closed = False
        self.received_length = 0
        self._driver = driver

    def send_packet(self, packet):
        pass

    def close(self, reason):
        if not self.closed:
            self.closed = True
            self._driver.close_link(self, reason)


class Driver:
    """A gateway, and links that bring it what robots send."""

    def __init__(self, monkeypatch, **parameters):
        self.now_s = 100.0
        monkeypatch.setattr(gateway.time, "monotonic", lambda: self.now_s)
        self.lines, self.keys = [], set()  # keys: of throttled lines
        self.gateway = Gateway(
            read_config(parameters),
            SimpleNamespace(call_later=lambda delay_s, call: None, call_soon=lambda call: None),
            SimpleNamespace(
                log=lambda level, text: self.lines.append(text),
                log_throttled=self.log_throttled,
            ),
            SimpleNamespace(submit=lambda job, always=False: True),  # nothing is registered with a master
            "/hero_driver",
            lambda: int(self.now_s * 1e9),
            lambda: None,
        )

    def log_throttled(self, level, key, text, robot=""):
        self.lines.append(text)
        self.keys.add(key)

    def connect(self, host):
        """Open a link from host."""
        link = FakeLink(self.gateway, host)
        assert self.gateway.open_link(link) is None
        return link

    def receive(self, link, data=HELLO):
        self.gateway.receive_data(link, data, self.now_s)

    def join(self, host):
        """Connect a robot from host that says it is hero_0."""
        link = self.connect(host)
        self.receive(link)
        return link

    def find_link(self):
        """Return the link that the driver takes for hero_0's."""
        record = self.gateway.fleet.robots.get("/hero_0")
        return None if record is None or record.link is None or record.link.closed else record.link


@pytest.fixture
def driver(monkeypatch):
    return Driver(monkeypatch)


def test_a_robot_is_found_by_its_name_while_it_is_connected(driver):
    assert driver.find_link() is None
    driver.connect(OTHER_HOST)
    link = driver.connect(HOST)
    assert driver.find_link() is None
    driver.receive(link)
    assert driver.find_link() is link
    link.close("closed by the robot")
    assert driver.find_link() is None


def test_log_lines_of_a_robot_are_passed_on_with_its_name(driver):
    link = driver.join(HOST)
    driver.receive(link, encode_packet(ID_LOG, encode_log(Log(LOG_INFO, "hello"))))
    assert driver.lines[-1] == "hero_0: hello"


def test_a_boot_line_that_comes_before_the_name_tells_the_versions(driver):
    link = driver.connect(HOST)
    driver.receive(link, encode_packet(ID_LOG, encode_log(Log(LOG_INFO, boot_line("hero_0")))))
    driver.receive(link)
    assert driver.gateway.fleet.robots["/hero_0"].firmware == "v3.8"
    assert any(line.startswith("hero_0: Firmware: v3.8") for line in driver.lines)


def test_parameters_limit_the_topics_and_the_packets_of_a_robot(monkeypatch):
    driver = Driver(monkeypatch, max_topics=len(PUBLISHED) - 1, max_payload_length=200)
    link = driver.join(HOST)
    assert driver.lines[-1].endswith("refused: more than %d topics (max_topics)" % (len(PUBLISHED) - 1))
    bad_packets = lambda: driver.gateway.peers[link].session.reader.bad_packets  # noqa: E731
    for length, expected in ((200, 0), (201, 1)):
        driver.receive(link, encode_packet(PUBLISHED[0].topic_id, bytes(length)))
        assert bad_packets() == expected


def test_a_robot_that_was_just_heard_keeps_its_id_from_another_host(driver):
    first = driver.join(HOST)
    driver.now_s += 60.0
    driver.receive(first)
    second = driver.join(OTHER_HOST)
    assert driver.find_link() is first
    assert not second.closed
    assert "two robots call themselves /hero_0: 10.42.0.17:50000 was first" in driver.lines[-1]
    keys = set(driver.keys)
    second.close("closed by the robot")
    driver.now_s += 1.0
    driver.receive(first)
    driver.join(OTHER_HOST)
    assert driver.keys == keys, "a duplicate that keeps dialling is one line"
