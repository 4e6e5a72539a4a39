"""What was seen of all robots -> figures. Draws for one robot and for a hundred; writes no files.

Up to seven robots have colours and a legend. More have shades and their number beside what is theirs; where lines
would cover each other, each robot has a row.
"""

from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np
from matplotlib import colors, patches
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from . import analysis
from .colours import MOST_NAMED, STATE_COLOURS, Colour, choose_colours
from .observations import Observations, RobotObservations

BODY_RADIUS_M = 0.0368
WIDTH_IN = 9.0
MOST_ROWS = 8
"""So many robots have a diagram of their own for their speeds; more share a picture with a row for each."""

LONGEST_BAR_S = 1.0
"""Bins of the picture of speeds are not longer than needed to see a stop."""

_GREY = "0.45"


class Figures:
    """The figures of one recording; each method returns one, or None if the recording holds nothing for it."""

    def __init__(self, observations: Observations, start_s: float, end_s: float, title: str) -> None:
        """Draw observations between start_s and end_s; title is the recording's name."""
        self._seen = observations
        self._robots = dict(sorted(observations.robots.items()))
        self._colours = choose_colours(list(self._robots))
        self._start_s, self._duration_s = start_s, max(1e-3, end_s - start_s)
        self._title = title

    # -- what the figures share ----------------------------------------------------------------------------

    def _begin(
        self, height_in: float, text: str, rows: int = 1, columns: int = 1, **options: Any
    ) -> Tuple[Figure, Any]:
        figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False, **options)
        figure.suptitle("%s\n" % text, fontsize=12, fontweight="bold")
        figure.text(
            0.5, 0.995, "\n" + self._title, ha="center", va="top", fontsize=8, color=_GREY, linespacing=2.2
        )
        return figure, axes

    def _has_legend(self) -> bool:
        return len(self._robots) <= MOST_NAMED

    def _add_legend(self, axes: Axes, others: Sequence[Line2D] = ()) -> None:
        handles: List[Line2D] = []
        if self._has_legend() and len(self._robots) > 1:
            handles = [
                Line2D([], [], color=self._colours[robot_id], label="hero_%d" % robot_id)
                for robot_id in self._robots
            ]
        handles += others
        if handles:
            axes.legend(
                handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8, frameon=False
            )

    def _since_start(self, times_s: np.ndarray) -> np.ndarray:
        return times_s - self._start_s

    def _row_height(self) -> float:
        return 1.6 + max(3, len(self._robots)) * (0.3 if len(self._robots) <= 20 else 0.16)

    def _label_rows(self, axes: Axes) -> None:
        """Give each robot a row, the first one on top."""
        axes.set_ylim(len(self._robots) - 0.4, -0.6)
        names = ["hero_%d" % robot_id for robot_id in self._robots]
        axes.set_yticks(range(len(names)), names, fontsize=8 if len(names) <= 20 else 6)

    # -- the figures ---------------------------------------------------------------------------------------

    def draw_paths(self) -> Optional[Figure]:
        """Draw the ways of all robots in the arena."""
        drawn = {
            key: robot
            for key, robot in self._robots.items()
            if len(robot.odometry) or len(robot.ground_truth)
        }
        if not drawn:
            return None
        placed = [key for key, robot in drawn.items() if robot.origins]
        figure, grid = self._begin(8.0, "Paths by odometry")
        axes = grid[0][0]
        axes.add_collection(
            LineCollection(
                [[(x1, y1), (x2, y2)] for x1, y1, x2, y2 in self._seen.walls_m],
                colors="black",
                linewidths=1.5,
            )
        )
        for x_m, y_m, radius_m in self._seen.circles_m:
            axes.add_patch(patches.Circle((x_m, y_m), radius_m, color="0.75"))
        with_truth = False
        for robot_id, robot in drawn.items():
            colour = self._colours[robot_id]
            true_path = analysis.read_true_path(robot)
            if len(true_path.x_m) and robot.origins:
                with_truth = True
                axes.plot(true_path.x_m, true_path.y_m, color=colour, linewidth=2.2, alpha=0.3, zorder=2)
            path = analysis.read_path(robot)
            if not len(path.x_m):
                continue
            axes.plot(path.x_m, path.y_m, color=colour, linewidth=0.9, zorder=3)
            axes.plot(
                path.x_m[0], path.y_m[0], "o", color=colour, markerfacecolor="white", markersize=4, zorder=4
            )
            self._draw_robot(axes, robot_id, path)
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.05)
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
        axes.grid(color="0.9", linewidth=0.5)
        axes.set_axisbelow(True)
        if len(placed) == len(drawn):
            axes.set_title("frame %s" % self._seen.shared_frame, fontsize=9)
        elif placed:
            names = ", ".join("hero_%d" % key for key in drawn if key not in placed)
            axes.set_title(
                "frame %s; %s in a frame of their own" % (self._seen.shared_frame, names), fontsize=9
            )
        elif len(drawn) > 1:
            axes.set_title("each robot in its own frame hero_N/odom: nobody said where it began", fontsize=9)
        others = [
            Line2D(
                [],
                [],
                color=_GREY,
                marker="o",
                markerfacecolor="white",
                markersize=4,
                linestyle="",
                label="begin",
            ),
            Line2D([], [], color=_GREY, marker="o", markersize=9, linestyle="", label="end"),
        ]
        if with_truth:
            others.append(Line2D([], [], color=_GREY, linewidth=2.2, alpha=0.4, label="ground truth"))
        self._add_legend(axes, others)
        return figure

    def _draw_robot(self, axes: Axes, robot_id: int, path: analysis.Path) -> None:
        """Draw a robot where its path ends, with a nose, and its number if there is no legend."""
        x_m, y_m, yaw_rad = path.x_m[-1], path.y_m[-1], path.yaw_rad[-1]
        colour = self._colours[robot_id]
        axes.add_patch(patches.Circle((x_m, y_m), BODY_RADIUS_M, color=colour, zorder=5))
        nose_x, nose_y = BODY_RADIUS_M * np.cos(yaw_rad), BODY_RADIUS_M * np.sin(yaw_rad)
        axes.plot([x_m, x_m + nose_x], [y_m, y_m + nose_y], color="white", linewidth=1.2, zorder=6)
        if not self._has_legend():
            axes.annotate(
                str(robot_id),
                (x_m, y_m),
                textcoords="offset points",
                xytext=(6, 6),
                fontsize=7,
                zorder=7,
                bbox={"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.7},
            )

    def draw_speeds(self) -> Optional[Figure]:
        """Draw how fast the robots drove and turned: curves beside the commands, or a row of shades for each."""
        drawn = {key: robot for key, robot in self._robots.items() if len(robot.odometry)}
        if not drawn:
            return None
        return self._draw_speed_curves(drawn) if len(drawn) <= MOST_ROWS else self._draw_speed_rows(drawn)

    def _draw_speed_curves(self, drawn: Dict[int, RobotObservations]) -> Figure:
        figure, grid = self._begin(1.2 + 1.5 * len(drawn), "Speeds", len(drawn), 2, sharex=True, sharey="col")
        for row, (robot_id, robot) in zip(grid, drawn.items()):
            arrival_s, _, _, _, _, linear_m_s, turn_rad_s = robot.odometry.columns()
            command_s, *commands = hold_commands(*robot.commands.columns())
            for axes, measured, commanded in zip(row, (linear_m_s, turn_rad_s), commands):
                axes.plot(
                    self._since_start(command_s),
                    commanded,
                    color=_GREY,
                    linewidth=0.8,
                    drawstyle="steps-post",
                )
                # A line over a pause would tell of a speed that nobody saw.
                times_s, values = break_at_gaps(arrival_s, measured)
                axes.plot(self._since_start(times_s), values, color=self._colours[robot_id], linewidth=0.8)
                axes.grid(color="0.9", linewidth=0.5)
                axes.set_xlim(0.0, self._duration_s)
            row[0].set_ylabel("hero_%d" % robot_id, fontweight="bold")
        grid[0][0].set_title("forward (m/s)", fontsize=9)
        grid[0][1].set_title("turn to the left (rad/s)", fontsize=9)
        for axes in grid[-1]:
            axes.set_xlabel("time (s)")
        handles = [
            Line2D([], [], color="black", linewidth=0.8, label="by odometry"),
            Line2D([], [], color=_GREY, linewidth=0.8, label="commanded"),
        ]
        figure.legend(handles=handles, loc="upper right", fontsize=8, frameon=False, ncol=2)
        return figure

    def _draw_speed_rows(self, drawn: Dict[int, RobotObservations]) -> Figure:
        figure, grid = self._begin(2.0 * self._row_height() - 1.0, "Speeds by odometry", 2, 1, sharex=True)
        bins = int(min(600, max(20, self._duration_s / LONGEST_BAR_S * 2.0)))
        shown = (("forward (m/s)", 5, 0.05), ("turn to the left (rad/s)", 6, 0.5))
        for axes, (text, column, least) in zip(grid[:, 0], shown):
            picture = np.full((len(self._robots), bins), np.nan)
            for row, robot in enumerate(self._robots.values()):
                columns = robot.odometry.columns()
                picture[row] = mean_in_bins(
                    self._since_start(columns[0]), columns[column], self._duration_s, bins
                )
            highest = max(least, float(np.nanpercentile(np.abs(picture), 99)))
            image = axes.imshow(
                picture,
                aspect="auto",
                interpolation="nearest",
                extent=(0.0, self._duration_s, len(picture) - 0.5, -0.5),
                cmap="PuOr",
                norm=colors.Normalize(-highest, highest),
            )
            axes.set_facecolor("0.8")
            self._label_rows(axes)
            figure.colorbar(image, ax=axes, label=text, pad=0.01)
        grid[-1][0].set_xlabel("time (s); grey: nothing came")
        return figure

    def draw_delays(self) -> Optional[Figure]:
        """Draw how late messages came, and how soon robots moved after a command."""
        messages = {key: analysis.find_message_delays(robot) * 1e3 for key, robot in self._robots.items()}
        motions = {key: analysis.find_motion_delays(robot) * 1e3 for key, robot in self._robots.items()}
        if not any(len(delays) for delays in messages.values()):
            return None
        figure, grid = self._begin(self._row_height(), "Delays", 1, 2, sharey=True)
        message_axes, motion_axes = grid[0]
        for row, robot_id in enumerate(self._robots):
            colour = self._colours[robot_id]
            if len(messages[robot_id]):
                self._draw_delay_bar(message_axes, row, messages[robot_id], colour)
            if len(motions[robot_id]):
                motion_axes.plot(
                    motions[robot_id],
                    np.full(len(motions[robot_id]), row),
                    "o",
                    color=colour,
                    markersize=3,
                    alpha=0.5,
                )
                motion_axes.plot(np.median(motions[robot_id]), row, "|", color="black", markersize=9)
        self._label_rows(message_axes)
        message_axes.set_xlabel("message delay: arrival of odom minus its stamp (ms)")
        message_axes.set_title("box 25 to 75 %, whiskers 1 to 99 %, cross: latest", fontsize=8)
        # Most delays are some ms, the latest may be a second: both can be read off a scale that bends at 100 ms.
        message_axes.set_xscale("symlog", linthresh=100.0, linscale=2.0)
        ticks = [-50, 0, 50, 100, 300, 1000, 3000, 10000]
        highest = max(float(delays.max()) for delays in messages.values() if len(delays))
        lowest = min(float(delays.min()) for delays in messages.values() if len(delays))
        message_axes.set_xlim(min(-5.0, lowest * 1.1), max(60.0, highest * 1.3))
        message_axes.set_xticks(
            [tick for tick in ticks if lowest * 1.1 - 5.0 <= tick <= max(60.0, highest * 1.3)]
        )
        message_axes.get_xaxis().set_major_formatter("{x:.0f}")
        message_axes.minorticks_off()
        motion_axes.set_xlabel("command to motion: first turn of the wheels after a start from rest (ms)")
        motion_axes.set_title("dots: starts, black: median", fontsize=8)
        motion_axes.set_xlim(0.0, None)
        if not any(len(delays) for delays in motions.values()):
            motion_axes.set_xlim(0.0, 1.0)
            motion_axes.text(
                0.5,
                0.5,
                "no start from rest\nin this recording",
                transform=motion_axes.transAxes,
                ha="center",
            )
        for axes in grid[0]:
            axes.grid(axis="x", color="0.9", linewidth=0.5)
            axes.set_axisbelow(True)
            axes.xaxis.label.set_fontsize(8)
        return figure

    @staticmethod
    def _draw_delay_bar(axes: Axes, row: int, delays_ms: np.ndarray, colour: Colour) -> None:
        low, quarter, middle, three_quarters, high = np.percentile(delays_ms, [1, 25, 50, 75, 99])
        axes.plot([low, high], [row, row], color=colour, linewidth=1.0)
        axes.barh(row, three_quarters - quarter, left=quarter, height=0.6, color=colour, alpha=0.5)
        axes.plot([middle, middle], [row - 0.3, row + 0.3], color="black", linewidth=1.2)
        axes.plot(delays_ms.max(), row, "x", color=colour, markersize=4)

    def draw_connections(self) -> Optional[Figure]:
        """Draw when each robot was connected, and when nothing came from it."""
        if not any(robot.states or len(robot.odometry) for robot in self._robots.values()):
            return None
        figure, grid = self._begin(self._row_height(), "Connections")
        axes = grid[0][0]
        for row, robot in enumerate(self._robots.values()):
            for span in analysis.find_spans(robot.states):
                left_s = span.start_s - self._start_s
                colour = STATE_COLOURS.get(span.state, _GREY)
                axes.barh(row, max(0.02, span.end_s - span.start_s), left=left_s, height=0.7, color=colour)
            arrival_s = robot.odometry.columns()[0]
            gaps = analysis.find_gaps(arrival_s)
            axes.hlines(
                [row] * len(gaps),
                [begin_s - self._start_s for begin_s, _ in gaps],
                [end_s - self._start_s for _, end_s in gaps],
                color="white",
                linewidth=2.5,
            )
            if not robot.states and len(arrival_s):
                axes.hlines(
                    row,
                    arrival_s[0] - self._start_s,
                    arrival_s[-1] - self._start_s,
                    color=_GREY,
                    linewidth=0.8,
                )
        self._label_rows(axes)
        axes.set_xlim(0.0, self._duration_s)
        axes.set_xlabel("time (s)")
        seen = {report.state for robot in self._robots.values() for report in robot.states}
        handles = [
            patches.Patch(color=colour, label=state)
            for state, colour in STATE_COLOURS.items()
            if state in seen
        ]
        handles.append(
            patches.Patch(
                facecolor="white",
                edgecolor=_GREY,
                label="no odom for\nmore than %g s" % analysis.ODOMETRY_GAP_S,
            )
        )
        if not self._seen.fleet_times_s:
            axes.set_title(
                "the driver's reports (/hero_driver/robots) were not recorded: lines show odometry",
                fontsize=8,
            )
        axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8, frameon=False)
        return figure

    def draw_errors(self) -> Optional[Figure]:
        """Draw how far odometry is from ground truth."""
        errors = {key: analysis.find_errors(robot) for key, robot in self._robots.items()}
        known = {key: error for key, error in errors.items() if error is not None}
        if not known:
            return None
        figure, grid = self._begin(6.0, "Odometry against ground truth", 2, 1, sharex=True)
        position_axes, yaw_axes = grid[:, 0]
        for robot_id, error in known.items():
            times_s, position_m = break_at_gaps(error.times_s, error.position_m)
            _, yaw_rad = break_at_gaps(error.times_s, error.yaw_rad)
            colour, width = self._colours[robot_id], 1.0 if self._has_legend() else 0.6
            position_axes.plot(self._since_start(times_s), position_m * 1e3, color=colour, linewidth=width)
            yaw_axes.plot(self._since_start(times_s), np.degrees(yaw_rad), color=colour, linewidth=width)
        if not self._has_legend():
            self._name_extremes(
                position_axes, {key: (error.times_s, error.position_m * 1e3) for key, error in known.items()}
            )
            self._name_extremes(
                yaw_axes, {key: (error.times_s, np.degrees(error.yaw_rad)) for key, error in known.items()}
            )
        position_axes.set_ylabel("position error (mm)")
        position_axes.set_ylim(0.0, None)
        yaw_axes.set_ylabel("heading error (degrees),\npositive: turned too far left")
        yaw_axes.set_xlabel("time (s)")
        yaw_axes.axhline(0.0, color=_GREY, linewidth=0.5)
        for axes in grid[:, 0]:
            axes.grid(color="0.9", linewidth=0.5)
            axes.set_xlim(0.0, self._duration_s)
        others = [] if self._has_legend() else [Line2D([], [], color="black", linewidth=1.8, label="median")]
        self._add_legend(position_axes, others)
        return figure

    def _name_extremes(self, axes: Axes, curves: Dict[int, Tuple[np.ndarray, np.ndarray]]) -> None:
        """Write the numbers of the robots that are off most at the end beside their curves, and draw the median."""
        ends = {robot_id: float(values[-1]) for robot_id, (_, values) in curves.items()}
        ranked = sorted(ends, key=lambda robot_id: ends[robot_id])
        for robot_id in {*ranked[:1], *ranked[-3:]}:
            axes.annotate(
                str(robot_id),
                (self._since_start(curves[robot_id][0][-1]), ends[robot_id]),
                textcoords="offset points",
                xytext=(3, -2),
                fontsize=7,
                annotation_clip=False,
            )
        grid_s = np.linspace(0.0, self._duration_s, 200)
        stacked = [
            np.interp(grid_s, self._since_start(times_s), values, left=np.nan, right=np.nan)
            for times_s, values in curves.values()
        ]
        known = np.isfinite(stacked).any(axis=0)
        axes.plot(
            grid_s[known], np.nanmedian(np.array(stacked)[:, known], axis=0), color="black", linewidth=1.8
        )


