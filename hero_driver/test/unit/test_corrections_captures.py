"""The messages of a real robot, cleaned."""

import math
import struct
from collections import Counter

import pytest
from corrected_robot import make_corrections, make_handler
from robot_messages import NOW_NS, read_odometry, read_stamp_ns, read_transform

from hero_driver.corrections.robot_corrections import TRANSFORMS
from hero_driver.ros.message_types import apply_aliases
from hero_driver.rosserial.session import MessagesReceived, Session, SessionLimits, Topic
from hero_node import Pose
from hero_test.nonempty import nonempty

START_NS = 1795240942 * 10**9 + 831 * 10**6
"""When recording A was made; its server gave the robot this time."""


def clean(data, namespace, start_ns, **settings):
    """Clean what is in a recording, arrivals as the bytes came; return the corrections and (name, payload) pairs."""
    outputs = []
    corrections = make_corrections(namespace, outputs, **settings)
    session = Session(SessionLimits(), 0.0)
    for start in range(0, len(data), 1000):
        arrival_ns = start_ns + start * 10**9 // 44051
        for event in session.receive_bytes(data[start : start + 1000], 0.0, 0.0):
            if type(event) is Topic:
                info = event.info
                event.receive = make_handler(corrections, info.name, apply_aliases(info.message_type), outputs)
            elif isinstance(event, MessagesReceived):
                for topic, payload in event.messages:
                    if topic.info.name.endswith("/set_odom"):
                        corrections.odometry.set_pose(Pose(1.0, 2.0, 0.5))
                    topic.receive(payload, arrival_ns)
    return corrections, outputs


def test_nothing_of_a_recording_is_lost_or_doubled(read_capture):
    corrections, outputs = clean(read_capture("A.robot_to_server.bin"), "/hero_0", START_NS)
    assert Counter(name for name, _ in outputs) == {
        "/hero_0/odom": 436,
        "/hero_0/odom_raw": 436,
        "/hero_0/encoder": 436,
        TRANSFORMS: 2180,
        "/hero_0/laser": 68,
        "/hero_0/proximity": 68,
        "/hero_0/set_odom": 1,
    }
    assert (corrections.refused, corrections.transforms.foreign_frames) == (0, set())
    children = Counter(read_transform(payload)[2] for name, payload in outputs if name == TRANSFORMS)
    assert set(children.values()) == {436}
    assert len(children) == 5


def test_every_stamp_of_a_recording_grows(read_capture):
    _, outputs = clean(read_capture("A.robot_to_server.bin"), "/hero_0", START_NS)
    last_ns = {}
    for name, payload in nonempty(outputs):
        if name in ("/hero_0/odom", "/hero_0/encoder", "/hero_0/proximity", TRANSFORMS):
            key = name if name != TRANSFORMS else read_transform(payload)[2]
            stamp_ns = read_stamp_ns(payload)
            assert stamp_ns > last_ns.get(key, START_NS - 10**9)
            last_ns[key] = stamp_ns
    assert len(last_ns) == 8


def test_recorded_ticks_give_the_distance_that_robot_odometry_lost(read_capture):
    _, outputs = clean(read_capture("A.robot_to_server.bin"), "/hero_0", START_NS)
    x_m, y_m, yaw_rad = read_odometry([payload for name, payload in outputs if name == "/hero_0/odom"][-1])[2:5]
    # The counters ended at 415 and 421 ticks after set_odom(1, 2, 0.5): nearly one arc.
    tick_m = math.pi * 0.0492 / 288.0
    turn_rad, distance_m = 6.0 * tick_m / 0.063, 418.0 * tick_m
    assert yaw_rad == pytest.approx(0.5 + turn_rad, abs=1e-9)
    assert x_m == pytest.approx(1.0 + distance_m * math.cos(0.5 + turn_rad / 2.0), abs=0.003)
    assert y_m == pytest.approx(2.0 + distance_m * math.sin(0.5 + turn_rad / 2.0), abs=0.003)
    raw = read_odometry([payload for name, payload in outputs if name == "/hero_0/odom_raw"][-1])
    assert math.hypot(raw[2] - 1.0, raw[3] - 2.0) < 0.75 * distance_m


def test_recorded_odometry_and_transforms_agree_in_stamp_and_pose(read_capture):
    _, outputs = clean(read_capture("A.robot_to_server.bin"), "/hero_0", START_NS)
    odometry = {
        read_stamp_ns(payload): read_odometry(payload)[2:5] for name, payload in outputs if name == "/hero_0/odom"
    }
    transforms = [read_transform(payload) for name, payload in outputs if name == TRANSFORMS]
    poses = {stamp_ns: pose for stamp_ns, _, child, *pose in transforms if child == "hero_0/base_link"}
    assert len(odometry) == 436
    assert {stamp_ns: pytest.approx(pose) for stamp_ns, pose in poses.items()} == {
        stamp_ns: list(pose) for stamp_ns, pose in odometry.items()
    }


def test_a_robot_with_the_imu_hat_gets_imu_messages_with_growing_stamps(read_capture):
    _, outputs = clean(read_capture("E_imu_hat.robot_to_server.bin"), "/hero_12", NOW_NS)
    imu = [payload for name, payload in outputs if name == "/hero_12/imu"]
    assert len(imu) == 63
    assert [struct.unpack_from("<I", payload)[0] for payload in imu] == list(range(63))
    stamps_ns = [read_stamp_ns(payload) for payload in imu]
    assert stamps_ns == sorted(set(stamps_ns))
