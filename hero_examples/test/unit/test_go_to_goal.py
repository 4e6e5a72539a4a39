"""Goals in virtual time: reached within their tolerance with and without obstacles, replaced, cancelled, given up."""

import math
import random

import numpy as np
import pytest
import true_paths

from hero_client.apps.goals import MAX_QUEUED_GOALS, GoalQueue, GoalRequest, InvalidGoalError
from hero_client.controllers import Goal
from hero_client.values.errors import GoalError
from hero_sim.stepped import StepSwarm
from hero_sim.world import load_arena
from hero_test.nonempty import nonempty

WORLDS = 30
TOLERANCE_M = 0.01
TRUE_TOLERANCE_M = 0.015
"""With what odometry may be off."""

ROUND_THE_POST = """
walls_m: [[[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]]
circles_m: [[0, 0, 0.06]]
starts_m_deg: [[-0.4, 0.02, 0]]
"""


def start_each(swarm, choose_goal, **options):
    """Start a motion of each robot to a goal in world; return the motions and the goals."""
    goals = [choose_goal(world) for world in range(len(swarm.robots))]
    return [robot.start_go_to(*goal, frame="world", **options) for robot, goal in zip(swarm, goals)], goals


@pytest.mark.slow
def test_random_goals_are_reached_and_no_robot_swings_there():
    rng = random.Random(5)
    with StepSwarm(1, seed=1, arena="empty", perfect=True, worlds=WORLDS) as swarm:
        log = swarm.log()
        motions, goals = start_each(
            swarm, lambda world: (rng.uniform(-0.6, 0.6), rng.uniform(-0.6, 0.6), rng.uniform(-math.pi, math.pi))
        )
        for motion in motions:
            motion.result()
        for path, goal in nonempty(zip(true_paths.split_worlds(log), goals)):
            distances_m = np.hypot(*(path[:, 0, :2] - goal[:2]).T)
            assert distances_m[-1] < TRUE_TOLERANCE_M
            assert abs(math.remainder(path[-1, 0, 2] - goal[2], math.tau)) < 0.12
            arrived = np.argmax(distances_m < TOLERANCE_M)
            assert distances_m[arrived:].max() < 2.0 * TRUE_TOLERANCE_M
        assert true_paths.stop_within(swarm)


@pytest.mark.slow
@pytest.mark.parametrize("avoid", [True, False])
def test_a_post_in_the_way_is_avoided_or_named_and_never_touched(tmp_path, avoid):
    arena = tmp_path / "post.yaml"
    arena.write_text(ROUND_THE_POST)
    rng = random.Random(7)
    with StepSwarm(1, seed=1, arena=str(arena), worlds=WORLDS) as swarm:
        log = swarm.log()
        motions, goals = start_each(swarm, lambda world: (0.4, rng.uniform(-0.05, 0.05)), avoid=avoid)
        errors = [motion.exception() for motion in motions]
        for path, goal, error in nonempty(zip(true_paths.split_worlds(log), goals, errors)):
            assert true_paths.measure_wall_gaps(path, load_arena(str(arena))).min() > 0.005
            if avoid:
                assert error is None and math.dist(path[-1, 0, :2], goal) < 0.1  # odometry has drifted
            else:
                assert "an obstacle is in the way" in str(error)
        assert true_paths.stop_within(swarm)


class NotedQueue(GoalQueue):
    """Notes what a server would tell clients and the log."""

    def __init__(self, robot, avoid):
        super().__init__(robot, avoid)
        self.accepted, self.progress, self.outcomes = [], [], []

    def accept_goal(self, request):
        self.accepted.append(request)

    def show_progress(self, request, distance_m, elapsed_s):
        self.progress.append(elapsed_s)

    def end_goal(self, request, outcome):
        self.outcomes.append(outcome)


class Goals:
    """The goals of one robot, and what happens while it drives."""

    def __init__(self, arena="empty", avoid=False):
        self.swarm = StepSwarm(1, arena=arena, perfect=True)
        self.queue = NotedQueue(self.swarm[0], avoid)
        self.events = []

    def put(self, *goal, timeout_s=60.0, frame="", handle=None):
        self.queue.put(GoalRequest(Goal(*goal), frame, TOLERANCE_M, timeout_s, handle))

    def drive(self):
        """Drive to all goals; events, a list of (time s, function), happen meanwhile."""

        def wait(duration_s):
            self.swarm.sleep(duration_s)
            while self.events and self.events[0][0] <= self.swarm.now_s:
                self.events.pop(0)[1]()

        while self.queue.drive_to_next(wait):
            continue
        assert true_paths.stop_within(self.swarm)


@pytest.fixture()
def goals():
    return Goals()


def test_a_goal_is_reported_on_the_way_and_at_its_end(goals):
    goals.put(0.2, 0.0)
    assert goals.queue.busy
    goals.drive()
    (outcome,) = goals.queue.outcomes
    assert outcome.reached and outcome.reason == "" and outcome.distance_m < TOLERANCE_M
    assert goals.queue.reached and not goals.queue.busy
    assert np.diff(goals.queue.progress) == pytest.approx(0.5, abs=0.1) and len(goals.queue.progress) > 4


