"""Several robots in virtual time: each gets its command, and what one lacks is told by its name."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from linkless_robot import FakeSwarm

from hero_client.controllers.pose_check import FROZEN
from hero_client.robots.common_frame import CommonFrame
from hero_client.robots.group import wait_for_all
from hero_client.robots.swarm_base import FIRST_REPORT_S, POLL_HZ, REPORT_PERIOD_S
from hero_client.values.errors import FrameError, GoalError, RobotNotReadyError, StaleDataError, StoppedError
from hero_client.values.readings import NOT_CALIBRATED
from hero_node import Pose, ProgramError, Velocity
from hero_node.robot_constants import MODELS
from hero_node.texts import NAMES_SHOWN
from hero_test.nonempty import nonempty


def test_robots_are_taken_by_their_numbers():
    swarm = FakeSwarm(4, 2)
    assert [robot.name for robot in swarm] == ["hero_4", "hero_2"] and swarm[2] is swarm.robots[1]
    assert 2 in swarm and swarm[4] in swarm and 3 not in swarm and len(swarm) == 2
    with pytest.raises(KeyError, match="hero_0 is not in this swarm: hero_4, hero_2"):
        swarm[0]
    with pytest.raises(KeyError, match="it has no robots"):
        FakeSwarm()[0]
    for wrong in (slice(0, 1), "2", (2,), [2]):
        with pytest.raises(TypeError, match="is hero_3"):
            swarm[wrong]
    swarm.links[0].ready_s += 1.0
    assert repr(swarm) == "<Swarm of hero_4, hero_2: 1 of 2 ready>"
    assert repr(FakeSwarm()) == "<Swarm of no robots: 0 of 0 ready>"


def test_arrays_have_a_row_for_each_robot_and_nan_where_data_are_old():
    swarm = FakeSwarm(9, 2, 4)
    swarm.sleep(3.0)
    for row, link in enumerate(swarm.links):
        link.pose, link.velocity, link.ranges = Pose(row, 2.0, 0.1), Velocity(0.1 * row, 1.0), [0.1 + row] * 8
    swarm.links[1].silent_s = {"odom": 1.1, "proximity": 1.1}
    assert swarm.pose_array[[0, 2]].tolist() == [[0.0, 2.0, 0.1], [2.0, 2.0, 0.1]]
    assert swarm.velocity_array[[0, 2]].tolist() == [[0.0, 1.0], [0.2, 1.0]]
    assert swarm.proximity_array[[0, 2]].tolist() == [[0.1] * 8, [2.1] * 8]
    for array, columns in ((swarm.pose_array, 3), (swarm.velocity_array, 2), (swarm.proximity_array, 8)):
        assert array.shape == (3, columns) and np.isnan(array[1]).all()
    swarm.links[1].localized = Pose(0.5, 0.6, 0.7)
    assert swarm.poses[2] == (0.5, 0.6, 0.7) and list(swarm.poses) == [9, 2, 4]


def test_first_data_of_a_swarm_are_waited_for():
    for read, topic in (
        (lambda swarm: swarm.pose_array, "odom"),
        (lambda swarm: swarm.velocity_array, "odom"),
        (lambda swarm: swarm.proximity_array, "proximity"),
    ):
        swarm = FakeSwarm(0, 1)
        swarm.links[1].silent_s.pop(topic)
        read(swarm)
        assert swarm.links[1].waited == [(topic, 2.0, 1)] and swarm.links[0].waited == []


def test_a_command_goes_to_all_robots():
    swarm = FakeSwarm(5, 2)
    swarm.drive(0.1, 0.2)
    swarm.led("red")
    swarm.blink("blue", 2.0)
    swarm.drive(0.1, 0.0, 0.2)
    assert [velocity for _, *velocity in swarm.links[1].sent] == [[0.1, 0.2], [0.1, 0.0], [0.1, 0.0], [0.0, 0.0]]
    assert swarm.links[0].sent == swarm.links[1].sent
    assert [link.colors for link in swarm.links] == [[(0.0, (1.0, 0.0, 0.0)), (0.0, (0.0, 0.0, 1.0))]] * 2
    swarm.close()
    assert [link.closed for link in swarm.links] == [1, 1]


def test_motions_of_all_robots_run_at_once():
    swarm = FakeSwarm(0, 1)
    swarm.forward(-0.2, 0.2)
    assert swarm.now_s < 105.0
    swarm.turn(1.0, 2.0)
    swarm.go_to(0.1, 0.2, tolerance_m=0.01)
    for link in nonempty(swarm.links):
        assert min(velocity[1] for velocity in link.sent) == pytest.approx(-0.16)
        assert max(velocity[2] for velocity in link.sent) > 1.4
        assert link.pose[:2] == pytest.approx((0.1, 0.2), abs=0.01) and link.velocity == (0.0, 0.0)
    with pytest.raises(TypeError, match="the goal of each robot"):
        swarm.go_to(0.1)


def test_errors_of_all_robots_are_told():
    swarm = FakeSwarm(8, 4, 6)
    for link in swarm.links[1:]:
        link.ready_s = math.inf
    with pytest.raises(GoalError, match=r"hero_4 is not ready after 2 s: .*; hero_6 is not ready"):
        swarm.go_to(0.1, 0.0)
    assert swarm.links[0].pose.x_m == pytest.approx(0.1, abs=0.01), "the others reach their goals"
    swarm.links[2].ready_s = 0.0
    with pytest.raises(RobotNotReadyError, match="^hero_4 is not ready after 2 s: nothing subscribes"):
        swarm.turn(0.2)
    broken = SimpleNamespace(exception=lambda: KeyError("ours"))
    with pytest.raises(KeyError):
        swarm._wait_for([broken, broken])


@pytest.mark.slow
def test_robots_cross_without_touching_and_those_without_a_goal_stay():
    swarm = FakeSwarm(7, 3, 12)
    swarm.links[2].model = MODELS["hero_plus"]
    swarm.go_to({7: (0.0, 0.5), 3: (0.0, 0.0)}, frame="world", tolerance_m=0.02)
    for link, place in nonempty(zip(swarm.links, ((0.0, 0.5), (0.0, -0.5), (0.0, 0.0)))):
        assert link.pose[:2] == pytest.approx(place, abs=0.02), "each in its own odometry"
        assert link.velocity == (0.0, 0.0)


def test_goals_too_near_to_each_other_or_to_a_robot_that_stays_are_refused():
    swarm = FakeSwarm(0, 1, 2)
    for goals, says in (
        ({0: (0.3, 0.0), 1: (0.3, 0.17)}, "hero_0 and hero_1 are 0.170 m apart: robots need 0.178 m"),
        ({0: (0.0, 0.9)}, "hero_0 and hero_2 are 0.100 m apart"),
        ({2: (0.0, 0.4)}, "hero_1 and hero_2 are 0.100 m apart"),
    ):
        with pytest.raises(GoalError, match=says):
            swarm.go_to_each(goals, frame="world")
    swarm.links[2].model = MODELS["hero_plus"]
    with pytest.raises(GoalError, match="hero_0 and hero_1 are 0.220 m apart: robots need 0.224 m"):
        swarm.go_to_each({0: (0.3, 0.0), 1: (0.3, 0.22)}, frame="world")
    swarm.links[2].origin = Pose(0.1, 0.5, 0.0)  # beside hero_1, and both stay
    swarm.go_to_each({0: (0.1, 0.0)}, frame="world", tolerance_m=0.02)
    with pytest.raises(TypeError, match=r"the goal of hero_0 must be \(x m, y m\)"):
        swarm.go_to_each({0: 0.3})
    with pytest.raises(KeyError):
        swarm.go_to_each({7: (0.3, 0.0)})


def test_robots_that_do_not_arrive_are_named_and_all_are_stopped():
    def stop_all(swarm):
        swarm.links[1].is_stopped = True

    def lose_pose(swarm):
        swarm.links[1].localized = StaleDataError("the pose of hero_1 is old")

    def end(swarm):
        swarm._clock.is_to_continue = False

    for spoil, error, says in (
        (lambda swarm: None, GoalError, "^no goal is reached by hero_0: not there after 3 s$"),
        (stop_all, StoppedError, "hero_1 does not move"),
        (lose_pose, GoalError, "no goal is reached: hero_1: no pose for 2 s: the pose of hero_1 is old$"),
        (end, GoalError, "by hero_0: cancelled"),
    ):
        swarm = FakeSwarm(0, 1)
        motion = swarm[0].start_go_to(9.0, 0.0)
        started_s = swarm.now_s

        def spoil_later(step_s, swarm=swarm, spoil=spoil, motion=motion):
            assert motion.done(), "it ended before the swarm began"
            if swarm.now_s > 101.0:
                spoil(swarm)

        swarm._clock.joined.append(SimpleNamespace(advance=spoil_later))
        with pytest.raises(error, match=says):
            swarm.go_to_each({0: (9.0, 0.0)}, frame="world", timeout_s=3.0)
        assert motion.done() and swarm.now_s - started_s < 3.4
        assert all(
            velocity == [0.0, 0.0] for link in nonempty(swarm.links) for _, *velocity in nonempty(link.sent[-1:])
        )


def test_without_poses_go_to_each_stops_at_once_and_ends_after_two_seconds():
    swarm = FakeSwarm(4, 1)
    ahead = StaleDataError("the pose of hero_1 is stamped 3600.0 s ahead")

    def lose_pose_now_and_then(step_s):
        passed_s = swarm.now_s - 100.0
        swarm.links[1].localized = ahead if 1.0 < passed_s < 2.9 or passed_s > 4.0 else None

    swarm._clock.joined.append(SimpleNamespace(advance=lose_pose_now_and_then))
    with pytest.raises(GoalError, match="no goal is reached: hero_1: no pose for 2 s: .* stamped 3600.0 s ahead"):
        swarm.go_to_each({4: (9.0, 0.0)}, frame="world")
    assert swarm.now_s - 100.0 == pytest.approx(6.0, abs=0.3), "1.9 s before were no reason to end"
    assert not any(velocity for sent_s, *velocity in swarm.links[0].sent if 1.1 < sent_s < 2.8 for velocity in velocity)


def test_robots_that_cannot_see_drive_by_their_poses_and_are_named():
    swarm = FakeSwarm(3, 8, 5)
    swarm.links[1].ranges = swarm.links[2].ranges = [math.nan] * 8
    swarm.go_to_each({3: (0.2, 0.0), 8: (0.2, 0.5)}, frame="world", tolerance_m=0.02)
    assert [link.warned for link in swarm.links] == [
        [],
        ["hero_8 drives by its pose alone: " + NOT_CALIBRATED],
        [],
    ], "the last one rests"


def test_what_is_waited_for_is_reported_now_and_then_and_its_end_once():
    swarm = FakeSwarm(0, 1)
    swarm.links[1].ready_s += FIRST_REPORT_S + REPORT_PERIOD_S + 1.0
    for _ in range(200):
        swarm.sleep(0.1)
        swarm.report_missing()
    first_s, second_s = FIRST_REPORT_S, FIRST_REPORT_S + REPORT_PERIOD_S
    assert [line[0] for line in swarm.logged] == pytest.approx([first_s, second_s, second_s + 1.0], abs=0.21)
    assert [line[1:] for line in swarm.logged] == [("warn", "hero_1: waiting: nothing subscribes")] * 2 + [
        ("info", "hero_1 answers")
    ]
    swarm.sleep(REPORT_PERIOD_S)
    swarm.report_missing({"hero_0": None, "hero_1": "its pose"})
    assert swarm.logged[-1][2] == "hero_1: waiting: its pose"


def test_of_many_robots_that_are_not_ready_some_are_named():
    swarm = FakeSwarm(*range(NAMES_SHOWN + 1))
    many = ((NAMES_SHOWN, "hero_9 are not"), (NAMES_SHOWN + 1, "hero_9 and 1 more are"))
    for count, says in ((1, "hero_0 is not ready after 0.5 s"), *many):
        for link in swarm.links[:count]:
            link.ready_s = math.inf
        with pytest.raises(RobotNotReadyError) as raised:
            swarm.wait_until_ready(0.5)
        assert says in str(raised.value)
    assert swarm.now_s == pytest.approx(101.5)
    steps = wait_for_all(swarm.robots, 0.03)
    assert [next(steps), steps.send(True)] == [0.02, 0.02], "polls, of which the last one comes after the time"
    started_s = swarm.now_s
    with pytest.raises(RobotNotReadyError, match="after 10 s"):
        swarm.wait_until_ready()
    assert swarm.now_s - started_s == pytest.approx(10.0)
    for link in swarm.links:
        link.ready_s = 0.0
    assert swarm.wait_until_ready() is swarm


def test_poses_in_one_frame_are_waited_for_and_their_absence_told():
    swarm, frame = FakeSwarm(0, 1), CommonFrame("world")
    assert frame.pose_of(swarm[1]) == (0.0, 0.5, 0.0) and frame.missing == {"hero_1": None}
    swarm.links[1].silent_s["odom"] = 1.1
    swarm.links[1].ready_s = math.inf
    assert frame.pose_of(swarm[1]) is None and frame.missing["hero_1"] == "nothing subscribes"
    swarm.links[1].silent_s["odom"] = 0.1
    for error in (StaleDataError("is old"), FrameError("was never measured")):
        swarm.links[1].localized = error
        assert frame.pose_of(swarm[1]) is None and frame.missing["hero_1"] == str(error)

    swarm.links[0].localized = Pose(1.0, 1.0, 0.0)
    swarm.links[0].velocity = Velocity(0.125, 0.0)
    for _ in range(32):
        pose = frame.pose_of(swarm[0])
        assert (pose is None) == (frame.missing["hero_0"] == FROZEN), "what is not where the robot is is no pose"
        swarm.sleep(0.125)
    assert pose is None
    swarm.links[0].localized, swarm.links[0].velocity = None, Velocity(0.0, 0.0)
    swarm.links[0].pose = Pose(0.0, 0.0, 0.0)

    def measure_later(step_s):
        swarm.links[1].localized = None if swarm.now_s > 108.0 else swarm.links[1].localized

    swarm._clock.joined.append(SimpleNamespace(advance=measure_later))
    assert swarm.wait_for_poses(frame) == [(0.0, 0.0, 0.0), (0.0, 0.5, 0.0)]
    assert swarm.now_s == pytest.approx(108.0, abs=1.01 / POLL_HZ)
    assert [text for _, _, text in swarm.logged] == ["hero_1: waiting: was never measured"]
    swarm._clock.is_to_continue = False
    with pytest.raises(ProgramError, match="ended before all robots were there"):
        swarm.wait_for_poses(frame)
