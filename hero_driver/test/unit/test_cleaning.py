"""A robot's messages as ROS programs get them: own frames only, true stamps, proximity, the rest untouched."""

import struct

import pytest
from cleaned_robot import TYPES, CleanedRobot, list_payloads, list_transforms
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

from hero_driver.cleaning import split_transforms

UPTIME_NS = 2 * NS_PER_S


def receive_transforms(robot, *pairs, stamp_ns=NOW_NS):
    message = build_transform_message(*(build_transform(stamp_ns, *pair) for pair in pairs))
    return robot.receive("/tf", message, NOW_NS)


def list_pairs(outputs):
    return [(parent, child) for _, parent, child, *_ in list_transforms(outputs)]


# Transforms.


@pytest.mark.parametrize("child", ["left_wheel_link", "right_wheel_link", "hat_link", "laser_link"])
def test_transforms_between_the_robots_own_frames_pass_as_they_are(child):
    robot = CleanedRobot()
    transform = build_transform(NOW_NS, "hero_0/base_link", "hero_0/" + child)
    for number in range(3):
        stamped = build_transform(NOW_NS + number * MS, "hero_0/base_link", "hero_0/" + child)
        assert robot.receive("/tf", build_transform_message(stamped), NOW_NS + number * MS) == [
            ("/tf", stamped)
        ]
    assert len(transform) == len(stamped)
    assert (robot.cleaner.refused, robot.cleaner.foreign_frames) == (0, set())


def test_a_transform_that_comes_twice_with_one_stamp_gets_a_later_one_the_second_time():
    robot = CleanedRobot()
    hat, laser = ("hero_0/base_link", "hero_0/hat_link"), ("hero_0/base_link", "hero_0/laser_link")
    receive_transforms(robot, hat, stamp_ns=NOW_NS - NS_PER_S)
    receive_transforms(robot, laser, stamp_ns=NOW_NS - NS_PER_S)
    outputs = [receive_transforms(robot, pair)[0] for pair in (hat, laser, laser, hat)]
    stamps_ns = [stamp_ns - NOW_NS for stamp_ns, *_ in list_transforms(outputs)]
    assert stamps_ns == [0, 0, 1000, 1000]
    assert list_pairs(outputs) == [hat, laser, laser, hat]


def test_a_stamp_that_passed_passes_for_nobody_elses_frames():
    robot = CleanedRobot()
    hat = ("hero_0/base_link", "hero_0/hat_link")
    for stamp_ns in (NOW_NS - MS, NOW_NS):
        assert list_pairs(receive_transforms(robot, hat, stamp_ns=stamp_ns)) == [hat]
        assert receive_transforms(robot, ("map", "hero_0/odom"), stamp_ns=stamp_ns) == []


def test_a_stamp_of_too_many_nanoseconds_comes_out_in_the_form_that_ros_takes():
    robot = CleanedRobot()
    pair = ("hero_0/base_link", "hero_0/hat_link")
    receive_transforms(robot, pair, stamp_ns=NOW_NS - NS_PER_S)
    odd = bytearray(build_transform_message(build_transform(NOW_NS, *pair)))
    secs, nsecs = struct.unpack_from("<II", odd, 8)
    struct.pack_into("<II", odd, 8, secs - 1, nsecs + NS_PER_S)
    assert robot.receive("/tf", bytes(odd), NOW_NS) == [("/tf", build_transform(NOW_NS, *pair))]


def test_several_transforms_in_one_message_come_out_one_by_one():
    pairs = [("hero_0/base_link", "hero_0/%s_link" % name) for name in ("left_wheel", "right_wheel", "hat")]
    robot = CleanedRobot()
    for _ in range(2):
        assert list_pairs(receive_transforms(robot, *pairs)) == pairs


@pytest.mark.parametrize(
    "pair",
    [
        ("hero_1/odom", "hero_1/base_link"),
        ("hero_0/odom", "hero_1/base_link"),
        ("hero_1/odom", "hero_0/base_link"),
        ("hero_01/odom", "hero_01/base_link"),
        ("hero_00/odom", "hero_0/base_link"),
        ("map", "hero_0/odom"),
        ("hero_0", "hero_0/odom"),
        ("/hero_0/odom", "/hero_0/base_link"),
        ("world", "map"),
        ("", ""),
        (b"hero_\xff/odom\n", "hero_0/base_link"),
    ],
)
def test_transforms_of_frames_that_are_not_the_robots_own_are_refused_counted_and_named(pair):
    robot = CleanedRobot()
    for _ in range(3):
        assert receive_transforms(robot, pair) == []
    assert robot.cleaner.refused == 3
    (name,) = robot.cleaner.foreign_frames
    assert name.isprintable()
    assert " -> " in name


