"""The program behavior on stepped robots, in their time: what it sends to robots, and what it says and shows."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rospy", reason="the program needs ROS")
import rospy
from nav_msgs.msg import Odometry
from visualization_msgs.msg import Marker

from hero_client import ProgramError
from hero_client.ros.localized_poses import PoseListener, PoseReport
from hero_client.values import BODY_RADIUS_M, HERO
from hero_msgs.msg import Robot, RobotArray, RobotPose
from hero_node import Pose
from hero_node.parameters import check_parameters
from hero_node.ros import ros_clock
from hero_sim.build import build_swarm
from hero_sim.main import build_parser
from hero_sim.stepped import StepSwarm
from hero_sim.stepped.swarm import StepWorld
from hero_swarm.behavior import Behavior, Binary, Neighbors, Sight, sense
from hero_swarm.metrics import consensus_error
from hero_swarm.metrics.graphs import measure_distances
from hero_swarm.ros import behavior_node, pose_source, wheel_commands
from hero_swarm.ros.behavior_markers import BehaviorMarkers
from hero_swarm.ros.behavior_node import PARAMETERS, BehaviorNode, _parse_fence
from hero_swarm.wheel_pulses import find_pulses, list_dead_zones

MILLING = {"left0": 0.8, "right0": 1.0, "left1": 0.5, "right1": 0.6}
"""Numbers of wheel_genome, which sends servo pulses."""

DEAD_ZONE_US = [1470.0, 1530.0, 1480.0, 1540.0]


def write_calibration(folder, number):
    (folder / ("hero_%d.yaml" % number)).write_text("robot: hero_%d\ndead_zones_us: %s\n" % (number, DEAD_ZONE_US))


class Stage:
    """Stepped robots, in place of all that the node has of ROS."""

    def __init__(self, monkeypatch, count=6, **options):
        self.swarm = StepSwarm(count, seed=3, **options)
        self.sent, self.warnings = {}, []
        self.silent = set()
        self.clock_ahead_s = 0.0  # of ROS, which is set back and forth
        monkeypatch.setattr(rospy, "get_time", lambda: self.swarm.now_s + self.clock_ahead_s)
        monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time.from_sec(self.swarm.now_s))
        monkeypatch.setattr(rospy, "get_name", lambda: "/behavior")
        monkeypatch.setattr(rospy, "Subscriber", lambda *arguments, **options: None)
        monkeypatch.setattr(rospy, "Publisher", self.advertise)
        monkeypatch.setattr(rospy, "logwarn", lambda text, *values: self.warnings.append(text % values))
        self.joined = range(count)
        monkeypatch.setattr(pose_source, "share_drivers", lambda: self)
        for module in (behavior_node, pose_source, ros_clock):
            monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.swarm.now_s))

    def advertise(self, topic, message_class, **options):
        messages = self.sent.setdefault(topic, [])
        return SimpleNamespace(publish=messages.append, get_num_connections=lambda: 1)

    def read(self):
        """Return the report of the driver."""
        return RobotArray(robots=[Robot(id=robot_id, state=Robot.READY) for robot_id in self.joined])

    def find_model(self, namespace):
        return "hero_plus" if namespace == "/hero_5" else "hero"

    def start(self, behavior, commanded=None, **given):
        numbers = MILLING if behavior == "wheel_genome" else {}
        given = {"behavior": behavior, "parameters": numbers, "frame": "world", "calibration_folder": "", **given}
        swarm = StepWorld(self.swarm.robots[:commanded], self.swarm._clock)
        self.node = BehaviorNode(swarm, check_parameters(PARAMETERS, given))

    def run(self, seconds):
        """Let the behavior step, at the poses of robots that are not silent."""
        sources = [one._source for one in (self.node, self.node._others) if one]
        for _ in range(round(seconds * self.node.control.rate_hz)):
            for robot in self.swarm:
                if robot.robot_id not in self.silent:
                    for source in sources:
                        source._receive_truth(robot.robot_id, self.tell(robot.true_pose))
            self.node.step()
            self.swarm.sleep(1.0 / self.node.control.rate_hz)

    def tell(self, pose):
        message = Odometry()
        message.header.stamp = rospy.Time.from_sec(self.swarm.now_s + self.clock_ahead_s)
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        place.x, place.y, turn.z, turn.w = pose.x_m, pose.y_m, np.sin(pose.yaw_rad / 2.0), np.cos(pose.yaw_rad / 2.0)
        return message

    @property
    def places_m(self):
        return self.swarm.rows.world.poses[None, :, :2].copy()


@pytest.fixture(name="stage")
def make_stage(monkeypatch):
    return Stage(monkeypatch)


@pytest.mark.slow
def test_robots_meet_and_the_metric_says_so(stage):
    stage.start("rendezvous")
    stage.run(0.5)
    first = stage.sent["~metric"][0].data
    stage.run(10.0)
    apart_m = consensus_error(stage.places_m)[0]
    assert apart_m < 0.6 * first
    assert stage.sent["~metric"][-1].data == pytest.approx(apart_m, abs=0.01)
    assert not stage.warnings


def test_the_metric_of_wall_following_needs_an_arena(stage):
    stage.start("wall_following")
    stage.run(2.0)
    assert np.isnan(stage.sent["~metric"][-1].data)
    assert stage.sent["behavior/markers"][-1].markers == []


@pytest.mark.parametrize("given", [{"arena": "empty"}, {"simulated": 6}])
def test_walls_are_followed_live_with_their_metric(stage, given):
    stage.start("wall_following", **given)
    stage.run(2.0)
    assert 0.0 <= stage.sent["~metric"][-1].data <= 1.0 and not stage.warnings
    (text,) = stage.sent["behavior/markers"][-1].markers
    assert text.text == f"wall_following {stage.sent['~metric'][-1].data:.2f}"


def test_a_controller_senses_the_floor_of_the_arena_that_it_names(stage, tmp_path):
    (tmp_path / "arena.yaml").write_text(
        "bounds_m: [-2, -2, 2, 2]\nareas: [{name: all, rectangle_m: [-2, -2, 2, 2], color: 0}]\n"
    )
    path = tmp_path / "a.controller"
    path.write_text(
        "arena: arena.yaml\nstates:\n- {name: a, do: stop, next: [{to: b, when: black floor, probability: 1}]}\n"
        "- {name: b, do: stop}\n"
    )
    stage.start(str(path))
    stage.run(0.5)
    assert stage.node.control.memory[0].tolist() == [1] * 6 and not stage.warnings


@pytest.mark.slow
def test_a_robot_whose_pose_is_old_stops_alone_and_is_named(stage):
    stage.start("wheel_genome")
    stage.run(4.0)
    stage.silent = {2}
    stage.run(2.0)
    wheels_m_s = np.abs(stage.swarm.rows.world.speeds_m_s).max(axis=1)
    assert wheels_m_s[2] == 0.0 and np.delete(wheels_m_s, 2).min() > 0.02
    assert any("hero_2" in text and "stopped meanwhile" in text for text in stage.warnings), stage.warnings
    # The metric of the others is still there, and lines begin at the others alone.
    beams = stage.sent["behavior/markers"][-1].markers[0]
    starts_m = {(round(point.x, 3), round(point.y, 3)) for point in beams.points[::2]}
    assert len(starts_m) == 5 and beams.ns == "/behavior/sees"
    assert np.isfinite(stage.sent["~metric"][-1].data)
    stage.silent = set()
    stage.run(2.0)
    assert np.abs(stage.swarm.rows.world.speeds_m_s[2]).max() > 0.02, "it goes on with a fresh pose"


@pytest.mark.slow
def test_a_program_that_is_late_drives_slowly_says_so_and_recovers(stage):
    stage.start("wheel_genome")
    stage.run(4.0)
    usual_m_s = np.abs(stage.swarm.rows.world.speeds_m_s).mean()
    planned_hz, stage.node.control.rate_hz = stage.node.control.rate_hz, 2.0
    stage.run(3.0)
    assert np.abs(stage.swarm.rows.world.speeds_m_s).mean() < 0.6 * usual_m_s
    share = (1.0 / planned_hz + 0.1) / 0.5
    text = "commands are late by 0.4 s: this PC is busy; robots drive at %.0f percent meanwhile"
    assert stage.warnings[1:] == [text % (100.0 * share)]
    stage.node.control.rate_hz = planned_hz
    stage.run(4.0)
    assert np.abs(stage.swarm.rows.world.speeds_m_s).mean() > 0.8 * usual_m_s


@pytest.mark.slow
def test_the_time_of_a_behavior_goes_on_when_the_clock_is_set(stage, monkeypatch):
    stage.clock_ahead_s = 7200.0
    stage.start("wheel_genome")
    stage.warnings.clear()
    times_s, step = [], stage.node.control.step

    def note(time_s, *sensed):
        times_s.append(time_s)
        return step(time_s, *sensed)

    monkeypatch.setattr(stage.node.control, "step", note)
    for stage.clock_ahead_s in (7200.0, 3600.0, 9000.0):
        stage.run(1.0)
    assert np.diff(times_s) == pytest.approx(1.0 / stage.node.control.rate_hz)
    assert not stage.warnings


def test_calibrated_motors_get_pulses_and_zero_velocity_at_rest(stage, tmp_path):
    for number in range(6):
        write_calibration(tmp_path, number)
    stage.start("wheel_genome", calibration_folder=str(tmp_path))
    stage.run(0.2)
    pulses = stage.sent["/hero_4/cmd_motor"]
    assert pulses
    for message in pulses:
        assert 1000 < message.left_motor_pwm < 1500 < message.right_motor_pwm < 2000, "both wheels forward"
    count = len(pulses)
    stage.silent = set(range(6))
    stage.run(2.0)
    assert len(pulses) < count + 15
    assert np.abs(stage.swarm.rows.world.speeds_m_s).max() < 1e-6


def test_the_robots_of_hero_sim_count_as_calibrated(stage):
    stage.start("wheel_genome", simulated=6)
    simulator = build_swarm(build_parser().parse_args(["--count", "6", "--arena", "empty"]), [""] * 6, print)
    left_us, right_us = find_pulses(0.08, 0.0, list_dead_zones(simulator.world.errors))
    stage.node._commands.send(np.full(6, 0.08), np.zeros(6), np.full(6, True))
    sent = [stage.sent["/hero_%d/cmd_motor" % number][0] for number in range(6)]
    assert [message.left_motor_pwm for message in sent] == left_us.tolist()
    assert [message.right_motor_pwm for message in sent] == right_us.tolist()
    assert not stage.warnings


def test_a_file_of_calibrate_stands_above_what_the_simulator_tells(stage, tmp_path):
    write_calibration(tmp_path, 4)
    (tmp_path / "hero_5.yaml").write_text("robot: hero_5\nwheels_m: [0.049, 0.049, 0.063]\n")
    simulated = wheel_commands._find_dead_zones("", 6)
    found = wheel_commands._find_dead_zones(str(tmp_path), 6)
    assert found == {**simulated, "hero_4": DEAD_ZONE_US}, "hero_5 was not swept"
    assert wheel_commands._find_dead_zones(str(tmp_path), 0) == {"hero_4": DEAD_ZONE_US}


def test_without_all_motors_calibrated_velocities_drive_and_are_explained(stage, tmp_path):
    write_calibration(tmp_path, 0)
    stage.start("wheel_genome", calibration_folder=str(tmp_path))
    before_m = stage.places_m
    stage.run(2.0)
    assert "the motors of hero_1, hero_2, hero_3, hero_4, hero_5 are not calibrated" in stage.warnings[0]
    assert not any(topic.endswith("cmd_motor") for topic in stage.sent)
    assert np.hypot(*np.moveaxis(stage.places_m - before_m, -1, 0)).min() > 0.02


@pytest.mark.parametrize("content", ["dead_zones_us: [1, 2]", "dead_zones_us: [a, 2, 3, 4]", "{", "dead_zones_us: 3"])
def test_an_unusable_calibration_file_is_named_and_its_robot_alone_lacks(stage, tmp_path, content):
    for number in range(6):
        write_calibration(tmp_path, number)
    (tmp_path / "hero_1.yaml").write_text("robot: hero_1\n" + content)
    stage.start("wheel_genome", calibration_folder=str(tmp_path))
    assert re.search(r"hero_1\.yaml.*: .*; correct the file", stage.warnings[0])
    assert "the motors of hero_1 are not calibrated" in stage.warnings[1]


@pytest.mark.parametrize("fence", ["1 2 3", "0 0 a 1", "1 0 0 1", "0 0 inf 1"])
def test_a_fence_that_is_none_is_refused(stage, fence):
    with pytest.raises(ProgramError, match="~fence is .* must be"):
        stage.start("wheel_genome", fence=fence)


def test_a_color_is_sent_when_it_changes_and_not_again(stage):
    stage.start("segregation")
    shown = []
    for robot in stage.swarm:
        robot.led = shown.append
    stage.run(1.0)
    assert shown == [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)] * 3


@pytest.mark.slow
def test_speeds_that_are_no_numbers_stop_their_robot_alone(stage, tmp_path):
    (tmp_path / "odd.py").write_text(
        "import numpy as np\n"
        "from hero_swarm.behavior import Behavior\n"
        "class Odd(Behavior):\n"
        "    def step(self, sensed, memory, random):\n"
        "        return np.where(sensed.numbers == 1, np.nan, 0.1), 0.0, memory\n"
    )
    stage.start(str(tmp_path / "odd.py"))
    before_m = stage.places_m
    stage.run(4.0)
    moved_m = np.hypot(*np.moveaxis(stage.places_m - before_m, -1, 0))[0]
    assert moved_m[1] == 0.0 and np.delete(moved_m, 1).min() > 0.02
    assert stage.warnings == [
        "the behavior gives hero_1 a speed that is no finite number; the robots are stopped meanwhile"
    ]


LEAVE = """\
import numpy as np
from hero_swarm.behavior import Behavior
class Leave(Behavior):
    rate_hz = %g
    def step(self, sensed, memory, random):
        x_m, y_m, yaw_rad = sensed.poses.T
        return 1e300, 6.0 * np.sin(np.arctan2(-y_m, 3.0 - x_m) - yaw_rad), memory
