"""One robot in virtual time: what its methods send, when, and which errors they raise."""

import math
from types import SimpleNamespace

import pytest
from linkless_robot import FakeSwarm, make_robot

from hero_client.controllers.go_to_goal import Goal
from hero_client.robots.group import READY_TIMEOUT_S
from hero_client.robots.robot_base import WARNING_PERIOD_S
from hero_client.values.errors import GoalError, NotCalibratedError, RobotNotReadyError, StaleDataError, StoppedError
from hero_client.values.readings import FRESH_S, NOT_CALIBRATED
from hero_node import Pose, Velocity
from hero_node.robot_constants import MAX_ANGULAR_RAD_S, MAX_LINEAR_M_S, MODELS
from hero_test.nonempty import nonempty


def test_data_count_until_they_are_a_second_old():
    robot, link = make_robot()
    link.velocity, link.pose = Velocity(0.1, 1.0), Pose(1.0, 2.0, 0.5)
    for age_s, is_fresh in ((FRESH_S, True), (FRESH_S + 0.01, False)):
        link.silent_s = {"odom": age_s, "proximity": age_s}
        assert (robot.fresh_pose() == link.pose) == (robot.fresh_velocity() == (0.1, 1.0)) == is_fresh
        assert (robot.fresh_proximity() == link.ranges) == is_fresh
        assert (", Pose(x_m=1.000" in repr(robot)) == is_fresh
        if is_fresh:
            assert robot.pose == link.pose and robot.velocity == (0.1, 1.0) and robot.proximity == link.ranges
            continue
        for read in (lambda: robot.pose, lambda: robot.velocity, lambda: robot.wheel_speeds):
            with pytest.raises(StaleDataError, match="last message on /hero_3/odom came 1.0 s ago: has the robot gone"):
                read()
        for read in (lambda: robot.proximity, robot.nearest):
            with pytest.raises(StaleDataError, match="/hero_3/proximity"):
                read()
    assert all(map(math.isnan, robot.fresh_proximity())) and len(robot.fresh_proximity()) == 8


@pytest.mark.parametrize("model, separation_m", [("hero", 0.063), ("hero_plus", 0.065)])
def test_speeds_of_the_wheels_are_those_of_the_rim(model, separation_m):
    robot, link = make_robot()
    link.velocity, link.model = Velocity(0.1, 2.0), MODELS[model]
    assert robot.wheel_speeds == pytest.approx((0.1 - separation_m, 0.1 + separation_m))


def test_the_nearest_obstacle_is_told_in_the_body_frame():
    robot, link = make_robot()
    link.ranges[6], link.ranges[1] = 0.1, 0.2
    assert robot.nearest() == pytest.approx((0.1, -math.pi / 2.0))
    link.ranges = [math.inf] * 8
    assert robot.nearest() is None


@pytest.mark.parametrize("unknown", [1, 8])
def test_what_no_calibrated_sensor_sees_is_not_known_and_never_free(unknown):
    robot, link = make_robot()
    link.ranges = [math.inf] * (8 - unknown) + [math.nan] * unknown
    with pytest.raises(NotCalibratedError, match="what is near hero_3 is not known: its infrared .* calibrate`"):
        robot.nearest()
    assert (robot.missing_ranges() is not None) == (unknown == 8)
    link.ranges[0] = 0.1
    assert robot.nearest() == (0.1, 0.0)
    link.ranges = []
    with pytest.raises(NotCalibratedError):
        robot.nearest()


def test_old_ranges_and_none_are_told_from_a_missing_calibration():
    robot, link = make_robot()
    assert robot.missing_ranges() is None
    link.silent_s["proximity"] = math.inf
    assert robot.missing_ranges() == "it has sent no ranges yet"
    link.silent_s["proximity"] = 3.2
    assert robot.missing_ranges() == "its last ranges came 3.2 s ago"
    robot.warn_if_blind()
    robot.warn_if_blind()
    assert link.warned == ["hero_3 drives by its pose alone: its last ranges came 3.2 s ago"]
    link.silent_s["proximity"], link.ranges = 0.0, [math.nan] * 8
    assert robot.missing_ranges() == NOT_CALIBRATED


def test_a_blind_robot_stops_and_names_the_calibration_now_and_then():
    robot, link = make_robot()
    assert not robot.stop_if_blind() and not link.sent
    link.ranges = [math.nan] * 8
    assert all(robot.stop_if_blind() for _ in range(3))
    assert [velocity[1:] for velocity in link.sent] == [(0.0, 0.0)] * 3
    assert link.warned == ["hero_3 waits: " + NOT_CALIBRATED]


