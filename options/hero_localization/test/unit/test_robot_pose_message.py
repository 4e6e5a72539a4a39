"""What a published pose says of its uncertainty."""

import numpy as np
import pytest
import rospy

from hero_localization.nodes.outputs import make_robot_pose
from hero_node import Pose


def test_the_published_deviations_are_those_of_one_axis_and_of_yaw():
    covariance = np.diag([4e-6, 16e-6, 9e-4])
    message = make_robot_pose(3, 0, rospy.Time(1, 0), Pose(0.1, 0.2, 0.3), covariance)
    assert message.position_sd == pytest.approx(10e-6**0.5)
    assert message.yaw_sd == pytest.approx(0.03)
