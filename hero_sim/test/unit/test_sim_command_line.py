"""The program as users start it: a process of its own, behind real sockets on loopback."""

import fcntl
import os
import re
import selectors
import signal
import socket
import struct
import subprocess
import sys
import termios
import time

import pytest
from driver_side import POSITION, RECEIVED, SENT, read_odom

from hero_driver.rosserial import packets, payloads
from hero_sim import main
from hero_sim.faults import KINDS
from hero_sim.world.robot_errors import KINDS as ERROR_KINDS
from hero_test.nonempty import nonempty
from hero_test.processes import Program, find_free_port
from hero_test.waiting import wait_for

LIMIT_S = 60.0
ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", ".."))


def build_environment():
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


@pytest.fixture
def simulate():
    programs = []

    def run(*arguments):
        # Four times real time: these tests wait for robots to boot.
        command = [sys.executable, "-m", "hero_sim", "--speed", "4", *arguments]
        programs.append(Program(*command, environment=build_environment()))
        return programs[-1]

    yield run
    for program in programs:
        program.close()


class Server:
    """Accepts robots; requests topics, answers the time, keeps every packet."""

    def __init__(self, port=0):
        self.peers = []
        self.selector = selectors.DefaultSelector()
        self.listener = socket.socket()
        self.listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.listener.bind(("127.0.0.1", port))
        self.listener.listen(16)
        self.port = self.listener.getsockname()[1]
        self.selector.register(self.listener, selectors.EVENT_READ)

    def accept(self):
        peer = Peer(self.listener.accept()[0])
        self.peers.append(peer)
        self.selector.register(peer.socket, selectors.EVENT_READ, peer)

    def run_until(self, condition):
        def serve():
            for key, _ in self.selector.select(0.05):
                if key.data is None:
                    self.accept()
                elif not key.data.receive():
                    self.selector.unregister(key.data.socket)
            return condition()

        wait_for(serve, "a robot to do what the test expects")

    def close(self):
        for peer in self.peers:
            peer.socket.close()
        self.listener.close()
        self.selector.close()


class Peer:
    def __init__(self, sock):
        self.socket = sock
        self.reader = packets.PacketReader()
        self.packets = []
        self.closed = False

    def receive(self):
        try:
            data = self.socket.recv(65536)
        except ConnectionError:
            data = b""
        if not data:
            self.closed = True
            return False
        for packet in self.reader.receive_bytes(data):
            self.packets.append(packet)
            if packet.topic_id == packets.ID_TIME:
                self.send(packets.ID_TIME, payloads.encode_time(payloads.split_seconds(time.time())))
        return True

    def send(self, topic_id, payload=b""):
        self.socket.sendall(packets.encode_packet(topic_id, payload))

    def count(self, topic_id):
        return sum(packet.topic_id == topic_id for packet in self.packets)

    def logs(self):
        return [
            payloads.decode_log(packet.payload).text for packet in self.packets if packet.topic_id == packets.ID_LOG
        ]

    def last(self, topic_id):
        return [packet.payload for packet in self.packets if packet.topic_id == topic_id][-1]


@pytest.fixture
def server():
    server = Server()
    yield server
    server.close()


def is_acknowledged(sock):
    """Return whether the other side took all that was sent, at least at the level of TCP."""
    return struct.unpack("i", fcntl.ioctl(sock, termios.TIOCOUTQ, bytes(4)))[0] == 0


def request_when_ready(server, count):
    """Wait until count robots are past their start, then ask each for its topics and await its odometry."""
    server.run_until(
        lambda: len(server.peers) >= count
        and all(any("Conected" in text for text in peer.logs()) for peer in server.peers)
    )
    for peer in server.peers:
        peer.send(packets.ID_PUBLISHER)
    server.run_until(lambda: all(peer.count(SENT["odom"]) > 3 for peer in server.peers))


@pytest.mark.slow
def test_robots_connect_declare_stream_and_drive(simulate, server):
    simulate("--count", "3", "--first-id", "5", "--port", str(server.port))
    request_when_ready(server, 3)
    names = {
        payloads.decode_topic_info(peer.packets[[f.topic_id for f in peer.packets].index(0)].payload).name
        for peer in server.peers
    }
    assert names == {"/hero_5/laser", "/hero_6/laser", "/hero_7/laser"}
    peer = server.peers[0]

    def moved():
        if len(peer.packets) % 5 == 0:
            peer.send(POSITION, struct.pack("<6d", 0.1, 0, 0, 0, 0, 0))
        return read_odom(peer.last(SENT["odom"]))[2][0] > 0.05

    server.run_until(moved)
    assert read_odom(server.peers[1].last(SENT["odom"]))[2][0] == 0.0
    assert all(peer.reader.bad_packets == 0 for peer in server.peers)


@pytest.mark.slow
def test_a_robot_that_vanishes_sends_no_end_and_its_successor_boots(simulate, server):
    simulate("--port", str(server.port), "--fault", "vanish@16:for=1")
    request_when_ready(server, 1)
    server.run_until(lambda: len(server.peers) == 2)
    old, new = server.peers
    server.run_until(lambda: len(new.logs()) >= 2)
    assert not old.closed
    assert "Firmware" in new.logs()[0]
    # Without power nothing is acknowledged either: what the driver sends stays in its own system.
    old.send(packets.ID_PUBLISHER)
    new.send(packets.ID_PUBLISHER)
    wait_for(lambda: is_acknowledged(new.socket), "the acknowledgement of the robot that has power")
    assert not is_acknowledged(old.socket)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have larger buffers")
