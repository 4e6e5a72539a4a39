"""Limits of the driver at their very values, which random cases never meet: what still counts, and what no more."""

import math
import sys

import pytest
from conversation import T0, open_declared_session, receive
from robot_messages import NOW_NS, build_laser, build_odometry, build_transform, build_transform_message
from vectors import TIME_REQUEST

from hero_driver.corrections import message_layouts
from hero_driver.corrections.correction_settings import CorrectionSettings
from hero_driver.corrections.message_layouts import ODOMETRY_TAIL_LENGTH, OdometryWriter
from hero_driver.corrections.robot_corrections import RobotCorrections
from hero_driver.corrections.stamps import MAX_FUTURE_NS, STEP_NS, STEP_SLACK_NS, StampFilter
from hero_driver.corrections.tick_odometry import TickOdometry, WheelGeometry
from hero_driver.corrections.transforms import FRAMES_MAX
from hero_driver.fleet.namespaces import Identity
from hero_driver.fleet.registry import ALIVE_S, FLAP_S, RIVALS_MAX, FleetRegistry, Verdict
from hero_driver.rosserial.packets import ID_LOG, encode_packet
from hero_driver.rosserial.payloads import LOG_INFO, Log, encode_log
from hero_driver.rosserial.session import DATA_SILENCE_S, UNCONFIGURED_S, SessionEnded
from hero_node.robot_constants import STOCK_BEAMS
from hero_node.ros_messages import ENCODER_FORM, HEADER, LENGTH, POSE_FORM

HERO = Identity("/hero_0", 0)


def beyond(value):
    return value * (1.0 + sys.float_info.epsilon)


@pytest.mark.parametrize("field", range(4))
def test_odometry_is_believed_up_to_its_limits(field):
    limit = (1e4, 1e4, 1.0, 100.0)[field]
    writer = OdometryWriter((0.0,) * 6, (0.0,) * 6)
    for sign in (1.0, -1.0):
        for value, is_believed in ((sign * limit, True), (beyond(sign * limit), False)):
            numbers = [0.0] * 4
            numbers[field] = value
            x_m, y_m, linear_m_s, angular_rad_s = numbers
            payload = build_odometry(NOW_NS, x_m, y_m, 0.0, linear_m_s, angular_rad_s)
            assert (writer.rewrite(payload, 0, NOW_NS, None) is not None) == is_believed, value


def test_transforms_are_believed_up_to_their_limits():
    for axis in range(3):
        for sign in (1.0, -1.0):
            for value, is_believed in ((sign * 1e4, True), (beyond(sign * 1e4), False)):
                numbers = [0.0] * 6 + [1.0]
                numbers[axis] = value
                assert (message_layouts.find_transform_fault(POSE_FORM.pack(*numbers)) == "") == is_believed
    for turn, is_believed in (
        ((0.5, 0.5, 0.0, 0.0), False),
        ((0.5, 0.5, 0.1, 0.0), True),
        ((0.0, 0.0, 1.0, 1.0), False),
        ((0.0, 0.0, 1.0, 0.9), True),
    ):
        assert (message_layouts.find_transform_fault(POSE_FORM.pack(0.0, 0.0, 0.0, *turn)) == "") == is_believed


def test_the_shortest_messages_are_read():
    assert message_layouts.read_stamp_ns(bytes(HEADER.size)) == 0
    assert message_layouts.read_odometry_velocity(bytes(ODOMETRY_TAIL_LENGTH)) == (0.0, 0.0)
    assert message_layouts.describe_odometry(bytes(ODOMETRY_TAIL_LENGTH)) == "x 0 m, y 0 m, 0 m/s, 0 rad/s"
    assert message_layouts.read_transforms(bytes(4)) == []
    nameless = bytes(HEADER.size)
    assert message_layouts.read_encoder(nameless + bytes(ENCODER_FORM.size)) == (0, 0.0, 0.0)
    scan = build_laser(NOW_NS, [0.1] * STOCK_BEAMS, [1.0] * STOCK_BEAMS)[-(7 + 2 + 2 * STOCK_BEAMS) * 4 :]
    assert message_layouts.make_proximity(nameless + scan, 0, NOW_NS, 0.2) is not None
    odometry = nameless + bytes(LENGTH.size + ODOMETRY_TAIL_LENGTH)
    assert OdometryWriter((0.0,) * 6, (0.0,) * 6).rewrite(odometry, 0, NOW_NS, None) is not None


def test_stamps_step_behind_a_clock_that_went_back_up_to_their_slack():
    for ahead_ns, expected_ns in (
        (0, NOW_NS + STEP_NS),
        (MAX_FUTURE_NS + STEP_SLACK_NS, NOW_NS + MAX_FUTURE_NS + STEP_SLACK_NS + STEP_NS),
        (MAX_FUTURE_NS + STEP_SLACK_NS + 1, NOW_NS),
    ):
        stamps = StampFilter()
        stamps.last_ns["/hero_0/odom"] = NOW_NS + ahead_ns
        assert stamps.correct("/hero_0/odom", NOW_NS, NOW_NS) == expected_ns


