"""Robots in real time: the pace of the clock, pauses of the machine, and what is told of connections."""

import collections
import hashlib
import inspect
import signal
import struct
from unittest.mock import create_autospec

import numpy as np
import pytest
from driver_side import VELOCITY, parse_options

from hero_driver.rosserial import packets
from hero_sim import main
from hero_sim import simulator as simulators
from hero_sim.build import build_simulator
from hero_sim.errors import OptionError
from hero_sim.faults import KINDS
from hero_sim.link.tcp_link import TcpLink
from hero_sim.robot_constants import RECEIVE_WINDOW_LENGTH
from hero_sim.simulator import _FLAPPING_MS, _LATE_S, _MAX_WAIT_S, _MIN_WAIT_S


class Link:
    """What a simulator asks of its connections, and what it was told."""

    host, port = "driver", 11411

    def __init__(self):
        self.calls, self.waits_s, self.open, self.connecting = [], [], 0, set()

    def __getattr__(self, name):
        signature = inspect.signature(getattr(TcpLink, name))

        def note(*arguments):
            signature.bind(self, *arguments)
            self.calls.append((name, *arguments))

        return note

    def poll(self, timeout_s):
        self.waits_s.append(timeout_s)

    def count_open(self):
        return self.open

    def is_connecting(self, index):
        return index in self.connecting


class Clock:
    """A clock that goes on when it is told to."""

    def __init__(self):
        self.now_s = 1000.0

    def monotonic(self):
        return self.now_s


@pytest.fixture()
def bench(monkeypatch):
    """Return a function that builds a simulator with these options, its lines, link and clock."""

    def build(*arguments):
        lines, clock = [], Clock()
        simulator, _ = build_simulator(parse_options("--port", "9", *arguments), lines.append)
        simulator.link.close_all()
        monkeypatch.setattr(simulators, "time", clock)
        simulator.link = Link()
        lines.clear()
        simulator._anchor_clock()
        return simulator, lines, simulator.link, clock

    return build


def test_robots_that_are_started_together_boot_one_after_the_other(bench):
    booted_ms = [robot.body.booted_ms for robot in bench("--count", "9")[0].swarm.robots]
    assert len(set(booted_ms)) > 5 and min(booted_ms) >= 0 and max(booted_ms) < 200


@pytest.mark.parametrize("speed", [1.0, 2.0, 0.5])
def test_robots_keep_the_pace_of_the_clock(bench, speed):
    simulator, lines, link, clock = bench("--speed", str(speed))
    start_ms = simulator.swarm.now_ms
    for _ in range(100):
        clock.now_s += 0.013
        simulator._step(None)
    assert simulator.swarm.now_ms - start_ms == pytest.approx(1300 * speed, abs=2)
    assert lines == [] and all(_MIN_WAIT_S <= wait_s <= _MAX_WAIT_S for wait_s in link.waits_s)
    # Until the next step of the world is due, and no longer.
    left_ms = simulator.swarm.world.time_ms + 10 - start_ms - 1300 * speed
    assert link.waits_s[-1] <= max(left_ms / 1000.0 / speed, _MIN_WAIT_S) + 1e-9


def test_what_a_busy_machine_missed_is_left_out_and_told_once(bench):
    simulator, lines, _, clock = bench("--speed", "2")
    simulator._step(None)
    for pause_s in (0.9 * _LATE_S, _LATE_S + 3.0, _LATE_S + 4.0):
        before_ms = simulator.swarm.now_ms
        clock.now_s += pause_s
        simulator._step(None)
        moved_ms = simulator.swarm.now_ms - before_ms
        assert moved_ms == (1 if pause_s > _LATE_S else pytest.approx(2000 * pause_s, abs=2))
        clock.now_s += 0.05
        simulator._step(None)
        assert simulator.swarm.now_ms - before_ms - moved_ms == pytest.approx(100, abs=3), "then at its pace again"
    (line,) = lines
    assert line.startswith("this machine was busy or asleep for %.1f s" % (_LATE_S + 3.0))


