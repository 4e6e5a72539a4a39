"""What was seen of a robot -> ways, errors, delays, connections. Pure: numpy only.

Units: m, rad, s. Times are the recorder's, seconds since 1970.
"""

from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from .observations import Origin, RobotObservations, StateReport

STANDING_S = 0.5
"""A robot whose wheels have not turned for so long stands."""

STARTING_S = 2.0
"""A robot that has not moved so long after a command did not get it."""

MOVED_TICKS = 2.0
"""Sum of both wheels that counts as motion; a single tick may be a wheel that settles."""

REPORT_GAP_S = 3.0
"""The driver reports every second; after a longer silence nobody knows."""

ODOMETRY_GAP_S = 0.5
"""A pause in the odometry that is longer than this is shown; hotspots pause for 0.1 to 0.3 s."""

SAME_MOMENT_S = 0.2
"""Ground truth further away in time than this says nothing about a pose."""


class Path(NamedTuple):
    """Poses over time."""

    times_s: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray
    yaw_rad: np.ndarray

    @property
    def length_m(self) -> float:
        """The way along the path."""
        return float(np.hypot(np.diff(self.x_m), np.diff(self.y_m)).sum()) if len(self.x_m) else 0.0


class PoseErrors(NamedTuple):
    """How far odometry is off, over time."""

    times_s: np.ndarray
    position_m: np.ndarray
    yaw_rad: np.ndarray


class Span(NamedTuple):
    """A time in one state."""

    start_s: float
    end_s: float
    state: str


def read_path(robot: RobotObservations) -> Path:
    """Return the odometry of a robot in the frame that all robots share, or in its own if there is none."""
    arrival_s, _, x_m, y_m, yaw_rad, _, _ = robot.odometry.columns()
    return place(Path(arrival_s, x_m.astype(float), y_m.astype(float), yaw_rad.astype(float)), robot.origins)


def read_true_path(robot: RobotObservations) -> Path:
    """Return the ground truth of a robot; empty if there was none."""
    arrival_s, _, x_m, y_m, yaw_rad, _, _ = robot.ground_truth.columns()
    return Path(arrival_s, x_m, y_m, yaw_rad)


def place(path: Path, origins: Sequence[Origin]) -> Path:
    """Return a path moved from a robot's odom frame to the frame that origins are in."""
    if not origins:
        return path
    table = np.array(origins)
    # A pose before the first origin was known belongs to it all the same.
    which = np.maximum(np.searchsorted(table[:, 0], path.times_s, side="right") - 1, 0)
    _, origin_x, origin_y, turn = table[which].T
    cosine, sine = np.cos(turn), np.sin(turn)
    return Path(
        path.times_s,
        origin_x + cosine * path.x_m - sine * path.y_m,
        origin_y + sine * path.x_m + cosine * path.y_m,
        wrap(path.yaw_rad + turn),
    )


def wrap(angle_rad: np.ndarray) -> np.ndarray:
    """Return angles within -pi to pi."""
    return np.arctan2(np.sin(angle_rad), np.cos(angle_rad))


def find_errors(robot: RobotObservations) -> Optional[PoseErrors]:
    """Return how far the odometry is from the ground truth of the same moment; None without ground truth.

    Moments are compared by stamp. A robot whose odom frame nobody placed is laid upon the ground truth where both
    begin.
    """
    if not len(robot.odometry) or len(robot.ground_truth) < 2:
        return None
    _, stamp_s, *_ = robot.odometry.columns()
    path = read_path(robot)
    _, true_stamp_s, true_x_m, true_y_m, true_yaw_rad, _, _ = robot.ground_truth.columns()
    order = np.argsort(true_stamp_s, kind="stable")
    true_stamp_s = true_stamp_s[order]
    nearest = np.clip(np.searchsorted(true_stamp_s, stamp_s), 1, len(true_stamp_s) - 1)
    apart_s = np.minimum(np.abs(stamp_s - true_stamp_s[nearest - 1]), np.abs(stamp_s - true_stamp_s[nearest]))
    seen = apart_s <= SAME_MOMENT_S
    if not seen.any():
        return None
    x_m = np.interp(stamp_s[seen], true_stamp_s, true_x_m[order])
    y_m = np.interp(stamp_s[seen], true_stamp_s, true_y_m[order])
    yaw_rad = np.interp(stamp_s[seen], true_stamp_s, np.unwrap(true_yaw_rad[order]))
    path = Path(*(column[seen] for column in path))
    if not robot.origins:
        turn = yaw_rad[0] - path.yaw_rad[0]
        cosine, sine = np.cos(turn), np.sin(turn)
        shift_x_m = x_m[0] - (cosine * path.x_m[0] - sine * path.y_m[0])
        shift_y_m = y_m[0] - (sine * path.x_m[0] + cosine * path.y_m[0])
        path = place(path, [Origin(0.0, shift_x_m, shift_y_m, turn)])
    return PoseErrors(path.times_s, np.hypot(path.x_m - x_m, path.y_m - y_m), wrap(path.yaw_rad - yaw_rad))


