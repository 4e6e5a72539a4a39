"""Calibrates the tag's mount on a robot and the latency of the camera's stamps by a drive on the spot and straight on.

Pure. The robot turns left and right on the spot, then drives forward and back. Turning moves the tag round the robot's
center and shows the stamps' delay; driving shows which way is forward.
"""

import math
from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from hero_client.controllers import is_upside_down
from hero_node import Pose, wrap_angle

from ..errors import CalibrationError

CALIBRATION_DRIVE = (
    (0.5, 0.0, 0.0),
    (2.6, 0.0, 2.5),
    (0.4, 0.0, 0.0),
    (2.6, 0.0, -2.5),
    (0.4, 0.0, 0.0),
    (2.0, 0.06, 0.0),
    (2.0, -0.06, 0.0),
    (0.8, 0.0, 0.0),
)
"""The drive: duration (s), m/s, rad/s. A turn to each side, and 0.12 m forward and back."""

MIN_POSES = 40
MIN_TURN_RAD = 4.0
MIN_DRIVE_M = 0.08
DELAYS_S = (-0.1, 0.5)
"""Delays of the stamps that are looked for."""

GOOD_RMS_M = 0.002
GOOD_DELAY_S = 0.005
CENTERED_M = 0.02
"""A tag further from the robot's center than this is more likely wrongly measured than so mounted."""

_DELAY_STEP_S = 0.005


class RobotCalibration(NamedTuple):
    """The tag on its robot, and the camera's stamps; what speaks against using them.

    mount: pose of the tag in base_link; yaw of its print's upper edge.
    delay_s, delay_error_s: the poses were true this long before their stamps; standard deviation of that.
    rms_m: how far the poses lie from those of the drive with such a tag.
    height_m: of the tag, by its size; nan before that is measured.
    """

    mount: Pose
    delay_s: float
    delay_error_s: float
    rms_m: float
    problems: List[str]
    height_m: float = math.nan


def calibrate_robot(seen: Sequence[Tuple[float, Pose]], odometry: Sequence[Tuple[float, Pose]]) -> RobotCalibration:
    """Return how the tag sits, by stamps (s) and poses of the tag itself, in `map`, and of /hero_N/odom.

    Raises: CalibrationError if the tag was hardly seen, or the robot did not turn or drive far enough.
    """
    stamps_s, tags = _join(seen)
    odometry_s, counted = _join(odometry)
    if len(odometry_s) < 2:
        raise CalibrationError("no odometry came: is the robot connected?")
    low, high = odometry_s[0] + DELAYS_S[1], odometry_s[-1] + DELAYS_S[0]
    inside = (stamps_s >= low) & (stamps_s <= high)
    stamps_s, tags = stamps_s[inside], tags[inside]
    if len(stamps_s) < MIN_POSES:
        text = "the robot's tag was seen %d times, which is too few (%d): light, id, and size of the tag?"
        raise CalibrationError(text % (len(stamps_s), MIN_POSES))
    if np.ptp(counted[:, 2]) < MIN_TURN_RAD:
        text = "the robot turned by %.0f degrees only; it takes %.0f"
        raise CalibrationError(text % (math.degrees(np.ptp(counted[:, 2])), math.degrees(MIN_TURN_RAD)))
    delay_s, delay_error_s = _find_delay(stamps_s, tags[:, 2], odometry_s, counted[:, 2])
    at = np.column_stack([np.interp(stamps_s - delay_s, odometry_s, counted[:, column]) for column in range(3)])
    mount, rms_m = _fit_mount(tags, at)
    off_m = math.hypot(mount.x_m, mount.y_m)
    problems = []
    if rms_m > GOOD_RMS_M:
        problems.append(
            "the tag was seen %.1f mm rms from its path (at most %.0f): does it sit loosely, or was the robot pushed?"
            % (1e3 * rms_m, 1e3 * GOOD_RMS_M)
        )
    if delay_error_s > GOOD_DELAY_S:
        problems.append(f"the delay is known to {1000.0 * delay_error_s:.0f} ms only: let the robot turn to and fro")
    if off_m > CENTERED_M:
        problems.append(f"the tag sits {1000.0 * off_m:.0f} mm from the robot's center")
    if is_upside_down(mount.yaw_rad):
        problems.append("the tag is on upside down: the upper edge of its print points to the robot's rear")
    return RobotCalibration(mount, delay_s, delay_error_s, rms_m, problems)


