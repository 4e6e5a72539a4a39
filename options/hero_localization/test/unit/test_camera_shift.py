"""A camera that moved a little since its calibration: its reference tags show it, and its poses are corrected."""

import math

import cv2
import numpy as np
import pytest
from test_tracker import CAMERA, SQUARE

from hero_localization.camera.camera_model import Camera
from hero_localization.tracking.settings import Settings
from hero_localization.tracking.tag_pose import TagCorners, TagLayout
from hero_localization.tracking.tracker import Tracker
from hero_node import Pose

PLACES_M = ((-1.15, -0.58), (1.15, -0.58), (1.15, 0.58), (-1.15, 0.58), (0.0, -0.62), (0.0, 0.62))
ROBOTS_M = [(x_m, y_m) for x_m in (-0.8, 0.0, 0.8) for y_m in (-0.4, 0.4)]
TILT = cv2.Rodrigues(np.radians((5.0, -3.3, 1.0)))[0] @ np.diag((1.0, -1.0, -1.0))
CALIBRATED = Camera(CAMERA.lens, TILT, np.array((0.15, 0.19, 2.2)))
RATE_HZ = 15.0


class Shifted:
    """A tracker whose camera has moved since its calibration, and reference tags, one of which moved by 4 mm."""

    def __init__(self, count=6, moved_m=(0.0, 0.0, 0.0), turned_deg=(0.0, 0.0, 0.0), wrong=None, corner_px=0.05):
        self.places = {100 + index: PLACES_M[index] for index in range(count)}
        references = {tag_id: Pose(*place_m, 0.0) for tag_id, place_m in self.places.items()}
        settings = Settings(layout=TagLayout(references=references), seen_references=references)
        self.tracker, self.random = Tracker(settings, CALIBRATED), np.random.RandomState(1)
        rotation = cv2.Rodrigues(np.radians(turned_deg))[0] @ CALIBRATED.rotation
        self.true = Camera(CAMERA.lens, rotation, CALIBRATED.position_m + moved_m)
        self.wrong, self.corner_px, self.frames = wrong, corner_px, 0

    def _see(self, tag_id, place_m, size_m, height_m):
        corners_m = np.column_stack((SQUARE * size_m + place_m, np.full(4, height_m)))
        return TagCorners(tag_id, self.true.project(corners_m) + self.random.normal(0.0, self.corner_px, (4, 2)))

    def run(self, duration_s):
        """Return the error of robots' poses, m rms, and the standard deviation in x that is told."""
        for _ in range(round(duration_s * RATE_HZ)):
            tags = [
                self._see(tag_id, np.add(place_m, (0.004 * (tag_id == self.wrong), 0.0)), 0.1, 0.0)
                for tag_id, place_m in self.places.items()
            ]
            tags += [self._see(index, place_m, 0.04, 0.076) for index, place_m in enumerate(ROBOTS_M)]
            self.frames += 1
            robots = self.tracker.take(tags, self.frames / RATE_HZ, self.frames).robots
        errors_m = [math.dist(robots[index].pose[:2], place_m) for index, place_m in enumerate(ROBOTS_M)]
        return math.sqrt(np.square(errors_m).mean()), robots[0].position_sd_m

    @property
    def texts(self):
        return [f"{problem.name}: {problem.text}" for problem in self.tracker.list_problems()]


SHIFTS = {
    "aside": ((0.004, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "up": ((0.0, 0.0, 0.004), (0.0, 0.0, 0.0)),
    "tilted": ((0.0, 0.0, 0.0), (0.1, 0.0, 0.0)),
    "turned": ((0.0, 0.0, 0.0), (0.0, 0.0, 0.2)),
}


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 6])
@pytest.mark.parametrize("shift", SHIFTS)
def test_small_shift_of_a_camera_is_named_and_corrected_slowly(shift, count):
    shifted = Shifted(count, *SHIFTS[shift])
    before_m, _ = shifted.run(0.2)
    assert before_m > 0.001
    _, sd_m = shifted.run(1.3)
    assert sd_m > 0.001, "until it is corrected, poses are known to be worse"
    after_m, sd_m = shifted.run(8.0)
    assert after_m < 0.0002 and sd_m < 0.0008
    (text,) = shifted.texts
    assert text.startswith("camera: the camera has moved by")
    assert text.endswith(" at the field's rim, which is corrected: calibrate the arena again soon")


@pytest.mark.slow
def test_a_camera_that_tilted_a_little_blames_no_tag_before_all_agree():
    for direction in range(12):
        turn_rad = direction * math.pi / 6.0
        shifted = Shifted(turned_deg=(0.1 * math.cos(turn_rad), 0.1 * math.sin(turn_rad), 0.0))
        for _ in range(6):
            shifted.run(0.6)
            assert not any("this reference tag" in text for text in shifted.texts), shifted.texts
        assert any("the camera has moved" in text for text in shifted.texts)


@pytest.mark.slow
def test_a_camera_that_did_not_move_stays_as_it_is():
    for count in (4, 6):
        shifted = Shifted(count, corner_px=0.15)
        _, before_m = shifted.run(0.2)
        assert shifted.run(6.0)[1] == pytest.approx(before_m, rel=1e-4)
        assert shifted.texts == [] and np.array_equal(shifted.tracker.camera.position_m, CALIBRATED.position_m)


@pytest.mark.slow
def test_one_tag_that_moved_is_named_and_moves_no_camera():
    shifted = Shifted(wrong=102)
    after_m, sd_m = shifted.run(4.0)
    (text,) = shifted.texts
    assert text.startswith("tag 102: this reference tag moved by 4 mm") and after_m < 0.0002 and sd_m < 0.0008
    shifted = Shifted(4, wrong=102)
    after_m, sd_m = shifted.run(4.0)
    assert after_m < 0.0002 and sd_m > 0.0012, "of four tags none is known to be right"


@pytest.mark.slow
def test_a_camera_and_a_tag_that_both_moved_are_told_apart():
    shifted = Shifted(6, (0.004, 0.0, 0.0), wrong=101)
    after_m, _ = shifted.run(9.0)
    assert after_m < 0.0003 and sorted(text.partition(":")[0] for text in shifted.texts) == ["camera", "tag 101"]


@pytest.mark.slow
def test_shifts_are_followed_after_time_has_gone_back():
    shifted = Shifted(6, *SHIFTS["aside"])
    shifted.frames = 1000
    shifted.run(1.5)
    shifted.frames = 0
    after_m, _ = shifted.run(9.0)
    assert after_m < 0.0002
