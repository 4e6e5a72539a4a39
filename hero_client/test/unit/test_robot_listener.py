"""What is received of a robot becomes a rate, a distance and the nearest obstacle."""

import io
import math
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32

from hero_client.ros import robot_listener
from hero_client.ros.robot_listener import NewestMessage, RateMeter, RobotTrack, follow
from hero_client.values.readings import front_first
from hero_node import Pose
from hero_node.files import ExtraTopic, FleetFile


def test_a_rate_is_the_count_divided_by_the_time():
    meter = RateMeter()
    assert meter.rate_hz(0.0) == 0.0
    for tick in range(1, 11):
        meter.total += 15
        rate_hz = meter.rate_hz(tick * 0.5)
    assert rate_hz == pytest.approx(30.0)


def test_a_robot_that_falls_silent_is_at_zero_within_a_few_seconds():
    meter = RateMeter()
    for tick in range(10):
        meter.total += 1
        meter.rate_hz(tick * 0.5)
    for tick in range(10, 20):
        rate_hz = meter.rate_hz(tick * 0.5)
    assert rate_hz == 0.0


def test_a_rate_is_that_of_the_last_three_seconds():
    meter = RateMeter()
    rates_hz = []
    for tick in range(41):
        meter.total += 0 if tick < 20 else 5
        rates_hz.append(meter.rate_hz(0.5 * tick))
    assert rates_hz[19] == 0.0 and rates_hz[20] == pytest.approx(5.0 / 3.0)
    assert rates_hz[25] == pytest.approx(10.0) == rates_hz[40]
    assert RateMeter().rate_hz(1.0) == 0.0 and not RobotTrack().proximity_seen


def test_turns_add_up_the_short_way():
    track = RobotTrack()
    for yaw_rad in (0.5, 0.8, 0.7, 3.0, -3.0):
        track.receive_pose(Pose(0.0, 0.0, yaw_rad))
    assert track.turned_rad == pytest.approx(0.3 + 0.1 + 2.3 + math.tau - 6.0)


def test_distances_add_up_from_the_first_pose_on():
    track = RobotTrack()
    for pose in (Pose(5.0, 5.0, 3.0), Pose(5.3, 5.4, 3.0), Pose(5.0, 5.0, -3.0)):
        track.receive_pose(pose)
    assert track.distance_m == pytest.approx(1.0)
    assert track.turned_rad == pytest.approx(math.tau - 6.0), "the short way round"


def test_a_pose_that_is_not_known_adds_no_distance():
    track = RobotTrack()
    for x_m, is_known in ((0.0, True), (1.0, True), (2.0, False), (5.0, True), (5.5, True)):
        track.receive_pose(Pose(x_m, 0.0, 0.0) if is_known else None)
        assert (track.pose is not None) == is_known
    assert track.distance_m == 1.5 and track.turned_rad == 0.0


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 1e306])
def test_a_listener_takes_no_implausible_pose(number, monkeypatch):
    silent = SimpleNamespace(count=1, take=lambda: None)
    monkeypatch.setattr(robot_listener, "NewestMessage", lambda topic, kind: SimpleNamespace(**vars(silent)))
    listener, odometry = robot_listener.RobotListener("/hero_0"), Odometry()
    odometry.pose.pose.position.x = number
    listener._odometry.take = lambda: odometry
    listener.read_newest()
    assert listener.track.pose is None


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_a_free_track_is_told_from_one_whose_sensors_are_not_calibrated(number):
    track = RobotTrack()
    track.receive_proximity([math.inf] * 7 + [number])
    assert track.is_free == (number == math.inf)
    track.receive_proximity([])
    assert not track.is_free


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_ranges_at_invalid_angles_are_not_seen(number):
    track = RobotTrack()
    for angle_min_rad, increment_rad, is_seen in ((0.0, 0.8, True), (number, 0.8, False), (0.0, number, False)):
        scan = SimpleNamespace(ranges=[0.1] * 8, angle_min=angle_min_rad, angle_increment=increment_rad)
        track.receive_proximity(front_first(scan))
        assert track.proximity_seen == is_seen == (track.nearest is not None)


