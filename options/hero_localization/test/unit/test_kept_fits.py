"""What fits of prints to images, of cameras and of robots' tags find, in figures: see kept_results."""

import math

import numpy as np
import pytest

pytest.importorskip("cv2")

import cv2

from hero_localization.calibration import print_fit, robot_calibration
from hero_localization.calibration.arena_calibration import calibrate_arena
from hero_localization.camera.camera_model import Camera
from hero_localization.prints.tag_images import draw_tag
from hero_localization.simulated_camera.view import CameraOptions
from hero_localization.tracking import tag_template
from hero_localization.tracking.camera_shift import CameraShift
from hero_localization.tracking.tag_pose import TagCorners, fit_squares, list_corners
from hero_node import Pose, transform_pose
from hero_test.checks.kept_results import check_figures

CAMERA = CameraOptions().geometry


def wave(count, phase, amount):
    """Return errors (count,) that look like chance, the same in all versions of numpy."""
    return amount * np.sin(phase * np.arange(1, count + 1) ** 2)


def photograph(tag_id, to_image, shadow=1.0, gamma=1.0, size_px=66):
    """Return an image (size, size) of a print of 36h11; to_image: (2, 3), cells from its upper left corner to px."""
    cells = np.pad(draw_tag("36h11", tag_id), 2, constant_values=255) / 255.0
    fine = np.kron(np.pad(cells, 4, constant_values=0.6), np.ones((6, 6)))
    # Texels by cells: six for each, and six cells of margin; 4 samples along each pixel.
    to_texel = np.array(((1 / 6, 0, -6 + 0.5 / 6), (0, 1 / 6, -6 + 0.5 / 6), (0, 0, 1)))
    to_sample = np.array(((4, 0, 1.5), (0, 4, 1.5), (0, 0, 1))) @ np.vstack((to_image, (0, 0, 1))) @ to_texel
    seen = cv2.warpPerspective(fine, to_sample, (4 * size_px,) * 2, borderMode=cv2.BORDER_REPLICATE)
    seen = cv2.GaussianBlur(seen, (0, 0), 2.4).reshape(size_px, 4, size_px, 4).mean(axis=(1, 3))
    light = np.where(np.add.outer(np.arange(size_px), 0.5 * np.arange(size_px)) > 0.72 * size_px, shadow, 1.0)
    return np.rint(255.0 * (light * (0.1 + 0.75 * seen)) ** (1.0 / gamma)).astype(np.uint8)


PRINTS = [
    (3, np.array(((3.1, 0.4, 14.2), (-0.5, 2.9, 17.3)))),
    (5, np.array(((-2.2, 1.1, 32.4), (-1.2, -2.1, 41.7)))),
    (11, np.array(((0.3, -4.1, 48.6), (3.9, 0.2, 16.4)))),
]
"""Tags, and turns and places of their prints: px by cells."""

TEMPLATES = """
14.03 17.26 38.96 13.20 42.40 36.58 17.47 40.64 3.12 0.42 -0.51 2.92 28.20 26.92 9.75 9.78 0.00 4.95 0.00
32.41 41.72 14.73 32.10 23.58 15.26 41.26 24.88 -2.21 1.11 -1.20 -2.11 28.00 28.48 9.94 9.96 0.00 5.53 0.00
48.79 16.40 51.01 47.68 18.01 49.22 15.78 17.95 0.28 -4.14 3.92 0.20 33.37 32.81 9.38 9.70 0.00 6.49 0.00
"""


def test_fits_of_prints_in_shadows_are_as_they_were():
    rows = []
    for (tag_id, to_image), shadow in zip(PRINTS, (0.35, 1.0, 0.5)):
        image, template = photograph(tag_id, to_image, shadow), tag_template.TagTemplate("36h11", tag_id, 0.35)
        shape, center = to_image[:, :2], to_image @ (4.0, 4.0, 1.0)
        side_px = 8.2 * math.sqrt(np.linalg.det(shape))
        (tag,) = tag_template.TemplateDetector(tag_id, center + 0.4, side_px, None).detect(image[2:], (0, 2))
        shades = np.log(image.astype(np.float32) + tag_template.DARK)
        fit = template._refine(shades, 1.03 * shape, center + (0.8, -0.6), 3)
        rows.append(
            (*tag.corners.ravel(), *fit.shape.ravel(), *fit.center, 10 * fit.code, 10 * fit.border, fit.misread,
             10 * fit.contrast, fit.is_settled)
        )  # fmt: skip
    check_figures(rows, TEMPLATES, 2)