def test_a_run_ends_after_its_simulated_time_or_when_it_is_told(bench):
    simulator, _, link, clock = bench("--speed", "1")
    start_ms = simulator.swarm.now_ms
    link.poll = lambda timeout_s: setattr(clock, "now_s", clock.now_s + 0.02)
    simulator.run(0.25)
    assert simulator.swarm.now_ms - start_ms == 250
    simulator.before_advance.append(lambda now_ms: setattr(simulator, "stopping", now_ms >= start_ms + 400))
    simulator.run()
    assert 400 <= simulator.swarm.now_ms - start_ms <= 450


def test_it_lingers_until_a_connection_ends_or_the_time_is_over(bench):
    for closes_s, limit_s, expected_s in ((0.5, 2.0, 0.5), (9.0, 2.0, 2.0)):
        simulator, lines, link, clock = bench()
        simulator.stopping, link.open, begin_s = True, 2, clock.now_s

        def poll(timeout_s, clock=clock, link=link, begin_s=begin_s, closes_s=closes_s):
            clock.now_s += 0.01
            link.open = 1 if clock.now_s >= begin_s + closes_s else 2

        link.poll = poll
        simulator.linger(limit_s)
        assert clock.now_s - begin_s == pytest.approx(expected_s, abs=0.03)
    simulator, _, link, clock = bench()
    before_s = clock.now_s
    simulator.linger(2.0)
    assert clock.now_s == before_s and link.waits_s == [], "without connections there is nothing to wait for"


def test_a_robot_that_left_connects_again_only_after_its_time(bench):
    simulator, lines, link, _ = bench()
    robot, start_ms = simulator.swarm.robots[0], simulator.swarm.now_ms
    simulator.leave(0, 500)
    assert ("close", 0) in link.calls
    link.calls.clear()
    robot.wants_connection = True
    simulator.serve_robot(0)
    assert link.calls == [] and not robot.wants_connection, "no connection is wanted meanwhile"
    simulator.swarm.now_ms = start_ms + 500
    robot.wants_connection = True
    simulator.serve_robot(0)
    assert link.calls == [("connect", 0)]
    link.connecting.add(0)
    assert lines == []
    simulator.serve_robot(0)
    assert len(lines) == 1 and "(no answer within 5 s)" in lines[0]
    assert link.calls == [("connect", 0)], "one attempt is under way"


def test_connections_that_come_and_go_are_told_now_and_then(bench):
    simulator, lines, _, _ = bench("--count", "2")
    start_ms = simulator.swarm.now_ms
    for robot in simulator.swarm.robots:
        robot.switch_on(start_ms)
    for after_ms in (0, 100, _FLAPPING_MS - 1, _FLAPPING_MS):
        simulator.swarm.now_ms = start_ms + after_ms
        simulator.connection_made(0)
        simulator.connection_lost(0, "the driver closed")
    lost = "hero_0 lost its connection: the driver closed"
    assert lines == ["hero_0 connected", lost, "hero_0 connected", lost]
    lines.clear()
    for index in (0, 1, 0):
        simulator.connection_failed(index, "refused")
    assert lines == ["no driver answers at driver:11411 (refused); the robots keep trying, as real ones do"]
    simulator.connection_made(1)
    simulator.connection_failed(0, "refused")
    assert len(lines) == 3, "told again after a connection"


def test_a_full_receive_window_leaves_the_rest_with_the_sender(bench):
    simulator, _, link, _ = bench()
    for length, paused in ((RECEIVE_WINDOW_LENGTH - 1, False), (1, True)):
        link.calls.clear()
        simulator.receive_bytes(0, bytes(length))
        assert link.calls == [("pause", 0, paused)]
    simulator.swarm.robots[0].connection_lost()
    simulator.swarm.robots[0].connection_made(simulator.swarm.now_ms)
    link.calls.clear()
    simulator._step(None)
    assert ("pause", 0, False) in link.calls, "read again when the robot has taken them"