def test_a_foreign_transform_does_not_take_its_neighbours_along():
    own = ("hero_0/base_link", "hero_0/hat_link")
    robot = CleanedRobot()
    for _ in range(2):
        outputs = receive_transforms(robot, own, ("map", "hero_0/odom"), own)
        assert list_pairs(outputs) == [own, own]
    assert robot.cleaner.refused == 2
    assert robot.cleaner.foreign_frames == {"'map' -> 'hero_0/odom'"}


def test_frames_that_a_robot_makes_up_do_not_fill_the_memory():
    robot = CleanedRobot()
    for number in range(1000):
        receive_transforms(robot, ("map", "x%d" % number), ("hero_0/base_link", "hero_0/x%d" % number))
    assert len(robot.cleaner.foreign_frames) <= 32
    assert len({child for _, child in list_pairs(robot.outputs)}) <= 32
    assert robot.cleaner.refused >= 1000


def test_a_broken_message_of_transforms_is_refused_whole():
    robot = CleanedRobot()
    receive_transforms(robot, ("hero_0/base_link", "hero_0/hat_link"))
    message = build_transform_message(build_transform(NOW_NS, "hero_0/base_link", "hero_0/hat_link"))
    for length in range(len(message)):
        assert robot.receive("/tf", message[:length], NOW_NS) == []
    assert robot.receive("/tf", message + b"\x00", NOW_NS) == []
    two = build_transform_message(*[build_transform(NOW_NS, "hero_0/base_link", "hero_0/hat_link")] * 2)
    assert robot.receive("/tf", b"\x01\x00\x00\x00" + two[4:], NOW_NS) == []
    assert robot.cleaner.refused == len(message) + 2


def test_transforms_of_devices_that_are_no_heros_pass_one_by_one_whatever_their_frames():
    transforms = [build_transform(NOW_NS, "map", "rover"), build_transform(UPTIME_NS, "rover", "camera")]
    message = build_transform_message(*transforms)
    assert split_transforms(message) == transforms
    assert split_transforms(message[:-1]) == []


# Stamps.


def test_messages_with_stamps_since_boot_get_the_time_of_their_arrival():
    robot = CleanedRobot()
    outputs = robot.receive_burst(UPTIME_NS, (0.0, 0.0), arrival_ns=NOW_NS)
    for name in ("/hero_0/odom", "/hero_0/encoder"):
        assert read_stamp_ns(list_payloads(outputs, name)[0]) == NOW_NS
    assert {stamp_ns for stamp_ns, *_ in list_transforms(outputs)} == {NOW_NS}
    assert robot.cleaner.corrected_stamps >= 7


def test_odometry_and_its_transform_have_one_stamp_before_and_after_the_robot_learns_the_time():
    robot = CleanedRobot()
    for number in range(10):
        arrival_ns = NOW_NS + number * 34 * MS
        stamp_ns = UPTIME_NS + number * 34 * MS if number < 4 else arrival_ns - 3 * MS
        outputs = robot.receive_burst(stamp_ns, (number, number), arrival_ns)
        stamps_ns = {read_stamp_ns(list_payloads(outputs, "/hero_0/odom")[0])}
        stamps_ns |= {
            stamp_ns for stamp_ns, _, child, *_ in list_transforms(outputs) if child == "hero_0/base_link"
        }
        assert stamps_ns == {arrival_ns if number < 4 else stamp_ns}


def test_the_time_of_arrival_is_taken_where_that_is_asked_for():
    robot = CleanedRobot(stamps="arrival")
    outputs = robot.receive_burst(NOW_NS - 20 * MS, (0.0, 0.0), arrival_ns=NOW_NS)
    assert read_stamp_ns(list_payloads(outputs, "/hero_0/odom")[0]) == NOW_NS
    assert {stamp_ns for stamp_ns, *_ in list_transforms(outputs)} == {NOW_NS}


