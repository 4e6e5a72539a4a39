"""Programs of the examples that are ended as by Ctrl-C, or end by themselves: exit status, lights, robots at rest."""

import re
import sys
from contextlib import nullcontext

import pytest
import true_paths
from program_runs import Run

from hero_node import ProgramError
from hero_sim.stepped import StepSwarm
from hero_sim.stepped.swarm import StepWorld

pytest.importorskip("rospy", reason="the programs import rospy")
from geometry_msgs.msg import Point, Pose, PoseArray

from hero_examples import stock_names
from hero_examples.driving import go_to_goal, joy_driver, measure_delay, random_walk, teleop, teleop_joy
from hero_examples.swarm import explore, follow, led_show, swarm_go_to

DARK = (0.0, 0.0, 0.0)


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


@pytest.mark.slow
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


@pytest.mark.parametrize(("seed", "seeds"), [(0, [0, 1, 2]), (-1, [None] * 3)])
def test_each_explorer_has_a_seed_of_its_own_or_draws_one(monkeypatch, swarm, seed, seeds):
    given, make = [], explore.Explorer
    monkeypatch.setattr(explore.rospy, "Subscriber", lambda *arguments, **options: None)
    monkeypatch.setattr(
        explore, "Explorer", lambda robot, common, seed: given.append(seed) or make(robot, common, seed)
    )
    Run(monkeypatch, explore, swarm, 0.2, seed=seed)()
    assert given == seeds


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


@pytest.mark.parametrize(
    ("module", "limits"),
    [
        (go_to_goal, "tolerance_m 0.01 0.002..1, timeout_s 120 1..3600"),
        (joy_driver, "deadzone 0.05 0..0.9, autorepeat_rate 20 1..100"),
        (measure_delay, "turns 10 1..1000"),
        (random_walk, "linear_m_s 0.1 0..0.2, angular_rad_s 1.5 0.1..4, seed -1 -1..2147483648"),
        (teleop, "linear_m_s 0.1 0.02..0.2, angular_rad_s 1.5 0.25..4"),
        (
            teleop_joy,
            "linear_m_s 0.15 0.02..0.2, angular_rad_s 2 0.25..8, linear_axis 1 0..63, angular_axis 0 0..63,"
            " enable_button 4 0..63, stop_button 1 0..63, next_button 5 0..63",
        ),
        (explore, "idle_s 10 1..3600, seed -1 -1..2147483648"),
        (follow, "gap_m 0.15 0.1..2, linear_m_s 0.15 0.01..0.2"),
        (led_show, "period_s 4 0.5..60, brightness 1 0..1"),
        (swarm_go_to, "linear_m_s 0.08 0.01..0.2, tolerance_m 0.01 0.005..0.1, timeout_s 120 1..3600"),
    ],
)
def test_numbers_of_each_program_have_these_defaults_and_limits(monkeypatch, swarm, module, limits):
    """Many are in the README, too; those of rare use are only here."""
    run, found = Run(monkeypatch, module, swarm), []

    def read_parameters(declared):
        found.extend((name, own) for name, own in declared.items() if getattr(own, "limits", None))
        raise ProgramError("was asked")

    monkeypatch.setattr(module, "read_parameters", read_parameters)
    with pytest.raises(ProgramError, match="was asked"):
        run()
    texts = ("%s %g %.10g..%.10g" % (name, own.default, *own.limits) for name, own in found)
    assert ", ".join(texts) == limits


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("random_walk2", "rosrun hero_examples random_walk"),
        ("hero_demo", "rosrun hero_examples swarm_go_to"),
        ("tag2pose", "roslaunch hero_localization localization.launch"),
    ],
)
def test_programs_of_the_stock_packages_name_what_does_the_same_here(monkeypatch, old, new):
    monkeypatch.setattr(sys, "argv", [f"/ws/devel/lib/hero_examples/{old}.py"])
    with pytest.raises(ProgramError, match=re.escape(f"here it is: {new} (docs/migration.md)")):
        stock_names.main()