@pytest.mark.parametrize("unknown", [[0], range(8)])
def test_motions_of_a_robot_that_does_not_see_its_way_say_so(unknown):
    robot, link = make_robot()
    for index in unknown:
        link.ranges[index] = math.nan
    text = "hero_3 does not see what is in its way: " + NOT_CALIBRATED
    robot.turn(1.0)
    robot.turn(-1.0)
    assert link.warned == []
    robot.forward(0.1)
    assert link.pose.x_m > 0.05 and link.warned == [text]
    link.clock.sleep(WARNING_PERIOD_S)
    robot.go_to(0.2, 0.0)
    assert link.warned == [text] * 2
    link.clock.sleep(WARNING_PERIOD_S)
    link.silent_s["proximity"] = math.inf
    robot.go_to(0.3, 0.0)
    assert link.warned == [text] * 2, "ranges that the program did not ask for"


def test_a_pose_in_another_frame_is_the_measured_one_or_by_the_origin():
    robot, link = make_robot()
    link.pose, link.origin = Pose(1.0, 0.0, 3.0), Pose(5.0, 7.0, math.pi / 2.0)
    assert robot.pose_in("/world") == pytest.approx((5.0, 8.0, 3.0 + math.pi / 2.0 - math.tau))
    link.localized = Pose(0.1, 0.2, 4.0)
    assert robot.pose_in("map") == pytest.approx((0.1, 0.2, 4.0 - math.tau))


def test_topics_that_few_read_are_subscribed_to_and_waited_for():
    robot, link = make_robot()
    with pytest.raises(StaleDataError):
        assert robot.infrared_counts
    assert link.subscribed == ["laser"] and link.waited == [("laser", 5.0, 1)]
    link.silent_s["laser"] = 0.2
    assert robot.infrared_counts == [5.0] * 8 and len(link.waited) == 1
    for topic in ("distance", "neighbors"):
        with pytest.raises(StaleDataError, match=topic):
            getattr(robot, topic)
        link.silent_s[topic] = 0.2
        assert link.subscribed[-1] == topic
    assert robot.distance == 0.7 and robot.neighbors == ["neighbor"]
    link.silent_s["neighbors"] = 1.1
    with pytest.raises(StaleDataError, match="came 1.1 s ago: does `rosrun hero_swarm virtual_sensors` run"):
        assert robot.neighbors
    link.silent_s["laser"] = 1.1
    with pytest.raises(StaleDataError, match="the last message on /hero_3/laser came 1.1 s ago"):
        assert robot.infrared_counts
    link.wait_for_next = lambda topic, timeout_s: link.waited.append((topic, timeout_s, link.subscribed[-1]))
    assert robot.wait_for_scan(0.7) == link.ranges
    assert link.waited[-1] == ("proximity", 0.7, "proximity")


def test_a_new_pose_counts_when_two_messages_came():
    robot, link = make_robot()
    link.wait_for_next = lambda topic, timeout_s, count: link.waited.append(
        (topic, timeout_s, count, link.subscribed[-1])
    )
    robot.set_pose(1.0, 2.0, 3.0)
    assert link.odometries == [(1.0, 2.0, 3.0)] and link.waited == [("odom", 5.0, 2, "odom")]


def test_speeds_are_limited_and_that_is_said_once():
    robot, link = make_robot()
    robot.drive(MAX_LINEAR_M_S, -MAX_ANGULAR_RAD_S)
    assert link.warned == []
    for _ in range(2):
        robot.drive(0.3, -9.0)
    robot.drive(0.1, 9.0)
    assert [velocity for _, *velocity in link.sent[1:]] == [[0.2, -8.0], [0.2, -8.0], [0.1, 8.0]]
    assert link.warned == ["hero_3 cannot drive 0.3 m/s and -9 rad/s: it is limited to 0.2 m/s and 8 rad/s"]
    turning, its_link = make_robot()
    turning.drive(0.1, 9.0)
    assert len(its_link.warned) == 1
    for wrong in ((math.nan, 0.0), (0.0, math.inf), ("0.1", 0.0), (None, 0.0)):
        with pytest.raises(ValueError, match="speeds must be finite"):
            robot.drive(*wrong)
    assert len(link.sent) == 4


