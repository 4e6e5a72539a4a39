"""Draws the figures of a recording, for one robot or a hundred; writes no files.

Up to seven robots have colors and a legend. More have shades, and are labeled with their ids where they end.
"""

from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np
from matplotlib import patches, pyplot
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hero_client.values import BODY_RADIUS_M

from . import analysis
from .observations import Observations, RobotObservations

WIDTH_IN = 9.0
SPEED_ROWS = 8
"""Most robots whose speeds are drawn, in a row each; plot --robots chooses others."""

LABELED = 3
"""Error curves with an id, of many robots."""

NO_COMMANDS = "no commands recorded:\nnothing on /hero_N/velocity_controller/cmd_vel"

STYLE = {
    "font.size": 8.0,
    "figure.titlesize": 12.0,
    "figure.titleweight": "bold",
    "lines.linewidth": 0.9,
    "lines.markersize": 4.0,
    "grid.color": "0.9",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "legend.frameon": False,
}
"""Style of all figures: draw within rc_context(STYLE)."""

_GRAY = "0.45"
_OBSTACLES = {"edgecolor": "black", "linewidth": 1.5}
"""Walls and round obstacles alike."""

_TRUTH = {"linewidth": 2.2, "alpha": 0.4}
_BEGIN = {"marker": "o", "markerfacecolor": "white", "linestyle": ""}
_END = {"marker": "o", "markersize": 9.0, "linestyle": ""}

# Okabe and Ito's palette (2008) without its yellow, which is hard to see on white.
_FEW = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")

MAX_NAMED = len(_FEW)
"""Up to this many robots have a color and a line in the legend; more have a shade and are labeled with their id."""


def choose_colors(robot_ids: Sequence[int]) -> Dict[int, Any]:
    """Return a color for each robot: distinct ones for few, a scale in order of their ids for many."""
    if len(robot_ids) <= MAX_NAMED:
        return dict(zip(robot_ids, _FEW))
    # The bright end of the scale is hard to see on white.
    return dict(zip(robot_ids, pyplot.get_cmap("viridis")(np.linspace(0.0, 0.85, len(robot_ids)))))


def _has_comparable_truth(robot: RobotObservations) -> bool:
    """Return whether a robot has ground truth, and its path is in a frame that robots share."""
    return len(robot.ground_truth) > 0 and bool(robot.origins or len(robot.poses))


