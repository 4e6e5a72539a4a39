"""Figures show the numbers of the recording: speeds, paths and errors at their robot, time and size."""

import math

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from synthetic_bag import START_S

from hero_client.values import BODY_RADIUS_M
from hero_recording.plots import analysis
from hero_recording.plots.figures import STYLE, Figures
from hero_recording.plots.observations import Observations, Origin, RobotObservations
from hero_test.nonempty import maybe_empty, nonempty

PERIOD_S = 0.1
END_S = 12.0


def add_odometry(robot, times_s, delay_s=0.0):
    """Add readings of a robot that drives along x at 0.1 m/s, beside a ground truth 0.02 m to the side."""
    robot.origins.append(Origin(0.0, 0.0, 0.0, 0.0))
    for time_s in times_s:
        x_m = 0.1 * time_s
        robot.odometry.add(START_S + time_s + delay_s, START_S + time_s, x_m, 0.0, 0.0, 0.1, 0.0)
        robot.ground_truth.add(START_S + time_s, START_S + time_s, x_m, 0.02, 0.1, 0.1, 0.0)


def draw(*robots):
    seen = Observations()
    for robot_id, robot in enumerate(robots):
        seen.robots[robot_id] = robot
    return Figures(seen, START_S, START_S + END_S, "test.bag")


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
    canvas = FigureCanvasAgg(axes.figure)
    canvas.draw()
    for text in nonempty(axes.texts):
        box, end_px = text.get_window_extent(canvas.get_renderer()), axes.transData.transform(text.xy)
        assert np.abs(np.array(((box.x0 + box.x1) / 2.0, (box.y0 + box.y1) / 2.0)) - end_px).max() < 30.0, (
            "beside its end"
        )


def test_an_error_is_known_only_near_a_reading_of_the_ground_truth():
    robot = RobotObservations()
    add_odometry(robot, np.arange(0.0, 4.0, PERIOD_S))
    late_s = START_S + 4.0 + 2.0 * analysis.SAME_TIME_S
    robot.odometry.add(late_s, late_s, 0.4, 0.0, 0.0, 0.1, 0.0)
    assert len(analysis.compute_odometry_errors(robot).times_s) == 40


def make_driven(count):
    """Return robots with all that figures show, side by side."""
    robots = [RobotObservations() for _ in range(count)]
    for number, robot in enumerate(robots):
        add_odometry(robot, np.arange(0.0, 4.0, PERIOD_S), 0.01 * number)
        robot.commands.add(START_S + 4.0, 0.1, 0.0)
        robot.poses.add(START_S + 1.0, START_S + 1.0, 0.1, 0.025 + number, 0.1)
        robot.poses.add(START_S + 2.0, START_S + 2.0, 0.2, 0.025 + number, math.pi / 3.0)
    return robots


FIGURES = ("paths", "speeds", "errors")


def draw_page(name, robots, duration_s=END_S):
    seen = Observations()
    seen.robots.update(enumerate(robots))
    seen.walls_m, seen.pose_frame, seen.true_frame = [(-1.0, 0.0, 1.0, 0.5)], "map", "map"
    with rc_context(STYLE):
        return getattr(Figures(seen, START_S, START_S + duration_s, "test.bag"), "draw_" + name)()


@pytest.mark.slow
def test_a_page_grows_with_its_robots():
    for name, count, height_in in (
        ("paths", 9, 8.0), ("errors", 9, 6.0), ("speeds", 3, 5.7), ("speeds", 9, 13.2),
    ):  # fmt: skip
        robots = make_driven(1) + [RobotObservations() for _ in range(count - 1)]
        for robot in robots if name == "speeds" else ():
            robot.odometry.add(START_S, START_S, 0.0, 0.0, 0.0, 0.0, 0.0)
        assert draw_page(name, robots).get_size_inches() == pytest.approx((9.0, height_in)), (name, count)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "count"), [("paths", 2), ("speeds", 2), ("errors", 2)])
