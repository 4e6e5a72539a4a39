"""What declarations become while the ROS master is slow, and the robot leaves, returns or changes its mind."""

import struct
from types import SimpleNamespace
from unittest.mock import call, create_autospec

import pytest

from hero_driver.config import read_config
from hero_driver.fleet.namespaces import identify
from hero_driver.ros.endpoints import Endpoints
from hero_driver.ros.log_relay import LogRelay
from hero_driver.ros.raw_publisher import RawPublisher, TransformPublisher
from hero_driver.ros.robot_bridge import RobotBridge
from hero_driver.ros.robot_commands import Owner, RobotCommands
from hero_driver.ros.services import RobotService
from hero_driver.rosserial.payloads import TopicInfo
from hero_driver.rosserial.session import Topic, TopicKind
from hero_driver.transport.call_queue import Worker
from hero_driver.transport.event_loop import EventLoop
from hero_node.ros_messages import MD5SUMS

LIGHT = "/hero_7/led"
COLOR_MD5 = "a29a96539573343b1310c73607334b00"
VELOCITY = "/hero_7/velocity_controller/cmd_vel"
ALIAS = "/hero_7/cmd_vel"
TWIST = "geometry_msgs/Twist"
SERVICE = "/hero_7/set_odom"


class Bench:
    """A bridge whose jobs for the ROS master, and whose calls on the loop, a test runs."""

    def __init__(self, **parameters):
        self.jobs, self.soon, self.is_full = [], [], False
        loop = create_autospec(EventLoop, instance=True)
        loop.call_soon.side_effect = self.soon.append
        registrar = create_autospec(Worker, instance=True)
        registrar.submit.side_effect = self.submit
        owner, log = create_autospec(Owner, instance=True), create_autospec(LogRelay, instance=True)
        transforms, config = TransformPublisher(loop.call_later), read_config(parameters)
        identity = identify(LIGHT)
        self.bridge = RobotBridge(identity, owner, loop, log, transforms, registrar, config, config, 4)
        self.endpoints = create_autospec(Endpoints, instance=True)
        self.bridge.endpoints = self.endpoints
        self.connect()

    def submit(self, job, always=False):
        if not self.is_full or always:
            self.jobs.append(job)
        return not self.is_full

    def connect(self):
        self.bridge.attach(SimpleNamespace(wheels=None))

    def declare(self, name=LIGHT, message_type="std_msgs/ColorRGBA", md5=COLOR_MD5, **others):
        kind, number = others.get("kind", TopicKind.SUBSCRIBER), others.get("number", 100)
        topic = Topic(TopicInfo(number, name, message_type, md5, 512), kind)
        self.bridge.declare(topic, name)
        return topic

    def run_jobs(self):
        """Let the ROS master answer."""
        jobs, self.jobs[:] = self.jobs[:], []
        for job in jobs:
            job()

    def settle(self):
        """Let the ROS master answer, and the loop take its answers."""
        self.run_jobs()
        calls, self.soon[:] = self.soon[:], []
        for one in calls:
            one()


@pytest.fixture(name="bench")
def make_bench():
    return Bench()


def test_what_waits_for_the_master_is_dropped_when_the_robot_leaves(bench):
    bench.declare()
    bench.bridge.detach("silent")
    assert bench.bridge.ids == {}
    bench.settle()
    assert not bench.endpoints.subscribe.called
    bench.connect()
    bench.declare(number=101)
    bench.declare(VELOCITY, TWIST, MD5SUMS[TWIST], number=102)
    bench.settle()
    assert [one.args[0] for one in bench.endpoints.subscribe.call_args_list] == [LIGHT, VELOCITY, ALIAS]
    assert bench.bridge.ids == {LIGHT: 101, VELOCITY: 102}


def test_an_answer_of_the_master_does_not_count_for_the_next_connection(bench):
    bench.endpoints.subscribe.return_value = False
    bench.declare()
    bench.run_jobs()
    bench.bridge.detach("silent")
    bench.connect()
    bench.endpoints.subscribe.return_value = True
    bench.declare(number=105)
    bench.settle()
    assert bench.bridge.ids == {LIGHT: 105}, "the refusal was of the connection before"


