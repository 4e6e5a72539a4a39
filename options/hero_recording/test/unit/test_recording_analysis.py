"""Analysis, figures and table of robots whose paths, delays, errors and pauses are known."""

import math
import re

import numpy as np
import pytest
import rosbag
import synthetic_bag
from synthetic_bag import (
    ANGULAR_RAD_S,
    DELAY_S,
    ERROR_M,
    MOTION_DELAY_S,
    PERIOD_S,
    RADIUS_M,
    START_S,
    write_bag,
)

from hero_recording import plot
from hero_recording.bags.bag_set import BagSet
from hero_recording.bags.topics import Message, find_robot_topic, is_fleet_topic, make_patterns
from hero_recording.errors import RecordingError
from hero_recording.plots import analysis
from hero_recording.plots.figures import Figures, choose_colors
from hero_recording.plots.observations import Observations, Origin, RobotObservations

MAX_NAMED = 7


def observe(path, robot_ids=None):
    bags = BagSet([str(path)])
    observations = Observations(robot_ids)
    bags.read(observations.wants, observations.receive)
    return observations


@pytest.fixture(scope="module")
def two_robots(tmp_path_factory):
    path = tmp_path_factory.mktemp("bags") / "two.bag"
    write_bag(path, robot_ids=(0, 3), seconds=12.0, pause=(6.0, 8.0))
    return path


def test_robots_that_join_later_are_recorded_and_other_topics_are_not():
    patterns = make_patterns(None, ["/mine"])

    def is_recorded(topic):
        return any(re.fullmatch(pattern, topic) for pattern in patterns)

    for topic in (
        *("/hero_%d/%s" % (number, name) for number in (0, 7, 123) for name in ("odom", "proximity", "imu", "led")),
        "/hero_4/velocity_controller/cmd_vel",
        "/hero_4/cmd_vel",
        "/hero_4/ground_truth",
        "/hero_4/pose",
        *(
            "/tf",
            "/tf_static",
            "/rosout",
            "/diagnostics",
            "/hero_driver/robots",
            "/hero_driver_b/robots",
            "/hero_sim/arena",
            "/arena",
            "/localization/poses",
            "/track/measured_poses",
            "/map",
            "/mine",
        ),
    ):
        assert is_recorded(topic), topic
    for topic in (
        "/hero_0/laser",
        "/hero_0/odom_raw",
        "/camera/image",
        "/hero_x/odom",
        "/rosout_agg",
        "/minefield",
        "/track/picture/compressed",
    ):
        assert not is_recorded(topic), topic


def test_reports_of_all_drivers_are_read():
    assert is_fleet_topic("/hero_driver/robots", "hero_msgs/RobotArray")
    assert is_fleet_topic("/hero_driver_b/robots", "hero_msgs/RobotArray")
    assert not is_fleet_topic("/hero_driver/robots", "std_msgs/String")
    assert not is_fleet_topic("/hero_driver/b/robots", "hero_msgs/RobotArray")


def test_patterns_for_some_robots_match_no_others():
    pattern = make_patterns([1, 12], [])[0]
    assert re.fullmatch(pattern, "/hero_12/led")
    assert not re.fullmatch(pattern, "/hero_2/odom")
    assert not re.fullmatch(pattern, "/hero_112/odom")


def test_a_topic_of_another_type_is_ignored():
    assert find_robot_topic("/hero_5/odom", "nav_msgs/Odometry") == (5, "odometry")
    assert find_robot_topic("/hero_5/odom", "std_msgs/String") is None
    assert find_robot_topic("/hero_5/speech", "std_msgs/String") is None


@pytest.mark.slow
def test_paths_are_in_the_shared_frame(two_robots):
    seen = observe(two_robots)
    assert sorted(seen.robots) == [0, 3]
    assert seen.shared_frame == "world"
    path = analysis.read_path(seen.robots[3])
    assert path.x_m[0] == pytest.approx(3.0 * synthetic_bag.ORIGIN_X_M, abs=1e-6)
    # During the pause the path is a chord.
    driven_s = 12.0 - synthetic_bag.START_DELAY_S - MOTION_DELAY_S
    assert path.length_m == pytest.approx(RADIUS_M * ANGULAR_RAD_S * driven_s, rel=0.03)
    assert seen.walls_m == [(-1.0, 0.0, 1.0, 0.0)]
    assert seen.circles_m == [(0.5, 0.0, 0.1)]


def test_a_path_is_moved_and_turned_with_the_origin_of_its_time():
    times_s = np.array([0.0, 1.0, 2.0])
    columns = ([1.0, 1.0, 0.0], [0.5, 0.5, 1.0], [0.0, 0.0, 3.0])
    path = analysis.Path(times_s, times_s, *map(np.array, columns))
    origins = [Origin(0.5, 2.0, 0.0, math.pi / 2.0), Origin(2.0, -1.0, -1.0, math.pi)]
    moved = analysis.transform_path(path, origins)
    assert moved.x_m == pytest.approx([1.5, 1.5, -1.0])
    assert moved.y_m == pytest.approx([1.0, 1.0, -2.0])
    assert moved.yaw_rad == pytest.approx([math.pi / 2.0, math.pi / 2.0, 3.0 - math.pi])


