"""The program behavior on stepped robots, in their time: what it sends to robots, and what it says and shows."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rospy", reason="the program needs ROS")
import rospy
from nav_msgs.msg import Odometry

from hero_client import ProgramError
from hero_node.parameters import check_parameters
from hero_sim.build import build_swarm
from hero_sim.main import build_parser
from hero_sim.stepped.swarm import StepSwarm
from hero_swarm.metrics import consensus_error
from hero_swarm.ros import behavior_node
from hero_swarm.ros.behavior_node import PARAMETERS, BehaviorNode
from hero_swarm.wheel_pulses import find_pulses, list_dead_zones

DEAD_ZONE_US = [1470.0, 1530.0, 1480.0, 1540.0]


def write_calibration(folder, number):
    (folder / ("hero_%d.yaml" % number)).write_text("robot: hero_%d\ndead_zones_us: %s\n" % (number, DEAD_ZONE_US))


class Stage:
    """Stepped robots, in place of all that the node has of ROS."""

    def __init__(self, monkeypatch, count=6):
        self.swarm = StepSwarm(count, seed=3)
        self.sent, self.warnings = {}, []
        self.silent = set()
        monkeypatch.setattr(rospy, "get_time", lambda: self.swarm.now_s)
        monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time.from_sec(self.swarm.now_s))
        monkeypatch.setattr(rospy, "get_name", lambda: "/behavior")
        monkeypatch.setattr(rospy, "Subscriber", lambda *arguments, **options: None)
        monkeypatch.setattr(rospy, "Publisher", self.advertise)
        monkeypatch.setattr(rospy, "logwarn", lambda text, *values: self.warnings.append(text % values))
        monkeypatch.setattr(behavior_node, "time", SimpleNamespace(monotonic=lambda: self.swarm.now_s))

    def advertise(self, topic, message_class, **options):
        messages = self.sent.setdefault(topic, [])
        return SimpleNamespace(publish=messages.append, get_num_connections=lambda: 1)

    def start(self, behavior, **given):
        given = {"behavior": behavior, "frame": "world", "calibration_folder": "", **given}
        self.node = BehaviorNode(self.swarm, check_parameters(PARAMETERS, given))

    def run(self, seconds):
        """Let the behavior step, at the poses of robots that are not silent."""
        for _ in range(round(seconds / self.node.period_s)):
            for robot in self.swarm:
                if robot.robot_id not in self.silent:
                    self.node._source._receive_truth(robot.robot_id, self.tell(robot.true_pose))
            self.node.step()
            self.swarm.sleep(self.node.period_s)

    def tell(self, pose):
        message = Odometry()
        message.header.stamp = rospy.Time.from_sec(self.swarm.now_s)
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        place.x, place.y, turn.z, turn.w = pose.x_m, pose.y_m, np.sin(pose.yaw_rad / 2.0), np.cos(pose.yaw_rad / 2.0)
        return message

    @property
    def places_m(self):
        return self.swarm.rows.world.poses[None, :, :2].copy()


@pytest.fixture(name="stage")
def make_stage(monkeypatch):
    return Stage(monkeypatch)


def test_robots_meet_and_the_metric_says_so(stage):
    stage.start("rendezvous")
    stage.run(0.5)
    first = stage.sent["~metric"][0].data
    stage.run(10.0)
    apart_m = consensus_error(stage.places_m)[0]
    assert apart_m < 0.6 * first
    assert stage.sent["~metric"][-1].data == pytest.approx(apart_m, abs=0.01)
    assert not stage.warnings


def test_a_robot_whose_pose_is_old_stops_alone_and_is_named(stage):
    stage.start("milling")
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


def test_calibrated_motors_get_pulses_and_zero_velocity_at_rest(stage, tmp_path):
    for number in range(6):
        write_calibration(tmp_path, number)
    stage.start("milling", calibration_folder=str(tmp_path))
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
    stage.start("milling", simulated=6)
    simulator = build_swarm(build_parser().parse_args(["--count", "6", "--arena", "empty"]), [""] * 6, print)
    left_us, right_us = find_pulses(0.08, 0.0, list_dead_zones(simulator.world.errors))
    stage.node._commands.send(np.full(6, 0.08), np.zeros(6), np.full(6, True))
    sent = [stage.sent["/hero_%d/cmd_motor" % number][0] for number in range(6)]
    assert [message.left_motor_pwm for message in sent] == left_us.tolist()
    assert [message.right_motor_pwm for message in sent] == right_us.tolist()
    assert not stage.warnings


def test_without_all_motors_calibrated_velocities_drive_and_are_explained(stage, tmp_path):
    write_calibration(tmp_path, 0)
    stage.start("milling", calibration_folder=str(tmp_path))
    before_m = stage.places_m
    stage.run(2.0)
    assert "the motors of hero_1, hero_2, hero_3, hero_4, hero_5 are not calibrated" in stage.warnings[0]
    assert not any(topic.endswith("cmd_motor") for topic in stage.sent)
    assert np.hypot(*np.moveaxis(stage.places_m - before_m, -1, 0)).min() > 0.02


@pytest.mark.parametrize("content", ["dead_zones_us: [1, 2]", "dead_zones_us: [a, 2, 3, 4]", "{", "dead_zones_us: 3"])
def test_an_unusable_calibration_file_is_named(stage, tmp_path, content):
    (tmp_path / "hero_1.yaml").write_text("robot: hero_1\n" + content)
    with pytest.raises(ProgramError, match=r"hero_1\.yaml: .*; "):
        stage.start("milling", calibration_folder=str(tmp_path))


@pytest.mark.parametrize("fence", ["1 2 3", "0 0 a 1", "1 0 0 1", "0 0 inf 1"])
def test_a_fence_that_is_none_is_refused(stage, fence):
    with pytest.raises(ProgramError, match="~fence is .* must be"):
        stage.start("milling", fence=fence)


def test_a_color_is_sent_when_it_changes_and_not_again(stage):
    stage.start("segregation")
    shown = []
    for robot in stage.swarm:
        robot.led = shown.append
    stage.run(1.0)
    assert shown == [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)] * 3


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
    stage.run(1.0)
    moved_m = np.hypot(*np.moveaxis(stage.places_m - before_m, -1, 0))[0]
    assert moved_m[1] == 0.0 and np.delete(moved_m, 1).min() > 0.02
