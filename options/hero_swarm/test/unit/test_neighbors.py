"""What the program virtual_sensors tells robots of each other, and what a Robot makes of it."""

import math

import numpy as np
import pytest

pytest.importorskip("rospy", reason="messages and the program need ROS")
import rospy

from hero_client import Robot, StaleDataError
from hero_client.ros.ros_link import MESSAGE_CLASSES, RosLink
from hero_client.values import Neighbors, sense_neighbors
from hero_sim.stepped import StepSwarm
from hero_swarm.ros.virtual_sensors_node import describe_neighbors
from hero_test.nonempty import nonempty

IDS = (7, 3, 5)
POSES = np.array([(0.0, 0.0, math.pi / 2), (0.0, 0.4, 0.0), (0.3, 0.0, -1.5)])
AGES_S = np.array([0.01, 0.2, 0.05])


def make(poses=POSES, ids=IDS, **limits):
    """Return the message of each robot."""
    near = sense_neighbors(poses[None], Neighbors(**limits))
    return [describe_neighbors(near, row, ids, poses, AGES_S) for row in range(len(ids))]


@pytest.fixture(autouse=True)
def fixture_ros_time(monkeypatch):
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(12))


class Received:
    """The newest messages of a robot's topics."""

    def __init__(self, message):
        self.message = message

    def subscribe(self, topic):
        assert topic == "neighbors"
        assert isinstance(self.message, MESSAGE_CLASSES[topic])

    def age_s(self, topic):
        return 0.1

    def read(self, topic):
        return self.message


def make_robot(message):
    link = RosLink.__new__(RosLink)  # without a ROS node
    link._name, link._namespace, received = "hero_7", "/hero_7", Received(message)
    link.subscribe, link.age_s, link.read = received.subscribe, received.age_s, received.read
    robot = Robot.__new__(Robot)
    robot.robot_id, robot.name, robot.namespace, robot._link = 7, "hero_7", "/hero_7", link
    return robot


def test_neighbors_come_nearest_first_with_range_bearing_heading_and_age():
    message = make()[0]
    assert message.is_known and message.header.frame_id == "hero_7/base_link"
    assert message.header.stamp.to_sec() == 12.0
    found = [(near.id, near.range, near.bearing, near.heading, near.age) for near in message.neighbors]
    assert [near[0] for near in found] == [5, 3]
    assert found[0][1:] == pytest.approx((0.3, -math.pi / 2, -1.5 - math.pi / 2, 0.05))
    assert found[1][1:] == pytest.approx((0.4, 0.0, -math.pi / 2, 0.2))
    assert [near.id for near in make(range_m=0.35)[0].neighbors] == [5]


def test_a_robot_whose_pose_is_old_senses_nothing_is_told_and_not_sensed():
    poses = POSES.copy()
    poses[2] = np.nan
    first, second, blind = make(poses)
    assert not blind.is_known and not blind.neighbors
    assert first.is_known and [near.id for near in first.neighbors] == [3]
    assert [near.id for near in second.neighbors] == [7]
    with pytest.raises(StaleDataError, match="senses no neighbors, as its own pose is not known"):
        make_robot(blind).neighbors  # noqa: B018 (a property)


def test_robot_neighbors_over_ros_and_in_process_are_the_same():
    swarm = StepSwarm(3, seed=2, first_id=4)
    swarm.sleep(0.5)
    poses = swarm.rows.world.poses
    message = make(poses, (4, 5, 6))[1]
    over_ros = make_robot(message).neighbors
    in_process = swarm[5].neighbors
    assert [near.robot_id for near in over_ros] == [near.robot_id for near in in_process]
    assert sorted(near.robot_id for near in in_process) == [4, 6]
    assert np.array(over_ros) == pytest.approx(np.array(in_process), abs=1e-6)


def test_robots_in_process_sense_none_of_another_world():
    swarm = StepSwarm(2, seed=2, worlds=2)
    swarm.sleep(0.5)
    for world in nonempty(swarm.worlds):
        ranges_m = math.dist(world[0].true_pose[:2], world[1].true_pose[:2])
        assert [tuple(near)[:2] for near in world[0].neighbors] == [(1, pytest.approx(ranges_m))]
