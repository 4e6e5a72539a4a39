"""A robot's messages as ROS programs get them: true stamps, proximity, the rest untouched."""

import struct

import pytest
from corrected_robot import TYPES, CorrectedRobot, list_payloads, list_topics, list_transforms
from robot_messages import (
    MS,
    NOW_NS,
    NS_PER_S,
    build_encoder,
    build_imu,
    build_laser,
    build_odometry,
    build_transform,
    build_transform_message,
    read_scan,
    read_seq,
    read_stamp_ns,
)

from hero_driver.corrections.robot_corrections import OFFSET_MAX_S, OFFSET_SAMPLES
from hero_node import Pose

UPTIME_NS = 2 * NS_PER_S


# Stamps.


def test_messages_with_stamps_since_boot_get_the_time_of_their_arrival():
    robot = CorrectedRobot()
    outputs = robot.receive_burst(UPTIME_NS, (0.0, 0.0), arrival_ns=NOW_NS)
    for name in ("/hero_0/odom", "/hero_0/encoder"):
        assert read_stamp_ns(list_payloads(outputs, name)[0]) == NOW_NS
    assert {stamp_ns for stamp_ns, *_ in list_transforms(outputs)} == {NOW_NS}
    assert robot.corrections.stamps.corrected >= 7


def test_odometry_and_its_transform_share_one_stamp_from_boot_on():
    robot = CorrectedRobot()
    for number in range(10):
        arrival_ns = NOW_NS + number * 34 * MS
        stamp_ns = UPTIME_NS + number * 34 * MS if number < 4 else arrival_ns - 3 * MS
        outputs = robot.receive_burst(stamp_ns, (number, number), arrival_ns)
        stamps_ns = {read_stamp_ns(list_payloads(outputs, "/hero_0/odom")[0])}
        stamps_ns |= {stamp_ns for stamp_ns, _, child, *_ in list_transforms(outputs) if child == "hero_0/base_link"}
        assert stamps_ns == {arrival_ns if number < 4 else stamp_ns}