"""


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [1.0, 20.0])
def test_robots_stay_in_the_fence_whatever_the_rate_and_speed(stage, tmp_path, rate_hz):
    (tmp_path / "leave.py").write_text(LEAVE % rate_hz)
    half_m = np.abs(stage.places_m).max() + 0.1
    fence = "%g %g %g %g" % (-half_m, -half_m, half_m, half_m)
    stage.start(str(tmp_path / "leave.py"), safety="fence and robots", fence=fence)
    farthest_m, nearest_m = [], []

    def watch(_):
        farthest_m.append(np.abs(stage.places_m).max())
        nearest_m.append(measure_distances(stage.places_m).min())

    stage.swarm.rows.on_cycle.append(watch)
    stage.run(8.0)
    assert max(farthest_m) < half_m - BODY_RADIUS_M and max(farthest_m) > half_m - 0.1
    assert min(nearest_m) > 2.0 * BODY_RADIUS_M
    (text, *more) = stage.warnings
    assert text.startswith("the behavior asks hero_0 for 1e+300 m/s and ") and "it drives this curve slower" in text
    assert len(more) <= 1, "once in 5 s"


CHASE = """\
import numpy as np
from hero_swarm.behavior import Behavior
class Chase(Behavior):
    def step(self, sensed, memory, random):
        x_m, y_m, yaw_rad = sensed.poses.T
        return 0.2, 6.0 * np.sin(np.arctan2(%g - y_m, %g - x_m) - yaw_rad), memory