@pytest.mark.parametrize("fault", ["frozen@16:robot=0,for=12", "stall@16:robot=0,for=12"])
def test_what_exceeds_the_receive_window_of_a_robot_stays_with_the_sender(simulate, server, fault):
    program = simulate("--count", "2", "--port", str(server.port), "--fault", fault)
    request_when_ready(server, 2)
    peer, other = sorted(server.peers, key=lambda peer: "hero_1" in peer.logs()[0])
    server.run_until(lambda: program.find_lines("fault"))
    for _ in range(100):
        peer.send(RECEIVED["laser_enable"], bytes(100))
    # The simulator has looked at all its sockets meanwhile.
    other.send(RECEIVED["set_odom"], bytes(24))
    server.run_until(lambda: other.count(SENT["set_odom"]) == 1)
    assert not is_acknowledged(peer.socket)
    wait_for(lambda: is_acknowledged(peer.socket), "the acknowledgement of what waited")


@pytest.mark.slow
def test_a_robot_that_is_sent_a_deadly_id_restarts(simulate, server):
    program = simulate("--port", str(server.port))
    request_when_ready(server, 1)
    server.peers[0].send(130, b"1234")
    server.run_until(lambda: len(server.peers) == 2 and server.peers[1].logs())
    assert "Firmware" in server.peers[1].logs()[0]
    program.wait_line("hero_0 crashed: the server sent id 130")


@pytest.mark.slow
def test_a_server_that_comes_late_finds_the_robots_waiting(simulate):
    port = find_free_port()
    program = simulate("--count", "2", "--port", str(port))
    program.wait_line("connecting")
    program.wait_line("no driver answers at 127.0.0.1:%d" % port)
    server = Server(port)
    server.run_until(lambda: len(server.peers) == 2)
    server.close()


@pytest.mark.slow
def test_a_network_with_delays_still_carries_everything(simulate, server):
    simulate("--count", "2", "--port", str(server.port), "--wifi", "hotspot")
    request_when_ready(server, 2)
    server.run_until(lambda: all(peer.count(SENT["odom"]) > 60 for peer in nonempty(server.peers)))
    assert all(peer.reader.bad_packets == 0 and peer.reader.skipped_bytes == 0 for peer in nonempty(server.peers))


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_quietly(simulate, server, number):
    program = simulate("--count", "4", "--port", str(server.port))
    server.run_until(lambda: len(server.peers) == 4)
    assert program.end(number) == 0
    assert all(re.match("hero_sim: hero_.* connect", line) for line in nonempty(program.lines))


@pytest.mark.parametrize(
    "arguments, named",
    [
        (("--host", "no such host"), "no such host"),
        (("--arena", "/nowhere.yaml"), "/nowhere.yaml"),
        (("--fault", "explode"), "explode"),
        (("--fault", "reboot:robot=7"), "robot 7"),
        (("--count", "two"), "two"),
        (("--wifi", "string"), "string"),
        (("--error", "slip=much"), "slip=much"),
        (("--print-errors", "--error", "robot=4,slip=0"), "robot must be 0..0, not 4"),
        (("--print-errors", "--errors", "no_such"), "errors no_such cannot be read: No such file or directory"),
        (("--flash-dir", "/proc/flash"), "/proc/flash"),
        (("--print-errors", "--model", "turtle"), "must be one of hero, v3.0, hero_plus"),
        (("--print-errors", "--model", "hero_plus,robot=3"), "robot must be 0..0, not 3"),
    ],
)
def test_a_wrong_option_gets_one_clear_line(arguments, named, capsys):
    try:
        code = main.main(list(arguments))
    except SystemExit as end:
        code = end.code
    assert code in (1, 2)
    assert named in capsys.readouterr().err.strip().splitlines()[-1]


def read_readme():
    with open(os.path.join(ROOT, "hero_sim", "README.md"), encoding="utf-8") as file:
        return file.read()


def test_the_readme_lists_every_option_and_every_fault():
    text = read_readme()
    options = [name for action in main.build_parser()._actions for name in action.option_strings]
    assert [name for name in options if "`%s" % name not in text and name not in ("-h", "--help")] == []
    assert [kind for kind in KINDS if "`%s`" % kind not in text] == []
    keys = [key for key in ERROR_KINDS if not re.match("alpha[1-6]", key)]
    assert [key for key in keys if "`%s`" % key not in text] == []


def test_numpy_that_is_missing_is_named():
    code = "import runpy, sys; sys.modules['numpy'] = None; runpy.run_module('hero_sim', run_name='__main__')"
    result = subprocess.run(
        [sys.executable, "-c", code],
        env=build_environment(),
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert result.returncode == 1
    assert result.stderr.startswith("hero_sim: numpy is missing") and len(result.stderr.splitlines()) == 1
