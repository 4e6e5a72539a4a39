"""calibrate_camera: views of the board until the lens is known; what was found of each robot's tag is written."""

import itertools
import math
import sys
from contextlib import nullcontext
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

from hero_client import ProgramError, Robot
from hero_localization.calibration.arena_calibration import ArenaCalibration
from hero_localization.calibration.lens_calibration import BoardView, LensCalibration
from hero_localization.calibration.print_fit import estimate_height, find_height_error, find_print_scale
from hero_localization.calibration.robot_calibration import RobotCalibration
from hero_localization.camera.camera_model import Intrinsics
from hero_localization.camera.frame_source import Frame
from hero_localization.errors import CalibrationError, DetectorError
from hero_localization.nodes import (
    calibrate_arena,
    calibrate_camera,
    calibrate_lens,
    calibrate_robots,
    calibration_images,
)
from hero_localization.simulated_camera.renderer import CameraRenderer
from hero_localization.simulated_camera.view import CameraOptions, PrintedTag
from hero_localization.tracking import settings
from hero_localization.tracking.detectors import create_detector
from hero_localization.tracking.tag_pose import TagCorners, TagLayout
from hero_node import Pose
from hero_sim.world.arena import build_rectangle

FOUND = {
    0: RobotCalibration(Pose(0.001, -0.002, math.radians(3.0)), 0.060, 0.001, 0.001, [], 0.073),
    1: RobotCalibration(Pose(0.002, 0.0, 0.0), 0.070, 0.001, 0.001, [], 0.079),
    2: RobotCalibration(Pose(0.0, 0.001, math.pi), 0.200, 0.001, 0.001, ["the tag is on upside down"], 0.076),
    3: RobotCalibration(Pose(0.0, 0.0, 0.0), 0.070, 0.001, 0.001, [], 0.0807),
    4: RobotCalibration(Pose(0.0, 0.0, 0.0), 0.070, 0.001, 0.001, []),
    5: RobotCalibration(Pose(0.0, 0.0, 0.0), 0.070, 0.001, 0.001, [], 0.0915),
}


@pytest.fixture
def calibrate(tmp_path, monkeypatch):
    """Return a function that calibrates robots, each of which drives as FOUND says, and returns status and settings."""
    path = str(tmp_path / "camera.yaml")
    camera = CameraOptions(position_m=(0.0, 0.0, 2.5)).geometry  # 3.5 mm of height are 0.033 px
    settings.update(path, settings.describe_camera(camera, {}))
    settings.update(path, {"mounts": {8: [0.003, 0.0, 5.0]}, "tag_robots": {12: 2}, "references": {100: [0, 0, 0]}})

    def watch(pictures, program, robot_id, tag_id):
        if robot_id not in FOUND:
            raise CalibrationError("tag %d is not in the image" % tag_id)
        return FOUND[robot_id]

    monkeypatch.setattr(calibrate_robots, "_watch_robot", watch)

    def run(robots):
        options = calibrate_camera.parse_options(["robots", "--robots", robots, "--file", path])
        images = SimpleNamespace(settings=settings.load(path))
        return calibrate_robots.calibrate_robot_tags(options, images, None), settings.load(path)

    return run


def test_places_of_tags_and_the_median_delay_are_written(calibrate):
    status, found = calibrate("0-2")
    assert status == 1  # one tag is upside down
    assert found.delay_s == pytest.approx(0.070)
    mounts = found.layout.mounts
    assert (mounts[0].x_m, mounts[0].y_m) == (0.001, -0.002)
    assert mounts[0].yaw_rad == pytest.approx(math.radians(3.0))
    assert mounts[12].yaw_rad == pytest.approx(math.pi)
    assert mounts[8].x_m == 0.003


def test_robots_without_a_fault_are_good(calibrate, capsys):
    assert calibrate("0-1")[0] == 0
    assert "hero_0: tag 1.0 mm ahead, -2.0 mm left, turned by 3.0 degrees; delay 60 ms" in capsys.readouterr().out


def test_tags_that_are_higher_than_the_file_says_are_named_in_one_line(calibrate, capsys):
    assert calibrate("0 1 3")[0] == 0, "0.079 is within the limit"
    assert "tag_height_m is right to 3 mm, as far as tags of this size tell\n" in capsys.readouterr().out
    assert calibrate("1 3")[0] == 1
    text = "  tags are 80 mm above the floor by their size, not 76: is tag_height_m right, all printed alike?\n"
    assert capsys.readouterr().out.count(text) == 1
    calibrate("4 0")
    assert "tag_height_m is right to 3 mm" in capsys.readouterr().out, "by those of which it is known"