"""


@pytest.mark.slow
@pytest.mark.parametrize("speed_m_s", [0.0, 0.06])
def test_robots_of_others_are_avoided_by_their_own_radii(stage, tmp_path, speed_m_s):
    goal = stage.swarm.robots[5].true_pose
    (tmp_path / "chase.py").write_text(CHASE % (goal.y_m, goal.x_m))
    stage.start(str(tmp_path / "chase.py"), 4, safety="fence and robots")
    stage.swarm.robots[5].drive(speed_m_s, speed_m_s / 0.05)
    gaps_m = []

    def watch(_):
        apart_m = measure_distances(stage.places_m)[0]
        others = np.column_stack((apart_m[:4, 4], apart_m[:4, 5] - 0.060 + BODY_RADIUS_M))
        gaps_m.append(min(apart_m[:4, :4].min(), others.min()) - 2.0 * BODY_RADIUS_M)

    stage.swarm.rows.on_cycle.append(watch)
    for _ in range(6):
        stage.swarm.robots[5].drive(speed_m_s, speed_m_s / 0.05)
        stage.run(1.0)
    assert 0.0 < min(gaps_m) < 0.3, min(gaps_m)


def test_driven_robots_are_kept_apart_by_the_radii_of_their_models(monkeypatch):
    stage = Stage(monkeypatch, 3, model="hero_plus,robot=1")
    link, reported = type(stage.swarm.robots[1]._link), []
    told = link.model.fget
    monkeypatch.setattr(link, "model", property(lambda own: told(own) if reported else HERO))
    stage.start("rendezvous", safety="fence and robots")
    stage.run(0.1)
    assert stage.node._filter.radii_m == [BODY_RADIUS_M] * 3, "no driver has reported them yet"
    reported.append("by their driver")
    stage.run(0.1)
    assert stage.node._filter.radii_m == [BODY_RADIUS_M, 0.060, BODY_RADIUS_M]


@pytest.mark.slow
def test_robots_of_others_without_a_pose_are_named_and_new_ones_added(stage):
    stage.joined, stage.silent = range(5), {4}
    stage.start("wheel_genome", 3, safety="fence and robots")
    stage.run(0.5)
    assert stage.node._filter.others_m[:, 2].tolist() == [BODY_RADIUS_M]
    stage.joined = range(6)
    stage.run(3.5)
    assert stage.node._filter.others_m[:, 2].tolist() == [BODY_RADIUS_M, 0.060]
    assert stage.warnings[-1] == "not avoided, for want of a pose in the frame world: hero_4"


def test_robots_that_localize_alone_knows_are_avoided_in_its_frame(stage, monkeypatch):
    stage.joined = (0, 4)
    places = {0: Pose(0.0, 0.0, 0.0), 2: Pose(1.0, 2.0, 0.0)}
    poses = PoseListener.__new__(PoseListener)
    robots = {number: RobotPose(id=number, state=RobotPose.UNKNOWN) for number in (0, 2, 3)}
    poses._report = PoseReport("map", 0.0, 0.0, robots)
    monkeypatch.setattr(poses, "find", lambda robot_id, *_, **__: places.get(robot_id))
    monkeypatch.setattr(poses, "age_s", lambda _: 0.1)
    monkeypatch.setattr(pose_source, "share_poses", lambda: poses)
    others = pose_source.OtherRobots([0], "map")
    assert others.read().tolist() == [[1.0, 2.0, BODY_RADIUS_M]]
    assert others.describe_missing() == "not avoided, for want of a pose in the frame map: hero_4"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"safety": "fence"}, "~safety is fence, but ~fence is empty"),
        ({"safety": "fence", "fence": " "}, "~safety is fence, but ~fence is empty"),
        ({"fence": "-1 -1 1 1"}, "~fence is '-1 -1 1 1', but ~safety is off"),
    ],
)
def test_a_fence_that_limits_nothing_is_refused(stage, given, words):
    with pytest.raises(ProgramError, match=words):
        stage.start("wheel_genome", **given)


@pytest.mark.slow
def test_missing_poses_are_told_after_3_s_and_then_every_5_s(stage):
    stage.start("wheel_genome")
    stage.run(1.02)
    assert len(stage.sent["~metric"]) == 9, "every second step of 0.06 s"
    stage.silent = set(range(6))
    stage.warnings.clear()
    told_s = []
    for _ in range(240):
        stage.run(0.06)
        if sum("hero_0" in text for text in stage.warnings) > len(told_s):
            told_s.append(stage.swarm.now_s)
    assert told_s == pytest.approx([3.0, 8.0, 13.0], abs=0.2)


@pytest.mark.parametrize(("count", "words"), [(10, "hero_8, hero_9 are not"), (11, "hero_9 and 1 more are not")])
def test_of_many_robots_without_calibration_ten_are_named(monkeypatch, count, words):
    stage = Stage(monkeypatch, count)
    stage.start("wheel_genome")
    assert words in stage.warnings[0] and "hero_10" not in stage.warnings[0]


def test_a_fence_has_a_width_and_a_height():
    assert _parse_fence(" ") is None
    assert _parse_fence("-1 0 1 0.5").tolist() == [-1.0, 0.0, 1.0, 0.5]
    for text in ("0 0 0 1", "0 0 1 0", "0 0 1 -1", "0 0 nan 1"):
        with pytest.raises(ProgramError, match="~fence is"):
            _parse_fence(text)


class Seeing(Behavior):
    metric = "order"
    beam = Binary(range_m=0.5)
    endless = Sight()
    near = Neighbors(range_m=0.5)

    def step(self, sensed, memory, random):
        return 0.0, 0.0, memory


def test_beams_end_where_sensors_do_and_the_metric_is_above_all(monkeypatch):
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(5))
    behavior, drawing = Seeing(), BehaviorMarkers(Seeing(), "map", "/node")
    poses = np.array([(0.0, 0.0, math.pi / 2.0), (1.0, 0.0, 0.0), (0.8, 0.3, 1.0), (math.nan,) * 3])

    def draw(time_s, value, shift_m=(0.0, 0.0)):
        moved = poses + (*shift_m, 0.0)
        markers = drawing.draw(moved, sense(behavior, time_s, moved[None], None), value)
        assert {(one.header.frame_id, one.action) for one in markers} == {("map", Marker.ADD)}
        assert len({one.ns for one in markers}) == len(markers)
        return {one.ns: one for one in markers}

    def list_lines(marker):
        points = [(point.x, point.y) for point in marker.points]
        assert len(marker.colors) == len(points)
        return [(*start, *end) for start, end in zip(points[::2], points[1::2])]

    first = draw(0.0, 1.0)
    assert set(first) == {"/node/beam", "/node/endless", "/node/near", "/node/metric"}
    reach_m = BODY_RADIUS_M + 0.5
    beams = list_lines(first["/node/beam"])
    assert len(beams) == 3 and beams[0] == pytest.approx((0.0, 0.0, 0.0, reach_m))
    assert beams[1] == pytest.approx((1.0, 0.0, 1.0 + reach_m, 0.0))
    assert list_lines(first["/node/endless"])[0] == pytest.approx((0.0, 0.0, 0.0, BODY_RADIUS_M + 3.0))
    assert list_lines(first["/node/near"]) == [pytest.approx((1.0, 0.0, 0.8, 0.3)), pytest.approx((0.8, 0.3, 1.0, 0.0))]
    text = draw(0.5, 3.0, (0.1, 0.2))["/node/metric"]
    assert text.text == "order 3.00" and text.pose.position.z > 0.0
    assert (text.pose.position.x, text.pose.position.y) == (pytest.approx(0.7), pytest.approx(0.3 + 0.2 + 0.09))


def test_a_beam_that_sees_has_another_color(monkeypatch):
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(5))
    poses = np.array([[(0.0, 0.0, 0.0), (0.4, 0.0, 0.0)]])
    sensed = sense(Seeing(), 0.0, poses, None)
    beams = BehaviorMarkers(Seeing(), "map", "/node")._draw_sensor("beam", poses[0], sensed)
    sees, free = beams.colors[0], beams.colors[2]
    assert beams.colors == [sees, sees, free, free] and sees.r > 0.9 > free.r


def test_numbers_of_the_program_are_taken_up_to_their_limits():
    limited = {name: one for name, one in PARAMETERS.items() if getattr(one, "limits", None)}
    assert {name: (one.default, *one.limits) for name, one in limited.items()} == {
        "object_radius_m": (0.05, 0.001, 5.0), "simulated": (0, 0, 1000), "seed": (0, 0, 2**31 - 1),
        "time_s": (0.0, 0.0, 1e6),
    }  # fmt: skip
