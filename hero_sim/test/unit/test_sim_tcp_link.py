"""The TCP side of simulated robots: what a driver does not read waits, in order, up to a limit."""

import contextlib
import select
import socket
import struct
import sys

import pytest
from driver_side import parse_options

from hero_sim.link import tcp_link
from hero_sim.link.tcp_link import LinkHandler, TcpLink


class Events(LinkHandler):
    """Notes what happens to the connections."""

    def __init__(self):
        self.seen, self.received, self.reasons = [], b"", []

    def connection_made(self, index):
        self.seen.append("made")

    def connection_failed(self, index, reason):
        self.seen.append("failed")
        self.reasons.append(reason)

    def connection_lost(self, index, reason):
        self.seen.append("lost")

    def receive_bytes(self, index, data):
        self.received += data

    def writing_blocked(self, index):
        self.seen.append("blocked")

    def writing_resumed(self, index):
        self.seen.append("resumed")


class Driver:
    """A link of one robot, and the socket at its other end."""

    def __init__(self):
        with socket.socket() as listener:
            # Little is kept by the system: a link that is not read is soon full.
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            listener.bind(("127.0.0.1", 0))
            listener.listen()
            self.link, self.events = TcpLink(1, *listener.getsockname()), Events()
            self.link.handler = self.events
            self.link.connect(0)
            assert self.link.is_connecting(0) and self.link.count_open() == 0
            self.socket, _ = listener.accept()
        self.poll_until(lambda: self.events.seen)
        assert self.events.seen == ["made"] and not self.link.is_connecting(0) and self.link.count_open() == 1

    def poll_until(self, is_done):
        for _ in range(100):
            if is_done():
                return
            self.link.poll(0.2)
        pytest.fail("the link is idle; it told of %s and gave %r" % (self.events.seen, self.events.received))

    def fill(self):
        """Send numbered pieces until the link is full; return all that was sent."""
        sent = b""
        while self.events.seen[-1] != "blocked":
            piece = len(sent).to_bytes(4, "big") * 500
            self.link.send(0, piece)
            sent += piece
        return sent

    def read_to(self, end):
        """Read up to an end while the link goes on."""
        data = b""
        self.socket.settimeout(0.01)
        while not data.endswith(end):
            self.link.poll(0.0)
            with contextlib.suppress(socket.timeout):
                data += self.socket.recv(65536)
        return data


@pytest.fixture()
def driver():
    made = Driver()
    yield made
    made.link.close_all()
    made.socket.close()


def test_bytes_of_a_driver_reach_the_robot_and_its_end_is_told(driver):
    driver.socket.sendall(b"bytes")
    driver.poll_until(lambda: driver.events.received)
    assert (driver.events.received, driver.events.seen) == (b"bytes", ["made"])
    driver.socket.close()
    driver.poll_until(lambda: driver.events.seen[-1] == "lost")
    assert driver.events.received == b"bytes"


def test_what_a_driver_does_not_read_waits_and_is_sent_when_it_does(driver):
    sent = driver.fill()
    for piece in (b"a" * 100, b"b" * 100, b"end"):
        driver.link.send(0, piece)
        sent += piece
    assert driver.read_to(b"end") == sent
    driver.poll_until(lambda: driver.events.seen[-1] == "resumed")
    assert driver.events.seen == ["made", "blocked", "resumed"]
    driver.link.send(0, b"again")
    assert driver.read_to(b"again") == b"again" and driver.events.seen[-1] == "resumed"


def test_what_waits_is_limited_and_can_be_dropped(driver, monkeypatch):
    monkeypatch.setattr(tcp_link, "_MAX_UNSENT", 2000)
    sent = driver.fill()
    for _ in range(20):
        driver.link.send(0, b"x" * 1000)
    assert 2000 <= len(driver.link._connections[0].unsent) < 3000
    driver.link.drop_unsent(0)
    driver.socket.settimeout(None)
    received = driver.socket.recv(len(sent))
    driver.link.send(0, b"end")
    received += driver.read_to(b"end")
    assert driver.events.seen == ["made", "blocked"], "nothing waits that could go on"
    assert sent.startswith(received[:-3]) and len(received) < len(sent) + 3, "whole until there, nothing twice"


def test_what_a_full_system_takes_nothing_of_is_sent_whole(driver):
    driver.fill()
    driver.link.drop_unsent(0)
    driver.link.send(0, b"all of it, to the end")
    assert driver.read_to(b"end").endswith(b"all of it, to the end")


def test_a_paused_robot_leaves_what_comes_to_the_system(driver):
    driver.link.pause(0, True)
    driver.socket.sendall(b"later")
    driver.link.poll(0.05)
    assert driver.events.received == b""
    driver.link.pause(0, False)
    driver.poll_until(lambda: driver.events.received)
    assert driver.events.received == b"later"