def test_commands_reach_a_robot_when_its_radio_has_carried_them(bench):
    simulator, _, _, _ = bench("--wifi", "router")
    taken, sent_ms = [], simulator.swarm.now_ms
    simulator.swarm.robots[0].receive_bytes = lambda now_ms, data: taken.append((now_ms, data))
    simulator.receive_bytes(0, b"first, ")
    simulator.receive_bytes(0, b"second")
    assert taken == [], "the radio needs its time"
    while len(b"".join(data for _, data in taken)) < len(b"first, second") and simulator.swarm.now_ms < sent_ms + 60000:
        simulator.swarm.now_ms += 1
        simulator._carry(simulator.swarm.now_ms)
    assert b"".join(data for _, data in taken) == b"first, second"
    assert all(now_ms > sent_ms for now_ms, _ in taken)


def test_a_robot_that_crashed_restarts_and_is_named(bench):
    simulator, lines, link, _ = bench()
    robot = simulator.swarm.robots[0]
    robot.switch_on(simulator.swarm.now_ms)
    robot.crash_reason = "id 99"
    simulator.serve_robot(0)
    assert lines == ["hero_0 crashed: the server sent id 99; the robot restarts"]
    assert robot.is_on and robot.crash_reason is None and ("abandon", 0) in link.calls


def test_a_robot_blocked_by_its_channel_and_its_link_waits_for_both(bench):
    simulator, _, link, _ = bench("--wifi", "router")
    resumed, unsent = [], [True, False]
    simulator.swarm.robots[0].unblock_writing = resumed.append
    link.has_unsent = lambda index: unsent[0]
    for has_unsent in (True, False):
        unsent[0] = has_unsent
        simulator._send_up(0, [bytes(1000)])
        if not has_unsent:
            simulator.writing_resumed(0)
        simulator._carry(simulator.swarm.now_ms)
        assert resumed == [], "the channel blocks it"
        simulator.swarm.now_ms += 10000
        simulator._carry(simulator.swarm.now_ms)
        if has_unsent:
            assert resumed == [], "the link blocks it"
            simulator.writing_resumed(0)
        assert resumed.pop() == simulator.swarm.now_ms


ENDS = {
    "power cut": lambda simulator: simulator.switch_off(1),
    "reboot": lambda simulator: simulator.reboot(1),
    "leaves": lambda simulator: simulator.leave(1, 100),
    "closed by the driver": lambda simulator: simulator.connection_lost(1, "the driver closed"),
}


@pytest.mark.parametrize("end", ENDS.values(), ids=list(ENDS))
def test_what_is_on_its_way_ends_with_the_connection_of_this_robot(bench, end):
    simulator, lines, link, _ = bench("--count", "2", "--first-id", "4", "--wifi", "router")
    taken = {index: [] for index in range(2)}
    for index, robot in enumerate(simulator.swarm.robots):
        robot.switch_on(simulator.swarm.now_ms)
        robot.receive_bytes = lambda now_ms, data, index=index: taken[index].append(data)
        simulator.connection_made(index)
        simulator.receive_bytes(index, b"down")
        simulator._send_up(index, [b"up"])
    link.calls.clear()
    end(simulator)
    for _ in range(60000):
        simulator.swarm.now_ms += 1
        simulator._carry(simulator.swarm.now_ms)
    assert taken == {0: [b"down"], 1: []}
    assert [one for one in link.calls if one[0] == "send"] == [("send", 0, b"up")]
    simulator.connection_made(1)
    assert lines.count("hero_5 connected") == 2 and lines.count("hero_4 connected") == 1


def test_a_connection_that_is_made_without_power_reaches_no_robot(bench):
    simulator, _, _, _ = bench("--count", "2")
    made = []
    for robot in simulator.swarm.robots:
        robot.switch_on(simulator.swarm.now_ms)
        robot.connection_made = lambda now_ms, robot=robot: made.append(robot.name)
    simulator.switch_off(0)
    for index in range(2):
        simulator.connection_made(index)
    assert made == ["hero_1"]


