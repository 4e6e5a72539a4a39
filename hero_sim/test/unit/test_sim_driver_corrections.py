"""A whole conversation of a simulated robot, in the hands of the driver's session and corrections."""

import math
import struct
from collections import Counter

import pytest
from driver_side import RECEIVED, SENT, DriverSide, read_odom

from hero_driver.corrections.correction_settings import CorrectionSettings
from hero_driver.corrections.robot_corrections import TRANSFORMS, RobotCorrections
from hero_driver.rosserial import packets
from hero_driver.rosserial.session import MessagesReceived, Session, SessionLimits, Topic

NAME = "/hero_7"
START_NS = 1_700_000_000 * 10**9
SEGMENT_LENGTH = 1460


class RecordedRobot(DriverSide):
    """One robot that streams, and what it has sent.

    Attributes:
        sent: the time (ms) and the bytes of each write.
    """

    def __init__(self, *arguments):
        self.sent = []
        super().__init__("--first-id", "7", "--arena", "empty", *arguments)

    def _collect(self, index):
        data = b"".join(self.swarm.robots[index].outbox)
        self.sent += [(self.swarm.now_ms, data)] if data else []
        super()._collect(index)

    def count(self, topic_id):
        return len(self.list_packets(0, topic_id))


class Listener:
    """What the driver makes of the bytes of a robot.

    Attributes:
        session: the driver's side of the connection.
        topics: what was declared.
        messages: (topic, payload) as received.
        outputs: (topic, payload) as published; transforms as TRANSFORMS.
    """

    def __init__(self, sent):
        self.topics, self.messages, self.outputs, self.requests = [], [], [], 0
        self.session = Session(SessionLimits(), 0.0)
        add_transform = Sink(TRANSFORMS, self.outputs).publish
        self._corrections = RobotCorrections(NAME, CorrectionSettings(), add_transform)
        for now_ms, data in sent:
            for start in range(0, len(data), SEGMENT_LENGTH):
                self._receive(now_ms, data[start : start + SEGMENT_LENGTH])

    def _receive(self, now_ms, data):
        for event in self.session.receive_bytes(data, now_ms / 1000.0, START_NS / 1e9 + now_ms / 1000.0):
            if isinstance(event, Topic):
                self.topics.append(event.info.name)
                kind = event.info.message_type.replace("hero_common/", "hero_msgs/").replace("tf/tf", "tf2_msgs/TF")
                outputs = self._corrections.list_outputs(event.info.name, kind)
                sinks = [Sink(name, self.outputs) for name, _ in outputs]
                event.receive = self._corrections.handler_for(event.info.name, kind, sinks)
            elif isinstance(event, MessagesReceived):
                self.messages += [(topic.info.name, payload) for topic, payload in event.messages]
                for topic, payload in event.messages:
                    topic.receive(payload, START_NS + now_ms * 10**6)
        self.session.poll(now_ms / 1000.0)
        self.requests += self.session.take_packets().count(packets.encode_packet(packets.ID_PUBLISHER, b""))

    def list(self, name):
        return [payload for topic, payload in self.outputs if topic == f"{NAME}/{name}"]


class Sink:
    is_wanted = True

    def __init__(self, name, outputs):
        self._name, self._outputs = name, outputs

    def publish(self, payload):
        self._outputs.append((self._name, payload))


@pytest.fixture(scope="module")
def robot():
    """Return a robot that has driven an arc of about 0.2 m."""
    robot = RecordedRobot()
    robot.start_streaming()
    robot.began = robot.true_pose(0)
    robot.drive(0, 0.1, 0.5, 2000)
    return robot


def read_stamp_ns(payload):
    seconds, nanoseconds = struct.unpack_from("<II", payload, 4)
    return seconds * 10**9 + nanoseconds


def read_pose(payload):
    _, _, (x_m, y_m, qz, qw), _ = read_odom(payload)
    return x_m, y_m, 2.0 * math.atan2(qz, qw)


def test_the_session_gets_every_topic_and_message_of_a_robot(robot):
    heard = Listener(robot.sent)
    assert len(heard.topics) == len(SENT) + len(RECEIVED)
    counts = Counter(topic for topic, _ in heard.messages)
    cycles = robot.count(130)
    assert cycles > 50
    assert counts[f"{NAME}/odom"] == counts[f"{NAME}/encoder"] == counts["/tf"] / 5 == cycles
    assert counts[f"{NAME}/laser"] == robot.count(125) > 8
    assert (heard.session.undeclared_messages, heard.session.reader.bad_packets) == (0, 0)


def test_corrections_of_a_conversation_lose_and_double_nothing(robot):
    counts = Counter(name for name, _ in Listener(robot.sent).outputs)
    cycles, scans = robot.count(130), robot.count(125)
    expected = {"odom": cycles, "odom_raw": cycles, "encoder": cycles, "laser": scans, "proximity": scans}
    assert counts == {**{f"{NAME}/{name}": count for name, count in expected.items()}, TRANSFORMS: 5 * cycles}


def test_stamps_of_each_topic_of_a_conversation_grow(robot):
    heard = Listener(robot.sent)
    for name in ("odom", "encoder", "proximity"):
        stamps_ns = [read_stamp_ns(payload) for payload in heard.list(name)]
        assert stamps_ns == sorted(set(stamps_ns)) and len(stamps_ns) > 8


def test_ticks_give_the_distance_that_the_robots_own_odometry_loses(robot):
    heard = Listener(robot.sent)
    driven_m = measure_distance(robot.began, robot.true_pose(0))
    assert driven_m > 0.12
    first, last = (read_pose(heard.list("odom")[index]) for index in (0, -1))
    assert measure_distance(first, last) == pytest.approx(driven_m, rel=0.05)
    assert last[2] - first[2] == pytest.approx(robot.true_pose(0)[2] - robot.began[2], rel=0.1)
    raw = [read_pose(payload) for payload in heard.list("odom_raw")]
    assert measure_distance(raw[0], raw[-1]) < 0.75 * driven_m


def measure_distance(start, end):
    return math.hypot(end[0] - start[0], end[1] - start[1])


def test_a_robot_with_the_imu_hat_brings_imu_messages_with_its_cycles():
    robot = RecordedRobot("--imu")
    robot.start_streaming()
    heard = Listener(robot.sent)
    assert len(heard.list("imu")) == len(heard.list("odom")) == robot.count(130) > 10
    stamps_ns = [read_stamp_ns(payload) for payload in heard.list("imu")]
    assert stamps_ns == sorted(set(stamps_ns))


def test_a_robot_that_declares_nothing_is_asked_again_for_its_topics():
    robot = RecordedRobot()
    robot.swarm.robots[0].zero_topics_next = True
    robot.start_streaming()
    heard = Listener(robot.sent)
    assert heard.topics == []
    streamed = [arrival for arrival in robot.arrivals[0] if arrival.topic_id in (125, 128, 129, 130)]
    assert heard.session.undeclared_messages == len(streamed) > 50
    assert heard.requests >= 2
