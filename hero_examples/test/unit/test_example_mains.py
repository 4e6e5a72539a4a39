"""The main functions of the examples on robots in virtual time: which robots they take, how they end, and in what state."""

from contextlib import nullcontext

import pytest
import true_paths

from hero_client.controllers import Goal
from hero_node import Clock, ProgramError
from hero_node.parameters import check_parameters
from hero_sim.stepped import StepSwarm
from hero_sim.stepped.swarm import StepWorld

pytest.importorskip("rospy", reason="the programs import rospy")
from geometry_msgs.msg import Point, Pose, PoseArray

from hero_examples.driving import go_to_goal, random_walk, teleop_joy
from hero_examples.swarm import explore, follow, led_show, swarm_go_to

DARK = (0.0, 0.0, 0.0)


class Run:
    """A main function with robots that begin at id 0, and an end of the program after some time of the robots."""

    def __init__(self, monkeypatch, module, swarm, seconds=1e9, **given):
        self.module, self.asked = module, []
        run = self

        class Program(Clock):
            def __init__(self, name, anonymous=False):
                assert name == module.__name__.rpartition(".")[2]
                self._end_s = swarm.now_s + seconds

            def __enter__(self):
                return self

            def __exit__(self, *error):
                run.is_over = True

            @property
            def now_s(self):
                return swarm.now_s

            def sleep(self, duration_s):
                swarm.sleep(duration_s)
                return swarm.now_s < self._end_s

        def open_swarm(program, robot_ids, odom=True, proximity=True):
            self.asked.append((robot_ids, odom, proximity))
            return swarm

        monkeypatch.setattr(module, "Program", Program)
        monkeypatch.setattr(module, "open_swarm", open_swarm, raising=False)
        monkeypatch.setattr(module, "read_parameters", lambda declared: check_parameters(declared, given))

    def __call__(self):
        return self.module.main()


@pytest.fixture(name="swarm")
def make_swarm():
    with StepSwarm(3, seed=1, arena="empty", perfect=True) as swarm:
        yield swarm


@pytest.mark.parametrize(
    ("module", "asked"),
    [(random_walk, ([0], False, True)), (led_show, (None, False, False))],
)
def test_at_the_end_lights_are_out_and_robots_rest(monkeypatch, swarm, module, asked):
    run = Run(monkeypatch, module, swarm, 2.0)
    assert not run() and run.asked == [asked] and run.is_over
    assert {robot.light for robot in swarm} == {DARK} and true_paths.stop_within(swarm)


@pytest.mark.parametrize(
    ("seconds", "options", "status"),
    [(60.0, {"once": True}, 0), (2.0, {"once": True}, 1), (2.0, {}, 0), (60.0, {"timeout_s": 1.0}, None)],
)
def test_a_formation_ends_with_whether_it_was_reached(monkeypatch, swarm, seconds, options, status):
    run = Run(monkeypatch, swarm_go_to, swarm, seconds, formation={"shape": "circle", "spacing_m": 0.4}, **options)
    with pytest.raises(ProgramError, match="after 1 s not in place") if status is None else nullcontext():
        assert run() == status
    assert run.asked == [(None, True, True)] and (swarm.now_s < 60.0 or status is None)
    assert true_paths.stop_within(swarm)


