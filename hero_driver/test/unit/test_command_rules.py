"""Commands of programs at their limits: refused, too old, of two programs at once, of a program that has gone."""

import math
import struct
from types import SimpleNamespace

import pytest

from hero_driver.commands.command_queue import CommandSettings
from hero_driver.commands.service_requests import find_request_error
from hero_driver.commands.velocity_shaper import ZERO_TWIST
from hero_driver.corrections import message_layouts
from hero_driver.corrections.tick_odometry import MAX_GAP_S, MAX_WHEEL_SPEED_M_S, MIN_GAP_S, TickOdometry, WheelGeometry
from hero_driver.corrections.wheel_motion import REST_TICKS, SETTLED_TICKS, WheelMotion
from hero_driver.ros import robot_commands
from hero_driver.ros.robot_commands import LIGHT_SUFFIX, SUPERSEDED_S, TUNING_SILENCE_S, RobotCommands
from hero_node import Pose
from hero_node.robot_constants import MAX_WATCHDOG_S
from hero_node.ros_messages import encode_pose

VELOCITY, POSITION = "/hero_1/velocity_controller/cmd_vel", "/hero_1/position_controller/cmd_vel"
TWIST = "geometry_msgs/Twist"


def twist(linear_m_s, angular_rad_s=0.0, *others):
    return struct.pack("<6d", linear_m_s, *(others or (0.0,) * 4), angular_rad_s)


class Bench:
    """RobotCommands with an owner, a loop and subscribers of the test's own."""

    def __init__(self, monkeypatch, **settings):
        self.now_s, self.stops, self.lines, self.later, self.sent = 100.0, 0, [], [], []
        monkeypatch.setattr(robot_commands, "time", SimpleNamespace(monotonic=lambda: self.now_s))
        monkeypatch.setattr(robot_commands, "RawSubscriber", self.make_subscriber)
        monkeypatch.setattr(robot_commands, "read_caller", lambda sender: sender or "")
        self.owner = SimpleNamespace(stopped=False, stop_robot=self.stop)
        given = CommandSettings(**{"command_max_age_s": 10.0, **settings})
        loop = SimpleNamespace(call_later=lambda delay_s, call: self.later.append((self.now_s + delay_s, call)))
        log = SimpleNamespace(log_throttled=lambda level, key, text: self.lines.append(text))
        self.commands = RobotCommands("/hero_1", self.owner, loop, log, given)
        self.commands.queue = SimpleNamespace(
            offered=[],
            discarded=[],
            cleared=0,
            offer_motion=self.offer_motion,
            offer=self.offer,
            discard_motion=self.discard,
            clear=self.clear,
        )
        self.wheels = WheelMotion()
        self.peer = SimpleNamespace(wheels=self.wheels, send_commands=lambda: self.sent.append(self.peer))
        self.commands.attach(self.peer)
        self.subscribers = {name: self.commands.make_subscriber(name, name, TWIST) for name in (VELOCITY, POSITION)}

    def make_subscriber(self, receive, loop, lose, moves):
        return SimpleNamespace(receive=receive, lose=lose, is_old=False, last_sender="/a")

    def stop(self, peer):
        assert peer is self.peer
        self.stops += 1

    def offer_motion(self, name, command, stop_payload, now_s):
        self.commands.queue.offered.append(command)

    def offer(self, name, payload):
        self.commands.queue.offered.append(payload)

    def discard(self, resume_s):
        self.commands.queue.discarded.append(resume_s)

    def clear(self):
        self.commands.queue.cleared += 1

    def command(self, payload, sender="/a", name=VELOCITY, after_s=0.0):
        self.now_s += after_s
        self.subscribers[name].last_sender = sender
        self.subscribers[name].receive(payload)

    def take(self):
        offered, self.commands.queue.offered = self.commands.queue.offered, []
        return offered


@pytest.fixture(name="bench")
def make_bench(monkeypatch):
    return Bench(monkeypatch)


def test_a_command_that_is_not_finite_stops_a_robot_that_drives(bench):
    bench.command(twist(math.nan))
    assert (bench.commands.refused, bench.stops) == (1, 0) and "is not finite and was refused" in bench.lines[0]
    bench.command(twist(0.1))
    bench.command(twist(math.inf))
    assert (bench.commands.refused, bench.stops) == (2, 1)
    bench.command(twist(0.0))
    bench.command(twist(math.inf))
    assert (bench.commands.refused, bench.stops) == (3, 1), "its newest command was a stop"
    bench.commands.note_tuning(True)
    bench.command(twist(math.inf))
    assert bench.stops == 2


