"""Odometry of a robot as ROS programs get it: of its ticks, each with the reading of its own burst, none lost."""

import math
from collections import Counter

import pytest
from corrected_robot import TYPES, CorrectedRobot, list_odometry, list_payloads, list_topics, list_transforms
from hypothesis import given
from hypothesis import strategies as st
from robot_messages import (
    MS,
    NOW_NS,
    build_burst,
    build_encoder,
    build_odometry,
    build_transform,
    build_transform_message,
    read_seq,
    read_stamp_ns,
)

from hero_node import Pose
from hero_node.ros_messages import PLUS_ENCODER_MD5

PERIOD_NS = 34 * MS
TICK_M = math.pi * 0.0492 / 288.0
CHILDREN = ["base_link", "left_wheel_link", "right_wheel_link", "hat_link", "laser_link"]


def list_children(outputs):
    return Counter(child.split("/")[1] for _, _, child, *_ in list_transforms(outputs))


# The stock robot's order: odometry, transforms, encoder.


def test_odometry_and_its_transform_wait_for_their_bursts_reading():
    robot = CorrectedRobot()
    robot.receive_burst(NOW_NS, (0.0, 0.0))
    *first, (encoder_name, _, encoder) = build_burst(NOW_NS + PERIOD_NS, (10.0, 10.0))
    before = [output for name, _, payload in first for output in robot.receive(name, payload, NOW_NS + PERIOD_NS)]
    assert [name for name, _ in before] == ["/hero_0/odom_raw"] + ["/tf"] * 4
    after = robot.receive(encoder_name, encoder, NOW_NS + PERIOD_NS)
    assert [name for name, _ in after] == ["/hero_0/odom", "/tf", "/hero_0/encoder"]
    assert list_odometry(after)[0][2:5] == pytest.approx((10.0 * TICK_M, 0.0, 0.0))
    assert list_transforms(after) == [
        (NOW_NS + PERIOD_NS, "hero_0/odom", "hero_0/base_link", pytest.approx(10.0 * TICK_M), 0.0, 0.0)
    ]


def test_every_burst_gives_each_message_once_with_the_pose_of_its_reading():
    robot = CorrectedRobot()
    for number in range(50):
        outputs = robot.receive_burst(NOW_NS + number * PERIOD_NS, (number * 3.0, number * 3.0))
        (odometry,) = list_odometry(outputs)
        assert odometry[:2] == ("hero_0/odom", "hero_0/base_link")
        assert odometry[2] == pytest.approx(number * 3.0 * TICK_M)
        assert list_children(outputs) == dict.fromkeys(CHILDREN, 1)
        assert {stamp_ns for stamp_ns, *_ in list_transforms(outputs)} == {NOW_NS + number * PERIOD_NS}
    assert [read_seq(payload) for payload in list_payloads(robot.outputs, "/hero_0/odom")] == list(range(50))
    assert [read_seq(payload) for payload in list_payloads(robot.outputs, "/hero_0/encoder")] == list(range(50))
    assert robot.corrections.refused == 0


def test_the_robots_own_odometry_is_there_unchanged_under_another_name():
    robot = CorrectedRobot()
    payload = build_odometry(NOW_NS, 1.0, 2.0, 0.5)
    assert robot.receive("/hero_0/odom", payload, NOW_NS) == [("/hero_0/odom_raw", payload)]
    assert list_topics(robot.corrections, "/hero_0/odom", "nav_msgs/Odometry") == {
        "/hero_0/odom": "nav_msgs/Odometry", "/hero_0/odom_raw": "nav_msgs/Odometry"
    }  # fmt: skip


def test_odometry_has_covariances_and_the_velocity_of_the_wheels():
    robot = CorrectedRobot()
    for number in range(10):
        robot.receive_burst(NOW_NS + number * PERIOD_NS, (-2.0 * number, 2.0 * number))
    *_, linear_m_s, angular_rad_s, pose_covariance, twist_covariance = list_odometry(robot.outputs)[-1]
    assert linear_m_s == pytest.approx(0.0, abs=1e-9)
    assert angular_rad_s == pytest.approx(4.0 * TICK_M / 0.063 / 0.034)
    assert pose_covariance[::7] == (1e-4, 1e-4, 1e-9, 1e-9, 1e-9, 1e-2)
    assert twist_covariance[::7] == (1e-4, 1e-9, 1e-9, 1e-9, 1e-9, 1e-2)