class Figures:
    """The figures of one recording; each method returns one, or None if the recording holds nothing for it."""

    def __init__(self, observations: Observations, start_s: float, end_s: float, title: str) -> None:
        """Draw observations between start_s and end_s; title is the recording's name."""
        self._seen = observations
        self._robots = dict(sorted(observations.robots.items()))
        self._colors = choose_colors(list(self._robots))
        self._start_s, self._duration_s = start_s, max(1e-3, end_s - start_s)
        self._title = title
        self._has_legend = len(self._robots) <= MAX_NAMED

    # -- shared by all figures -----------------------------------------------------------------------------

    def _begin(
        self, height_in: float, text: str, rows: int = 1, columns: int = 1, **options: Any
    ) -> Tuple[Figure, Any]:
        figure = Figure(figsize=(WIDTH_IN, height_in), constrained_layout=True)
        axes = figure.subplots(rows, columns, squeeze=False, **options)
        figure.suptitle(text + "\n")
        figure.text(0.5, 0.995, "\n" + self._title, ha="center", va="top", color=_GRAY, linespacing=2.2)
        return figure, axes

    def _add_legend(self, axes: Axes, others: Sequence[Any] = ()) -> None:
        handles = list(others)
        if self._has_legend and len(self._robots) > 1:
            robots = [Line2D([], [], color=color, label="hero_%d" % key) for key, color in self._colors.items()]
            handles = robots + handles
        if handles:
            axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0))

    def _set_time_axis(self, axes: Axes) -> None:
        axes.set_xlim(0.0, self._duration_s)
        axes.grid()

    # -- paths ---------------------------------------------------------------------------------------------

    def draw_paths(self) -> Optional[Figure]:
        """Draw the paths of all robots in the arena."""
        drawn = {
            key: robot
            for key, robot in self._robots.items()
            if len(robot.odometry) or len(robot.ground_truth) or len(robot.poses)
        }
        if not drawn:
            return None
        is_localized = any(len(robot.poses) for robot in drawn.values())
        figure, grid = self._begin(8.0, "Paths by localization" if is_localized else "Paths by odometry")
        axes = grid[0][0]
        walls = [[(x1, y1), (x2, y2)] for x1, y1, x2, y2 in self._seen.walls_m]
        axes.add_collection(LineCollection(walls, **_OBSTACLES))
        for x_m, y_m, radius_m in self._seen.circles_m:
            axes.add_patch(patches.Circle((x_m, y_m), radius_m, fill=False, **_OBSTACLES))
        ends = (("start", _BEGIN), ("end", _END))
        legend = [Line2D([], [], color=_GRAY, label=label, **style) for label, style in ends]
        if any(map(_has_comparable_truth, drawn.values())):
            legend.append(Line2D([], [], color=_GRAY, label="ground truth", **_TRUTH))
        if self._seen.walls_m or self._seen.circles_m:
            legend.append(patches.Patch(facecolor="none", label="walls, obstacles", **_OBSTACLES))
        for robot_id, robot in drawn.items():
            color = self._colors[robot_id]
            if _has_comparable_truth(robot):
                true_path = analysis.read_series(robot.ground_truth)
                axes.plot(true_path.x_m, true_path.y_m, color=color, **_TRUTH)
            path = analysis.read_series(robot.poses) if len(robot.poses) else analysis.read_path(robot)
            if len(path.x_m):
                axes.plot(path.x_m, path.y_m, color=color)
                axes.plot(path.x_m[0], path.y_m[0], color=color, **_BEGIN)
                self._draw_robot(axes, robot_id, path)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
        axes.grid()
        axes.set_title(self._describe_frames(drawn))
        self._add_legend(axes, legend)
        return figure

    def _describe_frames(self, drawn: Dict[int, RobotObservations]) -> str:
        """Return the frame of most robots, and those whose frame is another."""
        robots: Dict[str, List[str]] = {}
        for key, robot in drawn.items():
            frame = self._seen.pose_frame if len(robot.poses) else self._seen.shared_frame if robot.origins else ""
            robots.setdefault("frame " + frame if frame else "own odom frame", []).append("hero_%d" % key)
        if list(robots) == ["own odom frame"]:
            return "each robot in its own odom frame: no transforms on /tf_static" if len(drawn) > 1 else ""
        first, *others = sorted(robots, key=lambda frame: (frame.startswith("own"), -len(robots[frame])))
        texts = [first] + [f"{', '.join(robots[frame])}: {frame}" for frame in others]
        true_frame = self._seen.true_frame
        if true_frame and "frame " + true_frame != first and any(map(_has_comparable_truth, drawn.values())):
            texts.append("ground truth: frame " + true_frame)
        return "; ".join(texts)

    def _draw_robot(self, axes: Axes, robot_id: int, path: analysis.Path) -> None:
        """Draw a robot at the end of its path with a line to its front, and its id if there is no legend."""
        x_m, y_m, yaw_rad = path.x_m[-1], path.y_m[-1], path.yaw_rad[-1]
        above = Line2D.zorder  # its own front is drawn over it, paths of earlier robots are not
        axes.add_patch(patches.Circle((x_m, y_m), BODY_RADIUS_M, color=self._colors[robot_id], zorder=above))
        front = (x_m + BODY_RADIUS_M * np.cos(yaw_rad), y_m + BODY_RADIUS_M * np.sin(yaw_rad))
        axes.plot([x_m, front[0]], [y_m, front[1]], color="white")
        if not self._has_legend:
            box = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.7}
            axes.annotate(str(robot_id), (x_m, y_m), textcoords="offset points", xytext=(6, 6), bbox=box)

    # -- speeds --------------------------------------------------------------------------------------------

    def draw_speeds(self) -> Optional[Figure]:
        """Draw the speeds of up to SPEED_ROWS robots beside what was commanded."""
        moving = [key for key, robot in self._robots.items() if len(robot.odometry)]
        drawn = {key: self._robots[key] for key in moving[:SPEED_ROWS]}
        if not drawn:
            return None
        title = "Speeds" if len(drawn) == len(moving) else f"Speeds of the first {len(drawn)} robots"
        figure, grid = self._begin(1.2 + 1.5 * len(drawn), title, len(drawn), 2, sharex=True, sharey="col")
        for row, (robot_id, robot) in zip(grid, drawn.items()):
            arrival_s, _, _, _, _, *speeds = robot.odometry.columns()
            command_s, *commands = analysis.end_commands(*robot.commands.columns())
            for axes, measured, commanded in zip(row, speeds, commands):
                axes.step(command_s - self._start_s, commanded, where="post", color=_GRAY)
                times_s, values = analysis.break_at_gaps(arrival_s, measured)
                axes.plot(times_s - self._start_s, values, color=self._colors[robot_id])
                self._set_time_axis(axes)
            row[0].set_ylabel("hero_%d" % robot_id, fontweight="bold")
        for axes, text in zip(grid[0], ("linear (m/s)", "angular (rad/s)")):
            axes.set_title(text)
        for axes in grid[-1]:
            axes.set_xlabel("time (s)")
        is_commanded = any(len(robot.commands) for robot in drawn.values())
        handles = [
            Line2D([], [], color="black", label="odometry"),
            Line2D([], [], color=_GRAY, label="commanded" if is_commanded else NO_COMMANDS),
        ]
        figure.legend(handles=handles, loc="upper right", ncol=2)
        return figure

    # -- errors --------------------------------------------------------------------------------------------

    def draw_errors(self) -> Optional[Figure]:
        """Draw the errors of odometry, and those of localization beside them, each against ground truth."""
        known = {}
        computers = {"odometry": analysis.compute_odometry_errors, "localization": analysis.compute_localization_errors}
        for name, compute in computers.items():
            found = {key: compute(robot) for key, robot in self._robots.items()}
            if any(found.values()):
                known[name] = {key: error for key, error in found.items() if error is not None}
        if not known:
            return None
        title = f"Errors of {' and '.join(known)} against ground truth"
        figure, grid = self._begin(6.0, title, 2, len(known), sharex=True)
        for (position_axes, yaw_axes), (name, errors) in zip(grid.T, known.items()):
            times_s = {key: error.times_s for key, error in errors.items()}
            positions_mm = {key: error.position_m * 1e3 for key, error in errors.items()}
            yaws_deg = {key: np.degrees(error.yaw_rad) for key, error in errors.items()}
            self._draw_error_curves(position_axes, times_s, positions_mm)
            self._draw_error_curves(yaw_axes, times_s, yaws_deg)
            position_axes.set_title(name)
            position_axes.set_ylim(0.0, None)
            yaw_axes.set_xlabel("time (s)")
            yaw_axes.axhline(0.0, color=_GRAY)
        grid[0, 0].set_ylabel("position error (mm)")
        grid[1, 0].set_ylabel("heading error (degrees),\npositive: counter-clockwise")
        self._add_legend(grid[0, -1])
        return figure

    def _draw_error_curves(self, axes: Axes, times_s: Dict[int, Any], values: Dict[int, Any]) -> None:
        """Draw a curve for each robot; without a legend, with the ids of the largest at their ends."""
        ranked = sorted(values, key=lambda key: abs(float(values[key][-1])))
        for key in [] if self._has_legend else ranked[-LABELED:]:
            end = (times_s[key][-1] - self._start_s, values[key][-1])
            axes.annotate(str(key), end, textcoords="offset points", xytext=(3, -2), annotation_clip=False)
        for key, curve in values.items():
            curve_s, curve = analysis.break_at_gaps(times_s[key], curve)
            axes.plot(curve_s - self._start_s, curve, color=self._colors[key])
        self._set_time_axis(axes)