def find_message_delays(robot: RobotObservations) -> np.ndarray:
    """Return arrival minus stamp of every odometry message (s)."""
    arrival_s, stamp_s, *_ = robot.odometry.columns()
    return arrival_s - stamp_s


def find_motion_delays(robot: RobotObservations) -> np.ndarray:
    """Return how long after a command each start from rest was seen (s): both as they reached the recorder."""
    command_s, linear_m_s, turn_rad_s = robot.commands.columns()
    encoder_s, left_ticks, right_ticks = robot.encoder.columns()
    if not len(command_s) or len(encoder_s) < 2:
        return np.zeros(0)
    moving = (linear_m_s != 0.0) | (turn_rad_s != 0.0)
    begins = np.flatnonzero(
        moving & np.concatenate(([True], ~moving[:-1] | (np.diff(command_s) > STARTING_S)))
    )
    # When the wheels turned, and by how much.
    turned = np.abs(np.diff(left_ticks)) + np.abs(np.diff(right_ticks))
    delays = []
    for begin_s in command_s[begins]:
        before = np.searchsorted(encoder_s, begin_s)
        first = np.searchsorted(encoder_s, begin_s - STANDING_S)
        if before - first < 5 or turned[first : before - 1].any():
            continue  # it moved already, or nobody knows
        last = np.searchsorted(encoder_s, begin_s + STARTING_S)
        ticks = np.abs(left_ticks[before:last] - left_ticks[before - 1])
        ticks = ticks + np.abs(right_ticks[before:last] - right_ticks[before - 1])
        moved = np.flatnonzero(ticks >= MOVED_TICKS)
        if len(moved):
            delays.append(encoder_s[before + moved[0]] - begin_s)
    return np.array(delays)


def find_spans(reports: Sequence[StateReport]) -> List[Span]:
    """Return the times in each state, with gaps where the driver said nothing."""
    spans: List[Span] = []
    for report in reports:
        if spans and report.time_s - spans[-1].end_s <= REPORT_GAP_S:
            spans[-1] = spans[-1]._replace(end_s=report.time_s)
            if spans[-1].state == report.state:
                continue
        spans.append(Span(report.time_s, report.time_s, report.state))
    return spans


def find_gaps(times_s: np.ndarray, longest_s: float = ODOMETRY_GAP_S) -> List[Tuple[float, float]]:
    """Return begin and end of every pause between messages that is longer than longest_s."""
    where = np.flatnonzero(np.diff(times_s) > longest_s)
    return [(float(times_s[index]), float(times_s[index + 1])) for index in where]


class Summary(NamedTuple):
    """One robot in numbers; None where the recording does not tell."""

    robot_id: int
    way_m: float
    odometry_hz: Optional[float]
    longest_gap_s: Optional[float]
    message_delay_s: Optional[float]
    slow_message_delay_s: Optional[float]
    motion_delay_s: Optional[float]
    error_m: Optional[float]
    yaw_error_rad: Optional[float]
    reconnects: Optional[int]


def summarise(robot_id: int, robot: RobotObservations) -> Summary:
    """Return one robot in numbers; delays are medians, the slow one is the 99th percentile, errors are the last."""
    path = read_path(robot)
    delays = find_message_delays(robot)
    motion = find_motion_delays(robot)
    errors = find_errors(robot)
    gaps = np.diff(path.times_s)
    return Summary(
        robot_id,
        path.length_m,
        float(1.0 / np.median(gaps)) if len(gaps) and np.median(gaps) > 0.0 else None,
        float(gaps.max()) if len(gaps) else None,
        float(np.median(delays)) if len(delays) else None,
        float(np.percentile(delays, 99)) if len(delays) else None,
        float(np.median(motion)) if len(motion) else None,
        float(errors.position_m[-1]) if errors is not None else None,
        float(errors.yaw_rad[-1]) if errors is not None else None,
        robot.states[-1].reconnects if robot.states else None,
    )