def hold_commands(
    times_s: np.ndarray, linear_m_s: np.ndarray, turn_rad_s: np.ndarray
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return commands with zeros after each that was not followed within the robot's watchdog of 2 s."""
    if not len(times_s):
        return times_s, linear_m_s, turn_rad_s
    ends = np.flatnonzero(np.append(np.diff(times_s), np.inf) > analysis.STARTING_S)
    return (
        np.insert(times_s, ends + 1, times_s[ends] + analysis.STARTING_S),
        np.insert(linear_m_s, ends + 1, 0.0),
        np.insert(turn_rad_s, ends + 1, 0.0),
    )


def break_at_gaps(times_s: np.ndarray, values: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return a curve with a hole where nothing came for long."""
    holes = np.flatnonzero(np.diff(times_s) > analysis.ODOMETRY_GAP_S) + 1
    return np.insert(times_s, holes, times_s[holes]), np.insert(values.astype(float), holes, np.nan)


def mean_in_bins(times_s: np.ndarray, values: np.ndarray, duration_s: float, bins: int) -> np.ndarray:
    """Return the mean of the values in each of bins equal parts of the duration; NaN where there are none."""
    which = np.clip((times_s / duration_s * bins).astype(int), 0, bins - 1)
    counts = np.bincount(which, minlength=bins)
    sums = np.bincount(which, weights=values, minlength=bins)
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)