def test_no_end_of_a_run_leaves_a_connection_open(monkeypatch):
    close_all = create_autospec(TcpLink.close_all)
    monkeypatch.setattr(TcpLink, "close_all", close_all)
    monkeypatch.setattr(signal, "signal", lambda number, act: None)
    with pytest.raises(OptionError, match="robot 9 is not simulated here"):
        build_simulator(parse_options("--port", "9", "--fault", "stall", "--fault", "reboot:robot=9"), print)
    assert close_all.call_count == 1
    with pytest.raises(ZeroDivisionError), main.simulate(parse_options("--port", "9"), print):
        raise ZeroDivisionError
    assert close_all.call_count == 2


class Peer(Link):
    """A driver that accepts and closes connections, commands, and does not always read: at random, but the same."""

    def __init__(self, simulator):
        super().__init__()
        self.simulator, self.rng, self.open_rows, self.log = simulator, np.random.RandomState(3), set(), []

    def act(self):
        simulator, chance, now_ms = self.simulator, self.rng.randint(100), self.simulator.swarm.now_ms
        for name, index, *more in self.calls:
            if name == "connect":
                self.connecting.add(index)
            elif name in ("close", "abandon"):
                self.open_rows.discard(index)
                self.connecting.discard(index)
            self.log.append((now_ms, name, index, *more))
        self.calls.clear()
        for index in sorted(self.connecting):
            if chance < 60:
                self.connecting.discard(index)
                if chance < 20:
                    simulator.connection_failed(index, "refused")
                else:
                    self.open_rows.add(index)
                    simulator.connection_made(index)
                    simulator.receive_bytes(index, packets.encode_packet(packets.ID_PUBLISHER, b""))
        for index in sorted(self.open_rows):
            what = self.rng.randint(400)
            if what < 2:
                self.open_rows.discard(index)
                simulator.connection_lost(index, "closed")
            elif what < 4:
                simulator.writing_blocked(index)
            elif what < 16:
                simulator.writing_resumed(index)
            elif what < 60:
                simulator.receive_bytes(index, packets.encode_packet(packets.ID_TIME, bytes(8)))
                simulator.receive_bytes(
                    index, packets.encode_packet(VELOCITY, struct.pack("<6d", 0.1, 0, 0, 0, 0, 1.0))
                )
            elif what < 62:
                simulator.receive_bytes(index, bytes(2500))

    def has_unsent(self, index):
        return self.rng.randint(3) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wifi", "kept"),
    [
        ("ideal", "abandon 4 close 1 connect 25 drop_unsent 1021 pause 740 send 1075: 34 lines, 32f8433beb442b43"),
        ("bad,channels=2", "abandon 4 close 1 connect 19 pause 910 send 154: 32 lines, 598c65631a2af29c"),
    ],
    ids=["ideal", "bad"],
)
def test_what_robots_in_real_time_do_at_their_links_is_what_they_did(bench, wifi, kept):
    """Results must not change without a word in the CHANGELOG: to renew these, see test_sim_kept_results.py."""
    faults = [f"--fault={kind}@{3 + number}:robot={number % 4}" for number, kind in enumerate(sorted(KINDS))]
    simulator, lines, _, clock = bench("--count", "4", "--wifi", wifi, "--arena", "obstacles", *faults)
    simulator.link = peer = Peer(simulator)
    while simulator.swarm.now_ms < 16000:
        clock.now_s += peer.rng.randint(30) / 1000.0
        simulator._step(None)
        peer.act()
    counts = collections.Counter(name for _, name, *_ in peer.log)
    log = repr((peer.log, lines, np.round(peer.waits_s, 6).tolist())).encode()
    calls = " ".join(f"{name} {counts[name]}" for name in sorted(counts))
    assert f"{calls}: {len(lines)} lines, {hashlib.sha256(log).hexdigest()[:16]}" == kept
