"""Poses from localize: which are given, and what is said of a robot whose pose is not known."""

import math
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest

pytest.importorskip("hero_msgs.msg", reason="needs ROS")
import rospy

from hero_client.ros import localized_poses
from hero_client.ros.localized_poses import TOPIC, PoseListener, PoseReport
from hero_client.values.errors import FrameError, StaleDataError
from hero_msgs.msg import RobotPose, RobotPoses
from hero_node import NodeError
from hero_node.ros import ask_master

SENT_S = 100.0
"""By the clock of localize; that of the program says 7 s when the message comes."""


def make_pose(robot_id, state=RobotPose.TRACKED, age_s=0.03, position_sd=0.001, x=1.0):
    stamp = rospy.Time.from_sec(SENT_S - age_s)
    return RobotPose(id=robot_id, state=state, stamp=stamp, x=x, y=2.0, yaw=0.5, position_sd=position_sd)


def receive(*robots):
    return PoseReport("map", SENT_S, 7.0, {robot.id: robot for robot in robots})


def test_poses_of_all_robots_come_from_one_message():
    poses = receive(make_pose(0), make_pose(3, RobotPose.LOST, x=4.0))
    assert poses.find(0, 7.1) == (1.0, 2.0, 0.5)
    assert poses.find(3, 7.1) == (4.0, 2.0, 0.5)  # covered for a moment: it follows its odometry


@pytest.mark.parametrize(
    ("robot", "text"),
    [
        (None, "hero_3 has no pose in the frame map: localize does not know it: name it in its ~robots"),
        (make_pose(3, RobotPose.UNKNOWN, x=math.nan), "hero_3 has no pose in the frame map: .* is its tag in view"),
        (make_pose(3, x=math.inf), "hero_3 has no pose in the frame map"),
    ],
)
def test_a_robot_that_was_never_measured_is_named_with_a_remedy(robot, text):
    with pytest.raises(FrameError, match=text):
        receive(make_pose(0), *([robot] if robot else [])).find(3, 7.1)


@pytest.mark.parametrize(
    ("robot", "now_s", "text"),
    [
        (make_pose(3), 8.2, "pose of hero_3 in the frame map is old: no message .* for 1.2 s: does localize still run"),
        (make_pose(3, age_s=0.8), 7.3, "pose of hero_3 in the frame map is 1.1 s old, .* is the robot on and in reach"),
        (make_pose(3, RobotPose.LOST, position_sd=0.07), 7.1, "hero_3 in the frame map is uncertain by 70 mm: .*tag"),
        (make_pose(3, position_sd=math.nan), 7.1, "hero_3 .* uncertain"),
    ],
)
def test_an_old_or_uncertain_pose_is_an_error_with_its_cause(robot, now_s, text):
    with pytest.raises(StaleDataError, match=text):
        receive(robot).find(3, now_s)


@pytest.mark.parametrize(
    ("robot", "now_s"),
    [(make_pose(3, age_s=0.0), 8.0), (make_pose(3, age_s=-1.0), 7.0), (make_pose(3, position_sd=0.05), 7.0)],
    ids=["a second old", "a second ahead", "5 cm"],
)
def test_a_pose_counts_up_to_its_limits(robot, now_s):
    assert receive(robot).find(3, now_s) == (1.0, 2.0, 0.5)


@pytest.mark.parametrize("ahead_s", [1.2, 3600.0])
def test_a_pose_that_is_stamped_ahead_is_no_pose(ahead_s):
    poses = receive(make_pose(0, age_s=-0.05), make_pose(3, age_s=-ahead_s))
    assert poses.find(0, 7.1) == (1.0, 2.0, 0.5)
    with pytest.raises(StaleDataError, match="hero_3 in the frame map is stamped .* s ahead: do the clocks"):
        poses.find(3, 7.1)


def test_the_age_of_a_pose_is_that_of_its_stamp_and_of_the_silence_since():
    poses = receive(make_pose(3, age_s=0.03))
    assert poses.age_s(3, 7.1) == pytest.approx(0.13)
    assert poses.age_s(0, 7.1) == math.inf


