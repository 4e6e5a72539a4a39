"""Poses of robots, objects and reference tags from corners; tags that stand for nothing, come twice, or do not fit."""

import math

import numpy as np
import pytest

from hero_client.controllers import HeadingCheck, is_upside_down
from hero_localization.camera.camera_model import Camera, Intrinsics
from hero_localization.tracking.tag_pose import (
    SYSTEMATIC_M,
    SYSTEMATIC_RAD,
    TagCorners,
    TagLayout,
    find_smallest_side,
    fit_squares,
    locate,
)
from hero_node import Pose, transform_pose, wrap_angle

LENS = Intrinsics(
    1920,
    1080,
    np.array(((1390.0, 0.0, 955.0), (0.0, 1385.0, 545.0), (0.0, 0.0, 1.0))),
    np.array((-0.1, 0.02, 0.001, 0, 0)),
)
TILT = np.array(((1.0, 0.0, 0.0), (0.0, math.cos(0.1), -math.sin(0.1)), (0.0, math.sin(0.1), math.cos(0.1))))
CAMERA = Camera(LENS, TILT @ np.diag((1.0, -1.0, -1.0)), np.array((0.1, 0.0, 2.2)))


def see(tag_id, pose, size_m=0.04, height_m=0.076, noise_px=None):
    """Return the corners of a tag whose print points along its pose's yaw."""
    half = size_m / 2.0
    corners = [
        transform_pose(pose, Pose(x, y, 0.0)) for x, y in ((half, half), (half, -half), (-half, -half), (-half, half))
    ]
    pixels = CAMERA.project(np.array([(corner.x_m, corner.y_m, height_m) for corner in corners]))
    return TagCorners(tag_id, pixels if noise_px is None else pixels + noise_px)


def assert_near(found, expected, tolerance=1e-6):
    assert found[:2] == pytest.approx(expected[:2], abs=tolerance)
    assert abs(wrap_angle(found.yaw_rad - expected.yaw_rad)) < tolerance


@pytest.mark.parametrize("pose", [Pose(0.0, 0.0, 0.0), Pose(-1.2, 0.6, 3.1), Pose(1.3, -0.7, -1.2)])
def test_robots_wear_the_tag_of_their_number(pose):
    seen = locate(CAMERA, [see(12, pose)], TagLayout())
    assert_near(seen.robots[12].pose, pose)
    assert seen.robots[12].size_m == pytest.approx(0.04, abs=1e-6)


@pytest.mark.parametrize("yaw_rad", [0.0, 1.5, math.pi, -2.0])
def test_robots_pose_is_that_of_its_center_not_of_the_tag(yaw_rad):
    mount = Pose(0.012, -0.005, yaw_rad)
    robot = Pose(0.7, 0.3, 2.0)
    tag = transform_pose(robot, mount)
    seen = locate(CAMERA, [see(4, tag, 0.05, 0.09)], TagLayout(mounts={4: mount}, size_m=0.05, height_m=0.09))
    assert_near(seen.robots[4].pose, robot)


@pytest.mark.slow
def test_standard_deviations_hold_what_noise_of_the_corners_does():
    random, pose = np.random.RandomState(0), Pose(0.9, -0.3, 1.0)
    tags = [see(1, pose, noise_px=random.normal(0.0, 0.1, (4, 2))) for _ in range(2000)]
    found = fit_squares(CAMERA, tags, 0.076)
    spread = np.std([fit.pose for fit in found], axis=0)
    noise_m2 = found[0].position_sd_m ** 2 - SYSTEMATIC_M**2
    modeled = np.sqrt((noise_m2, noise_m2, found[0].yaw_sd_rad ** 2 - SYSTEMATIC_RAD**2))
    assert spread == pytest.approx(modeled, rel=0.2)


def test_tag_off_the_robots_center_makes_its_place_less_certain():
    near, far = (
        locate(CAMERA, [see(1, Pose(0.0, 0.0, 0.0))], TagLayout(mounts={1: mount})).robots[1]
        for mount in (Pose(0.0, 0.0, 0.0), Pose(0.06, -0.08, 2.0))
    )
    assert far.yaw_sd_rad == near.yaw_sd_rad > 0.0
    # In x and y together by as much as the heading moves the center, 0.1 m from the tag.
    both_m2 = 2.0 * (far.position_sd_m**2 - near.position_sd_m**2)
    assert both_m2 == pytest.approx((0.1 * near.yaw_sd_rad) ** 2)


