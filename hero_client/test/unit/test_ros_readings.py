"""What comes over ROS's topics: how long it is waited for, and what its numbers mean."""

import math
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest

pytest.importorskip("rospy", reason="topics are rospy's")
import rospy
from geometry_msgs.msg import Point, PoseWithCovariance, Quaternion, Twist, TwistWithCovariance, Vector3
from geometry_msgs.msg import Pose as RosPose
from sensor_msgs.msg import LaserScan
from std_msgs.msg import ColorRGBA

from hero_client.ros import frames, localized_poses, robot_topics, ros_link
from hero_client.ros.drivers import Drivers
from hero_client.ros.frames import find_origin
from hero_client.ros.localized_poses import PoseListener
from hero_client.ros.robot_topics import CommandTopic, NewestMessages
from hero_client.ros.ros_link import RosLink, ThreadMotion
from hero_client.values.background_motion import FullWait
from hero_client.values.errors import FrameError, GoalError, RobotError, StaleDataError
from hero_msgs.msg import Neighbor, RobotPose, RobotPoses
from hero_node import Pose
from hero_node.files import FleetFile


class Time:
    """A clock that sleeps move."""

    now_s = 100.0

    def sleep(self, duration_s):
        self.now_s += duration_s

    def monotonic(self):
        return self.now_s


@pytest.fixture(name="time")
def make_time(monkeypatch):
    time = Time()
    for module in (frames, localized_poses, robot_topics):
        monkeypatch.setattr(module, "time", time)
    for module in (frames, localized_poses, robot_topics, ros_link):
        monkeypatch.setattr(module.rospy, "is_shutdown", lambda: False)
    return time


def test_messages_age_and_the_next_ones_are_counted(monkeypatch, time):
    subscribed = []

    def subscribe(name, message_class, receive, topic, queue_size, tcp_nodelay):
        assert (queue_size, tcp_nodelay, topic) == (1, True, "odom"), "only the newest counts, and at once"
        subscribed.append(name)
        return SimpleNamespace(unregister=lambda: subscribed.append("left"))

    monkeypatch.setattr(robot_topics.rospy, "Subscriber", subscribe)
    messages = NewestMessages("/hero_0", {"odom": object})
    for _ in range(2):
        messages.subscribe("odom")
    assert subscribed == ["/hero_0/odom"] and messages.age_s("odom") == math.inf
    messages._receive_message("first", "odom")
    time.now_s += 0.4
    assert messages.age_s("odom") == pytest.approx(0.4) and messages.read("odom") == "first"
    assert messages.find_silent(("odom", "proximity"), 0.5) is None and messages.find_silent(("odom",), 0.3) == "odom"
    with pytest.raises(StaleDataError, match=r"no message on /hero_0/odom within 0.0 s"):
        messages.wait_for_next("odom", 0.0)
    wait_for = messages._arrival.wait_for

    def receive_meanwhile(is_there, timeout_s):
        for text in ("second", "third")[: round(timeout_s)]:
            messages._newest["odom"] = (time.now_s, text)
            messages._counts["odom"] += 1
        return wait_for(is_there, 0.0)

    messages._arrival.wait_for = receive_meanwhile
    with pytest.raises(StaleDataError):
        messages.wait_for_next("odom", 1.0, count=2)
    messages.wait_for_next("odom", 2.0, count=2)
    assert messages.read("odom") == "third"
    for _ in range(2):
        messages.close()
    assert subscribed == ["/hero_0/odom", "left"]


def test_a_light_waits_for_the_driver_at_the_start_only(monkeypatch, time):
    publisher = SimpleNamespace(get_num_connections=lambda: int(time.now_s > 101.0), publish=lambda message: None)
    monkeypatch.setattr(robot_topics.rospy, "Publisher", lambda *arguments, **options: publisher)
    CommandTopic("/hero_0/led", object, str).wait_until_connected()
    assert 101.0 < time.now_s < 101.1
    time.now_s, publisher.get_num_connections = 200.0, lambda: 0
    topic = CommandTopic("/hero_0/led", object, str)
    for _ in range(2):
        topic.wait_until_connected()
    assert time.now_s == pytest.approx(203.0, abs=0.03)


def test_a_transform_is_waited_for_until_its_time_is_out(time, monkeypatch):
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(50))
    found = SimpleNamespace(
        translation=SimpleNamespace(x=1.0, y=2.0), rotation=SimpleNamespace(x=0.0, y=0.0, z=1.0, w=0.0)
    )
    asked = []

    def look_up(target, source, stamp):
        asked.append((target, source))
        if time.now_s < 101.0:
            raise frames.tf2_ros.LookupException("not there.")
        return SimpleNamespace(transform=found, header=SimpleNamespace(stamp=stamped))

    stamped = rospy.Time(50.9)
    monkeypatch.setattr(frames, "listen", lambda: SimpleNamespace(lookup_transform=look_up))
    with pytest.raises(FrameError, match=r"no transform from hero_0/odom to map \(not there\): start"):
        find_origin("hero_0/odom", "map", 0.0)
    assert len(asked) == 1 and time.now_s == 100.0
    with pytest.raises(FrameError):
        find_origin("hero_0/odom", "map", 0.5)
    assert time.now_s == pytest.approx(100.5, abs=0.021)
    assert find_origin("hero_0/odom", "map", 2.0) == pytest.approx((1.0, 2.0, math.pi))
    assert asked[0] == ("map", "hero_0/odom")
    stamped = rospy.Time(51)
    assert find_origin("hero_0/odom", "map", 2.0) == pytest.approx((1.0, 2.0, math.pi)), "1 s ahead"
    stamped = rospy.Time(3650)
    with pytest.raises(StaleDataError, match="from map to hero_0/odom is stamped 3600.0 s ahead"):
        find_origin("hero_0/odom", "map", 2.0)


