"""Poses of robots and objects from topics: what is known, how old it may be, and what is told of what is not."""

from types import SimpleNamespace
from unittest.mock import create_autospec

import numpy as np
import pytest

pytest.importorskip("rospy", reason="the topics are ROS's")
import rospy
from nav_msgs.msg import Odometry

from hero_client.ros.drivers import Drivers
from hero_client.ros.localized_poses import PoseListener
from hero_client.values import MODELS
from hero_msgs.msg import ObjectPose, ObjectPoses, Robot, RobotArray
from hero_node import Pose
from hero_swarm.ros import pose_source
from hero_swarm.ros.pose_source import ObjectSource, OtherRobots, PoseSource


@pytest.fixture(name="topics")
def catch_topics(monkeypatch):
    """Topics that are subscribed to, with what receives their messages; the time of ROS is 100 s."""
    topics = {}
    subscribe = create_autospec(
        rospy.Subscriber, side_effect=lambda topic, _, receive, **__: topics.update({topic: receive})
    )
    monkeypatch.setattr(rospy, "Subscriber", subscribe)
    monkeypatch.setattr(rospy, "get_time", lambda: 100.0)
    return topics


def tell_objects(frame, **places):
    report = ObjectPoses(objects=[ObjectPose(name=name, x=x, y=y, yaw=yaw) for name, (x, y, yaw) in places.items()])
    report.header.frame_id = frame
    return report


@pytest.mark.parametrize(("frame", "topic"), [("map", "/track/objects"), ("world", "/hero_sim/objects")])
def test_an_object_that_a_picture_does_not_show_is_where_it_was(topics, frame, topic):
    source = ObjectSource(frame, 0.07, are_needed=True)
    assert source.describe_missing() == f"no object on {topic} in the frame {frame}"
    assert source.read().poses.shape == (1, 0, 3) and ObjectSource(frame, 0.07, False).describe_missing() == ""
    source = ObjectSource(frame, 0.07, are_needed=True)
    receive = topics[topic]
    receive(tell_objects(frame, box_2=(1.0, 2.0, 0.5), box_1=(3.0, 4.0, -0.5)))
    receive(tell_objects("other", box_1=(9.0, 9.0, 9.0)))
    receive(tell_objects(frame, box_2=(1.1, 2.0, 0.5)))
    things = source.read()
    assert things.poses.tolist() == [[[3.0, 4.0, -0.5], [1.1, 2.0, 0.5]]], "in the order of their names"
    assert things.radii_m.tolist() == [0.07, 0.07] and source.describe_missing() == ""


def tell_truth(topics, number, age_s):
    message = Odometry()
    message.header.stamp = rospy.Time.from_sec(100.0 - age_s)
    message.pose.pose.position.x, message.pose.pose.orientation.w = float(number), 1.0
    topics["/hero_%d/ground_truth" % number](message)


def test_poses_are_known_while_they_are_at_most_half_a_second_old(topics):
    source = PoseSource([4, 1, 7, 8], "world")
    source.add_robots([2])
    for number, age_s in ((4, 0.5), (1, 0.625), (7, -0.375), (2, -0.5)):
        tell_truth(topics, number, age_s)
    poses, ages_s = source.read()
    assert np.isfinite(poses).all(axis=1).tolist() == [True, False, True, False, False]
    assert poses[[0, 2], 0].tolist() == [4.0, 7.0] and ages_s.tolist() == [0.5, np.inf, -0.375, np.inf, np.inf]
    assert source.describe_missing() == "the pose of hero_1 in the frame world is 0.6 s old (and 2 more robots)"
    tell_truth(topics, 1, 0.0)
    tell_truth(topics, 2, 0.0)
    source.read()
    assert source.describe_missing() == "hero_8 has no pose in the frame world: does the simulator run?"
    tell_truth(topics, 8, 0.0)
    source.read()
    assert source.describe_missing() == ""


def test_poses_of_localize_are_asked_for_without_waiting(topics, monkeypatch):
    listener = create_autospec(PoseListener, instance=True)
    listener.find.side_effect = lambda number, frame, timeout_s: Pose(1.0, 2.0, 3.0) if number == 5 else None
    listener.age_s.return_value = 0.25
    monkeypatch.setattr(pose_source, "share_poses", lambda: listener)
    source = PoseSource([5, 6], "map")
    poses, ages_s = source.read()
    assert poses[0].tolist() == [1.0, 2.0, 3.0] and ages_s.tolist() == [0.25, np.inf]
    assert listener.find.call_args_list[0] == ((5, "map"), {"timeout_s": 0.0})
    assert source.describe_missing() == "hero_6 has no pose in the frame map: does localize run?"
    assert topics == {}


def test_other_robots_are_looked_for_every_second_but_for_refused_ones(topics, monkeypatch):
    clock, drivers = [10.0], create_autospec(Drivers, instance=True)
    monkeypatch.setattr(pose_source, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    monkeypatch.setattr(pose_source, "share_drivers", lambda: drivers)
    drivers.find_model.side_effect = lambda namespace: {"/hero_3": "hero_plus"}.get(namespace, "unknown")

    def join(*ids, refused=()):
        drivers.read.return_value = RobotArray(
            robots=[Robot(id=one, state=Robot.REFUSED if one in refused else Robot.READY) for one in ids]
        )

    join(0, 1, 2, -1, 9, refused=(9,))
    others = OtherRobots([0, 1], "world")
    assert others.read().shape == (0, 3)
    assert others.describe_missing() == "not avoided, for want of a pose in the frame world: hero_2"
    tell_truth(topics, 2, 0.0)
    assert others.read().tolist() == [[2.0, 0.0, MODELS["hero"].body_radius_m]] and others.describe_missing() == ""
    join(0, 1, 3)
    clock[0] = 10.99
    assert others.read().shape == (1, 3) and drivers.read.call_count == 1
    clock[0] = 11.0
    others.read()
    tell_truth(topics, 3, 0.1)
    assert others.read()[:, 2].tolist() == [MODELS["hero"].body_radius_m, MODELS["hero_plus"].body_radius_m]
    drivers.read.return_value = None
    clock[0] = 12.0
    tell_truth(topics, 3, 0.7)
    assert others.read()[:, 0].tolist() == [2.0]
    assert others.describe_missing() == "", "no driver has it now"
    assert set(topics) == {"/hero_2/ground_truth", "/hero_3/ground_truth"}


def test_what_is_missing_is_told_after_three_seconds_and_then_every_five(topics, monkeypatch):
    clock, told = [50.0], []
    monkeypatch.setattr(pose_source, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    monkeypatch.setattr(rospy, "logwarn", told.append)
    source = PoseSource([], "world")
    for clock[0] in (52.9, 53.0, 57.9, 58.0, 62.9, 63.0):
        source.warn("at %g" % clock[0])
    assert told == ["at 53", "at 58", "at 63"]
