"""Ground truth in ROS: what is published when, of which robots and objects, and only where it is wanted."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rospy", reason="ground truth is for ROS")
import rospy
from driver_side import parse_options

from hero_node import Pose, yaw_of
from hero_sim.build import build_swarm
from hero_sim.ground_truth import GroundTruth
from hero_sim.scene import START_S

NOW = rospy.Time(77, 5)


class Stage:
    """A swarm whose ground truth is published to topics with or without subscribers."""

    def __init__(self, monkeypatch, *arguments, with_clock=False, with_tf=False):
        self.sent, self.connected, self.latched = {}, set(), set()
        monkeypatch.setattr(rospy, "Publisher", self.advertise)
        monkeypatch.setattr(rospy.Time, "now", lambda: NOW)
        options = parse_options("--port", "9", *arguments)
        self.swarm = build_swarm(options, ["127.0.0.1"] * options.count, lambda text: None)
        self.truth = GroundTruth(SimpleNamespace(swarm=self.swarm), with_clock, with_tf)

    def advertise(self, topic, message_class, queue_size, latch=False):
        messages = self.sent.setdefault(topic, [])
        if latch:
            self.latched.add(topic)

        def publish(message):
            assert type(message) is message_class
            messages.append(message)

        return SimpleNamespace(publish=publish, get_num_connections=lambda: int(topic in self.connected))

    def publish(self, *times_ms):
        for messages in self.sent.values():
            messages.clear()
        for time_ms in times_ms:
            self.swarm.after_step(time_ms)

    def count(self, topic):
        return len(self.sent[topic])


def test_true_poses_come_twenty_times_a_second_to_those_who_listen(monkeypatch):
    stage = Stage(monkeypatch, "--count", "3", "--first-id", "4")
    stage.connected = {"/hero_5/ground_truth", "/hero_6/ground_truth"}
    stage.publish(*range(1000, 1100, 10))
    assert [stage.count("/hero_%d/ground_truth" % number) for number in (4, 5, 6)] == [0, 2, 2]
    for row, number in ((1, 5), (2, 6)):
        message, pose = stage.sent["/hero_%d/ground_truth" % number][0], stage.swarm.robots[row].body.true_pose
        assert message.header.frame_id == "world" and message.child_frame_id == "hero_%d/base_link" % number
        assert (message.header.stamp.secs, message.header.stamp.nsecs) == (77, 5)
        place = message.pose.pose.position
        assert (place.x, place.y, yaw_of(message.pose.pose.orientation)) == pytest.approx(tuple(pose))


def test_the_clock_begins_at_its_start_and_goes_with_each_step(monkeypatch):
    stage = Stage(monkeypatch, with_clock=True)
    stage.connected = {"/hero_0/ground_truth"}
    stage.publish(990, 1000, 12345)
    assert [one.clock.to_nsec() - START_S * 10**9 for one in stage.sent["/clock"]] == [
        990 * 10**6,
        10**9,
        12345 * 10**6,
    ]
    (message,) = stage.sent["/hero_0/ground_truth"]
    assert message.header.stamp == rospy.Time(START_S + 1, 0), "stamps are of that clock"
    assert "/clock" not in Stage(monkeypatch).sent


def test_markers_are_drawn_ten_times_a_second_for_those_who_look(monkeypatch):
    stage = Stage(monkeypatch, "--count", "2")
    stage.publish(*range(0, 1000, 10))
    assert stage.count("~markers") == 0
    stage.connected = {"~markers"}
    stage.publish(*range(0, 1000, 10))
    assert stage.count("~markers") == 10
    names = {marker.text for marker in stage.sent["~markers"][0].markers if marker.ns == "names"}
    assert names == {"hero_0", "hero_1"}


def test_odometry_frames_are_placed_anew_when_the_odometry_was_set(monkeypatch):
    stage = Stage(monkeypatch, "--count", "2", with_tf=True)
    assert [one.child_frame_id for one in stage.sent["/tf_static"][0].transforms] == ["hero_0/odom", "hero_1/odom"]
    stage.publish(1000, 1050)
    assert stage.count("/tf_static") == 0, "nothing has changed"
    stage.swarm.robots[1].body.odom_origin = Pose(1.0, 2.0, 0.5)
    stage.publish(1010, 1100, 1150)
    (message,) = stage.sent["/tf_static"]
    place = message.transforms[1].transform
    assert (place.translation.x, place.translation.y, yaw_of(place.rotation)) == pytest.approx((1.0, 2.0, 0.5))
    assert "/tf_static" not in Stage(monkeypatch).sent, "of localization"


def test_objects_are_drawn_again_only_when_they_have_moved(monkeypatch):
    stage = Stage(monkeypatch, "--arena", "discs", "--count", "2")
    count = len(stage.swarm.world.object_poses[0])
    assert count > 1 and "~object_markers" in stage.latched and "~arena" in stage.latched
    stage.publish(1000, 1050)
    assert stage.count("~objects") == 2 and stage.count("~object_markers") == 0
    message = stage.sent["~objects"][0]
    assert [one.name for one in message.objects] == ["object_%d" % number for number in range(count)]
    assert message.header.frame_id == "world"
    moved = np.array(stage.swarm.world.object_poses)
    moved[0, 1, 0] += 0.1
    with monkeypatch.context() as moving:
        moving.setattr(type(stage.swarm.world), "object_poses", moved, raising=False)
        stage.publish(1100, 1150)
    assert stage.sent["~objects"][0].objects[1].x == pytest.approx(message.objects[1].x + 0.1)
    assert stage.count("~object_markers") == 1
    stage = Stage(monkeypatch)
    assert [one.markers for one in stage.sent["~object_markers"]] == [[]] and "~objects" not in stage.sent