def test_commands_to_a_stopped_robot_are_warned_about_now_and_then():
    robot, link = make_robot()
    link.is_stopped = True
    robot.drive(0.0, 0.0)
    assert link.warned == []
    for step_s in (0.0, WARNING_PERIOD_S - 0.1, 0.1):
        link.clock.sleep(step_s)
        robot.drive(0.0, 1.0)
    assert link.warned == ["hero_3 does not move: the driver has stopped all robots"] * 2
    assert len(link.sent) == 4


def test_driving_for_a_time_repeats_the_command_and_stops_on_time():
    robot, link = make_robot()
    robot.drive(0.1, 0.5, duration_s=0.25)
    assert link.sent == [(0.0, 0.1, 0.5), (0.1, 0.1, 0.5), (0.2, 0.1, 0.5), (0.25, 0.0, 0.0)]
    assert robot.now_s == pytest.approx(100.35), "the stop is sent before the call returns"
    link.sent.clear()
    robot.drive(0.1, 0.0, duration_s=0.0)
    assert [velocity for _, *velocity in link.sent] == [[0.0, 0.0]]
    for wrong in (-0.1, math.nan, "2"):
        with pytest.raises(ValueError, match="a duration must be 0 s or more"):
            robot.drive(0.1, 0.0, wrong)


def test_a_stop_of_all_robots_ends_a_motion_with_a_stop():
    for move in (
        lambda robot: robot.drive(0.1, 0.0, 2.0),
        lambda robot: robot.forward(0.5),
        lambda robot: robot.turn(3.0),
        lambda robot: robot.go_to(0.5, 0.0),
    ):
        robot, link = make_robot()
        send = link.send_velocity

        def stop_all_later(*velocity, link=link, send=send):
            send(*velocity)
            link.is_stopped = len(link.sent) >= 3

        link.send_velocity = stop_all_later
        with pytest.raises(StoppedError, match="hero_3 does not move: the driver has stopped"):
            move(robot)
        assert len(link.sent) == 4 and link.velocity == (0.0, 0.0)


def test_a_motion_waits_for_its_robot_two_seconds():
    for ready_s, is_ready in ((READY_TIMEOUT_S - 0.05, True), (READY_TIMEOUT_S + 0.05, False)):
        for move in (lambda robot: robot.drive(0.1, 0.0, 0.5), lambda robot: robot.turn(0.2)):
            robot, link = make_robot()
            link.ready_s += ready_s
            if is_ready:
                move(robot)
                assert min(link.sent)[0] == pytest.approx(ready_s, abs=0.021)
                continue
            with pytest.raises(RobotNotReadyError, match="hero_3 is not ready after 2 s: nothing subscribes"):
                move(robot)
            assert link.sent == [] and robot.now_s == pytest.approx(100.0 + READY_TIMEOUT_S)


def test_forward_and_turn_end_within_their_tolerance():
    robot, link = make_robot()
    robot.forward(-0.2, 0.2)
    assert link.pose == pytest.approx((-0.2, 0.0, 0.0), abs=0.005)
    assert min(velocity[1] for velocity in link.sent) == pytest.approx(-0.16), "0.8 1/s times what is left"
    robot.turn(-7.0, 3.0)
    assert link.pose.yaw_rad == pytest.approx(math.tau - 7.0, abs=0.03)
    assert min(velocity[2] for velocity in link.sent) == -3.0
    for move in (robot.forward, robot.turn):
        for wrong in ((math.inf, 0.1), (math.nan, 0.1), ("0.1", 0.1), (0.1, 0.0), (0.1, -0.1), (0.1, math.inf)):
            with pytest.raises(ValueError, match="the speed positive"):
                move(*wrong)


def test_an_angle_that_looks_like_degrees_is_asked_about():
    for angle_rad, is_odd in ((90.0, True), (-7.0, True), (6.0, False), (7.5, False), (math.tau, False)):
        robot, link = make_robot()
        robot.turn_steps(angle_rad, 1.0)
        assert len(link.warned) == is_odd
    robot.turn_steps(90, 1.0)
    assert link.warned == ["hero_3 turns by 90 rad, 14.3 full turns: for degrees, turn(math.radians(90))"]


