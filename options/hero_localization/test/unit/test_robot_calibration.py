"""Tag on its robot and delay of the camera, from a simulated drive on the spot and straight on."""

import math

import numpy as np
import pytest

from hero_localization.calibration import robot_calibration
from hero_localization.calibration.robot_calibration import CALIBRATION_DRIVE, calibrate_robot
from hero_localization.errors import CalibrationError
from hero_node import Pose, transform_pose, wrap_angle

STEP_S = 0.01
FULL = (
    (6.5, 0.0, 1.2),
    (0.5, 0.0, 0.0),
    (6.5, 0.0, -1.2),
    (0.5, 0.0, 0.0),
    (2.0, 0.1, 0.0),
    (2.0, -0.1, 0.0),
)
"""Turn left, turn right, forward, back: duration s, m/s, rad/s."""


MOUNT = Pose(0.006, -0.003, 0.05)


def drive(parts=FULL, mount=MOUNT, delay_s=0.08, seed=0, noise_m=0.0007, noise_rad=0.006):
    """Return what the camera and odometry say; wheels slip by 2 % and the stamps are late."""
    random = np.random.RandomState(seed)
    true, counted, now_s = Pose(0.6, -0.3, 2.0), Pose(1.0, 2.0, -1.0), 10.0
    slip = 1.0 + random.uniform(0.0, 0.03, 2)
    ways, seen, odometry = [], [], []
    for duration_s, linear_m_s, angular_rad_s in parts:
        for _ in range(int(duration_s / STEP_S)):
            true = transform_pose(true, Pose(linear_m_s * STEP_S, 0.0, angular_rad_s * STEP_S))
            turned = angular_rad_s * STEP_S * slip[int(angular_rad_s > 0.0)]
            counted = transform_pose(counted, Pose(linear_m_s * STEP_S * 1.015, 0.0, turned))
            now_s += STEP_S
            ways.append((now_s, true, counted))
    for now_s, true, _ in ways[::3]:
        tag = transform_pose(true, mount)
        noise = random.normal(0.0, (noise_m, noise_m, noise_rad))
        seen.append(
            (
                now_s + delay_s,
                Pose(tag.x_m + noise[0], tag.y_m + noise[1], wrap_angle(tag.yaw_rad + noise[2])),
            )
        )
    odometry = [(now_s, counted._replace(yaw_rad=wrap_angle(counted.yaw_rad))) for now_s, _, counted in ways[::4]]
    return seen, odometry


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("mount", [Pose(0.0, 0.0, 0.0), Pose(0.008, -0.005, 0.2), Pose(-0.01, 0.004, -1.6)])
def test_place_and_yaw_of_the_tag_and_the_delay_are_found(mount, seed):
    found = calibrate_robot(*drive(mount=mount, seed=seed))
    assert found.problems == []
    assert (found.mount.x_m, found.mount.y_m) == pytest.approx(mount[:2], abs=0.0005)
    assert abs(wrap_angle(found.mount.yaw_rad - mount.yaw_rad)) < 0.012
    assert found.delay_s == pytest.approx(0.08, abs=0.003)
    assert found.delay_error_s < 0.003 and found.rms_m < 0.0012


@pytest.mark.parametrize("delay_s", [-0.03, 0.0, 0.25])
def test_delays_of_all_sizes_are_found(delay_s):
    found = calibrate_robot(*drive(delay_s=delay_s))
    assert found.delay_s == pytest.approx(delay_s, abs=0.003)


@pytest.mark.slow
def test_error_of_the_delay_is_stated_as_large_as_it_is():
    errors = [calibrate_robot(*drive(seed=seed)) for seed in range(12)]
    spread_s = np.std([found.delay_s for found in errors])
    stated_s = np.mean([found.delay_error_s for found in errors])
    assert 0.3 * stated_s < spread_s < 3.0 * stated_s


def test_tag_on_upside_down_is_named():
    found = calibrate_robot(*drive(mount=Pose(0.002, 0.0, math.pi - 0.05)))
    assert any("upside down" in problem for problem in found.problems)
    assert abs(wrap_angle(found.mount.yaw_rad - math.pi + 0.05)) < 0.012