# Other orders, and readings that do not come.


def test_odometry_that_comes_after_its_reading_does_not_wait():
    robot = CorrectedRobot()
    for number in range(5):
        stamp_ns = NOW_NS + number * PERIOD_NS
        *rest, (encoder_name, _, encoder) = build_burst(stamp_ns, (5.0 * number,) * 2)
        robot.receive(encoder_name, encoder, stamp_ns)
        outputs = [output for name, _, payload in rest for output in robot.receive(name, payload, stamp_ns)]
        assert list_odometry(outputs)[0][2] == pytest.approx(5.0 * number * TICK_M)
        assert list_children(outputs) == dict.fromkeys(CHILDREN, 1)


def test_odometry_waits_for_one_burst_only_when_no_reading_comes():
    robot = CorrectedRobot()
    robot.receive_burst(NOW_NS, (0.0, 0.0))
    without_reading = [build_burst(NOW_NS + number * PERIOD_NS)[:-1] for number in range(1, 6)]
    counts = []
    for burst in without_reading:
        outputs = [output for name, _, payload in burst for output in robot.receive(name, payload, NOW_NS)]
        counts.append((len(list_odometry(outputs)), list_children(outputs)["base_link"]))
    assert counts == [(0, 0), (2, 2), (1, 1), (1, 1), (1, 1)]


def test_one_lost_reading_does_not_end_the_waiting_for_good():
    robot = CorrectedRobot()
    robot.receive_burst(NOW_NS, (0.0, 0.0))
    for name, _, payload in build_burst(NOW_NS + PERIOD_NS)[:-1]:
        robot.receive(name, payload, NOW_NS + PERIOD_NS)
    for number in range(2, 30):
        outputs = robot.receive_burst(NOW_NS + number * PERIOD_NS, (10.0 * number, 10.0 * number))
    assert list_odometry(outputs)[-1][2] == pytest.approx(290.0 * TICK_M)


def test_a_declared_encoder_without_readings_keeps_the_robots_estimate():
    robot = CorrectedRobot()
    for number in range(5):
        stamp_ns = NOW_NS + number * PERIOD_NS
        robot.receive("/hero_0/odom", build_odometry(stamp_ns, 0.1 * number, 0.0, 0.3), stamp_ns)
    assert [odometry[2] for odometry in list_odometry(robot.outputs)][-1] == pytest.approx(0.4)