def test_one_tag_that_is_higher_than_others_is_named(calibrate, capsys):
    assert calibrate("0 1 5")[0] == 1
    out = capsys.readouterr().out
    assert "tag_height_m is right to 3 mm" in out
    text = "  tag 5 is 92 mm above the floor by its size, others 79: printed alike, flat on its robot?\n"
    assert out.count(text) == 1 and out.count("above the floor") == 1


@pytest.mark.parametrize(("focal_px", "error_mm"), [(1391.0, 2.7), (1150.0, 3.2), (900.0, 6.3)])
def test_heights_of_small_tags_are_told_less_well(focal_px, error_mm):
    camera = CameraOptions(focal_px=(focal_px, focal_px)).geometry
    assert 1e3 * find_height_error(camera, TagLayout()) == pytest.approx(error_mm, abs=0.1)


def test_a_height_that_no_reference_tag_shows_is_named(calibrate, capsys):
    assert calibrate("4")[0] == 1
    assert "  tag_height_m is not checked: no reference tag lies well within the image\n" in capsys.readouterr().out


@pytest.mark.slow
def test_the_height_of_a_tag_follows_from_its_size_beside_references():
    """Whatever the printer's scale: here, all are 2.5 % too large."""
    references = [PrintedTag(100 + index, 0.1025, 0.0, x_m, 0.3) for index, x_m in enumerate((-0.4, 0.0, 0.4))]
    tags = [PrintedTag(row, 0.041, 0.081) for row in range(6)]
    options = CameraOptions(center_px=(479.0, 269.0), width_px=960, height_px=540, position_m=(0.0, 0.0, 2.2))
    renderer = CameraRenderer(options, build_rectangle(3.0, 2.0, 0), tags, references)
    poses = np.array([(-0.5 + 0.2 * row, -0.15, 0.3 * row) for row in range(6)])
    image, layout = renderer.render(poses), TagLayout(references={100 + index: Pose(0, 0, 0) for index in range(3)})
    found, camera = create_detector(decimate=1.0).detect(image), renderer.camera
    assert len(found) == 9
    robots = [tag for tag in found if tag.tag_id < 6]
    for used in (layout, layout._replace(height_m=0.091)):
        scale = find_print_scale(camera, image, found, used, "36h11")
        assert scale.share == pytest.approx(1.025, abs=0.001)
        heights_m = [estimate_height(camera, image, tag, scale, used, "36h11") for tag in robots]
        assert np.mean(heights_m) == pytest.approx(0.081, abs=0.001), heights_m
    assert find_print_scale(camera, image, robots, layout, "36h11") is None, "no reference tag is seen"
    at_rim = robots[0]._replace(corners=robots[0].corners - robots[0].corners.min(axis=0))
    assert math.isnan(estimate_height(camera, image, at_rim, scale, layout, "36h11"))


def test_a_robot_that_is_not_seen_does_not_keep_others_from_the_file(calibrate, capsys):
    status, found = calibrate("7 0")
    assert status == 1 and 0 in found.layout.mounts and 7 not in found.layout.mounts
    assert "hero_7: tag 7 is not in the image" in capsys.readouterr().out


def test_a_robot_whose_tag_is_another_ones_is_not_driven(calibrate, capsys):
    status, found = calibrate("12 0")
    assert status == 1 and 12 not in found.layout.mounts
    assert "hero_12: tag 12 is assigned to something else: name the robot's in tag_robots" in capsys.readouterr().out


def test_a_detector_that_ends_ends_the_calibration_of_all_robots(calibrate, monkeypatch):
    def end(*_):
        raise DetectorError("the detector's process has ended")

    monkeypatch.setattr(calibrate_robots, "_watch_robot", end)
    with pytest.raises(DetectorError):
        calibrate("0-2")


def test_without_any_robot_seen_the_file_stays_as_it_was(calibrate):
    with pytest.raises(CalibrationError, match="hero_7: tag 7"):
        calibrate("7")