def test_texts_of_a_page_lie_on_it_and_apart(name, count):
    figure = draw_page(name, make_driven(count))
    FigureCanvasAgg(figure).draw()
    renderer, page = figure.canvas.get_renderer(), figure.bbox
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]
    title, subtitle = figure._suptitle, next(text for text in figure.texts if "test.bag" in text.get_text())
    assert title.get_fontsize() == 12.0 and title.get_fontweight() == "bold"
    labels = [label for axes in figure.axes for label in (axes.title, axes.xaxis.label, axes.yaxis.label)]
    for part in (*legends, title, subtitle, *(label for label in labels if label.get_text())):
        extent = part.get_window_extent(renderer)
        assert page.x0 <= extent.x0 and extent.x1 <= page.x1 + 1 and page.y0 <= extent.y0 and extent.y1 <= page.y1 + 1
    tops = [axes.title.get_window_extent(renderer).y1 for axes in figure.axes]
    assert subtitle.get_window_extent(renderer).y0 >= max(tops) - 1
    assert {text.get_fontsize() for text in (subtitle, *(text for one in legends for text in one.get_texts()))} == {8.0}
    for legend in maybe_empty(legends):
        names = [text.get_text() for text in legend.get_texts()]
        assert ("hero_1" in names) == (count == 2 and name in ("paths", "errors"))


@pytest.mark.slow
def test_every_figure_says_what_its_axes_are():
    labels = {}
    for name in FIGURES:
        figure = draw_page(name, make_driven(2))
        labels[name] = [(axes.get_title(), axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]
    assert labels["paths"] == [("frame map", "x (m)", "y (m)")]
    assert labels["speeds"] == [
        ("linear (m/s)", "", "hero_0"), ("angular (rad/s)", "", ""), ("", "time (s)", "hero_1"), ("", "time (s)", "")
    ]  # fmt: skip
    heading = "heading error (degrees),\npositive: counter-clockwise"
    assert labels["errors"] == [
        ("odometry", "", "position error (mm)"), ("localization", "", ""),
        ("", "time (s)", heading), ("", "time (s)", ""),
    ]  # fmt: skip
    for name in ("speeds", "errors"):
        (above, _, below, _) = draw_page(name, make_driven(2)).axes
        assert above.get_shared_x_axes().joined(above, below), "one time for all"
    for name in ("speeds", "errors"):
        for axes in nonempty(draw_page(name, make_driven(2)).axes):
            assert axes.get_xlim() == (0.0, END_S)
        assert draw_page(name, make_driven(1), duration_s=0.0).axes[0].get_xlim() == (0.0, 1e-3), "one message alone"


@pytest.mark.slow
def test_a_path_begins_white_and_ends_with_the_robot_and_its_front():
    figure = draw_page("paths", make_driven(2))
    (axes,) = figure.axes
    (walls,) = axes.collections
    assert [segment.tolist() for segment in walls.get_segments()] == [[[-1.0, 0.0], [1.0, 0.5]]]
    starts = [line.get_xydata() for line in axes.lines if line.get_marker() == "o"]
    assert np.allclose(starts, [[(0.1, 0.025)], [(0.1, 1.025)]])
    assert {line.get_markerfacecolor() for line in axes.lines if line.get_marker() == "o"} == {"white"}
    bodies = [(patch.center, patch.radius) for patch in axes.patches]
    assert bodies == [(pytest.approx((0.2, 0.025 + number)), BODY_RADIUS_M) for number in range(2)]
    fronts = [line.get_xydata()[1] for line in axes.lines if line.get_color() == "white"]
    front_m = np.array((0.2 + BODY_RADIUS_M / 2.0, 0.025 + BODY_RADIUS_M * math.sqrt(0.75)))
    assert np.allclose(fronts, [front_m, front_m + (0.0, 1.0)], atol=1e-6)
    truths = [line.get_xydata() for line in axes.lines if line.get_alpha() and len(line.get_xydata()) > 2]
    assert len(truths) == 2 and np.allclose(truths[0][:, 1], 0.02)
    assert axes.get_aspect() in ("equal", 1.0) and not axes.texts
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "hero_0", "hero_1", "start", "end", "ground truth", "walls, obstacles"
    ]  # fmt: skip
    untrue = make_driven(1)
    untrue[0].ground_truth = type(untrue[0].ground_truth)(2, 5)
    alone = draw_page("paths", untrue).axes[0]
    assert [text.get_text() for text in alone.get_legend().get_texts()] == ["start", "end", "walls, obstacles"]
    many = draw_page("paths", make_driven(8)).axes[0]
    assert [(text.get_text(), text.xy) for text in many.texts] == [
        (str(number), pytest.approx((0.2, 0.025 + number))) for number in range(8)
    ]


