"""Figures show the numbers of the recording: delays, states, gaps and errors at their robot, time and size."""

import numpy as np
import pytest
from synthetic_bag import START_S

from hero_recording import analysis
from hero_recording.figures import STATE_COLORS, Figures
from hero_recording.observations import Observations, Origin, RobotObservations, StateReport

PERIOD_S = 0.1
END_S = 12.0


def add_odometry(robot, times_s, delay_s=0.0):
    """Add readings of a robot that drives along x at 0.1 m/s, beside a ground truth 0.02 m to the side."""
    robot.origins.append(Origin(0.0, 0.0, 0.0, 0.0))
    for time_s in times_s:
        x_m = 0.1 * time_s
        robot.odometry.add(START_S + time_s + delay_s, START_S + time_s, x_m, 0.0, 0.0, 0.1, 0.0)
        robot.ground_truth.add(START_S + time_s, START_S + time_s, x_m, 0.02, 0.1, 0.1, 0.0)


def add_start(robot, start_s, delay_s, left, right):
    """Add a command at start_s after which the wheels turn delay_s later, by so many ticks per reading."""
    for time_s in np.arange(start_s - 3.0, start_s + 1.0, 0.02):
        readings = max(0.0, round((time_s - start_s - delay_s) / 0.02, 3))
        robot.encoder.add(START_S + time_s, left * readings, right * readings)
    robot.commands.add(START_S + start_s, 0.1, 0.0)


def draw(*robots):
    seen = Observations()
    for robot_id, robot in enumerate(robots):
        seen.robots[robot_id] = robot
    return Figures(seen, START_S, START_S + END_S, "test.bag")


def test_each_robots_delays_are_drawn_in_its_row():
    robots = [RobotObservations() for _ in range(3)]
    add_odometry(robots[0], np.arange(0.0, 2.0, PERIOD_S), 0.03)
    add_odometry(robots[2], np.arange(0.0, 2.0, PERIOD_S), 0.05)
    for start_s, delay_s, robot_id, left, right in ((4.0, 0.1, 0, 3, 0), (9.0, 0.3, 0, 0, -3), (4.0, 0.2, 2, 3, 3)):
        add_start(robots[robot_id], start_s, delay_s, left, right)
    messages, motions = draw(*robots).draw_delays().axes
    crosses = [line.get_xydata()[0] for line in messages.lines if line.get_marker() == "x"]
    assert np.allclose(crosses, [(30.0, 0), (50.0, 2)], atol=0.1)
    dots = np.concatenate([line.get_xydata() for line in motions.lines if line.get_marker() == "o"])
    assert dots[:, 1].tolist() == [0, 0, 2]
    assert dots[:, 0] == pytest.approx([120.0, 320.0, 220.0], abs=21.0)
    bars = [line.get_xydata()[0] for line in motions.lines if line.get_marker() == "|"]
    assert bars[0] == pytest.approx([np.median(dots[:2, 0]), 0.0])
    assert motions.get_xlim()[0] == 0.0


def test_states_and_gaps_are_drawn_at_their_times():
    told, untold = RobotObservations(), RobotObservations()
    told.states += [StateReport(START_S + time_s, "ready", 0) for time_s in (2.0, 3.0, 4.0)]
    told.states.append(StateReport(START_S + 5.0, "away", 0))
    for robot in (told, untold):
        add_odometry(robot, [*np.arange(1.0, 3.0, PERIOD_S), *np.arange(6.0, 7.05, PERIOD_S)])
    axes = draw(told, untold).draw_connections().axes[0]
    bars = [(bar.get_x(), bar.get_width(), round(bar.get_y() + bar.get_height() / 2)) for bar in axes.patches]
    assert np.allclose(bars, [(2.0, 3.0, 0), (5.0, 0.02, 0)])
    assert bars and axes.patches[0].get_facecolor()[:3] != axes.patches[1].get_facecolor()[:3]
    lines = sorted((*segment[0], *segment[1]) for lines in axes.collections for segment in lines.get_segments())
    gap, whole = (2.9, 6.0), (1.0, 7.0)
    wanted = [(whole[0], 1, whole[1], 1), (gap[0], 0, gap[1], 0), (gap[0], 1, gap[1], 1)]
    assert np.allclose(lines, wanted)  # the thin line shows odometry of a robot without reports
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert texts[:-1] == [state for state in STATE_COLORS if state in ("ready", "away")]


def test_errors_of_odometry_and_of_localization_are_side_by_side():
    robot = RobotObservations()
    add_odometry(robot, np.arange(0.0, 4.0, PERIOD_S))
    robot.poses.add(START_S + 1.0, START_S + 1.0, 0.1, 0.025, 0.1)
    axes = draw(robot).draw_errors().axes
    assert [one.get_title() for one in axes] == ["odometry", "localization", "", ""]
    for one, value in zip(axes, (20.0, 5.0, np.degrees(-0.1), 0.0)):
        assert one.lines[0].get_ydata()[-1] == pytest.approx(value, abs=1e-4)
    assert all(one.get_ylim()[0] == 0.0 for one in axes[:2])


def test_with_many_robots_the_largest_last_errors_have_their_ids():
    robots = [RobotObservations() for _ in range(20)]
    for robot_id, robot in enumerate(robots):
        robot.origins.append(Origin(0.0, 0.0, 0.0, 0.0))
        for step, side_m in enumerate((1.0 - 0.01 * robot_id, 0.01 * robot_id)):  # the first errors rank otherwise
            robot.odometry.add(START_S + step, START_S + step, 0.0, side_m, 0.0, 0.0, 0.0)
            robot.ground_truth.add(START_S + step, START_S + step, 0.0, 0.0, 0.0, 0.0, 0.0)
    axes = draw(*robots).draw_errors().axes[0]
    labels = {text.get_text(): text.xy for text in axes.texts}
    assert labels and set(labels) == {str(robot_id) for robot_id in range(20 - len(labels), 20)}
    assert labels["19"] == pytest.approx((1.0, 190.0))


def test_an_error_is_known_only_near_a_reading_of_the_ground_truth():
    robot = RobotObservations()
    add_odometry(robot, np.arange(0.0, 4.0, PERIOD_S))
    late_s = START_S + 4.0 + 2.0 * analysis.SAME_TIME_S
    robot.odometry.add(late_s, late_s, 0.4, 0.0, 0.0, 0.1, 0.0)
    assert len(analysis.compute_odometry_errors(robot).times_s) == 40
