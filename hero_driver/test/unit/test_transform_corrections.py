"""A robot's transforms as ROS programs get them: of its own frames only, one by one, with true stamps."""

import struct

import pytest
from corrected_robot import CorrectedRobot, list_transforms
from robot_messages import MS, NOW_NS, NS_PER_S, build_transform, build_transform_message

from hero_test.nonempty import nonempty


def receive_transforms(robot, *pairs, stamp_ns=NOW_NS):
    message = build_transform_message(*(build_transform(stamp_ns, *pair) for pair in pairs))
    return robot.receive("/tf", message, NOW_NS)


def list_pairs(outputs):
    return [(parent, child) for _, parent, child, *_ in list_transforms(outputs)]


@pytest.mark.parametrize("child", ["left_wheel_link", "right_wheel_link", "hat_link", "laser_link"])
def test_transforms_between_the_robots_own_frames_pass_as_they_are(child):
    robot = CorrectedRobot()
    transform = build_transform(NOW_NS, "hero_0/base_link", "hero_0/" + child)
    for number in range(3):
        stamped = build_transform(NOW_NS + number * MS, "hero_0/base_link", "hero_0/" + child)
        assert robot.receive("/tf", build_transform_message(stamped), NOW_NS + number * MS) == [("/tf", stamped)]
    assert len(transform) == len(stamped)
    assert (robot.corrections.refused, robot.corrections.transforms.foreign_frames) == (0, set())


def test_a_repeated_transform_gets_a_later_stamp():
    robot = CorrectedRobot()
    hat, laser = ("hero_0/base_link", "hero_0/hat_link"), ("hero_0/base_link", "hero_0/laser_link")
    receive_transforms(robot, hat, stamp_ns=NOW_NS - NS_PER_S)
    receive_transforms(robot, laser, stamp_ns=NOW_NS - NS_PER_S)
    outputs = [receive_transforms(robot, pair)[0] for pair in (hat, laser, laser, hat)]
    stamps_ns = [stamp_ns - NOW_NS for stamp_ns, *_ in list_transforms(outputs)]
    assert stamps_ns == [0, 0, 1000, 1000]
    assert list_pairs(outputs) == [hat, laser, laser, hat]


def test_a_stamp_that_passed_passes_only_for_its_own_frames():
    robot = CorrectedRobot()
    hat = ("hero_0/base_link", "hero_0/hat_link")
    for stamp_ns in (NOW_NS - MS, NOW_NS):
        assert list_pairs(receive_transforms(robot, hat, stamp_ns=stamp_ns)) == [hat]
        assert receive_transforms(robot, ("map", "hero_0/odom"), stamp_ns=stamp_ns) == []


def test_a_stamp_of_too_many_nanoseconds_is_normalized():
    robot = CorrectedRobot()
    pair = ("hero_0/base_link", "hero_0/hat_link")
    receive_transforms(robot, pair, stamp_ns=NOW_NS - NS_PER_S)
    odd = bytearray(build_transform_message(build_transform(NOW_NS, *pair)))
    secs, nsecs = struct.unpack_from("<II", odd, 8)
    struct.pack_into("<II", odd, 8, secs - 1, nsecs + NS_PER_S)
    assert robot.receive("/tf", bytes(odd), NOW_NS) == [("/tf", build_transform(NOW_NS, *pair))]


@pytest.mark.parametrize("count", [0, 2])
def test_a_message_whose_count_is_wrong_is_refused_or_empty(count):
    robot = CorrectedRobot()
    pair = ("hero_0/base_link", "hero_0/hat_link")
    receive_transforms(robot, pair, stamp_ns=NOW_NS - NS_PER_S)
    wrong = struct.pack("<I", count) + build_transform(NOW_NS, *pair)
    assert robot.receive("/tf", wrong, NOW_NS) == []
    assert list_pairs(receive_transforms(robot, pair)) == [pair]