def test_old_commands_and_those_to_stopped_robots_move_nothing(bench):
    bench.subscribers[VELOCITY].is_old = True
    bench.command(twist(0.1))
    assert bench.take() == [] and bench.commands.refused == 1 and "it may be from before the robot" in bench.lines[0]
    bench.command(ZERO_TWIST)
    assert bench.take() == [ZERO_TWIST], "a stop counts at any age"
    bench.subscribers[VELOCITY].is_old, bench.owner.stopped = False, True
    bench.command(twist(0.1))
    bench.command(ZERO_TWIST)
    assert bench.take() == [ZERO_TWIST] and bench.commands.refused == 2
    bench.owner.stopped = False
    bench.commands.detach()
    for payload in (twist(0.1), ZERO_TWIST):
        bench.command(payload)
    assert bench.take() == [] and bench.commands.refused == 4 and bench.commands.queue.cleared == 1


def test_only_two_programs_that_take_turns_are_named(bench):
    for sender, after_s in (("/a", 0.0), ("/b", 1.0), ("/b", 1.0), ("/a", SUPERSEDED_S + 0.1), ("", 0.1), ("/b", 0.1)):
        bench.command(twist(0.1), sender, after_s=after_s)
    assert bench.lines == []
    for sender in ("/a", "/b"):
        bench.command(twist(0.1), sender, after_s=0.1)
    assert bench.lines[-1] == "hero_1 is commanded by /a and /b at once and obeys the newest command: end one of them"


def test_a_program_that_goes_leaves_no_robot_driving(bench):
    for after_s, newer, is_stopped in (
        (0.0, None, True),
        (MAX_WATCHDOG_S + 0.1, None, False),
        (0.0, "/b", False),
        (0.0, "stop", False),
    ):
        bench.stops, bench.later = 0, []
        bench.command(twist(0.1), "/a", after_s=10.0)
        bench.now_s += after_s
        bench.subscribers[VELOCITY].lose()
        assert len(bench.later) == (after_s == 0.0)
        if newer:
            bench.command(ZERO_TWIST if newer == "stop" else twist(0.1), newer if newer != "stop" else "/a")
        for due_s, call in bench.later:
            assert due_s == pytest.approx(bench.now_s + 0.25)
            call()
        assert bench.stops == is_stopped
    bench.command(twist(0.1), "/a", name=POSITION)
    bench.later.clear()
    bench.command(ZERO_TWIST, "/a")
    bench.subscribers[VELOCITY].lose()
    assert bench.later == []


def test_a_stop_drops_what_waits(bench):
    bench.command(twist(0.1))
    assert bench.commands.is_commanded
    bench.commands.stop()
    assert not bench.commands.is_commanded and bench.commands.queue.discarded == [100.0]


def test_self_tuning_is_known_by_calls_and_for_a_while_by_its_log(monkeypatch):
    request = struct.pack("<6f", *(1.0,) * 6)
    for allowed, stopped, says in (
        (False, False, "self-tuning spins the robot"),
        (True, True, "all robots are stopped"),
        (True, False, None),
    ):
        bench = Bench(monkeypatch, allow_self_tuning=allowed)
        bench.owner.stopped = stopped
        name = "/hero_1" + robot_commands.CALIBRATION_SUFFIX
        refusal = bench.commands.offer_request(name, "std_srvs/Trigger", b"")
        assert (refusal is None) if says is None else says in refusal
        assert bench.take() == ([b""] if says is None else []) and bench.commands.tunes(bench.now_s) == (says is None)
    bench.commands.note_tuning(True)
    bench.now_s += 99.0
    assert bench.commands.tunes(bench.now_s)
    bench.commands.note_tuning(False)
    assert not bench.commands.tunes(bench.now_s)
    bench.commands.note_tuning(True)
    assert not bench.commands.is_commanded, "no program has asked for it since the last one ended"
    for after_s, tunes in ((TUNING_SILENCE_S - 0.125, True), (0.125, False)):
        bench.now_s += after_s
        assert bench.commands.tunes(bench.now_s) == tunes
    assert bench.commands.offer_request("/hero_1/set_pid", "hero_msgs/SetPID", request) is None and bench.take() == [
        request
    ]
    assert "gains must be finite" in bench.commands.offer_request("/hero_1/set_pid", "hero_msgs/SetPID", b"\xff" * 24)
    assert bench.take() == []


def test_the_light_is_remembered_by_its_topic_and_length(bench):
    color = struct.pack("<4f", 1.0, 0.0, 0.0, 1.0)
    for name, payload, light in (
        ("/hero_1/other", color, robot_commands.NO_LIGHT),
        (LIGHT_SUFFIX, color[:-1], robot_commands.NO_LIGHT),
        ("/hero_1" + LIGHT_SUFFIX, color, color),
    ):
        bench.commands.choose_receiver(name, name, "std_msgs/ColorRGBA")(payload)
        assert bench.commands.light == light and bench.take() == [payload]
    bench.commands.detach()
    bench.commands.choose_receiver("/hero_1" + LIGHT_SUFFIX, "x", "std_msgs/ColorRGBA")(robot_commands.NO_LIGHT)
    assert bench.commands.light == color and bench.commands.refused == 1