SOUGHT = """
1.00 7.00 29.67 26.16 29.67 29.20 28.24 26.83 3.12 0.42 -0.48 2.95 0.97 0.97 0.50
1.00 7.00 27.79 27.95 33.85 27.95 28.27 26.95 3.12 0.45 -0.50 2.95 0.97 0.98 0.49
1.00 7.00 25.66 24.63 31.72 27.67 25.36 24.94 3.93 0.62 -0.58 3.70 0.01 -0.12 -0.14
1.00 7.00 28.27 28.81 28.27 26.37 28.00 28.49 -2.21 1.11 -1.20 -2.11 0.99 1.00 0.55
1.00 7.00 26.58 29.05 26.58 31.49 28.09 28.45 -2.17 1.05 -1.19 -2.11 0.99 0.99 0.57
1.00 7.00 29.71 31.04 27.28 31.04 29.55 30.50 -2.58 1.26 -1.99 -2.23 0.03 0.41 -0.19
1.00 7.00 34.42 33.35 34.42 29.34 33.42 32.87 0.28 -4.14 3.91 0.18 0.94 0.97 0.65
1.00 7.00 35.22 30.66 31.21 22.65 35.58 32.11 0.16 -4.84 4.07 0.39 0.53 0.55 -0.02
1.00 7.00 37.75 35.65 33.74 35.65 37.09 34.90 0.18 -5.23 4.60 0.01 -0.13 0.09 -0.10
"""


def test_prints_are_sought_farther_away_as_they_were():
    """From places and sizes that are far off: whether they are found, and the first iterations."""
    rows = []
    for index, (tag_id, to_image) in enumerate(PRINTS):
        image, template = (
            photograph(tag_id, to_image, (0.35, 1.0, 0.5)[index]),
            tag_template.TagTemplate("36h11", tag_id, 0.35),
        )
        shape, center = to_image[:, :2], to_image @ (4.0, 4.0, 1.0)
        shades, cell_px = np.log(image.astype(np.float32) + tag_template.DARK), math.sqrt(np.linalg.det(shape))
        for cells, factor in ((0.9, 1.0), (1.6, 1.08), (0.3, 1.3)):
            off_px = cells * cell_px * np.array((math.cos(2.0 * index + 1.0), math.sin(2.0 * index + 1.0)))
            shapes = factor * np.array((shape, shape @ cv2.Rodrigues(np.array((0.0, 0.0, 0.15)))[0][:2, :2]))
            found = template.find(image, center + off_px, shapes)
            starts = list(template._list_starts(shades, center + off_px, shapes, cell_px))
            fit = template._refine(shades, *starts[1], 2)
            numbers = fit.code, fit.border, fit.contrast
            rows.append(
                (
                    found is not None,
                    len(starts),
                    *starts[1][1],
                    *starts[3][1],
                    *fit.center,
                    *fit.shape.ravel(),
                    *numbers,
                )
            )
    check_figures(rows, SOUGHT, 2)


PRINT_FITS = """
101.0 0.61 26 217 1.00 14.20 17.30 39.00 13.30 42.20 36.50 17.40 40.50
101.0 0.61 71 233 1.80 32.40 41.70 14.80 32.10 23.60 15.30 41.20 24.90
101.8 0.90 1 200 1.50 48.72 16.27 51.14 47.72 18.08 49.33 15.66 17.88
"""


def test_scale_blur_shades_and_gamma_of_prints_are_as_they_were():
    rows = []
    for index, (tag_id, to_image) in enumerate(PRINTS):
        image = photograph(tag_id, to_image, gamma=(1.0, 1.8, 0.8)[index])
        corners = np.array(((0, 0, 1), (8, 0, 1), (8, 8, 1), (0, 8, 1))) @ to_image.T
        tag = TagCorners(tag_id, corners.mean(axis=0) + 0.99 * (corners - corners.mean(axis=0)))
        known = print_fit.PrintScale(1.0, 0.9, 1.5) if index == 2 else None
        fit = print_fit._fit_print(image, tag, draw_tag("36h11", tag_id), known)
        rows.append((100.0 * fit[0], *fit[1:], *print_fit._scale(tag, fit[0]).corners.ravel()))
    check_figures(rows, PRINT_FITS, (1, 2, 0, 0, 2, *[2] * 8))


PLACES = [Pose(x_m, y_m, 0.1 * index) for index, (x_m, y_m) in enumerate(
    ((-1.0, -0.6), (1.0, -0.6), (1.0, 0.6), (-1.0, 0.6), (0.0, 0.65), (0.1, -0.62), (0.5, 0.1))
)]  # fmt: skip


def see(camera, places, error_px=0.0):
    corners_m = np.array([list_corners(place, 0.1, 0.0) for place in places])
    pixels = camera.project(corners_m)
    pixels += wave(pixels.size, 1.3, error_px).reshape(pixels.shape)
    return [TagCorners(100 + index, corners) for index, corners in enumerate(pixels)]


ARENAS = """
29.9 -20.9 2199.7 0.05 0.20 0.13 0.11 0.13 0.12 0.30 0.16 0.10 0 0
30.1 -20.3 2199.6 0.04 0.14 12.28 0.11 0.12 0.13 0.30 0.16 0.11 1 1
27.5 -31.6 2201.7 1.26 1.86 2.04 0.94 1.16 nan nan 1.51 1.31 0 2
"""


