"""led_show in virtual time: the lights that robots truly show."""

import pytest
import true_paths
from program_runs import Run

from hero_sim.stepped import StepSwarm

pytest.importorskip("rospy", reason="the program imports rospy")
from hero_examples.swarm import led_show
from hero_test.nonempty import nonempty

ROBOTS = 5
PERIOD_S = 2.0


def show(pattern, brightness=1.0, duration_s=PERIOD_S):
    """Return the lights of all robots after each step."""
    swarm = StepSwarm(ROBOTS)
    rows = []

    def step(time_s):
        rows.append([robot.light for robot in swarm])
        led_show.step(swarm, led_show.PATTERNS[pattern], time_s / PERIOD_S % 1.0, brightness)

    true_paths.run(swarm, step, duration_s, hz=5.0)
    return rows[1:]


def test_chase_lights_one_robot_after_the_other():
    white, dark = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
    lit = [[number for number, light in enumerate(lights) if light == white] for lights in show("chase")]
    assert [numbers for one, numbers in zip([[]] + lit, lit) if numbers != one] == [[0], [1], [2], [3], [4]]
    assert all(lights.count(dark) == ROBOTS - 1 for lights in nonempty(show("chase")))


def test_rainbow_gives_every_robot_another_color_that_wanders_on():
    rows = show("rainbow", duration_s=2.0 * PERIOD_S)
    assert all(len(set(lights)) == ROBOTS for lights in rows)
    assert rows[0][1] == pytest.approx(rows[2][0])  # a fifth of the period later
    assert all(now == pytest.approx(later) for now, later in nonempty(zip(rows[0], rows[10])))  # a period later


def test_blink_alternates_between_red_and_blue_together():
    rows = show("blink")
    assert {tuple(set(lights)) for lights in rows} == {((1.0, 0.0, 0.0),), ((0.0, 0.0, 1.0),)}


def test_brightness_dims_every_color():
    assert max(max(light) for lights in show("rainbow", 0.25) for light in lights) == 0.25


def test_the_program_shows_what_its_parameters_say(monkeypatch):
    for duration_s, color in ((0.5, (0.25, 0.0, 0.0)), (1.5, (0.0, 0.0, 0.25))):
        with StepSwarm(2) as swarm:
            monkeypatch.setattr(swarm, "led", lambda color: None)  # which ends it
            Run(monkeypatch, led_show, swarm, duration_s, pattern="blink", period_s=2.0, brightness=0.25)()
            assert [robot.light for robot in swarm] == [color] * 2


def test_patterns_go_through_their_colors_once_a_period():
    assert led_show.rainbow(0.0, 0.0, False) == (1.0, 0.0, 0.0)
    assert led_show.rainbow(0.5, 0.5 + 1.0 / 3.0, False) == pytest.approx((0.0, 1.0, 0.0))
    assert [led_show.blink(phase, 0.0, False) for phase in (0.49, 0.5)] == [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    with StepSwarm(3) as swarm:
        led_show.step(swarm, led_show.rainbow, 0.0)
        swarm.sleep(0.2)
        assert [robot.light for robot in swarm] == [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