def test_ids_are_looked_up_among_references_objects_and_robots():
    layout = TagLayout(
        tag_robots={40: 2},
        objects={9: "box"},
        references={1: Pose(1.0, 0.5, 0.0)},
        mounts={9: Pose(0.02, 0.0, math.pi)},
    )
    tags = [
        see(0, Pose(0.1, 0.2, 0.3)),
        see(40, Pose(0.5, 0.2, 0.3)),
        see(1, Pose(1.0, 0.5, 0.0), 0.1, 0.0),
        see(9, Pose(-0.5, 0.2, 0.3)),
    ]
    seen = locate(CAMERA, tags, layout)
    assert set(seen.robots) == {0, 2} and set(seen.objects) == {"box"} and set(seen.references) == {1}
    assert_near(seen.robots[2].pose, Pose(0.5, 0.2, 0.3))
    assert_near(transform_pose(seen.objects["box"].pose, Pose(0.02, 0.0, math.pi)), Pose(-0.5, 0.2, 0.3))
    assert_near(seen.references[1].pose, Pose(1.0, 0.5, 0.0))
    assert not seen.unknown and not seen.doubled and not seen.misshapen


@pytest.mark.parametrize("corner", [0.0, math.nan])
def test_a_tag_whose_corners_are_no_square_counts_nowhere(corner):
    seen = locate(CAMERA, [TagCorners(3, np.full((4, 2), corner))], TagLayout())
    assert set(seen.misshapen) == {3} and not seen.robots


def test_the_own_id_of_a_robot_that_wears_another_tag_is_unknown():
    tags = [see(tag_id, Pose(0.2 * tag_id, 0.0, 0.0)) for tag_id in (0, 2)]
    seen = locate(CAMERA, tags, TagLayout(tag_robots={40: 2}))
    assert set(seen.robots) == {0} and seen.unknown == [2]


def test_robots_wear_the_tag_of_their_id_unless_told_otherwise():
    layout = TagLayout(tag_robots={40: 2, 3: 7}, objects={9: "box"}, references={1: Pose(1.0, 0.5, 0.0)})
    assert layout.find_tags((0, 2, 7)) == {0: 0, 2: 40, 7: 3}
    assert layout.find_tags((1, 3, 9)) == {}, "these tags stand for something else"


def test_id_seen_twice_is_named_and_gives_no_pose():
    tags = [see(3, Pose(0.0, 0.0, 0.0)), see(5, Pose(0.2, 0.0, 0.0)), see(3, Pose(0.5, 0.0, 0.0))]
    seen = locate(CAMERA, tags, TagLayout())
    assert seen.doubled == [3] and set(seen.robots) == {5}


@pytest.mark.parametrize("size_m", [0.03, 0.05])
def test_tag_of_another_size_is_named_and_gives_no_pose(size_m):
    seen = locate(CAMERA, [see(3, Pose(0.0, 0.0, 0.0), size_m)], TagLayout())
    assert not seen.robots and seen.misshapen == pytest.approx({3: size_m / 0.04}, rel=1e-6)


def test_print_that_is_a_little_small_gives_the_same_pose():
    """As printers make it that fit the page."""
    seen = locate(CAMERA, [see(3, Pose(0.8, 0.4, 1.0), 0.0388)], TagLayout())
    assert_near(seen.robots[3].pose, Pose(0.8, 0.4, 1.0))
    assert seen.robots[3].size_m == pytest.approx(0.0388, abs=1e-6)


def test_picture_without_tags_shows_nothing():
    assert locate(CAMERA, [], TagLayout()).robots == {}


def drive(parts, heading_error_rad=0.0, speed=1.0):
    """Return poses seen, with a heading that is wrong, and odometry, of a drive in parts (distance, turn)."""
    true, odometry = Pose(0.5, 0.2, 2.0), Pose(0.0, 0.0, 0.0)
    seen, counted = [], []
    random = np.random.RandomState(1)
    for distance_m, turn_rad in parts:
        for _ in range(20):
            step = Pose(distance_m / 20.0, 0.0, turn_rad / 20.0)
            true, odometry = transform_pose(true, step), transform_pose(odometry, step)
            noise = random.normal(0.0, 0.0005, 2)
            seen.append(Pose(true.x_m + noise[0], true.y_m + noise[1], wrap_angle(true.yaw_rad + heading_error_rad)))
            counted.append(odometry)
    return seen, counted


def find_heading_error(seen, odometry):
    check = HeadingCheck()
    for at, counted in zip(seen, odometry):
        check.add(at, counted)
    return check.error_rad