def test_the_clock_offset_is_the_median_of_stamp_minus_arrival():
    robot = CorrectedRobot()
    assert robot.corrections.clock_offset_s == 0.0
    for ahead_ms in (20, 30, -1000):
        robot.receive("/hero_0/odom", build_odometry(NOW_NS + ahead_ms * MS), NOW_NS)
    assert robot.corrections.clock_offset_s == pytest.approx(0.02)
    for number in range(OFFSET_SAMPLES):
        robot.receive("/hero_0/odom", build_odometry(NOW_NS - (number % 7 + number // 7) * MS), NOW_NS)
    late_ms = sorted(number % 7 + number // 7 for number in range(OFFSET_SAMPLES))
    assert robot.corrections.clock_offset_s == pytest.approx(-1e-3 * late_ms[(OFFSET_SAMPLES - 1) // 2])


@pytest.mark.parametrize("stamp_ns, offset_s", [(0, -OFFSET_MAX_S), (0xFFFFFFFF * NS_PER_S, OFFSET_MAX_S)])
def test_a_clock_that_is_absurdly_off_is_shown_as_far_off(stamp_ns, offset_s):
    robot = CorrectedRobot()
    robot.receive("/hero_0/odom", build_odometry(stamp_ns), NOW_NS)
    assert robot.corrections.clock_offset_s == offset_s


# The other topics.


def test_the_stock_scan_passes_untouched_and_proximity_is_made_of_it():
    robot = CorrectedRobot()
    for number in range(3):
        stamp_ns = NOW_NS + number * 205 * MS
        laser = build_laser(stamp_ns, [0.1] * 16, [50.0] * 16)
        outputs = robot.receive("/hero_0/laser", laser, stamp_ns)
        assert outputs[0] == ("/hero_0/laser", laser)
        ((name, proximity),) = outputs[1:]
        assert name == "/hero_0/proximity"
        assert (read_seq(proximity), read_stamp_ns(proximity)) == (number, stamp_ns)
        assert len(read_scan(proximity)[2]) == 8
    assert list_topics(robot.corrections, "/hero_0/laser", "sensor_msgs/LaserScan") == {
        "/hero_0/laser": "sensor_msgs/LaserScan", "/hero_0/proximity": "sensor_msgs/LaserScan"
    }  # fmt: skip


def test_a_scan_that_is_not_the_stock_one_passes_and_gives_no_proximity():
    robot = CorrectedRobot()
    laser = build_laser(NOW_NS, [0.1] * 360, [])
    assert robot.receive("/hero_0/laser", laser, NOW_NS) == [("/hero_0/laser", laser)]
    assert robot.corrections.refused == 1


def test_proximity_is_not_made_without_subscribers():
    robot = CorrectedRobot(is_wanted=lambda name: name != "/hero_0/proximity")
    laser = build_laser(NOW_NS, [0.1] * 16, [50.0] * 16)
    assert robot.receive("/hero_0/laser", laser, NOW_NS) == [("/hero_0/laser", laser)]


def test_imu_messages_get_stamps_and_numbers_and_keep_their_data():
    robot = CorrectedRobot()
    for number in range(3):
        payload = build_imu(UPTIME_NS)
        ((_, stamped),) = robot.receive("/hero_0/imu", payload, NOW_NS + number * MS)
        assert (read_seq(stamped), read_stamp_ns(stamped)) == (number, NOW_NS + number * MS)
        assert stamped[12:] == payload[12:]


def test_topics_that_nothing_is_known_of_pass_untouched():
    robot = CorrectedRobot({"/hero_0/battery": "std_msgs/Float32"})
    assert robot.receive("/hero_0/battery", b"\x00\x00\x80\x3f", NOW_NS) == [("/hero_0/battery", b"\x00\x00\x80\x3f")]
    topics = list_topics(robot.corrections, "/hero_0/battery", "std_msgs/Float32")
    assert topics == {"/hero_0/battery": "std_msgs/Float32"}


@pytest.mark.parametrize("name", sorted(set(TYPES) - {"/tf"}))
def test_a_known_name_with_another_type_passes_untouched(name):
    robot = CorrectedRobot({name: "std_msgs/String"})
    assert robot.receive(name, b"\x00\x00\x00\x00", NOW_NS) == [(name, b"\x00\x00\x00\x00")]
    assert list_topics(robot.corrections, name, "std_msgs/String") == {name: "std_msgs/String"}
    assert robot.corrections.refused == 0


@pytest.mark.parametrize(
    "name, payload",
    [
        ("/hero_0/odom", build_odometry(NOW_NS)),
        ("/hero_0/encoder", build_encoder(NOW_NS, 1.0, 1.0)),
        ("/hero_0/imu", build_imu(NOW_NS)),
    ],
)
def test_a_message_too_short_for_its_header_is_refused(name, payload):
    robot = CorrectedRobot()
    for length in range(16):
        assert robot.receive(name, payload[:length], NOW_NS) == []
    assert robot.corrections.refused == 16


def test_an_odometry_message_cut_short_is_refused_when_its_reading_comes():
    robot = CorrectedRobot()
    robot.receive("/hero_0/odom", build_odometry(NOW_NS)[:-1], NOW_NS)
    robot.receive("/hero_0/encoder", build_encoder(NOW_NS, 1.0, 1.0), NOW_NS)
    assert list_payloads(robot.outputs, "/hero_0/odom") == []
    assert robot.corrections.refused == 1


@pytest.mark.parametrize(("apart_ms", "belong"), [(10, True), (-10, True), (11, False), (-11, False)])
def test_odometry_and_a_reading_up_to_10_ms_apart_are_of_one_burst(apart_ms, belong):
    for encoder_ms, next_ms, waits in ((apart_ms, 34, belong), (0, apart_ms, not belong)):
        robot = CorrectedRobot()
        robot.receive("/hero_0/odom", build_odometry(NOW_NS), NOW_NS)
        robot.receive("/hero_0/encoder", build_encoder(NOW_NS + encoder_ms * MS, 0.0, 0.0), NOW_NS)
        robot.receive("/hero_0/odom", build_odometry(NOW_NS + next_ms * MS), NOW_NS + 34 * MS)
        assert len(list_payloads(robot.outputs, "/hero_0/odom")) == 2 - waits


@pytest.mark.parametrize("is_wanted", [True, False])
def test_a_distance_passes_and_is_a_range_where_one_is_wanted(is_wanted):
    name = "/hero_0/distance"
    robot = CorrectedRobot({name: "std_msgs/Float32"}, is_wanted=lambda topic: is_wanted)
    topics = list_topics(robot.corrections, name, "std_msgs/Float32")
    assert topics == {name: "std_msgs/Float32", "/hero_0/range": "sensor_msgs/Range"}
    for number in range(2):
        outputs = robot.receive(name, struct.pack("<f", 0.5), NOW_NS + number)
        assert outputs[0] == (name, struct.pack("<f", 0.5))
        ranges = [(topic, read_seq(payload), read_stamp_ns(payload)) for topic, payload in outputs[1:]]
        assert ranges == [("/hero_0/range", number, NOW_NS + number)] * is_wanted
        assert all(b"hero_0/hat_link" in payload for _, payload in outputs[1:])
    assert robot.receive(name, b"short", NOW_NS) == [(name, b"short")]
    assert robot.corrections.refused == is_wanted


def test_eight_messages_wait_for_a_reading_and_more_are_refused():
    robot = CorrectedRobot()
    robot.receive_burst(NOW_NS, (0.0, 0.0))
    stamp_ns = NOW_NS + 34 * MS
    robot.receive("/hero_0/odom", build_odometry(stamp_ns), stamp_ns)
    for number in range(10):
        transform = build_transform(stamp_ns + number, "hero_0/odom", "hero_0/base_link")
        assert robot.receive("/tf", build_transform_message(transform), stamp_ns) == []
        assert robot.corrections.refused == max(0, number - 6)
    outputs = robot.receive("/hero_0/encoder", build_encoder(stamp_ns, 0.0, 0.0), stamp_ns)
    assert len(list_transforms(outputs)) == 7


def test_counters_that_begin_anew_are_no_turn_of_a_wheel():
    robot = CorrectedRobot()
    for begin_anew in (
        robot.corrections.odometry.note_reboot,
        lambda: robot.corrections.odometry.set_pose(Pose(0.0, 0.0, 0.0)),
    ):
        robot.receive_burst(NOW_NS, (500.0, 500.0))
        robot.receive_burst(NOW_NS + 34 * MS, (500.0, 500.0))
        still = robot.corrections.odometry.wheels.still_readings
        begin_anew()
        for number in (2, 3):
            robot.receive_burst(NOW_NS + number * 34 * MS, (0.0, 0.0))
        assert robot.corrections.odometry.wheels.still_readings == still + 1 > 1
        begin_anew()
