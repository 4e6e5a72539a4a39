"""What procedures send and when, and which readings count: by readings whose times are known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from test_calibration_rules import FakeSession

from hero_calibration.errors import CalibrationError, EndedError
from hero_calibration.models import dead_zone, step_response
from hero_calibration.models.encoder_readings import Readings
from hero_calibration.models.infrared_model import Facing
from hero_calibration.procedures import infrared, motors, velocity, wheels
from hero_node import Pose, transform_pose
from hero_node.robot_constants import TICK_M
from hero_test.nonempty import nonempty

SETTLE_S = 0.6

STEP_S = 0.034
STARTS_S = [2.0, 2.45, 2.9, 3.35]


def make_readings(left_ticks, right_ticks=None):
    counts = np.arange(len(left_ticks))
    left_ticks = np.asarray(left_ticks, dtype=float)
    right_ticks = -left_ticks / 2.0 if right_ticks is None else right_ticks
    is_even = np.ones(len(counts) - 1, dtype=bool)
    return Readings(counts * STEP_S, counts, left_ticks, right_ticks, STEP_S, counts * STEP_S, is_even)


def test_a_step_of_a_sweep_is_measured_between_its_settling_and_its_end():
    readings = make_readings(2.0 * np.arange(150))
    speeds = dead_zone.measure_sweep(readings, STARTS_S)
    assert np.allclose(speeds, [[2.0 * TICK_M / STEP_S] * 4, [-TICK_M / STEP_S] * 4])
    inside = (readings.times_s >= 2.2) & (readings.times_s <= 2.48)
    for ticks in (np.where(readings.times_s < 2.2, 500.0, 0.0), np.where(readings.times_s > 2.48, 500.0, 0.0)):
        changed = readings._replace(left_ticks=readings.left_ticks + ticks)
        assert dead_zone.measure_sweep(changed, STARTS_S)[0, 0] == pytest.approx(speeds[0, 0])
    jump = int(np.flatnonzero(inside)[3])
    is_even = readings.is_even.copy()
    is_even[jump] = False
    paused = readings._replace(left_ticks=readings.left_ticks + 500.0 * (np.arange(150) > jump), is_even=is_even)
    assert dead_zone.measure_sweep(paused, STARTS_S)[0, 0] == pytest.approx(speeds[0, 0]), "a pause is left out"


def test_steps_whose_command_may_have_come_late_are_unknown():
    readings = make_readings(2.0 * np.arange(150))

    def hear(*silences_s):
        heard_s = readings.times_s.copy()
        for start_s, end_s in silences_s:
            heard_s[(heard_s > start_s) & (heard_s < end_s)] = end_s
        return np.isnan(dead_zone.measure_sweep(readings._replace(heard_s=heard_s), STARTS_S)[0]).tolist()

    assert hear((2.6, 3.0)) == [False, True, True, False]
    assert hear((2.6, 2.82)) == [False] * 4, "shorter than what loses a command"
    assert hear((1.0, 1.8)) == [False] * 4 and hear((1.0, 1.95))[0]
    assert hear((2.21, 2.9))[:2] == [False, True]
    with pytest.raises(CalibrationError, match="too few encoder readings came"):
        hear((2.1, 3.0))
    few = make_readings(2.0 * np.arange(72))  # ends during the second step
    assert np.isnan(dead_zone.measure_sweep(few, STARTS_S[:2])[0]).tolist() == [False, True]


def test_one_wrong_speed_of_five_moves_no_edge():
    pulses_us, speeds_m_s = np.arange(5.0) * 6.0 + 1530.0, 0.001 * (np.arange(5.0) * 6.0 + 4.0)
    speeds_m_s[4] += 0.1
    assert dead_zone._find_edge(pulses_us, speeds_m_s) == pytest.approx((1526.0, 0.001))
    with pytest.raises(CalibrationError, match="does not turn faster with a longer pulse"):
        dead_zone._find_edge(pulses_us, np.full(5, 0.05))


def step_wheel(before_ticks=0.0, readings=120):
    """Readings of a wheel that makes so many ticks before reading 50, and turns at 0.08 m/s from there on."""
    ticks = np.maximum(np.arange(readings) - 50, 0) * (step_response.STEP_M_S * STEP_S / TICK_M)
    return make_readings(ticks + before_ticks * (np.arange(readings) >= 48))


def test_a_wheel_that_was_not_at_rest_is_not_measured():
    for ticks, is_taken in ((3.0, True), (-3.0, True), (4.0, False), (-4.0, False)):
        readings = step_wheel(ticks)
        if is_taken:
            step_response.measure_speed(readings, readings.left_ticks, 50, 9.0)
            continue
        with pytest.raises(CalibrationError, match="still turned when a test started"):
            step_response.measure_speed(readings, readings.left_ticks, 50, 9.0)


def test_speeds_are_measured_from_the_start_to_the_stop():
    readings = step_wheel()
    times_s, speeds_m_s = step_response.measure_speed(readings, readings.left_ticks, 50, 9.0)
    assert speeds_m_s[:4] == pytest.approx([0.08 / 3.0, 0.16 / 3.0, 0.08, 0.08]), "over three readings each"
    assert np.allclose(speeds_m_s[2:], step_response.STEP_M_S)
    assert times_s[0] == pytest.approx(-0.034 * 2 + 1.5 * STEP_S) and 1.3 < times_s[-1] < 1.4 - STEP_S
    stopped_s, _ = step_response.measure_speed(readings, readings.left_ticks, 50, 50 * STEP_S + 1.3)
    assert 1.2 < stopped_s[-1] < 1.3 - STEP_S
    with pytest.raises(CalibrationError, match="speeds could be measured in 1.5 s"):
        step_response.measure_speed(readings, readings.left_ticks, 50, 50 * STEP_S + 1.19)
    assert step_response.DEFAULT_GAINS == (1200.0, 2300.0, 0.1), "of an erased flash"


class TurningSession(FakeSession):
    """Robots that are turned as far as they are told after so many seconds, or never."""

    def __init__(self, needs_s):
        super().__init__(1)
        (self.probe,) = self.probes
        self.probe.check_alive = lambda now_s: None
        self.probe.turn = lambda angle_rad: self.probe.sent.append((self.time_s - 100.0, angle_rad))

        def move(now_s):
            told = [(start_s, angle_rad) for start_s, angle_rad in self.probe.sent if start_s != "stop"] or [(0.0, 0.0)]
            if now_s - 100.0 - told[-1][0] >= needs_s:
                self.probe.pose = Pose(0.0, 0.0, self.target_rad)

        self.on_sleep = move

    def turn(self, target_rad):
        self.probe.sent, self.target_rad = _Sent(), target_rad
        infrared._turn(self, "infrared", {0: target_rad})
        return self.time_s - 100.0


class _Sent(list):
    """Notes turns alone."""

    def append(self, item):
        if item != "stop":
            super().append(item)


def test_a_turn_ends_when_it_is_reached_and_is_tried_three_times():
    quick = TurningSession(1.0)
    assert quick.turn(0.7) == pytest.approx(1.0 + SETTLE_S, abs=0.05) and quick.probe.sent == [(0.0, 0.7)]
    at_once = TurningSession(0.0)
    assert at_once.turn(0.7) == pytest.approx(2.5 / 4.0 + SETTLE_S, abs=0.05)
    stuck = TurningSession(math.inf)
    assert stuck.turn(0.7) == pytest.approx(3.0 * (2.5 + SETTLE_S), abs=0.1)
    assert [angle_rad for _, angle_rad in stuck.probe.sent] == [0.7] * 3
    assert "could not turn on the spot: 40 degrees are missing" in stuck.probe.failure
    near = TurningSession(math.inf)
    assert near.turn(math.radians(4.9)) == pytest.approx(2.5 + SETTLE_S, abs=0.05) and near.probe.failure is None
    off = TurningSession(math.inf)
    off.turn(math.radians(9.9))
    assert len(off.probe.sent) == 3 and off.probe.failure is None
    silent = TurningSession(0.0)

    def fail(now_s):
        raise CalibrationError("no data for 1 s")

    silent.probe.check_alive = fail
    silent.turn(0.7)
    assert silent.probe.failure == "infrared: no data for 1 s"
    wrapped = TurningSession(math.inf)
    wrapped.turn(2.0 * math.pi - 0.1)
    assert wrapped.probe.sent[0][1] == pytest.approx(-0.1)


def test_readings_tell_how_far_a_robot_came_to_the_wall(monkeypatch):
    session, moved_m, sides_m = FakeSession(1), [0.0, 0.01, -0.02, 0.0, 0.03, 0.0, 0.0, 0.0], [0.0, 0.0, 0.01, 0.05] * 2
    (probe,) = session.probes
    start = Pose(0.3, 0.2, 1.0)
    left = [transform_pose(start, Pose(ahead_m, side_m, 0.0)) for ahead_m, side_m in zip(moved_m, sides_m)]

    def receive(now_s):
        session.hear((12.0,) * 8)
        probe.receive_pose(now_s, left[0])

    session.on_sleep = receive
    monkeypatch.setattr(infrared, "_turn", lambda *_: left.pop(0))
    facings = infrared._face_wall_with_each_sensor(session, "infrared", 2, {})
    assert [facing.moved_m for facing in facings[0]] == pytest.approx(moved_m)
    assert [facing.sensor for facing in facings[0]] == [4, 3, 2, 1, 0, 7, 6, 5]


def test_infrared_says_how_long_it_takes(monkeypatch, capsys):
    monkeypatch.setattr(infrared, "_face_wall_with_each_sensor", lambda *arguments: {})
    infrared.calibrate_infrared(FakeSession(0), {})
    assert capsys.readouterr().out.startswith("infrared: about 96 s\n")


def test_constants_that_robots_hold_are_kept_if_their_check_is_ended(monkeypatch):
    rounds, results, session = [], {}, FakeSession(2)

    def face(session, title, samples, walls):
        rounds.append(title)
        if len(rounds) > 1:
            raise EndedError
        return {
            probe.robot_id: [Facing(sensor, [], [0.14] * 8, 0.0) for sensor in range(8)] for probe in session.probes
        }

    def compute(facings):
        if results:
            raise CalibrationError("sensor left reads 3 counts")
        return [0.5] * 8

    monkeypatch.setattr(infrared, "_face_wall_with_each_sensor", face)
    monkeypatch.setattr(infrared.model, "compute_calibration", compute)
    with pytest.raises(EndedError):
        infrared.calibrate_infrared(session, results)
    assert list(results) == [0] and session.probes[0].sent[-1] == ("infrared_counts_m2", [0.5] * 8)
    assert results[0].to_file()["infrared_counts_m2"] == [0.5] * 8
    assert results[0].describe().endswith("mm before, not checked after")


def test_pulses_are_swept_up_and_down_at_their_times(monkeypatch):
    session, measured = FakeSession(2), []

    def measure(readings, starts_s):
        measured.append(list(starts_s))
        return np.array([(-0.1, 0.1), (-0.13, 0.07)])  # wheels whose centers are at 1500 and about 1529 us

    monkeypatch.setattr(dead_zone, "measure_sweep", measure)
    result = SimpleNamespace(to_file=lambda: {"motor_centers_us": [1500, 1510]})
    monkeypatch.setattr(motors, "evaluate_sweep", lambda pulses_us, speeds_m_s: result)
    monkeypatch.setattr(type(session.probes[0]), "read_wheels", lambda probe: None)
    results = {}
    motors.calibrate_motors(session, results)
    assert results == {0: result, 1: result}
    for probe in nonempty(session.probes):
        sent = [tuple(values) for name, *values in filter(lambda one: one[0] == "pulses", probe.sent)]
        assert sent[:2] == [(1380, 1380), (1620, 1620)]
        assert sent[2:] == [(us, us + 28) for us in dead_zone.list_pulses()]
        assert ("motor_centers_us", [1500, 1510]) in probe.sent
    assert list(map(len, measured)) == [2, 2, 82, 82]
    assert np.diff(measured[2]) == pytest.approx(np.full(81, 0.45), abs=0.01)


def test_a_robot_that_fails_while_gains_are_tried_is_left_with_the_best(monkeypatch):
    session, rounds, results = FakeSession(2), [], {}

    def test(session):
        rounds.append(session.now_s)
        if len(rounds) == 4:
            session.probes[1].failure = "velocity: too few readings"
        error = 0.1 if len(rounds) == 2 else 0.3  # the first gains that are tried are the best
        response = step_response.Response(error, 0.0)
        return {probe.robot_id: [response] * 2 for probe in session.active}

    monkeypatch.setattr(velocity, "_test", test)
    velocity.calibrate_velocity(session, {}, results)
    for probe in nonempty(session.probes):
        written = [command for command in probe.sent if command[0] == "velocity_gains"]
        assert len(written) > 3 and written[-1] == written[0] != written[1], probe.robot_id
        assert results[probe.robot_id].to_file()["velocity_gains"] == written[-1][1], "what it holds is kept"


def test_a_velocity_test_turns_to_each_side_for_its_time(monkeypatch):
    session, tested = FakeSession(1), []

    def evaluate(readings, starts_s, may_be_late):
        tested.append((list(starts_s), may_be_late))
        return "responses"

    monkeypatch.setattr(velocity, "evaluate_test", evaluate)
    monkeypatch.setattr(type(session.probes[0]), "read_wheels", lambda probe: None)
    assert velocity._test(session) == {0: "responses"}
    speeds = [command[1] for command in session.probes[0].sent if command[0] == "drive"]
    left = [speed for speed in speeds if speed > 0.0]
    assert 15 <= len(left) <= 16 and len(speeds) == 2 * len(left), "ten a second"
    assert speeds == pytest.approx([0.16 / 0.063] * len(left) + [-0.16 / 0.063] * len(left))
    (starts_s, may_be_late) = tested[0]
    assert not may_be_late and starts_s == pytest.approx([100.6, 100.6 + 1.55 + SETTLE_S], abs=0.06)


@pytest.mark.parametrize(("model", "ticks"), [("hero", 10.0), ("hero_plus", 30.0)])
def test_ticks_of_other_models_count_as_those_of_the_stock_robot(model, ticks, monkeypatch):
    ros_probe = pytest.importorskip("hero_calibration.robots.ros_probe", reason="imports rospy")
    monkeypatch.setattr(ros_probe.rospy, "Publisher", lambda *arguments, **options: None)
    monkeypatch.setattr(ros_probe.rospy, "Subscriber", lambda *arguments, **options: None)
    monkeypatch.setattr(ros_probe.rospy, "get_time", lambda: 7.0)
    probe, heard = ros_probe.RosProbe(3, model), []
    probe.receive_encoder = lambda *values: heard.append(values)
    message = ros_probe.Encoder(left_ticks=10, right_ticks=-10)
    message.header.seq, message.header.stamp = 5, ros_probe.rospy.Time(6)
    probe._take_encoder(message)
    assert heard == [(7.0, 6.0, 5, ticks, -ticks)]


def test_a_probe_hears_its_topics_and_commands_its_controllers(monkeypatch):
    ros_probe = pytest.importorskip("hero_calibration.robots.ros_probe", reason="imports rospy")
    heard, sent = {}, []

    def advertise(topic, kind, queue_size, tcp_nodelay):
        assert tcp_nodelay

        def publish(message):
            assert isinstance(message, kind)
            sent.append((topic.partition("/hero_3/")[2], message))

        return SimpleNamespace(publish=publish, name=topic, get_num_connections=lambda: topic not in ("", unheard))

    def subscribe(topic, kind, receive, queue_size, tcp_nodelay):
        assert tcp_nodelay
        heard[topic] = lambda message: receive(message) if isinstance(message, kind) else pytest.fail(topic)

    monkeypatch.setattr(ros_probe.rospy, "Publisher", advertise)
    monkeypatch.setattr(ros_probe.rospy, "Subscriber", subscribe)
    monkeypatch.setattr(ros_probe.rospy, "get_time", lambda: 7.0)
    probe, unheard, odometry = ros_probe.RosProbe(3, "hero"), "", ros_probe.Odometry()
    odometry.pose.pose.position.x, odometry.pose.pose.position.y, odometry.pose.pose.orientation.w = 1.0, 2.0, 1.0
    assert list(heard) == ["/hero_3/encoder", "/hero_3/laser", "/hero_3/odom", "/localization/poses"]
    for missing, message in (("encoder", ros_probe.Encoder()), ("laser", ros_probe.LaserScan()), ("odom", odometry)):
        assert missing in probe.find_silence(8.0)
        heard["/hero_3/" + missing](message)
    assert probe.find_silence(8.0) is None and probe.pose == (1.0, 2.0, 0.0)
    for topic in ("cmd_motor", "velocity_controller/cmd_vel", "position_controller/cmd_vel"):
        unheard = "/hero_3/" + topic
        assert probe.find_silence(8.0) == f"nothing subscribes to {unheard}: is the driver running?"
    assert probe.find_place(0.0) is None
    states = (ros_probe.RobotPose.TRACKED, ros_probe.RobotPose.LOST)
    robots = [ros_probe.RobotPose(id=number, state=state, x=number + state) for number in (3, 4) for state in states]
    heard["/localization/poses"](ros_probe.RobotPoses(robots=robots))
    assert probe.find_place(7.0) == (3.0 + states[0], 0.0, 0.0) and probe.find_place(7.1) is None
    probe.drive(1.5, 0.1)
    probe.drive(2.0)
    probe.turn(-0.7)
    probe.stop()
    velocity, position = "velocity_controller/cmd_vel", "position_controller/cmd_vel"
    assert [(topic, twist.linear.x, twist.angular.z) for topic, twist in sent] == [
        (velocity, 0.1, 1.5), (velocity, 0.0, 2.0), (position, 0.0, -0.7), (velocity, 0.0, 0.0), (position, 0.0, 0.0),
    ]  # fmt: skip
    probe.set_pulses(1400, 1600)
    assert sent[-1][0] == "cmd_motor" and sent[-1][1] == ros_probe.Motor(1400, 1600)


def test_a_side_of_a_square_ends_on_time_and_needs_two_readings():
    session = FakeSession(1)
    (probe,) = session.probes
    wheels._drive(session, [probe], (0.1, 0.5, 1.05))
    assert session.time_s == pytest.approx(101.05 + SETTLE_S, abs=0.021)
    assert {command for command in probe.sent if command != "stop"} == {("drive", 0.5, 0.1)}
    for seq, heard_s in enumerate((1.0, 2.0, 3.0, 4.0)):
        probe.receive_encoder(heard_s, heard_s, seq + 1, 10.0 * seq, -10.0 * seq)
    start_s = 2.01 + wheels.MEASURE_S / 2.0  # since the middle of a stop, without its first reading
    assert wheels._take_ticks(probe, start_s, 4.0).tolist() == [[20.0, -20.0], [30.0, -30.0]]
    with pytest.raises(CalibrationError, match="no encoder readings came"):
        wheels._take_ticks(probe, start_s, 3.99)