@pytest.mark.slow
def test_frames_are_told_where_robots_are_not_all_in_one():
    def describe(*robots):
        seen = Observations()
        seen.robots.update(enumerate(robots))
        seen.shared_frame, seen.pose_frame, seen.true_frame = "world", "map", "lab"
        return Figures(seen, START_S, START_S + END_S, "test.bag").draw_paths().axes[0].get_title()

    def make(with_origin, with_pose=False, with_truth=False):
        robot = RobotObservations()
        robot.odometry.add(START_S, START_S, 0.0, 0.0, 0.0, 0.0, 0.0)
        if with_origin:
            robot.origins.append(Origin(0.0, 0.0, 0.0, 0.0))
        if with_pose:
            robot.poses.add(START_S, START_S, 0.0, 0.0, 0.0)
        if with_truth:
            robot.ground_truth.add(START_S, START_S, 0.0, 0.0, 0.0, 0.0, 0.0)
        return robot

    assert describe(make(False)) == ""
    assert describe(make(False), make(False)) == "each robot in its own odom frame: no transforms on /tf_static"
    assert describe(make(True), make(True)) == "frame world"
    assert describe(make(False), make(False), make(True)) == "frame world; hero_0, hero_1: own odom frame"
    assert describe(make(True), make(True, True), make(True, True)) == "frame map; hero_0: frame world"
    assert describe(make(True, with_truth=True)) == "frame world; ground truth: frame lab"
    assert describe(make(True), make(False, with_truth=True)) == "frame world; hero_1: own odom frame"


@pytest.mark.slow
def test_speeds_are_drawn_beside_commands_up_to_eight_robots():
    robots = make_driven(9)
    robots[1].odometry = type(robots[1].odometry)(2, 5)
    figure = draw_page("speeds", robots)
    rows = [axes.get_ylabel() for axes in figure.axes if axes.get_ylabel()]
    assert rows == ["hero_%d" % number for number in range(9) if number != 1]
    assert figure._suptitle.get_text() == "Speeds\n"
    linear, angular = figure.axes[:2]
    commanded, measured = linear.lines
    assert commanded.get_xydata().tolist() == [[4.0, 0.1], [6.0, 0.0]] and commanded.get_drawstyle() == "steps-post"
    assert measured.get_xdata()[:2] == pytest.approx([0.0, PERIOD_S]) and set(measured.get_ydata()) == {0.1}
    assert set(angular.lines[1].get_ydata()) == {0.0} and to_hex(commanded.get_color()) != to_hex(measured.get_color())
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["odometry", "commanded"]
    many = draw_page("speeds", make_driven(9))
    assert many._suptitle.get_text() == "Speeds of the first 8 robots\n" and len(many.axes) == 16
    untold = make_driven(1)
    untold[0].commands = type(untold[0].commands)(1, 2)
    assert "no commands recorded" in draw_page("speeds", untold).legends[0].get_texts()[1].get_text()
    assert draw_page("speeds", [RobotObservations()]) is None is draw_page("paths", [RobotObservations()])