def _join(poses: Sequence[Tuple[float, Pose]]) -> Tuple[np.ndarray, np.ndarray]:
    """Return stamps (N,) in order and poses (N, 3) with continuous yaw."""
    ordered = sorted(poses, key=lambda item: item[0])
    table = np.array([pose for _, pose in ordered], dtype=float).reshape(-1, 3)
    table[:, 2] = np.unwrap(table[:, 2])
    return np.array([stamp_s for stamp_s, _ in ordered]), table


def _find_delay(
    stamps_s: np.ndarray, yaw_rad: np.ndarray, odometry_s: np.ndarray, counted_rad: np.ndarray
) -> Tuple[float, float]:
    """Return the delay at which the camera's yaw follows the odometry's best, and its standard deviation, s."""
    steps_rad = np.diff(counted_rad, prepend=counted_rad[0])
    lefts_rad, rights_rad = (np.cumsum(np.clip(sign * steps_rad, 0.0, None)) for sign in (1.0, -1.0))

    def measure(delay_s: float) -> float:
        at_s = stamps_s - delay_s
        # Wheels slip: odometry turns more than the robot does, by another share to the left than to the right.
        turned = (np.interp(at_s, odometry_s, part_rad) for part_rad in (lefts_rad, rights_rad))
        design = np.column_stack((*turned, np.ones(len(at_s))))
        fit = np.linalg.lstsq(design, yaw_rad, rcond=None)[0]
        return float(((design @ fit - yaw_rad) ** 2).sum())

    delays_s = np.arange(DELAYS_S[0], DELAYS_S[1] + 1e-9, _DELAY_STEP_S)
    sums = np.array([measure(delay_s) for delay_s in delays_s])
    best = int(np.argmin(sums))
    if best in (0, len(delays_s) - 1):
        raise CalibrationError(
            "the camera's yaw follows the odometry's with no delay between %.0f and %.0f ms: do the clocks agree, and"
            " is it this robot's tag?" % (1e3 * DELAYS_S[0], 1e3 * DELAYS_S[1])
        )
    before, at, after = sums[best - 1 : best + 2]
    curvature = max((before - 2.0 * at + after) / _DELAY_STEP_S**2, 1e-12)
    delay_s = float(delays_s[best] - (after - before) / (2.0 * _DELAY_STEP_S) / curvature)
    variance = max(at, 1e-12) / (len(stamps_s) - 4)
    return delay_s, math.sqrt(2.0 * variance / curvature)


def _fit_mount(tags: np.ndarray, at: np.ndarray) -> Tuple[Pose, float]:
    """Return the pose of the tag in base_link, and the residual (m rms).

    With the tag's yaw for the heading, what odometry drove between two images is known but for the tag's yaw on the
    robot and a factor: the tag's place is linear in the start, these two, and its place seen from itself.
    """
    steps = np.diff(at[:, 0] + 1j * at[:, 1])
    headings = (at[:-1, 2] + at[1:, 2]) / 2.0
    yaws = (tags[:-1, 2] + tags[1:, 2]) / 2.0
    driven = np.concatenate(((0.0,), np.cumsum(steps * np.exp(1j * (yaws - headings)))))
    if np.ptp(np.abs(driven)) < MIN_DRIVE_M:
        text = "the robot drove %.0f mm only; to see which way is forward it takes %.0f"
        raise CalibrationError(text % (1e3 * np.ptp(np.abs(driven)), 1e3 * MIN_DRIVE_M))
    places = tags[:, 0] + 1j * tags[:, 1]
    design = np.column_stack((np.ones(len(places)), driven, np.exp(1j * tags[:, 2])))
    _, turn, offset = fit = np.linalg.lstsq(design, places, rcond=None)[0]
    rms_m = float(np.sqrt((np.abs(design @ fit - places) ** 2).mean()))
    yaw_rad = -math.atan2(turn.imag, turn.real)
    place = offset * np.exp(1j * yaw_rad)
    return Pose(float(place.real), float(place.imag), wrap_angle(yaw_rad)), rms_m
