"""What localize publishes of many robots: one whose pose is not known hides no other, each reading comes once."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rospy", reason="outputs are ROS topics")
import rospy
from diagnostic_msgs.msg import DiagnosticStatus

from hero_localization.filter.pose_hypothesis import StampedPose
from hero_localization.filter.swarm_localizer import LocalizedRobot, RobotState
from hero_localization.nodes.outputs import Outputs
from hero_node import Pose, invert_pose, transform_pose, yaw_of

NOW = rospy.Time(50)


class Bench:
    """Outputs whose messages a test reads, by topic; all are listened to but those named."""

    def __init__(self, monkeypatch):
        self.sent, self.unheard = {}, set()
        monkeypatch.setattr(rospy, "Publisher", self.advertise)
        monkeypatch.setattr(rospy, "get_rostime", lambda: NOW)
        monkeypatch.setattr(rospy, "get_name", lambda: "/localization")
        self.outputs = Outputs("map")
        for robot_id in (2, 5, 9):
            self.outputs.add_robot(robot_id)

    def advertise(self, topic, message_class, queue_size):
        messages = self.sent[topic] = []

        def publish(message):
            assert type(message) is message_class
            messages.append(message)

        return SimpleNamespace(publish=publish, get_num_connections=lambda: int(topic not in self.unheard))

    def publish(self, *robots):
        for messages in self.sent.values():
            messages.clear()
        self.outputs.publish(robots)
        return [one.child_frame_id for message in self.sent["/tf"] for one in message.transforms]


@pytest.fixture(name="bench")
def make_bench(monkeypatch):
    return Bench(monkeypatch)


ORIGIN = Pose(0.1, 0.2, -0.3)


def make_robot(robot_id, stamp_s=40.0, **others):
    estimate = StampedPose(stamp_s, Pose(robot_id, 1.0, 0.5), np.diag((4e-6, 4e-6, 9e-6)))
    odometry = transform_pose(invert_pose(ORIGIN), estimate.pose)
    fields = {"state": RobotState.TRACKED, "estimate": estimate, "odometry": odometry, "problem": ""}
    return LocalizedRobot(robot_id, **{**fields, **others})


def test_robots_without_a_pose_hide_none_of_the_others(bench):
    unknown = make_robot(2, state=RobotState.UNKNOWN, estimate=None)
    assert bench.publish(unknown, make_robot(9)) == ["hero_9/odom"]
    (report,) = bench.sent["~poses"]
    assert (report.header.frame_id, report.header.stamp) == ("map", NOW)
    assert [robot.id for robot in report.robots] == [2, 9]
    first, last = report.robots
    assert first.state == RobotState.UNKNOWN and math.isnan(first.x) and math.isnan(first.position_sd)
    assert (last.x, last.y, last.yaw) == (9.0, 1.0, 0.5) and last.stamp == rospy.Time(40)
    assert (last.position_sd, last.yaw_sd) == pytest.approx((0.002, 0.003))


def test_each_reading_of_odometry_places_its_frame_once(bench):
    assert bench.publish(make_robot(2), make_robot(5)) == ["hero_2/odom", "hero_5/odom"]
    (transform, _) = bench.sent["/tf"][0].transforms
    assert (transform.header.frame_id, transform.header.stamp) == ("map", rospy.Time(40))
    place = transform.transform
    assert (place.translation.x, place.translation.y, yaw_of(place.rotation)) == pytest.approx(ORIGIN)
    assert (place.translation.z, place.rotation.x, place.rotation.y) == (0.0, 0.0, 0.0)
    assert bench.publish(make_robot(2), make_robot(5, 40.1)) == ["hero_5/odom"]
    assert len(bench.sent["~poses"]) == 1 and bench.sent["/hero_2/pose"] == []
    assert bench.publish(make_robot(2), make_robot(5, 40.1)) == [] and bench.sent["/tf"] == []
    assert bench.publish(make_robot(2, 39.0)) == ["hero_2/odom"], "time went back"


def test_frames_of_odometry_are_placed_for_those_who_listen(bench):
    bench.unheard = {"/tf"}
    assert bench.publish(make_robot(2)) == [] and len(bench.sent["/hero_2/pose"]) == 1
    bench.unheard = set()
    assert bench.publish(make_robot(2, 40.1)) == ["hero_2/odom"]


def test_poses_with_their_covariance_go_to_those_who_listen(bench):
    bench.unheard = {"/hero_2/pose"}
    bench.publish(make_robot(2), make_robot(5))
    assert bench.sent["/hero_2/pose"] == []
    (message,) = bench.sent["/hero_5/pose"]
    assert (message.pose.pose.position.x, yaw_of(message.pose.pose.orientation)) == pytest.approx((5.0, 0.5))
    assert message.pose.pose.position.z == message.pose.pose.orientation.x == message.pose.pose.orientation.y == 0.0
    covariance = np.array(message.pose.covariance).reshape(6, 6)
    assert np.diag(covariance) == pytest.approx([4e-6, 4e-6, 0.0, 0.0, 0.0, 9e-6])
    assert np.count_nonzero(covariance) == 3 and message.header.frame_id == "map"


def test_diagnostics_name_robots_tags_and_sources(bench):
    robots = [make_robot(2), make_robot(5, problem="its tag is upside down")]
    bench.outputs.publish_diagnostics(robots, [7], {"/track": "poses come late"})
    (message,) = bench.sent["/diagnostics"]
    told = {status.hardware_id: (status.level, status.message) for status in message.status}
    assert told["hero_7"] == (
        DiagnosticStatus.WARN,
        "its tag is seen, but no driver knows the robot: is it on, and is tag 7 its own?",
    )
    assert told["/track"] == (DiagnosticStatus.WARN, "poses come late")
    assert told["hero_2"] == (DiagnosticStatus.OK, "tracked")
    assert told["hero_5"] == (DiagnosticStatus.WARN, "its tag is upside down")
    assert {status.name for status in message.status} >= {"localization: hero_2", "localization: /track"}