def test_a_pose_of_localize_is_waited_for_if_localize_runs(time):
    listener = PoseListener.__new__(PoseListener)
    listener._report, listener._is_expected = None, False
    assert listener.age_s(0) == math.inf
    assert listener.find(0, "map", 2.0) is None and time.now_s == 100.0
    listener._is_expected = True
    with pytest.raises(FrameError, match="hero_0 .* no message on /localization/poses yet, does localize run"):
        listener.find(0, "map", 0.5)
    assert time.now_s == pytest.approx(100.5, abs=0.021)
    robot = RobotPose(id=3, state=RobotPose.TRACKED, stamp=rospy.Time(49.97), x=1.0, y=2.0, yaw=0.5)
    message = RobotPoses(robots=[robot])
    message.header.frame_id, message.header.stamp = "map", rospy.Time(50.0)
    listener._receive(message)
    assert listener.find(3, "map", 0.0) == (1.0, 2.0, 0.5) and listener.age_s(3) == pytest.approx(0.03)
    assert listener.find(0, "world", 2.0) is None and time.now_s < 100.6
    with pytest.raises(FrameError, match="localize does not know it"):
        listener.find(0, "map", 0.0)


def test_infrared_counts_begin_at_the_front_without_averages():
    link = RosLink.__new__(RosLink)
    # Rear first, counter-clockwise, each reading followed by the average with the next one.
    counts = [100.0 * (index // 2) + index % 2 for index in range(16)]
    link.read = {"laser": LaserScan(intensities=counts)}.get
    assert link.read_infrared_counts() == [400.0, 500.0, 600.0, 700.0, 0.0, 100.0, 200.0, 300.0]


def test_why_a_robot_cannot_be_driven_is_told_in_order():
    link = RosLink.__new__(RosLink)
    link._namespace, link._name, link._robot_id, state = "/hero_3", "hero_3", 3, {}
    link._cmd_vel = SimpleNamespace(connected=False, describe_absence=lambda: "nothing subscribes")
    link.find_silent = lambda topics, limit_s: "odom" if limit_s < state["age_s"] else None
    link._drivers = SimpleNamespace(knows=lambda namespace: state["known"], find=lambda namespace: "/lab/driver")
    state.update(age_s=2.0, known=False)
    assert link.missing() == "nothing subscribes"
    link._cmd_vel.connected = True
    assert link.missing() == "no message on /hero_3/odom: is the robot on and in reach?"
    state["age_s"] = 0.9
    assert link.missing().startswith("no driver has reported it yet")
    state["known"] = True
    assert link.missing() is None
    assert "the driver lab/driver has stopped all robots" in link.describe_stop()
    assert "rosservice call /lab/driver/stop false" in link.describe_stop()


@pytest.fixture(name="linked")
def make_linked(monkeypatch):
    """Give the link of robot 7, and what its topics and its driver are."""
    ros = SimpleNamespace(commands={}, subscribed={}, drivers=create_autospec(Drivers, instance=True))

    def make_topic(name, message_class, explain_absence):
        ros.commands[name] = message_class, create_autospec(CommandTopic, instance=True, connected=True)
        assert explain_absence() is ros.drivers.explain_absence.return_value
        return ros.commands[name][1]

    def subscribe(name, message_class, receive, topic, queue_size, tcp_nodelay):
        ros.subscribed[name] = lambda message: receive(message_class(**message), topic)

    monkeypatch.setattr(ros_link, "CommandTopic", make_topic)
    monkeypatch.setattr(robot_topics.rospy, "Subscriber", subscribe)
    monkeypatch.setattr(ros_link, "share_drivers", lambda: ros.drivers)
    monkeypatch.setattr(ros_link, "load_fleet_file", FleetFile)
    return RosLink(7), ros


def test_a_robot_is_reached_by_its_own_topics_and_its_own_driver(linked):
    link, ros = linked
    velocity, led = "/hero_7/velocity_controller/cmd_vel", "/hero_7/led"
    assert {name: kind for name, (kind, _) in ros.commands.items()} == {velocity: Twist, led: ColorRGBA}
    ros.drivers.explain_absence.assert_called_with("/hero_7")
    link.send_color((1.0, 0.5, 0.0))
    (_, topic) = ros.commands[led]
    assert [call[0] for call in topic.method_calls] == ["wait_until_connected", "publish"]
    topic.publish.assert_called_once_with(ColorRGBA(1.0, 0.5, 0.0, 1.0))
    link.send_velocity(0.0, -0.5)
    ros.commands[velocity][1].publish.assert_called_once_with(Twist(angular=Vector3(z=-0.5)), is_stop=False)
    for name, radius_m in (("hero_plus", 0.060), ("hero", 0.036835), ("another", 0.036835)):
        ros.drivers.find_model.return_value = name
        assert link.model.body_radius_m == radius_m
    ros.drivers.find_model.assert_called_with("/hero_7")
    assert link.is_stopped is ros.drivers.is_robot_stopped.return_value
    ros.drivers.is_robot_stopped.assert_called_once_with("/hero_7")


def test_what_a_robot_sends_is_read_from_the_topic_of_its_name(linked):
    link, ros = linked
    for topic in ("odom", "distance", "neighbors"):
        link.subscribe(topic)
    assert sorted(ros.subscribed) == ["/hero_7/distance", "/hero_7/neighbors", "/hero_7/odom"]
    place = PoseWithCovariance(pose=RosPose(Point(1.0, 2.0, 0.0), Quaternion(0.0, 0.0, 1.0, 0.0)))
    twist = TwistWithCovariance(twist=Twist(Vector3(0.1, 0.2, 0.0), Vector3(0.0, 0.3, 0.4)))
    ros.subscribed["/hero_7/odom"]({"pose": place, "twist": twist})
    assert link.read_pose() == pytest.approx((1.0, 2.0, math.pi)) and link.read_velocity() == (0.1, 0.4)
    ros.subscribed["/hero_7/distance"]({"data": 0.25})
    assert link.read_distance() == 0.25
    found = [Neighbor(id=3, range=0.5, bearing=-1.0, heading=2.0)]
    ros.subscribed["/hero_7/neighbors"]({"is_known": True, "neighbors": found})
    assert link.read_neighbors() == [(3, 0.5, -1.0, 2.0)]
    ros.subscribed["/hero_7/neighbors"]({"is_known": False})
    with pytest.raises(StaleDataError, match="hero_7 senses no neighbors, as its own pose is not known"):
        link.read_neighbors()


def test_only_a_stop_is_sent_without_a_warning():
    link, sent = RosLink.__new__(RosLink), []
    link._cmd_vel = SimpleNamespace(
        publish=lambda twist, is_stop: sent.append((is_stop, twist.linear.x, twist.angular.z)),
    )
    for velocity in ((0.1, 0.0), (0.0, -0.5), (0.0, 0.0)):
        link.send_velocity(*velocity)
    assert sent == [(False, 0.1, 0.0), (False, 0.0, -0.5), (True, 0.0, 0.0)]


def test_odometry_is_set_or_why_it_is_not_is_told(monkeypatch):
    link, asked = RosLink.__new__(RosLink), []
    link._namespace = "/hero_3"
    answer = SimpleNamespace(success=True, message="")
    monkeypatch.setattr(ros_link.rospy, "wait_for_service", lambda name, timeout_s: asked.append((name, timeout_s)))
    monkeypatch.setattr(ros_link.rospy, "ServiceProxy", lambda name, kind: lambda *pose: asked.append(pose) or answer)
    link.set_odometry(Pose(1.0, 2.0, 3.0))
    assert asked == [("/hero_3/set_odom", ros_link.SERVICE_TIMEOUT_S), (1.0, 2.0, 3.0)]
    answer.success, answer.message = False, "busy"
    with pytest.raises(RobotError, match="/hero_3/set_odom: the robot answers: busy"):
        link.set_odometry(Pose(1.0, 2.0, 3.0))
    refuse = create_autospec(rospy.wait_for_service, side_effect=rospy.ROSException("timeout exceeded"))
    monkeypatch.setattr(rospy, "wait_for_service", refuse)
    with pytest.raises(RobotError, match="/hero_3/set_odom: timeout exceeded"):
        link.set_odometry(Pose(1.0, 2.0, 3.0))


def test_a_motion_on_a_thread_ends_with_its_steps_its_error_or_cancel(monkeypatch):
    monkeypatch.setattr(ros_link.rospy, "is_shutdown", lambda: False)

    def take(sent, error=None):
        while (yield 0.0 if error else 60.0):
            if error:
                raise error
        sent.append("stop")
        yield FullWait(0.0)
        sent.append("sent")

    for error in (GoalError("no"), ValueError("wrong"), TypeError("kind"), rospy.ROSException("closed topic")):
        motion = ThreadMotion(take([], error))
        with pytest.raises(type(error)):
            motion.result(60.0)
        assert not motion.cancel()
    sent = []
    motion = ThreadMotion(take(sent))
    assert not motion.done()
    motion.cancel_and_wait()
    assert motion.done() and sent == ["stop", "sent"] and not motion.cancel()