def test_a_topic_declared_anew_takes_nothing_before_the_master_knows(bench):
    bench.declare()
    assert bench.bridge.ids == {LIGHT: 100}, "at once, for the first time"
    bench.settle()
    bench.declare(message_type="std_msgs/Float32", md5="73fcbf46b49191e672908e50842a83d4", number=101)
    assert bench.bridge.ids == {}, "programs still send what was declared before"
    bench.settle()
    assert bench.bridge.ids == {LIGHT: 101}
    bench.endpoints.subscribe.return_value = False
    bench.declare(number=102)
    bench.settle()
    assert bench.bridge.ids == {}, "it cannot be used"


def test_of_two_declarations_in_a_row_the_later_one_settles(bench):
    bench.declare()
    bench.run_jobs()
    bench.endpoints.subscribe.return_value = False
    bench.declare(message_type="std_msgs/Float32", md5="73fcbf46b49191e672908e50842a83d4", number=101)
    bench.settle()
    assert bench.bridge.ids == {}
    bench.endpoints.subscribe.return_value = True
    bench.declare(number=102)
    bench.run_jobs()
    bench.declare(message_type="std_msgs/Float32", md5="73fcbf46b49191e672908e50842a83d4", number=103)
    (settle_first,) = bench.soon
    settle_first()
    assert bench.bridge.ids == {}, "the ROS master has not heard of the later one"


def test_the_alias_of_velocities_goes_where_the_topic_is_something_else(bench):
    bench.declare()
    bench.settle()
    assert not bench.endpoints.unsubscribe.called
    bench.declare(VELOCITY, "std_msgs/ColorRGBA", COLOR_MD5)
    bench.settle()
    assert [one.args[0] for one in bench.endpoints.subscribe.call_args_list] == [LIGHT, VELOCITY]
    bench.endpoints.unsubscribe.assert_called_once_with(ALIAS)


def test_a_robot_that_takes_the_alias_itself_gets_it_as_its_own(bench):
    for number, name in ((101, ALIAS), (102, VELOCITY)):
        bench.declare(name, TWIST, MD5SUMS[TWIST], number=number)
        bench.settle()
    assert [one.args[0] for one in bench.endpoints.subscribe.call_args_list] == [ALIAS, VELOCITY]
    assert not bench.endpoints.unsubscribe.called and bench.bridge.ids == {ALIAS: 101, VELOCITY: 102}


def test_names_are_limited_and_those_that_are_known_stay(bench):
    for number in range(4):
        bench.declare("/hero_7/color_%d" % number, number=number)
    bench.declare("/hero_7/color_4", number=4)
    bench.declare("/hero_7/color_3", number=30)
    assert bench.bridge.ids == {**{"/hero_7/color_%d" % number: number for number in range(3)}, "/hero_7/color_3": 30}
    ((key, text),) = [one.args for one in bench.endpoints.report_error.call_args_list]
    assert key == "names" and "color_4 refused: more than 4 names" in text


def test_a_master_that_takes_no_more_topics_is_told_of(bench):
    bench.is_full = True
    bench.declare()
    ((key, text),) = [one.args for one in bench.endpoints.report_error.call_args_list]
    assert key == "registrar" and "too many topics wait for the ROS master" in text
    bench.bridge.close()
    assert len(bench.jobs) == 1, "what is registered goes all the same"


def test_a_topic_sent_with_another_layout_gets_a_publisher_of_its_own(bench):
    for md5 in (COLOR_MD5, COLOR_MD5, "0" * 32):
        bench.declare("/hero_7/color", md5=md5, kind=TopicKind.PUBLISHER)
    bench.run_jobs()
    made = [one.args for one in bench.endpoints.advertise.call_args_list]
    (first,), (again,), (other,) = [[publisher for _, _, publisher in publishers] for _, _, publishers, _ in made]
    assert first is again and other is not first
    assert [replaced for *_, replaced in made] == [[], [], [first]]


def test_every_service_that_is_called_fails_when_the_robot_leaves(bench):
    services = [create_autospec(RobotService, instance=True) for _ in range(2)]
    bench.bridge._services = dict(zip(("/hero_7/set_odom", "/hero_7/set_pid"), services))
    bench.bridge.detach("closed by the robot")
    assert [service.fail.call_args for service in services] == [call("closed by the robot")] * 2