def test_without_an_encoder_the_robots_estimate_passes_at_once():
    robot = CorrectedRobot({name: TYPES[name] for name in ("/hero_0/odom", "/tf")})
    outputs = robot.receive("/hero_0/odom", build_odometry(NOW_NS, 1.0, 2.0, 0.5, 0.1, 0.2), NOW_NS)
    assert list_odometry(outputs)[0][2:7] == pytest.approx((1.0, 2.0, 0.5, 0.1, 0.2))
    transform = build_transform(NOW_NS, "hero_0/odom", "hero_0/base_link", (3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    outputs = robot.receive("/tf", build_transform_message(transform), NOW_NS)
    assert list_transforms(outputs) == [(NOW_NS, "hero_0/odom", "hero_0/base_link", 3.0, 4.0, 0.0)]


def test_a_reading_without_subscribers_moves_the_odometry():
    robot = CorrectedRobot(is_wanted=lambda name: name != "/hero_0/encoder")
    robot.receive_burst(NOW_NS, (0.0, 0.0))
    outputs = robot.receive_burst(NOW_NS + PERIOD_NS, (10.0, 10.0))
    assert list_payloads(robot.outputs, "/hero_0/encoder") == []
    assert list_odometry(outputs)[0][2] == pytest.approx(10.0 * TICK_M)


# Connections, reboots, set_odom.


def test_the_pose_goes_on_over_a_lost_connection():
    robot = CorrectedRobot()
    robot.receive_burst(NOW_NS, (100.0, 100.0))
    robot.receive_burst(NOW_NS + PERIOD_NS, (200.0, 200.0))
    robot.reconnect(rebooted=False)
    outputs = robot.receive_burst(NOW_NS + 3000 * MS, (300.0, 300.0), arrival_ns=NOW_NS + 3200 * MS)
    assert list_odometry(outputs)[0][2] == pytest.approx(200.0 * TICK_M)


def test_counters_with_stamps_since_boot_are_of_a_new_boot():
    robot = CorrectedRobot()
    robot.receive_burst(NOW_NS, (100.0, 100.0))
    robot.reconnect(rebooted=False)
    robot.receive_burst(3000 * MS, (300.0, 300.0), arrival_ns=NOW_NS + 3000 * MS)
    outputs = robot.receive_burst(3034 * MS, (310.0, 310.0), arrival_ns=NOW_NS + 3034 * MS)
    assert list_odometry(outputs)[0][2] == pytest.approx(10.0 * TICK_M)


@pytest.mark.parametrize("is_noticed", [True, False], ids=["noticed", "seen by its counters alone"])
def test_the_pose_stays_where_it_was_when_the_robot_reboots(is_noticed):
    robot = CorrectedRobot()
    robot.receive_burst(NOW_NS, (100.0, 100.0))
    robot.receive_burst(NOW_NS + PERIOD_NS, (200.0, 200.0))
    robot.reconnect(rebooted=is_noticed)
    outputs = robot.receive_burst(NOW_NS + 3000 * MS, (0.0, 0.0))
    assert list_odometry(outputs)[0][2] == pytest.approx(100.0 * TICK_M)
    outputs = robot.receive_burst(NOW_NS + 3034 * MS, (10.0, 10.0))
    assert list_odometry(outputs)[0][2] == pytest.approx(110.0 * TICK_M)


def test_a_reboot_noticed_after_the_declarations_keeps_the_encoder():
    robot = CorrectedRobot()
    robot.receive_burst(NOW_NS, (100.0, 100.0))
    robot.corrections.odometry.note_reboot()
    robot.receive_burst(NOW_NS + PERIOD_NS, (0.0, 0.0))
    outputs = robot.receive_burst(NOW_NS + 2 * PERIOD_NS, (10.0, 10.0))
    assert list_odometry(outputs)[0][2] == pytest.approx(10.0 * TICK_M)


def test_pending_messages_are_not_sent_on_the_next_connection():
    robot = CorrectedRobot()
    robot.receive("/hero_0/odom", build_odometry(NOW_NS), NOW_NS)
    robot.reconnect(rebooted=False)
    outputs = robot.receive_burst(NOW_NS + PERIOD_NS, (0.0, 0.0))
    assert len(list_odometry(outputs)) == 1


def test_odometry_of_another_world_begins_at_zero_at_any_count():
    robot = CorrectedRobot()
    robot.corrections.odometry.set_pose(Pose(1.0, 2.0, 1.0))
    robot.corrections.odometry.start_at_zero()
    odometry = robot.corrections.odometry.ticks
    odometry.integrate(7000.0, 7000.0, 100.0)
    assert (odometry.x_m, odometry.y_m, odometry.yaw_rad, odometry.resets) == (0.0, 0.0, 0.0, 0)


def test_a_set_pose_is_where_the_odometry_goes_on_from():
    robot = CorrectedRobot()
    robot.receive_burst(NOW_NS, (100.0, 100.0))
    robot.corrections.odometry.set_pose(Pose(1.0, 2.0, math.pi / 2.0))
    outputs = robot.receive_burst(NOW_NS + PERIOD_NS, (10.0, 10.0))
    assert list_odometry(outputs)[0][2:5] == pytest.approx((1.0, 2.0 + 10.0 * TICK_M, math.pi / 2.0))


# Whatever order and losses.


@given(
    bursts=st.lists(st.tuples(st.permutations(range(3)), st.sets(st.integers(0, 2))), max_size=20),
    jitter_ms=st.integers(0, 2),
)
def test_odometry_and_transforms_come_out_once_with_growing_stamps(bursts, jitter_ms):
    robot = CorrectedRobot()
    sent = Counter()
    for number, (order, lost) in enumerate([*bursts, ((0, 1, 2), set()), ((0, 1, 2), set())]):
        stamp_ns = NOW_NS + number * PERIOD_NS
        transform = build_transform(stamp_ns + jitter_ms * MS, "hero_0/odom", "hero_0/base_link")
        messages = [
            ("/hero_0/odom", build_odometry(stamp_ns)),
            ("/tf", build_transform_message(transform)),
            ("/hero_0/encoder", build_encoder(stamp_ns + jitter_ms * MS, number, number)),
        ]
        for index in order:
            if index not in lost:
                robot.receive(*messages[index], stamp_ns + 5 * MS)
                sent[messages[index][0]] += 1
    for name, count in sent.items():
        payloads = list_payloads(robot.outputs, name)
        assert len(payloads) == count
        stamps_ns = [read_stamp_ns(payload) for payload in payloads]
        assert stamps_ns == sorted(set(stamps_ns))
    assert robot.corrections.refused == 0


@pytest.mark.parametrize("name", TYPES)
@given(payload=st.binary(max_size=800))
def test_arbitrary_bytes_never_raise_and_are_counted(name, payload):
    robot = CorrectedRobot()
    outputs = robot.receive(name, payload, NOW_NS)
    assert outputs or robot.corrections.refused == 1


# Models.


@pytest.mark.parametrize(
    "md5sum, model", [(PLUS_ENCODER_MD5, "hero_plus"), ("b5586cdbae9b740afc6a1f403a2d7dde", "hero")]
)
def test_ticks_are_those_of_the_model_that_the_robot_is(md5sum, model):
    robot = CorrectedRobot()
    robot.corrections.note_encoder(md5sum)
    robot.receive_burst(NOW_NS, (0.0, 0.0))
    (odometry,) = list_odometry(robot.receive_burst(NOW_NS + 34 * MS, (20.0, 20.0)))
    tick_m = {"hero": math.pi * 0.0492 / 288, "hero_plus": math.pi * 0.050 / 96}[model]
    assert robot.corrections.model == model
    assert odometry[2] == pytest.approx(20 * tick_m)


# What cannot be true.


def receive_odometry(robot, **numbers):
    """Give one odometry message; return how many came out."""
    return len(list_odometry(robot.receive("/hero_0/odom", build_odometry(NOW_NS, **numbers), NOW_NS)))


@pytest.mark.parametrize(
    ("numbers", "text"),
    [
        ({"x_m": math.nan}, "x nan m"),
        ({"y_m": 1e300}, "y 1e+300 m"),
        ({"linear_m_s": 1688.0}, "1688 m/s"),
        ({"angular_rad_s": -1e300}, "-1e+300 rad/s"),
    ],
)
def test_odometry_that_cannot_be_true_is_refused_and_named(numbers, text):
    robot = CorrectedRobot({"/hero_0/odom": TYPES["/hero_0/odom"]})
    assert receive_odometry(robot, x_m=30.0, linear_m_s=-0.3, angular_rad_s=20.0) == 1
    assert robot.corrections.take_problem() == ""
    assert receive_odometry(robot, **numbers) == 0
    assert "odom refused" in robot.corrections.refused * robot.corrections.take_problem()
    receive_odometry(robot, **numbers)
    assert text in robot.corrections.take_problem()
    assert robot.corrections.take_problem() == ""
    assert receive_odometry(robot) == 1


@pytest.mark.parametrize(("ticks", "text"), [(1e6, "jumped by 999994"), (math.nan, "counts nan"), (math.inf, "inf")])
def test_an_encoder_reading_that_cannot_be_true_is_named(ticks, text):
    robot = CorrectedRobot()
    robot.receive_burst(NOW_NS, (5.0, 5.0))
    robot.receive_burst(NOW_NS + PERIOD_NS, (6.0, 6.0))
    assert robot.corrections.take_problem() == ""
    robot.receive_burst(NOW_NS + 2 * PERIOD_NS, (ticks, 7.0))
    assert text in robot.corrections.take_problem()
    assert robot.corrections.take_problem() == ""