def test_several_transforms_in_one_message_come_out_one_by_one():
    pairs = [("hero_0/base_link", "hero_0/%s_link" % name) for name in ("left_wheel", "right_wheel", "hat")]
    robot = CorrectedRobot()
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
        ("hero_0/base_link", b"hero_0/\xff\xfe"),
        ("hero_0/base_link", "hero_0/a\nb"),
        ("hero_0/base_link", "hero_0/" + 4000 * "x"),
    ],
)
def test_transforms_of_foreign_frames_are_refused_counted_and_named(pair):
    robot = CorrectedRobot()
    for _ in range(3):
        assert receive_transforms(robot, pair) == []
    assert robot.corrections.refused == 3
    (name,) = robot.corrections.transforms.foreign_frames
    assert name.isprintable()
    assert " -> " in name
    assert len(name) < 150


@pytest.mark.parametrize(("length", "passes"), [(128, True), (129, False)])
def test_a_frames_name_has_at_most_128_characters(length, passes):
    robot = CorrectedRobot()
    pair = ("hero_0/base_link", "hero_0/".ljust(length, "x"))
    assert list_pairs(receive_transforms(robot, pair)) == [pair] * passes


def test_a_foreign_transform_does_not_take_its_neighbors_along():
    own = ("hero_0/base_link", "hero_0/hat_link")
    robot = CorrectedRobot()
    for _ in range(2):
        outputs = receive_transforms(robot, own, ("map", "hero_0/odom"), own)
        assert list_pairs(outputs) == [own, own]
    assert robot.corrections.refused == 2
    assert robot.corrections.transforms.foreign_frames == {"'map' -> 'hero_0/odom'"}
    assert robot.corrections.take_problem() == "", "diagnostics name the frames"


def test_frames_that_a_robot_makes_up_do_not_fill_the_memory():
    robot = CorrectedRobot()
    for number in range(1000):
        receive_transforms(robot, ("map", "x%d" % number), ("hero_0/base_link", "hero_0/x%d" % number))
    assert len(robot.corrections.transforms.foreign_frames) == 32
    assert len({child for _, child in list_pairs(robot.outputs)}) == 32
    assert robot.corrections.refused == 1000 + 1000 - 32


def test_a_broken_message_of_transforms_is_refused_whole():
    robot = CorrectedRobot()
    receive_transforms(robot, ("hero_0/base_link", "hero_0/hat_link"))
    message = build_transform_message(build_transform(NOW_NS, "hero_0/base_link", "hero_0/hat_link"))
    for length in nonempty(range(len(message))):
        assert robot.receive("/tf", message[:length], NOW_NS) == []
    assert robot.receive("/tf", message + b"\x00", NOW_NS) == []
    two = build_transform_message(*[build_transform(NOW_NS, "hero_0/base_link", "hero_0/hat_link")] * 2)
    assert robot.receive("/tf", b"\x01\x00\x00\x00" + two[4:], NOW_NS) == []
    assert robot.corrections.refused == len(message) + 2


@pytest.mark.parametrize("number", [1e300, -10001.0, float("nan"), -float("inf")])
@pytest.mark.parametrize("pair", [("hero_0/odom", "hero_0/base_link"), ("hero_0/base_link", "hero_0/hat_link")])
def test_transforms_whose_numbers_cannot_be_true_are_refused_and_named(pair, number):
    robot = CorrectedRobot()
    right = (1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    receive_transforms(robot, pair, stamp_ns=NOW_NS - MS)  # what was right once need not stay so
    for index in range(7):
        for stamp_ns in (NOW_NS + 2 * index * MS, NOW_NS + (2 * index + 1) * MS):  # known and unknown frames
            wrong = (*right[:index], number, *right[index + 1 :])
            transform = build_transform(stamp_ns, *pair, numbers=wrong)
            assert robot.receive("/tf", build_transform_message(transform), stamp_ns) == []
            assert robot.corrections.take_problem().startswith("tf refused, it cannot be true (x ")
    assert receive_transforms(robot, pair, stamp_ns=NOW_NS + 40 * MS)
    assert robot.corrections.take_problem() == ""