def declare_service(bench, *types):
    for kind, message_type in zip((TopicKind.SERVICE_REQUESTS, TopicKind.SERVICE_ANSWERS), types):
        bench.declare(SERVICE, message_type, "0" * 32, kind=kind)


def test_a_service_whose_halves_differ_in_type_is_refused(bench):
    declare_service(bench, "hero_msgs/SetOdom", "hero_msgs/SetPID")
    bench.settle()
    assert not bench.endpoints.serve.called and bench.bridge.ids == {}
    ((key, text),) = [one.args for one in bench.endpoints.report_error.call_args_list]
    assert key == SERVICE and text.endswith("its halves are hero_msgs/SetOdom and hero_msgs/SetPID")


def test_a_request_goes_only_to_the_service_that_the_robot_has_now(bench):
    bench.bridge.commands = create_autospec(RobotCommands, instance=True)
    bench.bridge.commands.offer_request.return_value = None
    declare_service(bench, "hero_msgs/SetOdom", "hero_msgs/SetOdom")
    first = bench.bridge._services[SERVICE]
    assert bench.bridge.send_request(first, b"pose") is None
    bench.bridge.commands.offer_request.assert_called_once_with(SERVICE, "hero_msgs/SetOdom", b"pose")
    bench.bridge.detach("silent")
    assert bench.bridge.send_request(first, b"pose") == "the robot is not connected"
    bench.connect()
    declare_service(bench, "hero_msgs/SetPID", "hero_msgs/SetPID")
    bench.settle()
    assert bench.bridge.send_request(first, b"pose") == "the robot declared it with another type"
    assert bench.bridge.commands.offer_request.call_count == 1


@pytest.mark.parametrize(("answer", "is_set"), [(b"\x01", True), (b"\x00", False), (b"", False)])
def test_odometry_is_set_by_the_answer_of_a_robot_that_agrees(bench, answer, is_set):
    declare_service(bench, "hero_msgs/SetOdom", "hero_msgs/SetOdom")
    service, poses = bench.bridge._services[SERVICE], []
    bench.bridge.corrections.odometry.set_pose = poses.append
    bench.bridge._receive_answer(service, answer)
    assert poses == [], "none was asked for"
    service._request = struct.pack("<3d", 1.0, 2.0, 0.5)
    bench.bridge._receive_answer(service, answer)
    assert poses == ([(1.0, 2.0, 0.5)] if is_set else [])


def test_transforms_of_another_type_and_unknown_layouts_are_refused(bench):
    for name, message_type, md5, words in (
        ("/tf", "std_msgs/ColorRGBA", COLOR_MD5, "topic /tf refused: its type is std_msgs/ColorRGBA"),
        ("/hero_7/encoder", "hero_msgs/Encoder", "0" * 32, "loses distance: flash firmware with that message"),
        ("/hero_7/imu", "sensor_msgs/Imu", "0" * 32, "its sensor_msgs/Imu has md5 000"),
    ):
        bench.endpoints.report_error.reset_mock()
        topic = bench.declare(name, message_type, md5, kind=TopicKind.PUBLISHER)
        told = " ".join(one.args[1] for one in bench.endpoints.report_error.call_args_list)
        assert words.partition(": flash")[0] in told, told
        topic.receive(b"goes nowhere", 0)
        bench.jobs.clear()


def test_half_a_service_of_the_connection_before_makes_none(bench):
    bench.declare(SERVICE, "hero_msgs/SetOdom", "0" * 32, kind=TopicKind.SERVICE_REQUESTS)
    bench.bridge.detach("silent")
    bench.connect()
    bench.declare(SERVICE, "hero_msgs/SetOdom", "0" * 32, kind=TopicKind.SERVICE_ANSWERS)
    bench.settle()
    assert not bench.endpoints.serve.called


def test_a_robot_that_left_takes_down_its_endpoints_once(bench):
    bench.declare("/hero_7/color", kind=TopicKind.PUBLISHER)
    publisher = bench.bridge._publishers["/hero_7/color"] = create_autospec(RawPublisher, instance=True)
    release = [lambda: None]
    publisher.release.return_value = release
    bench.jobs.clear()
    for _ in range(2):
        bench.bridge.close()
    bench.endpoints.end.assert_called_once_with()
    bench.run_jobs()
    bench.endpoints.close.assert_called_once_with(release, [publisher])