def test_a_place_is_reached_in_any_frame():
    start, origin = Pose(1.0, 0.0, math.pi / 2.0), Pose(0.5, 0.5, math.pi / 2.0)
    for frame, goal, place, yaw_rad in (
        ("odom", (1.1, 0.2), (1.1, 0.2), None),
        ("/hero_3/odom", (1.1, 0.2, 1.0), (1.1, 0.2), 1.0),
        ("robot", (0.2, 0.1), (0.9, 0.2), None),
        ("robot", (0.2, 0.1, -1.0), (0.9, 0.2), math.pi / 2.0 - 1.0),
        ("world", (0.3, 1.6), (1.1, 0.2), None),
    ):
        robot, link = make_robot()
        link.pose, link.origin, seen = start, origin, []
        robot.go_to(*goal, frame=frame, on_step=lambda controller, seen=seen: seen.append(controller.distance_m))
        assert link.pose[:2] == pytest.approx(place, abs=0.01), frame
        assert yaw_rad is None or link.pose.yaw_rad == pytest.approx(yaw_rad, abs=0.05)
        assert seen[0] > 0.2 and seen[-1] < 0.01 and link.velocity == (0.0, 0.0)


def test_a_goal_that_is_not_reached_is_named_as_it_was_given():
    for frame, says in (
        ("odom", r"hero_3 did not reach \(5, 0.5\): not there after 1 s, "),
        ("robot", r"hero_3 did not reach \(5, 0.5\) in the frame robot: not there"),
        ("world", r"hero_3 did not reach \(5, 0.5\) in the frame world: not there"),
    ):
        robot, link = make_robot()
        link.pose = Pose(1.0, 1.0, 0.0)
        with pytest.raises(GoalError, match=says):
            robot.go_to(5.0, 0.5, frame=frame, timeout_s=1.0)
        assert link.velocity == (0.0, 0.0)
    with pytest.raises(GoalError, match=r"hero_3 did not reach \(-6, 1\): not there after 2 s"):
        robot.go_to(5.0, 0.5, on_step=lambda controller: controller.change_goal(Goal(-6.0, 1.0), 0.1, 2.0, 100.0))
    for move, says in ((robot.forward, "drive 0.5 m"), (robot.turn, "turn 0.5 rad")):
        link.ranges[:] = [0.05] * 8
        link.advance = lambda step_s: None
        with pytest.raises(GoalError, match="hero_3 did not %s: " % says):
            move(0.5)


def test_a_measured_pose_that_stays_the_same_ends_a_motion():
    for frame, ended_s in (("map", 3.0), ("odom", 0.0)):
        robot, link = make_robot()
        link.localized = Pose(1.0, 1.0, 0.0)
        if frame == "odom":
            robot.go_to(0.3, 0.0)
            continue
        with pytest.raises(GoalError, match="its wheels turn, but its pose stays the same"):
            robot.go_to(2.0, 1.0, frame=frame)
        assert robot.now_s - 100.0 == pytest.approx(ended_s, abs=0.3)


def test_a_robot_that_falls_silent_on_its_way_fails_with_the_cause():
    robot, link = make_robot()
    motion = robot.start_go_to(1.0, 0.0)
    robot.sleep(1.0)
    assert link.velocity.linear_m_s > 0.1
    link.silent_s["odom"] = 1.5
    robot.sleep(0.1)
    assert link.velocity == (0.0, 0.0)
    with pytest.raises(GoalError, match="no pose for 2 s: the last message on /hero_3/odom came 1.5 s ago"):
        motion.result()
    assert robot.now_s == pytest.approx(103.1, abs=0.15)


def test_a_motion_in_its_own_frame_waits_for_the_first_pose():
    robot, link = make_robot()
    link.silent_s["odom"] = math.inf
    motion = robot.start_go_to(0.1, 0.0, frame="robot")
    robot.sleep(1.5)
    link.silent_s["odom"], link.pose = 0.03, Pose(2.0, 0.0, 0.0)
    motion.result()
    assert link.pose[:2] == pytest.approx((2.1, 0.0), abs=0.01)
    link.silent_s["odom"] = 1.5
    started_s = robot.now_s
    with pytest.raises(StaleDataError, match="/hero_3/odom"):
        robot.go_to(0.1, 0.0, frame="robot")
    assert robot.now_s - started_s == pytest.approx(READY_TIMEOUT_S, abs=0.03)


def test_a_motion_in_the_background_ends_by_cancel_stop_or_the_next():
    for end in (
        lambda robot, motion: motion.cancel(),
        lambda robot, motion: robot.stop(),
        lambda robot, motion: robot.drive(0.0, 1.0),
        lambda robot, motion: robot.start_go_to(0.1, 0.0),
        lambda robot, motion: robot.close(),
    ):
        robot, link = make_robot()
        motion = robot.start_go_to(1.0, 0.0)
        robot.sleep(0.5)
        assert not motion.done() and link.velocity.linear_m_s > 0.0
        end(robot, motion)
        with pytest.raises(GoalError, match=r"hero_3 did not reach \(1, 0\): cancelled"):
            motion.result()
        assert any(velocity == [0.0, 0.0] for _, *velocity in link.sent)