def test_tag_far_from_the_robots_center_is_named():
    found = calibrate_robot(*drive(mount=Pose(0.03, 0.0, 0.0)))
    assert any("30 mm from the robot's center" in problem for problem in found.problems)


def test_loose_tag_is_named():
    found = calibrate_robot(*drive(noise_m=0.004))
    assert any("loosely" in problem for problem in found.problems)


def test_steady_turning_does_not_show_the_delay():
    steady = ((12.0, 0.0, 1.2), (2.0, 0.1, 0.0))
    try:
        found = calibrate_robot(*drive(steady, noise_rad=0.1))
    except CalibrationError as error:
        assert "clocks" in str(error)
    else:
        assert any("to and fro" in problem for problem in found.problems)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ((*FULL[:4], (1.0, 0.02, 0.0)), "drove .* mm only"),
        (FULL[4:], "turned by 0 degrees only"),
        (((0.2, 0.0, 1.0),), "seen 0 times"),
    ],
)
def test_drives_that_are_too_short_are_refused(parts, words):
    with pytest.raises(CalibrationError, match=words):
        calibrate_robot(*drive(parts))


def test_robot_without_odometry_is_named():
    seen, _ = drive()
    with pytest.raises(CalibrationError, match="no odometry"):
        calibrate_robot(seen, [])


def test_tag_of_another_robot_is_named():
    seen, odometry = drive()
    still = [(stamp_s, Pose(0.1, 0.2, 0.3 + 1e-3 * math.sin(stamp_s))) for stamp_s, _ in seen]
    try:
        found = calibrate_robot(still, odometry)
    except CalibrationError as error:
        assert "clocks" in str(error)
    else:
        assert found.problems


def test_the_drive_turns_to_both_sides_and_ends_where_it_begins():
    turns_rad = [duration_s * angular_rad_s for duration_s, _, angular_rad_s in CALIBRATION_DRIVE]
    steps_m = [duration_s * linear_m_s for duration_s, linear_m_s, _ in CALIBRATION_DRIVE]
    assert sum(turns_rad) == 0.0 and sum(steps_m) == 0.0
    assert max(turns_rad) == 6.5 and max(steps_m) == 0.12
    assert all(not turn_rad or not step_m for turn_rad, step_m in zip(turns_rad, steps_m)), "one after the other"
    assert 11.0 < sum(duration_s for duration_s, _, _ in CALIBRATION_DRIVE) < 12.0
    found = calibrate_robot(*drive(CALIBRATION_DRIVE))
    assert found.problems == [] and (found.mount.x_m, found.mount.y_m) == pytest.approx(MOUNT[:2], abs=0.0005)


@pytest.mark.parametrize("delay_s", [-0.08, 0.0, 0.25, 0.48])
def test_delays_are_found_as_far_as_they_are_looked_for(delay_s):
    assert calibrate_robot(*drive(delay_s=delay_s)).delay_s == pytest.approx(delay_s, abs=0.003)


@pytest.mark.parametrize("delay_s", [-0.13, 0.56])
def test_a_delay_beyond_that_is_of_another_clock(delay_s):
    with pytest.raises(CalibrationError, match="no delay between -100 and 500 ms: do the clocks agree"):
        calibrate_robot(*drive(delay_s=delay_s))


def test_problems_begin_at_their_limits():
    for x_m, named in ((0.0192, False), (0.0208, True)):
        found = calibrate_robot(*drive(mount=Pose(x_m, 0.0, 0.0), noise_m=1e-4, noise_rad=1e-3))
        assert any("from the robot's center" in problem for problem in found.problems) == named, x_m
    for noise_m, named in ((0.00125, False), (0.0016, True)):
        found = calibrate_robot(*drive(noise_m=noise_m))
        assert any("loosely" in problem for problem in found.problems) == named, noise_m
        assert found.rms_m == pytest.approx(math.sqrt(2.0) * noise_m, rel=0.1), "of both axes"


def test_a_short_drive_is_enough_from_its_limit_on():
    for duration_s, is_enough in ((1.05, True), (0.85, False)):
        parts = (*FULL[:4], (duration_s, 0.1, 0.0))
        try:
            calibrate_robot(*drive(parts, noise_m=1e-4))
        except CalibrationError as error:
            assert not is_enough and "it takes 80" in str(error)
        else:
            assert is_enough