@pytest.mark.slow
def test_localized_robots_are_drawn_in_map_and_others_are_named(tmp_path):
    path = tmp_path / "localized.bag"
    write_bag(path, robot_ids=(0, 3, 5), seconds=3.0)
    with rosbag.Bag(str(path), "a") as bag:
        for robot_id in (0, 3):
            for step in range(3):
                pose = synthetic_bag.make_localized(START_S + step, robot_id + 0.1 * step, -2.0, 0.5)
                bag.write("/hero_%d/pose" % robot_id, pose, pose.header.stamp)
    seen = observe(path)
    axes = Figures(seen, START_S, START_S + 3.0, "localized.bag").draw_paths().axes[0]
    assert axes.get_title() == "frame map; hero_5: frame world; ground truth: frame world"
    assert axes.figure._suptitle.get_text().strip() == "Paths by localization"
    drawn = [tuple(line.get_xdata()) for line in axes.lines]
    assert pytest.approx((3.0, 3.1, 3.2)) in drawn
    assert analysis.read_path(seen.robots[3]).x_m[0] == pytest.approx(3.0 * synthetic_bag.ORIGIN_X_M, abs=1e-6)
    del seen.robots[5]
    seen.true_frame = "map"
    assert Figures(seen, START_S, START_S + 3.0, "localized.bag").draw_paths().axes[0].get_title() == "frame map"


def test_robots_can_be_selected(two_robots):
    assert sorted(observe(two_robots, {3}).robots) == [3]


@pytest.mark.slow
def test_the_table_holds_rate_gaps_delays_and_error(two_robots):
    cells = plot.describe_robot(observe(two_robots).robots[3])
    assert cells["ODOM"] == "%.1f Hz" % (1.0 / PERIOD_S)
    assert float(cells["LONGEST GAP"].split()[0]) == pytest.approx(2.0, abs=0.05)
    assert cells["MESSAGE DELAY"] == cells["99 %"] == "%.0f ms" % (1e3 * DELAY_S)
    assert cells["FINAL ERROR"].startswith("%.0f mm (" % (1e3 * ERROR_M))


def test_a_true_heading_that_passes_pi_between_two_readings_is_no_error():
    robot = RobotObservations()
    robot.origins.append(Origin(0.0, 0.0, 0.0, 0.0))
    for reading in range(100):
        stamp_s, yaw_rad = 0.1 * reading, 0.25 * reading
        for series, shift in ((robot.ground_truth, 0.0), (robot.odometry, 0.5)):  # stamps half way between
            turn_rad = math.remainder(yaw_rad + 0.25 * shift, math.tau)
            series.add(stamp_s, stamp_s + 0.1 * shift, 0.0, 0.0, turn_rad, 0.0, 0.0)
    assert np.abs(analysis.compute_odometry_errors(robot).yaw_rad[:-1]).max() < 1e-6


def test_poses_by_localization_have_errors_of_their_own(two_robots):
    robot = observe(two_robots).robots[3]
    times_s = robot.ground_truth.columns()[1]
    for time_s, x_m, y_m, yaw_rad in zip(times_s, *robot.ground_truth.columns()[2:5]):
        robot.poses.add(time_s, time_s, x_m + 0.003, y_m - 0.004, yaw_rad + 2.0 * math.pi - 0.01)
    errors = analysis.compute_localization_errors(robot)
    assert errors.position_m == pytest.approx(0.005)
    assert errors.yaw_rad == pytest.approx(-0.01)
    assert plot.describe_robot(robot)["LOCALIZATION RMS"] == "5.0 mm"


def test_messages_with_absurd_numbers_are_skipped_and_counted():
    observations = Observations()
    for x_m in (0.0, math.nan, math.inf, 1e30, 0.1):
        pose = synthetic_bag.make_pose("odom", 1.0, x_m, 0.0, 0.0)
        observations.receive(Message("/hero_0/odom", "nav_msgs/Odometry", pose, 1.0))
    assert analysis.read_path(observations.robots[0]).length_m == pytest.approx(0.1)
    assert plot.format_table(observations)[-1].startswith("hero_0: skipped 3 messages")