def test_the_clock_offset_is_the_median_of_stamp_minus_arrival():
    robot = CleanedRobot()
    assert robot.cleaner.clock_offset_s == 0.0
    for ahead_ms in (20, 30, -1000):
        robot.receive("/hero_0/odom", build_odometry(NOW_NS + ahead_ms * MS), NOW_NS)
    assert robot.cleaner.clock_offset_s == pytest.approx(0.02)
    for _ in range(100):
        robot.receive("/hero_0/odom", build_odometry(NOW_NS - 5 * MS), NOW_NS)
    assert robot.cleaner.clock_offset_s == pytest.approx(-0.005)


# The other topics.


def test_the_stock_scan_passes_untouched_and_proximity_is_made_of_it():
    robot = CleanedRobot()
    for number in range(3):
        stamp_ns = NOW_NS + number * 205 * MS
        laser = build_laser(stamp_ns, [0.1] * 16, [50.0] * 16)
        outputs = robot.receive("/hero_0/laser", laser, stamp_ns)
        assert outputs[0] == ("/hero_0/laser", laser)
        ((name, proximity),) = outputs[1:]
        assert name == "/hero_0/proximity"
        assert (read_seq(proximity), read_stamp_ns(proximity)) == (number, stamp_ns)
        assert len(read_scan(proximity)[2]) == 8
    assert robot.cleaner.find_derived("/hero_0/laser", "sensor_msgs/LaserScan") == {
        "/hero_0/proximity": "sensor_msgs/LaserScan"
    }


def test_a_scan_that_is_not_the_stock_one_passes_and_gives_no_proximity():
    robot = CleanedRobot()
    laser = build_laser(NOW_NS, [0.1] * 360, [])
    assert robot.receive("/hero_0/laser", laser, NOW_NS) == [("/hero_0/laser", laser)]
    assert robot.cleaner.refused == 1


def test_proximity_is_not_made_when_nobody_wants_it():
    robot = CleanedRobot(is_wanted=lambda name: name != "/hero_0/proximity")
    laser = build_laser(NOW_NS, [0.1] * 16, [50.0] * 16)
    assert robot.receive("/hero_0/laser", laser, NOW_NS) == [("/hero_0/laser", laser)]


def test_imu_messages_get_stamps_and_numbers_and_keep_their_data():
    robot = CleanedRobot()
    for number in range(3):
        payload = build_imu(UPTIME_NS)
        ((_, stamped),) = robot.receive("/hero_0/imu", payload, NOW_NS + number * MS)
        assert (read_seq(stamped), read_stamp_ns(stamped)) == (number, NOW_NS + number * MS)
        assert stamped[12:] == payload[12:]


def test_topics_that_nothing_is_known_of_pass_untouched():
    robot = CleanedRobot({"/hero_0/battery": "std_msgs/Float32"})
    assert robot.receive("/hero_0/battery", b"\x00\x00\x80\x3f", NOW_NS) == [
        ("/hero_0/battery", b"\x00\x00\x80\x3f")
    ]
    assert robot.cleaner.find_derived("/hero_0/battery", "std_msgs/Float32") == {}


@pytest.mark.parametrize("name", TYPES)
def test_a_known_name_with_another_type_passes_untouched(name):
    robot = CleanedRobot({name: "std_msgs/String"})
    assert robot.receive(name, b"\x00\x00\x00\x00", NOW_NS) == [(name, b"\x00\x00\x00\x00")]
    assert robot.cleaner.find_derived(name, "std_msgs/String") == {}
    assert robot.cleaner.refused == 0


@pytest.mark.parametrize(
    "name, payload",
    [
        ("/hero_0/odom", build_odometry(NOW_NS)),
        ("/hero_0/encoder", build_encoder(NOW_NS, 1.0, 1.0)),
        ("/hero_0/imu", build_imu(NOW_NS)),
    ],
)
def test_a_message_too_short_for_its_header_is_refused(name, payload):
    robot = CleanedRobot()
    for length in range(16):
        assert robot.receive(name, payload[:length], NOW_NS) == []
    assert robot.cleaner.refused == 16


def test_an_odometry_message_cut_short_is_refused_when_its_reading_comes():
    robot = CleanedRobot()
    robot.receive("/hero_0/odom", build_odometry(NOW_NS)[:-1], NOW_NS)
    robot.receive("/hero_0/encoder", build_encoder(NOW_NS, 1.0, 1.0), NOW_NS)
    assert list_payloads(robot.outputs, "/hero_0/odom") == []
    assert robot.cleaner.refused == 1