@pytest.mark.parametrize("error_rad", [0.0, 0.1, -0.7, 3.0])
@pytest.mark.parametrize("forward", [0.2, -0.2])
def test_wrong_heading_of_a_tag_is_found_on_a_straight_drive(error_rad, forward):
    found = find_heading_error(*drive([(forward, 0.0), (0.0, 1.5), (forward, 0.1)], error_rad))
    assert abs(wrap_angle(found - error_rad)) < 0.02


def test_heading_cannot_be_found_without_driving_straight():
    assert find_heading_error(*drive([(0.0, 6.0)], 0.5)) is None
    assert find_heading_error(*drive([(0.1, 0.0)], 0.5)) is None
    assert find_heading_error([], []) is None


def test_robot_that_a_wall_holds_shows_no_heading():
    seen, odometry = drive([(0.4, 0.0)], 0.0)
    assert find_heading_error(seen[:1] * len(odometry), odometry) is None


def test_tag_on_upside_down_is_told_from_one_that_is_turned():
    assert is_upside_down(find_heading_error(*drive([(0.2, 0.0)], math.pi)))
    assert is_upside_down(-3.0)
    assert not is_upside_down(math.pi / 2.0) and not is_upside_down(0.1)


@pytest.mark.parametrize(("share", "is_right"), [(0.84, False), (0.86, True), (1.14, True), (1.16, False)])
def test_tags_may_measure_15_percent_more_or_less_than_their_print(share, is_right):
    seen = locate(CAMERA, [see(3, Pose(0.2, 0.1, 0.5), 0.04 * share)], TagLayout())
    assert (3 in seen.robots) == is_right and (3 in seen.misshapen) == (not is_right)


def test_uncertainty_is_that_of_the_corners_and_what_calibration_leaves():
    tag = see(1, Pose(0.1, 0.0, 0.4))
    (found,) = fit_squares(CAMERA, [tag], 0.076)
    side_px = np.linalg.norm(tag.corners - np.roll(tag.corners, 1, axis=0), axis=1).mean()
    corner_m = 0.1 * 0.04 / side_px
    place_m2, yaw_rad2 = corner_m**2 / 4.0 + 0.0007**2, (corner_m / 0.04) ** 2 / 2.0 + 0.003**2
    assert (found.position_sd_m, found.yaw_sd_rad) == pytest.approx((math.sqrt(place_m2), math.sqrt(yaw_rad2)))


def test_the_smallest_side_is_that_of_the_tag_seen_from_farthest():
    matrix = np.array(((1390.0, 0.0, 959.5), (0.0, 1390.0, 539.5), (0.0, 0.0, 1.0)))
    straight = Intrinsics(1920, 1080, matrix, np.zeros(5))
    down = Camera(straight, np.diag((1.0, -1.0, -1.0)), np.array((0.1, 0.0, 2.2)))
    assert find_smallest_side(down, 0.04, 0.076) == pytest.approx(1390.0 * 0.04 / (2.2 - 0.076))
    assert find_smallest_side(down, 0.05, 0.2) == pytest.approx(1390.0 * 0.05 / 2.0)
    tilted = down._replace(rotation=TILT @ down.rotation)
    depth_m = 2.124 / math.cos(0.1 + math.atan(0.47 * 1080.0 / 1390.0)) * math.cos(math.atan(0.47 * 1080.0 / 1390.0))
    assert find_smallest_side(tilted, 0.04, 0.076) == pytest.approx(1390.0 * 0.04 / depth_m, rel=0.12)
    up = down._replace(rotation=np.eye(3))
    assert find_smallest_side(up, 0.04, 0.076) == math.inf


def test_tags_are_centered_unless_they_are_calibrated():
    layout = TagLayout(mounts={4: Pose(0.01, 0.0, 0.0)})
    assert layout.find_mount(4).x_m == 0.01 and layout.find_mount(5) == (0.0, 0.0, 0.0)
    assert (layout.size_m, layout.height_m, layout.reference_size_m) == (0.04, 0.076, 0.1)


def test_center_and_side_of_a_tag_are_those_of_its_print_in_perspective():
    tag = TagCorners(0, np.array(((0.0, 0.0), (40.0, 0.0), (30.0, 20.0), (10.0, 20.0))))
    assert tag.center == pytest.approx((20.0, 40.0 / 3.0)), "where the diagonals cross"
    assert tag.side_px == pytest.approx(math.sqrt(600.0))
    flat = TagCorners(0, np.array(((0.0, 0.0), (2.0, 2.0), (4.0, 4.0), (6.0, 6.0))))
    assert flat.center == pytest.approx((3.0, 3.0)) and flat.side_px == 0.0