@pytest.mark.parametrize(
    ("frontiers_until_s", "once", "end_s"), [(0.0, True, 1.0), (3.0, True, 4.0), (0.0, False, 6.0)]
)
def test_an_exploration_ends_some_time_after_the_last_frontier(monkeypatch, swarm, frontiers_until_s, once, end_s):
    run, callbacks, start_s = (
        Run(monkeypatch, explore, swarm, 6.0, once=once, idle_s=1.0, frame="world"),
        [],
        swarm.now_s,
    )

    def subscribe(topic, kind, receive, queue_size):
        assert (topic, kind) == ("/map_arena/frontiers", PoseArray)
        callbacks.append(receive)

    step = explore.explore_together

    def send_and_step(explorers, frontiers, now_s):
        step(explorers, frontiers, now_s)
        is_mapped = swarm.now_s >= start_s + frontiers_until_s - 0.05
        places = [] if is_mapped else [Pose(position=Point(9.0, 9.0, 0.0))]
        callbacks[0](PoseArray(poses=[Pose(position=Point(8.0, 8.0, 0.0))]))
        callbacks[0](PoseArray(poses=places))  # the newest counts

    monkeypatch.setattr(explore.rospy, "Subscriber", subscribe)
    monkeypatch.setattr(explore, "explore_together", send_and_step)
    assert not run() and run.asked == [(None, True, True)]
    assert swarm.now_s - start_s == pytest.approx(end_s, abs=0.35)
    assert {robot.light for robot in swarm} == {DARK} and true_paths.stop_within(swarm)


@pytest.mark.parametrize(
    ("reached", "given", "status", "goals"),
    [
        ([True] * 3, {"goals": "1 0; 2 0 90; 3 0", "once": True}, 0, 3),
        ([True, False, True], {"goals": "1 0; 2 0 90; 3 0", "once": True}, 1, 3),
        ([False] * 3, {}, 0, 0),
    ],
)
def test_goals_are_given_up_by_all_robots_before_the_first_one_closes(
    monkeypatch, swarm, reached, given, status, goals
):
    steps, start_s = [], swarm.now_s

    class Server:
        """Drives for a second."""

        busy = property(lambda self: self.is_driving and swarm.now_s < start_s + 1.0)

        def __init__(self, robot, tolerance_m, timeout_s, avoid):
            assert (tolerance_m, timeout_s, avoid) == (0.01, 120.0, False)
            self.robot, self.is_driving, self.reached = robot, False, reached[robot.robot_id]

        def put_goal(self, goal, frame):
            self.is_driving = True
            steps.append((self.robot.robot_id, goal, frame))

        def give_up(self):
            steps.append("give up")

        def close(self):
            steps.append("close")

    monkeypatch.setattr(go_to_goal, "GoToGoalServer", Server)
    run = Run(monkeypatch, go_to_goal, swarm, 5.0, robots="0-2", frame="map", **given)
    assert run() == status and run.asked == [([0, 1, 2], True, True)]
    assert steps[goals:] == ["give up"] * 3 + ["close"] * 3
    if goals:
        assert [step[0] for step in steps[:goals]] == [0, 1, 2] and {step[2] for step in steps[:goals]} == {"map"}
        assert steps[1][1] == Goal(2.0, 0.0, pytest.approx(1.5708, abs=1e-4))
    assert swarm.now_s - start_s == pytest.approx(1.0 if goals else 5.0, abs=0.11)


def test_a_leader_is_never_driven_by_its_followers_program(monkeypatch, swarm):
    run, driven = Run(monkeypatch, follow, swarm, 1.0, robots="2 0 1"), []
    chain = StepWorld([swarm[number] for number in (2, 0, 1)], swarm._clock)
    monkeypatch.setattr(
        follow, "Swarm", lambda ids, proximity: chain if (ids, proximity) == ([2, 0, 1], False) else None
    )
    for robot in swarm:
        send = robot._link.send_velocity
        robot._link.send_velocity = lambda *speeds, send=send, robot=robot: driven.append(robot.robot_id) or send(
            *speeds
        )
    assert not run() and set(driven) == {0, 1}
    for robots in ("all", "3"):
        with pytest.raises(ProgramError, match="must name a leader and at least one follower"):
            Run(monkeypatch, follow, swarm, 1.0, robots=robots)()


@pytest.mark.parametrize("name", ["enable_button", "next_button"])
def test_a_joystick_stops_by_a_button_of_its_own(monkeypatch, swarm, name):
    run = Run(monkeypatch, teleop_joy, swarm, **{name: 1})
    with pytest.raises(ProgramError, match="~stop_button is 1, the same as ~" + name):
        run()
    assert run.asked == []
