"""Topics of stepped robots: read with ROS's own classes, they say what the robots know."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from hero_node import yaw_of
from hero_sim.stepped.swarm import StepSwarm
from hero_sim.stepped.topics import ARENA, MARKERS, OBJECTS, StepTopics

CLASSES = {message._type: message for message in (LaserScan, MarkerArray, Odometry, TFMessage, Twist, Float32)}


def drive(arena="maze", time_s=1.0, **options):
    """Return the swarm, its topics, and all messages, decoded, by topic."""
    messages = {}
    swarm = StepSwarm(2, seed=3, first_id=4, arena=arena, **options)
    topics = StepTopics(
        swarm.rows, [4, 5], lambda topic, kind, content, time_ns: messages.setdefault(topic, []).append((kind, content))
    )
    swarm[4].drive(0.1, 0.5)
    swarm[5].led("red")
    swarm.sleep(time_s)
    decoded = {
        topic: [CLASSES[kind]().deserialize(content) for kind, content in found] for topic, found in messages.items()
    }
    return swarm, topics, decoded


def test_odometry_and_ground_truth_are_those_of_the_robots():
    swarm, _, messages = drive()
    odom, truth = messages["/hero_4/odom"][-1], messages["/hero_4/ground_truth"][-1]
    assert (odom.header.frame_id, odom.child_frame_id) == ("hero_4/odom", "hero_4/base_link")
    assert odom.header.stamp.to_sec() == pytest.approx(1600000001.0, abs=0.05)
    assert (odom.pose.pose.position.x, yaw_of(odom.pose.pose.orientation)) == pytest.approx(
        (swarm[4].pose.x_m, swarm[4].pose.yaw_rad)
    )
    assert (odom.twist.twist.linear.x, odom.twist.twist.angular.z) == pytest.approx(swarm[4].velocity)
    assert truth.header.frame_id == "world"
    assert truth.pose.pose.position.x == pytest.approx(swarm[4].true_pose.x_m, abs=0.005)
    assert len(messages["/hero_5/odom"]) == len(messages["/hero_4/odom"]) == 29


def test_a_command_is_sent_when_it_changes():
    _, _, messages = drive()
    (command,) = messages["/hero_4/cmd_vel"]
    assert (command.linear.x, command.angular.z) == (0.1, 0.5)
    assert "/hero_5/cmd_vel" not in messages


@pytest.mark.slow
def test_distances_are_sent_for_robots_that_measure_them():
    swarm, topics, messages = drive(model=["hero_plus,robot=5"])
    assert "/hero_4/distance" not in topics.types
    assert len(messages["/hero_5/distance"]) == 21  # at 0, 50, ..., 1000 ms
    assert messages["/hero_5/distance"][-1].data == pytest.approx(swarm[5].distance)
    marker = messages[MARKERS][-1].markers
    assert sorted({round(found.scale.x, 4) for found in marker if found.type == Marker.CYLINDER}) == [0.0737, 0.12]


def test_ranges_are_in_the_order_of_the_topic_and_by_rep_117():
    swarm, _, messages = drive(time_s=0.3)
    scan = messages["/hero_4/proximity"][-1]
    shown = [0.0 if range_m == -math.inf else range_m for range_m in scan.ranges]
    assert np.roll(shown, 4) == pytest.approx(swarm[4].proximity, nan_ok=True)
    assert (scan.angle_min, scan.angle_increment) == pytest.approx((-math.pi, math.pi / 4.0))


def test_transforms_place_each_robot_where_it_truly_began():
    swarm, _, messages = drive()
    (static,) = messages["/tf_static"]
    by_child = {each.child_frame_id: each for each in static.transforms}
    place = by_child["hero_4/odom"]
    x_m, y_m, yaw_rad = swarm[4]._link._origin
    assert place.header.frame_id == "world"
    assert (place.transform.translation.x, place.transform.translation.y) == pytest.approx((x_m, y_m))
    assert yaw_of(place.transform.rotation) == pytest.approx(yaw_rad)
    assert by_child["hero_4/laser_link"].header.frame_id == "hero_4/base_link"
    assert [each.child_frame_id for each in messages["/tf"][-1].transforms] == ["hero_4/base_link", "hero_5/base_link"]


def test_robots_objects_and_arena_are_drawn():
    swarm, _, messages = drive(arena="discs")
    body = next(marker for marker in messages[MARKERS][-1].markers if (marker.ns, marker.id) == ("robots", 1))
    assert (body.type, body.color.r, body.color.g) == (Marker.CYLINDER, 1.0, 0.0)
    assert body.pose.position.y == pytest.approx(swarm[5].true_pose.y_m, abs=0.001)
    assert {marker.text for marker in messages[MARKERS][-1].markers if marker.ns == "names"} == {"hero_4", "hero_5"}
    assert len(messages[OBJECTS][-1].markers) == len(swarm.rows.world.arena.objects)
    assert len(messages[ARENA][0].markers) == len(swarm.rows.world.arena.segments_m)


def test_only_the_first_world_is_shown_and_nothing_after_close():
    swarm, topics, messages = drive(worlds=2, wifi="hotspot", model="hero_plus")
    assert len(messages[MARKERS][-1].markers) == 6
    received = []
    topics._pass_on = lambda *message: received.append(message)
    topics.close()
    swarm.sleep(0.2)
    assert received == []