def test_few_robots_have_distinct_colors_and_many_a_scale():
    assert len(set(choose_colors(range(MAX_NAMED)).values())) == MAX_NAMED
    assert len(set(map(tuple, choose_colors(range(50)).values()))) == 50
    assert len(choose_colors([4])) == 1


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, MAX_NAMED + 1])
def test_figures_of_one_and_of_many_robots_have_titles_units_and_ids(count, tmp_path):
    path = tmp_path / "fleet.bag"
    write_bag(path, robot_ids=range(count), seconds=1.5)
    drawing = Figures(observe(path), START_S, START_S + 1.5, "fleet.bag")
    figures = {
        "speeds": drawing.draw_speeds(),
        "errors": drawing.draw_errors(),
        "paths": drawing.draw_paths(),
    }
    for name, figure in figures.items():
        figure.savefig(str(tmp_path / (name + ".png")), dpi=30)
        labels = [text for axes in figure.axes for text in (axes.get_xlabel(), axes.get_ylabel(), axes.get_title())]
        assert any("(m" in label or "(s)" in label for label in labels), name
        assert "fleet.bag" in "".join(text.get_text() for text in figure.texts)
    numbers = {text.get_text() for text in figures["paths"].axes[0].texts}
    assert numbers == (set() if count == 1 else {str(number) for number in range(count)})


def run_plot(capsys, *arguments):
    plot.main([str(argument) for argument in arguments])
    return capsys.readouterr().out


@pytest.mark.slow
def test_plot_writes_png_files_beside_the_bag_and_prints_a_table(two_robots, capsys):
    output = run_plot(capsys, two_robots)
    assert re.search(r"^hero_3 +1\.\d\d m +29\.\d Hz +2\.\d\d s +20 ms", output, re.MULTILINE)
    for name in plot.FIGURES:
        path = two_robots.parent / ("two_%s.png" % name)
        assert path.read_bytes().startswith(b"\x89PNG")
        assert str(path) in output


@pytest.mark.slow
def test_figures_can_be_written_as_pdf(two_robots, tmp_path, capsys):
    run_plot(capsys, two_robots, "--format", "pdf", "--out", tmp_path / "my")
    assert {path.name for path in tmp_path.iterdir()} == {"my_%s.pdf" % name for name in plot.FIGURES}
    assert (tmp_path / "my_paths.pdf").read_bytes().startswith(b"%PDF")


def write_parts(path, robot_ids, *kinds):
    """Write a bag of synthetic robots that holds only topics that end in one of kinds."""
    write_bag(path.parent / "whole.bag", robot_ids=robot_ids, seconds=3.0)
    with rosbag.Bag(str(path.parent / "whole.bag")) as whole, rosbag.Bag(str(path), "w") as bag:
        for topic, message, time in whole.read_messages():
            if topic.endswith(kinds):
                bag.write(topic, message, time)
    return path


@pytest.mark.slow
def test_figures_for_which_a_topic_is_missing_are_named_with_it(tmp_path, capsys):
    output = run_plot(capsys, write_parts(tmp_path / "part.bag", (0,), "/odom"))
    assert "no figure of errors: nothing of /hero_N/odom or /hero_N/pose with /hero_N/ground_truth" in output
    with pytest.raises(RecordingError, match=r"part\.bag: no figure of paths: nothing of /hero_N/odom"):
        run_plot(capsys, write_parts(tmp_path / "part.bag", (0,), "/cmd_vel"))


@pytest.mark.slow
def test_all_obstacles_have_one_color_and_ground_truth_its_name(two_robots):
    axes = Figures(observe(two_robots), START_S, START_S + 12.0, "two.bag").draw_paths().axes[0]
    (walls,) = axes.collections
    circle = next(patch for patch in axes.patches if patch.get_radius() == pytest.approx(0.1))
    assert tuple(walls.get_edgecolor()[0]) == circle.get_edgecolor()
    assert not circle.get_fill(), "paths below it are seen"
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert {"ground truth", "walls, obstacles"} <= set(labels)


@pytest.mark.slow
def test_wrong_input_of_plot_is_refused_by_name(two_robots, tmp_path, capsys):
    rosbag.Bag(str(tmp_path / "other.bag"), "w").close()
    with rosbag.Bag(str(tmp_path / "other.bag"), "w") as bag:
        bag.write("/chatter", synthetic_bag.ColorRGBA())
    for arguments, words in (
        ([tmp_path / "other.bag"], "no robot in it; its topics: /chatter"),
        ([two_robots, "--robots", "1 2"], r"no robot with these ids \(1, 2\)"),
    ):
        with pytest.raises(RecordingError, match=words):
            run_plot(capsys, *arguments)
    with pytest.raises(FileNotFoundError, match="no/where_paths.png'$"):
        run_plot(capsys, two_robots, "--out", tmp_path / "no" / "where")
    for arguments in (["--robots", "x"], ["--format", "gif"]):
        with pytest.raises(SystemExit) as caught:
            plot.parse_options([str(two_robots), *arguments])
        assert caught.value.code == 2
        assert arguments[1] in capsys.readouterr().err
