"""calibrate_camera: views of the board until the lens is known; what was found of each robot's tag is written."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hero_localization.calibration.lens_calibration import BoardView, LensCalibration
from hero_localization.calibration.robot_calibration import RobotCalibration
from hero_localization.camera.camera_model import Intrinsics
from hero_localization.camera.frame_source import Frame
from hero_localization.errors import CalibrationError
from hero_localization.nodes import calibrate_camera
from hero_localization.tracking import settings

FOUND = {
    0: RobotCalibration(0.001, -0.002, math.radians(3.0), 0.060, 0.001, 0.001, []),
    1: RobotCalibration(0.002, 0.0, 0.0, 0.070, 0.001, 0.001, []),
    2: RobotCalibration(0.0, 0.001, math.pi, 0.200, 0.001, 0.001, ["the tag is on upside down"]),
}


@pytest.fixture
def calibrate(tmp_path, monkeypatch):
    """Return a function that calibrates robots, each of which drives as FOUND says, and returns status and settings."""
    path = str(tmp_path / "camera.yaml")
    settings.update(path, {"mounts": {8: [0.003, 0.0, 5.0]}, "tag_robots": {12: 2}})

    def watch(settings, pictures, program, robot_id, tag_id):
        if robot_id not in FOUND:
            raise CalibrationError("tag %d is not in the image" % tag_id)
        return FOUND[robot_id]

    monkeypatch.setattr(calibrate_camera, "_watch_robot", watch)

    def run(robots):
        options = calibrate_camera.parse_options(["robots", "--robots", robots, "--file", path])
        return calibrate_camera.calibrate_robot_tags(options, None, None), settings.load(path)

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


def test_a_robot_that_is_not_seen_does_not_keep_others_from_the_file(calibrate, capsys):
    status, found = calibrate("0 7")
    assert status == 1 and 0 in found.layout.mounts and 7 not in found.layout.mounts
    assert "hero_7: tag 7 is not in the image" in capsys.readouterr().out


def test_a_robot_whose_tag_is_another_ones_is_not_driven(calibrate, capsys):
    status, found = calibrate("0 12")
    assert status == 1 and 12 not in found.layout.mounts
    assert "hero_12: tag 12 is assigned to something else: name the robot's in tag_robots" in capsys.readouterr().out


def test_without_any_robot_seen_the_file_stays_as_it_was(calibrate):
    with pytest.raises(CalibrationError, match="hero_7: tag 7"):
        calibrate("7")


class Board:
    """A board that is held still for two images at each place; the lens is known from `enough` views."""

    def __init__(self, enough, monkeypatch):
        self.enough, self.pictures, self.calibrated = enough, 0, []
        monkeypatch.setattr(calibrate_camera, "find_board", self.find)
        monkeypatch.setattr(calibrate_camera, "calibrate_lens", self.calibrate)

    def take(self):
        self.pictures += 1
        return Frame(0.0, np.zeros((2, 2), np.uint8), 0)

    def find(self, gray, board):
        return BoardView(np.arange(4), np.full((4, 2), 100.0 * (self.pictures // 2)))

    def calibrate(self, views, width_px, height_px, board):
        self.calibrated.append(len(views))
        problems = [] if len(views) >= self.enough else ["the board is hardly tilted"]
        return LensCalibration(Intrinsics(width_px, height_px, np.eye(3), np.zeros(5)), 0.1, 0.001, [], problems)


@pytest.mark.parametrize(
    ("options", "enough", "status", "calibrated"),
    [
        ([], 20, 0, [20]),
        ([], 23, 0, [20, 21, 22, 23]),
        (["--views", "21"], 99, 1, [20, 21]),
        (["--views", "8"], 0, 0, [8]),
    ],
)
def test_views_are_taken_until_the_lens_is_known(options, enough, status, calibrated, tmp_path, monkeypatch):
    board, path = Board(enough, monkeypatch), str(tmp_path / "camera.yaml")
    parsed = calibrate_camera.parse_options(["lens", "--file", path, *options])
    assert calibrate_camera.calibrate_lens_by_board(parsed, board, SimpleNamespace(now_s=0.0)) == status
    assert board.calibrated == calibrated
    assert settings.load(path).lens.width_px == 2


def test_too_few_views_are_refused_before_any_is_taken(capsys):
    with pytest.raises(SystemExit):
        calibrate_camera.parse_options(["lens", "--views", "7"])
    assert "--views 7: it takes at least 8 images" in capsys.readouterr().err