def test_forty_poses_within_the_odometry_are_enough():
    seen, odometry = drive()
    first_s, last_s = odometry[0][0], odometry[-1][0]
    # Of a pose whose delay may be half a second, the robot's must be known before it, and 0.1 s after it.
    inside = [item for item in seen if first_s + 0.5 <= item[0] <= last_s - 0.1]
    chosen = [inside[index] for index in np.linspace(0, len(inside) - 1, 40).astype(int)]
    beyond = [(first_s + 0.49, seen[0][1]), (last_s - 0.09, seen[-1][1])] * 20
    assert calibrate_robot([*chosen, *beyond], odometry).delay_s == pytest.approx(0.08, abs=0.02)
    with pytest.raises(CalibrationError, match=r"seen 39 times, which is too few \(40\)"):
        calibrate_robot([*chosen[1:], *beyond], odometry)
    again = calibrate_robot([*reversed(seen)], [*reversed(odometry)])
    assert again == calibrate_robot(seen, odometry), "in any order"


@pytest.mark.parametrize(("turn_rad", "is_enough"), [(4.1, True), (3.9, False)])
def test_a_turn_of_four_radians_is_enough(turn_rad, is_enough):
    parts = ((turn_rad / 1.2 / 1.02, 0.0, 1.2), (0.5, 0.0, 0.0), (turn_rad / 1.2 / 1.02, 0.0, -1.2), *FULL[3:])
    # Wheels slip by up to 3 %: of the turn, what odometry counted.
    seen, odometry = drive(parts)
    yaws_rad = np.unwrap([pose.yaw_rad for _, pose in odometry])
    scale = turn_rad / np.ptp(yaws_rad)
    counted = [(stamp_s, pose._replace(yaw_rad=wrap_angle(yaw_rad * scale)))
               for (stamp_s, pose), yaw_rad in zip(odometry, yaws_rad)]  # fmt: skip
    if is_enough:
        assert calibrate_robot(seen, counted).delay_s == pytest.approx(0.08, abs=0.004)
    else:
        with pytest.raises(CalibrationError, match="turned by 223 degrees only; it takes 229"):
            calibrate_robot(seen, counted)


@pytest.mark.parametrize(("error_s", "is_named"), [(0.0049, False), (0.0051, True)])
def test_a_delay_is_known_well_enough_to_five_milliseconds(error_s, is_named, monkeypatch):
    monkeypatch.setattr(robot_calibration, "_find_delay", lambda *_: (0.08, error_s))
    found = calibrate_robot(*drive())
    assert found.delay_error_s == error_s
    assert found.problems == (["the delay is known to 5 ms only: let the robot turn to and fro"] if is_named else [])


@pytest.mark.slow
def test_the_delay_and_its_error_are_those_of_least_squares():
    random = np.random.RandomState(2)
    odometry_s = np.arange(0.0, 12.0, 0.03)
    counted_rad = 3.0 * np.sin(odometry_s)
    errors, stated = [], []
    for _ in range(30):
        stamps_s = np.sort(random.uniform(1.0, 11.0, 200))
        yaw_rad = 0.97 * np.interp(stamps_s - 0.1234, odometry_s, counted_rad) + 0.5 + random.normal(0.0, 0.02, 200)
        delay_s, error_s = robot_calibration._find_delay(stamps_s, yaw_rad, odometry_s, counted_rad)
        errors.append(delay_s - 0.1234)
        stated.append(error_s)
    # Of yaw by time, a straight line through the noise: sd / (rms of the slope) / sqrt(n).
    assert np.mean(stated) == pytest.approx(0.02 / (3.0 * 0.97 / math.sqrt(2.0)) / math.sqrt(200.0), rel=0.15)
    assert np.std(errors) == pytest.approx(np.mean(stated), rel=0.35) and abs(np.mean(errors)) < 0.0004


def test_the_pauses_of_the_drive_are_those_that_the_camera_needs():
    pauses_s = [duration_s for duration_s, *speeds in CALIBRATION_DRIVE if not any(speeds)]
    assert pauses_s == [0.5, 0.4, 0.4, 0.8]
    assert [part[0] for part in CALIBRATION_DRIVE if any(part[1:])] == [2.6, 2.6, 2.0, 2.0]