class Localize:
    """The program localize, or none; a clock that goes on while the program waits, and when messages come then."""

    def __init__(self, monkeypatch, published=(TOPIC,), error=None):
        self.now_s, self.later = 7.0, []
        answer = [["/rosout", "rosgraph_msgs/Log"], *([topic, RobotPoses._type] for topic in published)]
        ask = create_autospec(ask_master, return_value=answer, side_effect=error)
        monkeypatch.setattr(localized_poses, "ask_master", ask)
        monkeypatch.setattr(localized_poses.time, "monotonic", lambda: self.now_s)
        monkeypatch.setattr(localized_poses.time, "sleep", self.sleep)
        monkeypatch.setattr(rospy, "Subscriber", self.subscribe)
        monkeypatch.setattr(rospy, "is_shutdown", lambda: False)
        self.listener = PoseListener()

    def subscribe(self, topic, message_class, receive, queue_size, tcp_nodelay):
        assert (topic, message_class, queue_size, tcp_nodelay) == (TOPIC, RobotPoses, 1, True)
        self.receive = receive
        return SimpleNamespace(resolved_name=topic)

    def sleep(self, duration_s):
        self.now_s += duration_s
        if self.later and self.later[0][0] <= self.now_s:
            self.send(self.later.pop(0)[1])

    def send(self, *robots, frame="map"):
        message = RobotPoses(robots=list(robots))
        message.header.frame_id, message.header.stamp = frame, rospy.Time.from_sec(SENT_S)
        self.receive(message)


@pytest.mark.parametrize("error", [None, NodeError("no ROS master")])
def test_without_localize_there_is_no_pose_to_wait_for(monkeypatch, error):
    localize = Localize(monkeypatch, (), error)
    assert localize.listener.find(3, "map", 2.0) is None and localize.now_s == 7.0
    assert localize.listener.ids == set() and localize.listener.age_s(3) == math.inf


def test_poses_in_another_frame_are_none_of_this_one(monkeypatch):
    localize = Localize(monkeypatch)
    localize.send(make_pose(3), make_pose(8))
    assert localize.listener.find(3, "hall", 2.0) is None and localize.now_s == 7.0
    assert localize.listener.find(8, "map", 2.0) == (1.0, 2.0, 0.5) and localize.listener.ids == {3, 8}
    assert localize.listener.age_s(8) == pytest.approx(0.03)


def test_a_robot_that_was_never_measured_is_waited_for(monkeypatch):
    localize = Localize(monkeypatch)
    localize.later = [(7.5, make_pose(3, RobotPose.UNKNOWN)), (8.0, make_pose(3))]
    assert localize.listener.find(3, "map", 2.0) == (1.0, 2.0, 0.5)
    assert localize.now_s == pytest.approx(8.0, abs=0.03)
    with pytest.raises(FrameError, match="localize does not know it"):
        localize.listener.find(8, "map", 0.5)
    assert localize.now_s == pytest.approx(8.5, abs=0.05)


def test_a_first_message_is_waited_for_as_long_as_asked_for(monkeypatch):
    localize = Localize(monkeypatch)
    with pytest.raises(FrameError, match="no message on /localization/poses yet"):
        localize.listener.find(3, "map", 2.0)
    assert localize.now_s == pytest.approx(9.0, abs=0.03)
    with pytest.raises(FrameError):
        localize.listener.find(3, "map", 0.0)
    assert localize.now_s == pytest.approx(9.0, abs=0.03), "a loop that asks does not wait"
    monkeypatch.setattr(rospy, "is_shutdown", lambda: True)
    with pytest.raises(FrameError):
        localize.listener.find(3, "map", 2.0)
    assert localize.now_s == pytest.approx(9.0, abs=0.03), "nor does a program that ends"


def test_a_pose_that_is_old_is_an_error_at_once(monkeypatch):
    localize = Localize(monkeypatch)
    localize.send(make_pose(3))
    localize.now_s += 1.2
    with pytest.raises(StaleDataError, match="no message on"):
        localize.listener.find(3, "map", 2.0)
    assert localize.now_s == 8.2