@pytest.mark.parametrize("avoid", [True, False])
def test_a_goal_behind_a_post_is_reached_only_by_going_around_it(tmp_path, avoid):
    arena = tmp_path / "post.yaml"
    arena.write_text(ROUND_THE_POST)
    goals = Goals(str(arena), avoid)
    goals.put(0.8, 0.0)
    goals.drive()
    assert goals.queue.reached == avoid


def test_a_new_goal_replaces_the_old_one(goals):
    goals.put(0.5, 0.0)
    goals.events = [(1.0, lambda: goals.put(0.0, 0.1))]
    goals.drive()
    first, second = goals.queue.outcomes
    assert not first.reached and first.gave_up and first.reason == "another goal came"
    assert first.elapsed_s < 1.3
    assert second.reached and goals.queue.reached
    assert math.dist(goals.swarm[0].pose[:2], (0.0, 0.1)) < TRUE_TOLERANCE_M


def test_a_goal_around_obstacles_fails_for_sensors_without_calibration():
    with StepSwarm(1, seed=1, arena="empty") as swarm:
        swarm.rows.set_infrared_calibration(0, np.full(8, math.nan))
        swarm.sleep(0.3)
        log, start_s = swarm.log(), swarm.now_s
        with pytest.raises(GoalError, match="cannot go around obstacles: its infrared sensors are not calibrated"):
            swarm[0].go_to(0.3, 0.0, avoid=True)
        assert swarm.now_s - start_s < 3.0
        assert np.ptp(log.true_pose[:, 0, 0], axis=0).max() < 1e-6


def stream(goals, count, put):
    """Call put(n) for each of count goals, 10 times a second, and drive to the last one."""
    goals.events = [(0.1 * number, lambda number=number: put(number)) for number in range(1, count)]
    put(0)
    goals.drive()


def test_a_stream_of_goals_is_followed_without_a_stop(goals, monkeypatch):
    sent, send = [], goals.swarm.rows.send_velocity
    monkeypatch.setattr(
        goals.swarm.rows, "send_velocity", lambda row, *velocity: (sent.append(velocity), send(row, *velocity))
    )
    stream(goals, 40, lambda number: goals.put(0.3 + 0.005 * number, 0.0))
    assert len(goals.queue.accepted) == 40 and goals.queue.reached and not goals.queue.busy
    assert [outcome.reason for outcome in goals.queue.outcomes] == ["another goal came"] * 39 + [""]
    assert math.dist(goals.swarm[0].pose[:2], (0.495, 0.0)) < TOLERANCE_M
    assert all(linear_m_s > 0.0 for linear_m_s, _ in nonempty(sent[:40]))
    assert goals.swarm.now_s < 8.0


def test_of_goals_that_wait_only_the_newest_is_driven_to(goals):
    for y_m in (0.3, 0.2, 0.1):
        goals.put(0.0, y_m)
    goals.drive()
    assert [request.goal.y_m for request in goals.queue.accepted] == [0.1]
    assert [outcome.gave_up for outcome in goals.queue.outcomes] == [True, True, False]


def test_the_time_limit_of_a_goal_begins_with_it_and_names_it(goals):
    stream(goals, 30, lambda number: goals.put(50.0 + number, 0.0, timeout_s=2.0))
    assert [outcome.gave_up for outcome in goals.queue.outcomes] == [True] * 29 + [False]
    assert "reach (79, 0): not there after 2 s" in goals.queue.outcomes[-1].reason


def test_goals_in_another_frame_start_over(goals):
    stream(goals, 2, lambda number: goals.put(0.2, 0.0, frame=("", "robot")[number]))
    assert [request.frame for request in goals.queue.accepted] == ["", "robot"]
    assert goals.queue.reached and goals.swarm[0].pose.x_m > 0.2


def test_a_cancelled_goal_ends_and_another_ones_cancellation_does_not(goals):
    goals.put(0.5, 0.0, handle="mine")
    goals.events = [(1.0, lambda: goals.queue.cancel("another")), (2.0, lambda: goals.queue.cancel("mine"))]
    goals.drive()
    (outcome,) = goals.queue.outcomes
    assert outcome.gave_up and outcome.reason == "cancelled" and 2.0 <= outcome.elapsed_s < 2.3
    goals.put(0.1, 0.0, handle="next")
    goals.drive()
    assert goals.queue.reached


def test_the_end_of_the_program_gives_up_all_goals(goals):
    goals.put(0.5, 0.0)
    goals.events = [(1.0, goals.queue.give_up)]
    goals.drive()
    assert [outcome.reason for outcome in goals.queue.outcomes] == ["the program ends"]
    goals.put(0.1, 0.0)
    assert not goals.queue.drive_to_next(goals.swarm.sleep)


def test_a_goal_out_of_reach_or_in_an_unknown_frame_fails_with_the_reason(goals):
    goals.put(50.0, 0.0, timeout_s=1.0)
    goals.drive()
    goals.put(0.1, 0.0, frame="nowhere")
    goals.drive()
    late, lost = goals.queue.outcomes
    assert not late.reached and not late.gave_up and "not there after 1 s" in late.reason
    assert not lost.reached and "nowhere" in lost.reason and math.isnan(lost.distance_m)


def test_goals_are_refused_when_too_many_wait(goals):
    for _ in range(MAX_QUEUED_GOALS):
        goals.put(0.1, 0.0)
    with pytest.raises(InvalidGoalError, match="more than 100 goals"):
        goals.put(0.1, 0.0)