def test_requests_end_at_their_limits():
    for kind, layout, low, high, beyond in (
        ("hero_msgs/SetOdom", "<3d", -1e6, 1e6, (-1.01e6, 1.01e6)),
        ("hero_msgs/SetPID", "<6f", 0.0, 1e6, (-0.01, 1.01e6)),
        ("hero_msgs/SetMotor", "<2h", 1000, 2000, (999, 2001)),
        ("hero_msgs/SetIRCalibration", "<8d", 1e-6, 1e3, (0.9e-6, 1001.0)),
    ):
        count = struct.calcsize(layout) // struct.calcsize(layout[0] + layout[2])
        for value in (low, high, *beyond):
            fault = find_request_error(kind, struct.pack(layout, *(value,) * count))
            assert (fault is None) == (value in (low, high)), (kind, value)


def test_odometry_that_is_written_lies_in_the_plane_and_counts_round():
    writer = message_layouts.OdometryWriter((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (7.0,) * 6)
    frames = b"".join(struct.pack("<I", len(text)) + text for text in (b"odom", b"base_link"))
    payload = struct.pack("<3I", 1, 2, 3) + frames + bytes(8 * (7 + 36 + 6 + 36))
    written = writer.rewrite(payload, 2**32 + 5, 1_500_000_007, (encode_pose(1.0, 2.0, math.pi / 2.0), 0.1, 0.5))
    assert struct.unpack_from("<3I", written) == (5, 1, 500_000_007)
    numbers = struct.unpack_from("<85d", written, 12 + len(frames))
    root = math.sqrt(0.5)
    assert numbers[:7] == pytest.approx((1.0, 2.0, 0.0, 0.0, 0.0, root, root))
    assert numbers[7:43][::7] == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0) and sum(numbers[7:43]) == 21.0
    assert numbers[43:49] == (0.1, 0.0, 0.0, 0.0, 0.0, 0.5) and sum(numbers[49:]) == 42.0


def test_ticks_are_believed_up_to_the_speed_of_a_wheel_in_ten_seconds():
    tick_m = WheelGeometry().ticks_m[0]
    for pause_s, limit_s in (
        (0.034, MIN_GAP_S),
        (1.0, 1.0),
        (MAX_GAP_S, MAX_GAP_S),
        (3600.0, MAX_GAP_S),
        (-5.0, MIN_GAP_S),
    ):
        limit_ticks = MAX_WHEEL_SPEED_M_S * limit_s / tick_m
        for share, is_believed in ((0.999, True), (1.001, False)):
            for left, right in ((1.0, 1.0), (-1.0, -1.0), (0.0, 1.0), (1.0, 0.0), (0.0, -1.0)):
                odometry = TickOdometry(WheelGeometry())
                odometry.integrate(7.0, 9.0, 100.0)
                ticks = share * limit_ticks
                moved = odometry.integrate(7.0 + left * ticks, 9.0 + right * ticks, 100.0 + pause_s)
                assert moved == is_believed and odometry.resets == (not is_believed)
    odometry.set_pose(Pose(1.0, 2.0, 0.5))
    assert (odometry.x_m, odometry.y_m, odometry.yaw_rad) == (1.0, 2.0, 0.5)


def test_wheels_rest_within_a_tick_and_settled_ones_within_two():
    for settled, tolerance in ((False, REST_TICKS), (True, SETTLED_TICKS)):
        for turn, is_still in (
            (tolerance, True),
            (-tolerance, True),
            (tolerance + 0.1, False),
            (-tolerance - 0.1, False),
        ):
            for side in ((turn, 0.0), (0.0, turn)):
                wheels = WheelMotion()
                wheels.read_ticks(50.0, 50.0)
                if settled:
                    wheels.settle()
                    wheels.read_ticks(50.0, 50.0)
                wheels.read_ticks(50.0 + side[0], 50.0 + side[1])
                assert (wheels.still_readings > 0) == is_still
    wheels = WheelMotion()
    for velocity, is_still in (
        ((0.002, 0.05), True),
        ((-0.0021, 0.0), False),
        ((0.0, -0.051), False),
        ((0.0, 0.0), True),
    ):
        wheels.read_velocity(*velocity)
        assert (wheels.still_readings > 0) == is_still
    assert wheels.readings == 4