class Board:
    """A board that is held still for two images at each place; the lens is known from `enough` views."""

    def __init__(self, enough, monkeypatch):
        self.enough, self.pictures, self.calibrated = enough, 0, []
        monkeypatch.setattr(calibrate_lens, "find_board", self.find)
        monkeypatch.setattr(calibrate_lens, "calibrate_lens", self.calibrate)

    def take(self):
        self.pictures += 1
        return Frame(0.0, np.zeros((2, 2), np.uint8), 0)

    def find(self, gray):
        return BoardView(np.arange(4), np.full((4, 2), 100.0 * (self.pictures // 2)))

    def calibrate(self, views, width_px, height_px):
        self.calibrated.append(len(views))
        problems = [] if len(views) >= self.enough else ["the board is hardly tilted"]
        return LensCalibration(Intrinsics(width_px, height_px, np.eye(3), np.zeros(5)), 0.1, 0.001, [], problems)


@pytest.mark.parametrize(
    ("options", "enough", "status", "calibrated"),
    [
        ([], 20, 0, [20]),
        ([], 23, 0, [20, 21, 22, 23]),
        ([], 99, 1, [20, 21, 22, 23, 24, 25]),
    ],
)
def test_views_are_taken_until_the_lens_is_known(options, enough, status, calibrated, tmp_path, monkeypatch, capsys):
    board, path = Board(enough, monkeypatch), str(tmp_path / "camera.yaml")
    parsed = calibrate_camera.parse_options(["lens", "--file", path, *options])
    assert calibrate_lens.calibrate_lens_by_board(parsed, board, SimpleNamespace(now_s=0.0)) == status
    assert board.calibrated == calibrated
    assert settings.load(path).lens.width_px == 2
    assert "error 0.10 px rms, focal length known to 0.10 %" in capsys.readouterr().out


def test_views_are_still_and_away_from_others(tmp_path, monkeypatch):
    board = Board(0, monkeypatch)
    # Each image by how far the board is moved from the one before: still below 3 px, new from 40 px on.
    places_px = np.cumsum([0.0, 2.9, 39.0, 2.9, 0.2, 40.0, 3.1, 2.9, 50.0, 2.9, 50.0, 3.1, 50.0])
    taken = []
    monkeypatch.setattr(
        board, "find", lambda gray: BoardView(np.arange(4), np.full((4, 2), (places_px[board.pictures - 1], 0.0)))
    )
    monkeypatch.setattr(calibrate_lens, "find_board", board.find)
    monkeypatch.setattr(calibrate_lens, "say", taken.append)
    parsed = calibrate_camera.parse_options(["lens", "--file", str(tmp_path / "camera.yaml")])
    with pytest.raises(IndexError):  # no more images
        calibrate_lens.calibrate_lens_by_board(parsed, board, SimpleNamespace(now_s=0.0))
    assert taken[1:] == ["%d of at least 20 images" % count for count in (1, 2, 3, 4)]


def test_a_shift_is_that_of_the_corners_that_both_views_show():
    view = BoardView(np.array([1, 2, 5]), np.array([(0.0, 0.0), (10.0, 0.0), (0.0, 10.0)]))
    other = BoardView(np.array([5, 2, 7]), np.array([(3.0, 14.0), (10.0, 1.0), (99.0, 99.0)]))
    assert calibrate_lens._measure_shift(view, other) == pytest.approx((5.0 + 1.0) / 2.0)
    assert calibrate_lens._measure_shift(view, other._replace(ids=np.array([6, 7, 8]))) == math.inf


def test_without_a_board_for_ten_seconds_a_hint_is_given(tmp_path, monkeypatch, capsys):
    board, program = Board(0, monkeypatch), SimpleNamespace(now_s=100.0)
    times_s = iter((105.0, 109.9, 110.1, 119.0, 120.0, 120.2))

    def take():
        program.now_s = next(times_s)
        return Frame(0.0, np.full((2, 2), 77, np.uint8), 0)

    board.take = take
    monkeypatch.setattr(calibrate_lens, "find_board", lambda gray: None)
    parsed = calibrate_camera.parse_options(["lens", "--file", str(tmp_path / "camera.yaml")])
    with pytest.raises(StopIteration):
        calibrate_lens.calibrate_lens_by_board(parsed, board, program)
    assert capsys.readouterr().out.count("no board in the images (mean shade 77 of 255)") == 2, "after 10 s each"


@pytest.fixture
def watch(monkeypatch):
    """Return a function that watches hero_4 in images with so many tags 9 each; its robot and subscriber are mocks."""
    times_s = itertools.count(0.0, 0.5)
    robot, subscriber = mock.create_autospec(Robot, instance=True), mock.Mock(spec=["unregister"])
    monkeypatch.setattr(calibrate_robots, "Robot", lambda robot_id: {4: nullcontext(robot)}[robot_id])
    monkeypatch.setattr(calibrate_robots, "read_duration_clock_s", lambda: next(times_s))
    monkeypatch.setattr(calibrate_robots.rospy, "Subscriber", mock.Mock(return_value=subscriber))
    camera, tag = CameraOptions().geometry, TagCorners(9, np.array(((0, 0), (25, 0), (25, 25), (0, 25))) + 900.0)

    def run(counts):
        found = iter(counts)
        frame = Frame(1.0, np.zeros((8, 8), np.uint8), 0)
        images = SimpleNamespace(settings=settings.Settings(camera=camera), take=lambda: frame, poll=lambda: frame)
        images.find_tags = lambda frame: [tag] * next(found)
        return calibrate_robots._watch_robot(images, SimpleNamespace(sleep=None), 4, 9)

    return SimpleNamespace(run=run, robot=robot, subscriber=subscriber, subscribed=calibrate_robots.rospy.Subscriber)


@pytest.mark.parametrize(
    ("count", "reason"), [(0, "is not in the image, or too dark; the robot was not"), (2, "appears more than once")]
)
def test_a_robot_whose_tag_is_not_seen_alone_for_three_seconds_stands(watch, count, reason):
    with pytest.raises(CalibrationError, match=f"tag 9 {reason}"):
        watch.run([count] * 20)
    assert watch.robot.wait_until_ready.called and watch.robot.check_not_stopped.called
    assert not watch.robot.drive.called and not watch.subscribed.called


def test_odometry_of_a_robot_is_not_heard_any_more_when_its_drive_fails(watch):
    with pytest.raises(StopIteration):  # no more images
        watch.run([1] * 5)
    assert watch.subscribed.call_args.args[0] == "/hero_4/odom"
    assert watch.robot.drive.call_args_list[-1].args == (0.0, 2.5) and watch.subscriber.unregister.call_count == 1


LENSES = {
    name: Intrinsics(8, 8, np.diag((focal_px, focal_px, 1.0)), np.zeros(5))
    for name, focal_px in (("file", 5.0), ("info", 6.0))
}


@pytest.mark.parametrize(("known", "taken"), [("file info", "file"), ("info", "info"), ("", None)])
def test_the_arena_is_calibrated_with_the_lens_of_the_file_if_it_has_one(known, taken, tmp_path, monkeypatch, capsys):
    lenses = {name: lens if name in known else None for name, lens in LENSES.items()}
    images = mock.create_autospec(calibration_images.Images, instance=True)
    images.settings, images.source = (
        settings.Settings(lens=lenses["file"]),
        mock.Mock(lens=lenses["info"], lens_problem="K"),
    )
    images.take.return_value, images.find_tags.return_value = Frame(0.0, np.zeros((8, 8), np.uint8), 0), []
    camera = CameraOptions().geometry._replace(lens=LENSES[taken or "file"])
    found = ArenaCalibration(
        camera, {100: 0.001, 101: 0.002, 102: 0.012, 103: 0.001, 104: 0.0}, [102], ["measure again"]
    )
    calibrate = mock.create_autospec(calibrate_arena.calibrate_arena, return_value=found)
    monkeypatch.setattr(calibrate_arena, "calibrate_arena", calibrate)
    monkeypatch.setattr(calibrate_arena, "find_print_mistake", lambda gray, family: "mirrored")
    options = calibrate_camera.parse_options(["arena", "--file", str(tmp_path / "camera.yaml")])
    if taken is None:
        with pytest.raises(CalibrationError, match=r"holds no lens \(K\): calibrate_camera lens comes"):
            calibrate_arena.calibrate_extrinsics(options, images)
        return
    assert calibrate_arena.calibrate_extrinsics(options, images) == 1
    assert calibrate.call_args.args[0] is lenses[taken] and images.take.call_count == 30
    written = settings.load(options.file)
    assert written.lens.matrix[0, 0] == LENSES[taken].matrix[0, 0] and written.arena_sd_m == pytest.approx(
        found.sd_m, abs=1e-5
    )
    out = capsys.readouterr().out
    assert "tag 101: 2.0 mm\n" in out and "tag 102: 12.0 mm (left out)\n" in out
    assert "residual 1.2 mm rms; the camera is 2.20 m above the floor" in out
    calibrate.side_effect = CalibrationError("no camera sees this")
    with pytest.raises(CalibrationError, match="^no camera sees this; mirrored$"):
        calibrate_arena.calibrate_extrinsics(options, images)


@pytest.mark.parametrize("part", ["lens", "arena", "robots"])
def test_a_calibration_that_fails_leaves_the_camera(part, monkeypatch):
    images = mock.create_autospec(calibration_images.Images, instance=True)
    monkeypatch.setattr(calibrate_camera, "Images", lambda *_: images)
    monkeypatch.setattr(calibrate_camera, "_check_file", lambda options: settings.Settings())
    monkeypatch.setattr(calibrate_camera, "Program", lambda *_, **__: nullcontext())
    for name in ("calibrate_lens_by_board", "calibrate_extrinsics", "calibrate_robot_tags"):
        monkeypatch.setattr(calibrate_camera, name, mock.Mock(side_effect=CalibrationError(name)))
    monkeypatch.setattr(sys, "argv", ["calibrate_camera", part, "--robots", "1"])
    with pytest.raises(CalibrationError, match={"lens": "board", "arena": "extrinsics", "robots": "tags"}[part]):
        calibrate_camera.main()
    images.close.assert_called_once_with()


@pytest.fixture
def images(monkeypatch):
    """Return the images of a camera that gives none."""
    polls_s = []
    source = SimpleNamespace(problem="", warning="too dark", lens="its own", poll=polls_s.append, close=lambda: None)
    monkeypatch.setattr(calibration_images, "open_source", lambda *_: source)
    program, options = SimpleNamespace(running=True), calibrate_camera.parse_options(["lens"])
    found = calibration_images.Images(options, program, settings.Settings())
    found.polls_s = polls_s
    return found


def test_an_image_is_waited_for_for_ten_seconds(images, capsys):
    with pytest.raises(CalibrationError, match="no image from camera/image_raw for 10 s: is the camera's driver"):
        images.take()
    assert images.polls_s == [0.1] * 100 and capsys.readouterr().out == "  too dark\n", "a warning once"
    images.source.problem = "unplugged"
    with pytest.raises(CalibrationError, match="for 10 s: unplugged"):
        images.take()
    images._program.running = False
    with pytest.raises(ProgramError, match="the file is as it was"):
        images.take()
    images.close()


def test_what_a_part_needs_is_named(tmp_path, capsys):
    path = str(tmp_path / "camera.yaml")
    for count in (3, 4):
        settings.update(path, {"references": {100 + index: [index, 0.0, 0.0] for index in range(count)}})
        options = calibrate_camera.parse_options(["arena", "--file", path])
        if count == 4:
            assert len(calibrate_camera._check_file(options).layout.references) == 4
        else:
            with pytest.raises(CalibrationError, match="names 3 reference tags, but it takes 4"):
                calibrate_camera._check_file(options)
    with pytest.raises(CalibrationError, match="run calibrate_camera arena first"):
        calibrate_camera._check_file(calibrate_camera.parse_options(["robots", "--robots", "1", "--file", path]))
    assert calibrate_camera._check_file(calibrate_camera.parse_options(["lens", "--file", path])).camera is None
    with pytest.raises(SystemExit):
        calibrate_camera.parse_options(["robots"])
    assert "each turns on the spot and drives 0.12 m to and fro" in capsys.readouterr().err
    options = calibrate_camera.parse_options(["lens"])
    assert (options.rate, options.size, options.image, options.device, options.yaml) == (
        30.0, "1920x1080", "camera/image_raw", "", None,
    )  # fmt: skip


def test_the_arena_without_scipy_is_refused_before_a_camera_is_opened(tmp_path, monkeypatch):
    path = str(tmp_path / "camera.yaml")
    settings.update(path, {"references": {100 + index: [index, 0.0, 0.0] for index in range(4)}})
    monkeypatch.setattr(sys, "argv", ["calibrate_camera", "arena", "--file", path])
    started = []
    monkeypatch.setattr(calibrate_camera, "Program", lambda *_, **__: started.append("node") or 1 / 0)
    with pytest.raises(ZeroDivisionError):
        calibrate_camera.main()
    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    with pytest.raises(ProgramError, match=r"scipy.optimize is missing \(.*\); install it: apt install python3-scipy$"):
        calibrate_camera.main()
    assert started == ["node"]