def test_cameras_found_from_places_by_a_tape_are_as_they_were():
    """With a small error of all places, with a tag 12 mm off, and with two of which either may be off."""
    rows = []
    for wrong_m, count in ((0.0, 7), (0.012, 7), (0.0055, 5)):
        errors_m = wave(14, 2.1, 0.0007).reshape(7, 2)
        errors_m[2, 0] += wrong_m
        told = {
            100 + i: Pose(pose.x_m + errors_m[i, 0], pose.y_m + errors_m[i, 1], 0.0) for i, pose in enumerate(PLACES)
        }
        found = calibrate_arena(CAMERA.lens, see(CAMERA, PLACES[:count], 0.1), told)
        residuals_mm = 1e3 * np.array([found.residuals_m.get(100 + index, math.nan) for index in range(7)])
        numbers = 1e3 * found.camera.position_m, residuals_mm, (1e3 * found.rms_m, 1e3 * found.sd_m)
        rows.append((*np.concatenate(numbers), len(found.left_out), len(found.problems)))
    check_figures(rows, ARENAS, (*[1] * 3, *[2] * 9, 0, 0))


SHIFTS = """
1.90 2.13 0 0.00 30.4 -20.2 2200.1
3.05 1.12 0 0.00 30.6 -20.3 2200.1
3.73 0.51 0 0.00 30.7 -20.4 2200.2
4.14 0.15 0 0.00 30.8 -20.4 2200.2
4.39 0.00 103 1.80 30.8 -20.4 2200.2
4.55 0.00 103 3.60 30.8 -20.4 2200.2
4.64 0.00 103 3.60 30.8 -20.4 2200.2
"""


def test_a_shift_of_a_camera_is_followed_as_it_was():
    seen = {fit.tag_id: fit.pose for fit in fit_squares(CAMERA, see(CAMERA, PLACES), 0.0)}
    shift, rows = CameraShift(CAMERA, seen), []
    turn = cv2.Rodrigues(np.array((0.0008, -0.001, 0.0006)))[0]
    moved = Camera(CAMERA.lens, turn @ CAMERA.rotation, CAMERA.position_m + (0.001, -0.0005, 0.0))
    for image in range(80):
        places = list(PLACES)
        if image > 45:
            places[3] = transform_pose(Pose(0.003, 0.002, 0.0), PLACES[3])
        shift.add(see(moved, places, 0.03)[: 7 if image % 3 else 4], 0.1 * image)
        if image % 11 == 10:
            tag_id, off_m = shift.wrong or (0, 0.0)
            place_mm = 1e3 * shift.camera.position_m
            rows.append((1e3 * shift.shift_m, 1e3 * shift.rest_m, tag_id, 1e3 * off_m, *place_mm))
    check_figures(rows, SHIFTS, (2, 2, 0, 2, 1, 1, 1))


ROBOTS = """
4.0502 -2.9836 0.10223 62.0390 0.23483 0.99981 0
-11.9953 19.9833 -2.89757 -30.9630 0.21296 1.00193 2
"""


def test_mounts_and_delays_found_by_a_drive_are_as_they_were():
    rows = []
    for mount, delay_s in ((Pose(0.004, -0.003, 0.1), 0.062), (Pose(-0.012, 0.02, -2.9), -0.031)):
        true, counted, drive, odometry = Pose(0.2, 0.1, 2.0), Pose(0.0, 0.0, 0.0), [], []
        for duration_s, linear_m_s, angular_rad_s in robot_calibration.CALIBRATION_DRIVE:
            for _ in range(round(duration_s / 0.01)):
                true = transform_pose(true, Pose(0.01 * linear_m_s, 0.0, 0.01 * angular_rad_s))
                slip = 1.02 if angular_rad_s > 0.0 else 1.035
                counted = transform_pose(counted, Pose(0.0101 * linear_m_s, 0.0, 0.01 * slip * angular_rad_s))
                drive.append((0.01 * len(drive), transform_pose(true, mount)))
                odometry.append(counted)
        errors = wave(3 * len(drive), 0.7, 1.0).reshape(-1, 3) * (0.001, 0.001, 0.006)
        seen = [(at_s + delay_s, Pose(*np.add(pose, off))) for (at_s, pose), off in zip(drive, errors)][::4]
        found = robot_calibration.calibrate_robot(seen, [(0.01 * i, pose) for i, pose in enumerate(odometry)][::3])
        place_mm, times_ms = 1e3 * np.array(found.mount[:2]), (1e3 * found.delay_s, 1e3 * found.delay_error_s)
        rows.append((*place_mm, found.mount.yaw_rad, *times_ms, 1e3 * found.rms_m, len(found.problems)))
    check_figures(rows, ROBOTS, (4, 4, 5, 4, 5, 5, 0))