def test_the_end_of_a_connection_is_told_once_and_nothing_is_sent_after_it(driver):
    driver.socket.close()
    driver.poll_until(lambda: driver.events.seen[-1] == "lost")
    driver.link.send(0, b"no peer")
    driver.link.pause(0, True)
    driver.link.drop_unsent(0)
    driver.link.close(0)
    assert driver.events.seen == ["made", "lost"] and driver.link.count_open() == 0


def test_a_closed_connection_is_over_for_the_driver_at_once(driver):
    connection = driver.link._connections[0]  # what nothing refers to would be closed anyway
    driver.link.close(0)
    driver.socket.settimeout(60.0)
    assert driver.socket.recv(1) == b"" and connection.socket.fileno() == -1
    assert driver.events.seen == ["made"], "which the robot knows"


def reset(driver):
    driver.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    driver.socket.close()


def test_a_reset_that_a_robot_meets_when_it_sends_is_told_at_once(driver):
    reset(driver)
    driver.link.send(0, b"no peer")
    assert driver.events.seen == ["made", "lost"]


def test_the_driver_is_on_this_pc_unless_robots_are_told():
    assert (parse_options().host, parse_options("--host", "lab").host) == ("127.0.0.1", "lab")


def test_a_reset_while_bytes_wait_is_told_once(driver):
    driver.fill()
    reset(driver)
    driver.poll_until(lambda: driver.events.seen[-1] == "lost")
    assert driver.events.seen == ["made", "blocked", "lost"]


def test_an_abandoned_connection_gets_no_end(driver):
    driver.link.abandon(0)
    driver.socket.settimeout(0.05)
    with pytest.raises(socket.timeout):
        driver.socket.recv(1)
    assert driver.link.count_open() == 0 and not driver.link.is_connecting(0)
    if sys.platform.startswith("linux"):
        driver.socket.sendall(b"nothing arrives, and so nothing is acknowledged")
        assert select.select(driver.link._abandoned, [], [], 0.05)[0] == []
    driver.link.abandon(0)


def test_of_too_many_abandoned_connections_the_first_ends(driver, monkeypatch):
    monkeypatch.setattr(tcp_link, "_MAX_ABANDONED", 1)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        driver.link._address = listener.getsockname()
        driver.link.abandon(0)
        driver.link.connect(0)
        later, _ = listener.accept()
    with later:
        driver.poll_until(lambda: driver.events.seen.count("made") == 2)
        driver.link.abandon(0)
        driver.socket.settimeout(60.0)
        assert driver.socket.recv(1) == b""
        later.settimeout(0.05)
        with pytest.raises(socket.timeout):
            later.recv(1)


class Probe:
    """A socket that finds out addresses, on a PC without some of them."""

    lacks = ()

    def __init__(self, family, kind):
        assert (family, kind) == (socket.AF_INET, socket.SOCK_DGRAM)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def bind(self, address):
        self.connect(address)

    def connect(self, address):
        if address[0] in self.lacks:
            raise OSError("no such address")

    def getsockname(self):
        return "10.42.0.7", 40000


def test_a_robot_names_the_address_that_leads_to_its_driver(monkeypatch):
    monkeypatch.setattr(tcp_link.socket, "socket", Probe)
    found = [(family, 1, 6, "", address) for family, address in ((socket.AF_INET6, ("::1", 11411, 0, 0)),) * 2]
    for host, lacks, own in (
        ("10.42.0.1", (), ["10.42.0.7"] * 2),
        ("10.42.0.1", ("10.42.0.1",), ["0.0.0.0"] * 2),
        ("127.0.0.1", (), ["127.0.1.1", "127.0.1.2"]),
        ("127.0.0.1", ("127.0.1.1",), ["127.0.0.1", "127.0.1.2"]),
    ):
        entries = [*found, (socket.AF_INET, 1, 6, "", (host, 11411))]
        monkeypatch.setattr(tcp_link.socket, "getaddrinfo", lambda *given, entries=entries, **named: list(entries))
        monkeypatch.setattr(Probe, "lacks", lacks)
        link = TcpLink(2, "lab", 11411)
        assert link.own_addresses == own and link._address == (host, 11411), "robots use IPv4"
        link.close_all()


def test_robots_connect_from_addresses_of_their_own(monkeypatch):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        link = TcpLink(3, *taken.getsockname(), first_number=248)
        link.handler = events = Events()
        assert link.own_addresses == ["127.0.1.249", "127.0.1.250", "127.0.2.1"]
        link.connect(0)
        while not events.seen:
            link.poll(1.0)
        assert (events.seen, events.reasons) == (["failed"], ["Connection refused"]), "no server listens"
        link._address = ("255.255.255.255", 1)  # not for TCP, so that the system refuses at once
        made, make = [], socket.socket
        monkeypatch.setattr(tcp_link.socket, "socket", lambda *given: made.append(make(*given)) or made[-1])
        link.connect(1)
        assert [sock.fileno() for sock in made] == [-1], "closed"
        assert events.reasons[1] and "Errno" not in events.reasons[1]
        assert events.seen == ["failed"] * 2 and not link.is_connecting(1)
        link.close_all()