@pytest.mark.parametrize(
    ("drive", "is_of_the_next"),
    [
        (lambda robot: robot.turn(1.0), lambda linear_m_s, angular_rad_s: linear_m_s == 0.0 <= angular_rad_s),
        (lambda robot: robot.forward(-0.1), lambda linear_m_s, angular_rad_s: linear_m_s <= 0.0),
        (lambda robot: robot.drive(-0.1, 0.0, duration_s=0.5), lambda linear_m_s, angular_rad_s: linear_m_s <= 0.0),
        (lambda robot: robot.go_to(0.0, 0.0), lambda linear_m_s, angular_rad_s: True),
    ],
)
def test_a_motion_that_is_waited_for_begins_when_the_one_before_has_ended(drive, is_of_the_next):
    robot, link = make_robot()
    motion = robot.start_go_to(1.0, 0.0)
    robot.sleep(0.5)
    count = len(link.sent)
    link.clock.joined.append(SimpleNamespace(advance=lambda step_s: motion.done() or pytest.fail("it goes on")))
    drive(robot)
    assert all(is_of_the_next(*velocity) for _, *velocity in nonempty(link.sent[count:]))


def test_what_ends_a_wait_stops_the_robot_before_it_goes_on():
    robot, link = make_robot()
    link.clock.is_to_continue = False
    with pytest.raises(GoalError, match="cancelled"):
        robot.go_to(1.0, 0.0)
    assert [velocity for _, *velocity in link.sent][-1] == [0.0, 0.0]
    robot.drive(0.1, 0.0, duration_s=5.0)
    assert link.velocity == (0.0, 0.0) and robot.now_s < 101.0
    link.ready_s = math.inf
    with pytest.raises(RobotNotReadyError):
        robot.wait_until_ready(10.0)
    assert robot.now_s < 101.1


@pytest.mark.parametrize("ending", [KeyboardInterrupt, SystemExit, StoppedError])
def test_whatever_ends_a_motion_stops_every_robot_of_a_swarm(monkeypatch, ending):
    swarm = FakeSwarm(2, 5)
    sleep = swarm._clock.sleep

    def end_once(duration_s):
        monkeypatch.setattr(swarm._clock, "sleep", sleep)
        raise ending

    monkeypatch.setattr(swarm._clock, "sleep", end_once)
    with pytest.raises(ending):
        swarm.drive(0.1, 0.5, duration_s=1.0)
    assert [[velocity[1:] for velocity in link.sent] for link in swarm.links] == [[(0.1, 0.5), (0.0, 0.0)]] * 2


def test_only_a_robot_that_was_driven_is_stopped_at_the_end():
    watched, link = make_robot()
    with watched:
        assert not watched.driven
    assert link.sent == [] and link.closed == 0
    driven, link = make_robot()
    with pytest.raises(KeyError), driven:
        driven.drive(0.1, 0.0)
        raise KeyError
    assert [velocity for _, *velocity in link.sent] == [[0.1, 0.0], [0.0, 0.0]]
    for _ in range(2):
        driven.close()
    assert link.closed == 2 and link.velocity == (0.0, 0.0)


def test_a_motion_slows_down_for_obstacles_by_the_body_of_its_model():
    speeds_m_s = []
    for model in (MODELS["hero"], MODELS["hero_plus"]):
        robot, link = make_robot()
        link.model, link.ranges[0] = model, 0.13
        motion = robot.start_go_to(1.0, 0.0, avoid=False)
        robot.sleep(0.5)
        speeds_m_s.append(link.velocity.linear_m_s)
        motion.cancel()
    assert speeds_m_s[0] > speeds_m_s[1] + 0.01


def test_a_robot_tells_its_state():
    robot, link = make_robot()
    assert repr(robot) == "<hero_3: ready, Pose(x_m=0.000, y_m=0.000, yaw_rad=0.000)>"
    link.is_stopped = True
    assert robot.is_stopped and repr(robot).startswith("<hero_3: stopped")
    link.ready_s = math.inf
    assert repr(robot).startswith("<hero_3: connecting")
    link.clock.now_s += READY_TIMEOUT_S
    assert repr(robot).startswith("<hero_3: nothing subscribes")
    assert robot.connected and robot.age_s("odom") == 0.03