def receive(newest, message, md5sum=None):
    """Let a message come on a subscription, as rospy passes it on undecoded."""
    data = io.BytesIO()
    message.serialize(data)
    came = rospy.AnyMsg().deserialize(data.getvalue())
    came._connection_header = {"md5sum": md5sum or message._md5sum}
    newest._keep(came)


@pytest.fixture(name="subscriber")
def make_subscriber(monkeypatch):
    made = create_autospec(rospy.Subscriber)
    made.return_value.get_num_connections.return_value = 1
    monkeypatch.setattr(robot_listener.rospy, "Subscriber", made)
    return made


def test_of_the_messages_that_came_the_newest_is_read_once(subscriber):
    newest = NewestMessage("/hero_3/battery", Float32)
    subscriber.assert_called_once_with("/hero_3/battery", rospy.AnyMsg, newest._keep, queue_size=10)
    assert newest.take() is None and newest.has_publisher
    for value in (1.0, 2.0, 3.0):
        receive(newest, Float32(value))
    receive(newest, Float32(9.0), "0" * 32)
    assert newest.count == 3 and newest.take() == Float32(3.0), "that of another layout is none"
    assert newest.take() is None and newest.count == 3
    newest._bytes = b"no"
    assert newest.take() is None and newest.take() is None
    newest.close()
    subscriber.return_value.unregister.assert_called_once_with()
    subscriber.return_value.get_num_connections.return_value = 0
    assert not newest.has_publisher


def test_a_listener_reads_odometry_proximity_and_what_the_fleet_declares(subscriber, monkeypatch):
    topics = [
        ExtraTopic("charge", "battery", "std_msgs/Float32", "data"),
        ExtraTopic("load", "cpu", "std_msgs/Float32", "data"),
    ]
    monkeypatch.setattr(robot_listener, "load_fleet_file", lambda: FleetFile(topics=tuple(topics)))
    listener = robot_listener.RobotListener("/hero_3")
    assert [call[0][0] for call in subscriber.call_args_list] == [
        "/hero_3/battery",
        "/hero_3/cpu",
        "/hero_3/odom",
        "/hero_3/proximity",
    ]
    odometry = Odometry()
    odometry.pose.pose.position.x, odometry.pose.pose.orientation.w = 1.0, 1.0
    odometry.twist.twist.linear.x, odometry.twist.twist.angular.z = 0.1, -0.2
    for _ in range(2):
        receive(listener._odometry, odometry)
    receive(listener._extras[topics[1]], Float32(0.5))
    receive(listener._proximity, LaserScan(ranges=[0.1] + [math.inf] * 7, angle_min=0.0, angle_increment=0.785))
    listener.read_newest()
    track = listener.track
    assert track.odometry.total == 2 and track.pose == (1.0, 0.0, 0.0) and track.velocity == pytest.approx((0.1, -0.2))
    assert listener.values == {"load": 0.5} and listener.ranges_m[0] == pytest.approx(0.1)
    assert track.proximity_seen and track.nearest.range_m == pytest.approx(0.1)
    receive(listener._extras[topics[0]], Float32(3.75))
    listener.read_newest()
    assert listener.values == {"load": 0.5, "charge": 3.75} and track.pose == (1.0, 0.0, 0.0), "known as before"
    listener.close()
    assert subscriber.return_value.unregister.call_count == 4


def test_what_is_wanted_is_opened_and_the_rest_closed_each_once():
    opened, closed = [], []

    def open_source(name):
        opened.append(name)
        return SimpleNamespace(close=lambda: closed.append(name))

    sources = {}
    for wanted in ({"b", "a"}, {"b", "a"}, {"b", "c"}, set()):
        follow(sources, wanted, open_source)
        assert set(sources) == wanted
    assert opened == ["a", "b", "c"] and closed[0] == "a" and sorted(closed) == ["a", "b", "c"]
