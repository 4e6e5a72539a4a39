"""What a published pose says of its uncertainty, and which transforms are sent."""

from unittest.mock import Mock, create_autospec

import numpy as np
import pytest
import rospy

from hero_localization.filter.pose_hypothesis import StampedPose
from hero_localization.filter.swarm_localizer import LocalizedRobot, RobotState
from hero_localization.nodes.outputs import Outputs, describe_robot
from hero_node import Pose


def test_the_published_deviations_are_those_of_one_axis_and_of_yaw():
    covariance = np.diag([4e-6, 16e-6, 9e-4])
    pose = Pose(0.1, 0.2, 0.3)
    message = describe_robot(LocalizedRobot(3, RobotState.TRACKED, StampedPose(1.0, pose, covariance), pose, ""))
    assert message.position_sd == pytest.approx(10e-6**0.5)
    assert message.yaw_sd == pytest.approx(0.03)


def test_a_robot_without_new_odometry_keeps_no_other_from_tf(monkeypatch):
    publishers = {}

    def advertise(topic, kind, queue_size):
        publishers[topic] = Mock(**{"get_num_connections.return_value": int(topic == "/tf")})
        return publishers[topic]

    monkeypatch.setattr(rospy, "Publisher", create_autospec(rospy.Publisher, side_effect=advertise))
    monkeypatch.setattr(rospy, "get_rostime", lambda: rospy.Time(9))
    outputs, pose = Outputs("map"), Pose(0.1, 0.2, 0.3)
    for robot_id in (3, 10):
        outputs.add_robot(robot_id)
    for stamps_s in ((1.0, 1.0), (1.0, 2.0)):
        estimates = [StampedPose(stamp_s, pose, np.eye(3), "/track") for stamp_s in stamps_s]
        states = zip((3, 10), estimates)
        outputs.publish([LocalizedRobot(number, RobotState.TRACKED, found, pose, "") for number, found in states])
    sent = [[one.child_frame_id for one in call[0][0].transforms] for call in publishers["/tf"].publish.call_args_list]
    assert sent == [["hero_3/odom", "hero_10/odom"], ["hero_10/odom"]]