def test_wheels_are_believed_up_to_1_m_s_and_reset_within_five_ticks():
    eighth = WheelGeometry(1.0 / math.pi, 0.5, 8.0)  # an eighth of a meter per tick
    assert eighth.ticks_m == (0.125, 0.125)
    for left, right, elapsed_s, velocity in (
        (8.0, -8.0, 1.0, (0.0, -4.0)),
        (-8.0, 8.0, 1.0, (0.0, 4.0)),
        (9.0, 0.0, 1.0, None),
        (0.0, -9.0, 1.0, None),
        (8.0, 8.0, 1.125, (0.0, 0.0)),
        (1.0, 1.0, 0.0, (0.0, 0.0)),
    ):
        odometry = TickOdometry(eighth)
        odometry.integrate(0.0, 0.0, 10.0)
        assert odometry.integrate(left, right, 10.0 + elapsed_s) == (velocity is not None), (left, right)
        assert (odometry.linear_m_s, odometry.angular_rad_s) == (velocity or (0.0, 0.0)), (left, right)
    odometry = TickOdometry(eighth)
    for ticks, stamp_s, linear_m_s in ((0.0, 10.0, 0.0), (1.0, 10.5, 0.25), (2.0, 10.5, 0.0)):
        odometry.integrate(ticks, ticks, stamp_s)
        assert odometry.linear_m_s == linear_m_s, "two readings of one stamp say nothing of it"
    for before, left, right, is_reset in (
        (21.0, 5.0, -5.0, True),
        (-21.0, 0.0, 0.0, True),
        (21.0, 6.0, 0.0, False),
        (21.0, 0.0, -6.0, False),
        (20.0, 0.0, 0.0, False),
    ):
        odometry = TickOdometry(eighth)
        odometry.integrate(0.0, before, 10.0)
        assert odometry.looks_reset(left, right) == is_reset, (before, left, right)


def test_a_robot_may_use_so_many_frames_and_as_many_foreign_ones_are_told():
    added = []
    robot = RobotCorrections("/hero_0", CorrectionSettings(calibration_folder=""), added.append)

    def send(child, parent="hero_0/base_link"):
        robot.transforms.correct(build_transform_message(build_transform(NOW_NS, parent, child)), NOW_NS)

    for number in range(FRAMES_MAX + 3):
        send("hero_0/link_%d" % number)
    assert len(added) == FRAMES_MAX
    for number in range(FRAMES_MAX + 3):
        send("world_%d" % number)
    assert len(robot.transforms.foreign_frames) == FRAMES_MAX


def claim(fleet, link, now_s, host="10.0.0.1", opened_s=0.0):
    return fleet.claim_identity(link, HERO, host, f"{host}:{link}", opened_s, now_s)


def test_a_robot_is_alive_for_three_seconds_and_flaps_within_five():
    for now_s, verdict in ((T0 + ALIVE_S - 0.125, Verdict.REFUSED), (T0 + ALIVE_S, Verdict.TOOK_OVER)):
        fleet = FleetRegistry(10.0)
        claim(fleet, 1, T0)
        assert claim(fleet, 2, now_s, "10.0.0.2").verdict is verdict
    for after_s, heard_s, verdict in (
        (FLAP_S - 0.125, 1.0, Verdict.REFUSED),
        (FLAP_S, 1.0, Verdict.TOOK_OVER),
        (FLAP_S - 0.125, 0.0, Verdict.TOOK_OVER),
    ):
        fleet = FleetRegistry(10.0)
        claim(fleet, 1, T0)
        record = claim(fleet, 2, T0 + 1.0).record
        record.last_heard_s = T0 + after_s
        opened_s = record.last_heard_s - heard_s  # whether the other one spoke after this one had connected
        assert claim(fleet, 3, T0 + 1.0 + after_s, opened_s=opened_s).verdict is verdict, (after_s, heard_s)


def test_an_id_is_kept_from_rivals_that_came_before_its_robot_was_heard():
    fleet = FleetRegistry(10.0)
    record = claim(fleet, 1, T0).record
    for number in range(RIVALS_MAX + 1):
        claim(fleet, 2 + number, T0 + 1.0, "10.0.1.%d" % number)
    assert len(record.rivals) == RIVALS_MAX
    for heard_s, is_kept in ((T0 + 1.0, False), (T0 + 1.125, True)):
        record.last_heard_s = heard_s
        assert fleet.is_reserved(record, "10.0.1.0") == is_kept


def test_a_session_is_silent_lacks_data_and_forgets_beyond_its_times():
    session = open_declared_session(silence_timeout_s=6.0)
    receive(session, TIME_REQUEST, T0 + 1.0)
    assert session.poll(T0 + 7.0) == [] and type(session.poll(T0 + 7.125)[0]) is SessionEnded
    for silence_s, lacks in ((DATA_SILENCE_S, False), (DATA_SILENCE_S + 0.125, True)):
        session = open_declared_session()
        receive(session, TIME_REQUEST, T0 + silence_s)
        assert session.begins_to_lack_data() == lacks
    for after_s, asks in ((UNCONFIGURED_S, False), (UNCONFIGURED_S + 0.125, True)):
        session = open_declared_session()
        receive(session, TIME_REQUEST, T0 + 1.0)
        session.take_packets()
        receive(session, encode_packet(ID_LOG, encode_log(Log(LOG_INFO, "hello"))), T0 + 1.0 + after_s)
        session.poll(T0 + 1.0 + after_s)
        assert bool(session.take_packets()) == asks
