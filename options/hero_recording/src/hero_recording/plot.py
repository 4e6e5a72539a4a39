"""Program plot: draws figures of all robots in bags, and prints a table."""

import argparse
import os
from typing import Dict, List, Optional, Sequence

import numpy as np

from hero_node import import_optional
from hero_node.files import replace_file
from hero_node.parameters import robot_ids_option

from .bags.bag_set import BagSet
from .errors import RecordingError
from .plots import analysis
from .plots.observations import Observations, RobotObservations

FIGURES = {
    "paths": "/hero_N/odom",
    "speeds": "/hero_N/odom",
    "errors": "/hero_N/odom or /hero_N/pose with /hero_N/ground_truth",
}
"""And the topics without which there is nothing to draw."""

MIN_DISTANCE_M = 0.05
"""An error is not given as a share of less than this."""


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="plot", description="Plot recordings of robots.")
    parser.add_argument("bags", nargs="+", metavar="FILE.bag", help="the bags of one recording, in any order")
    parser.add_argument("--robots", type=robot_ids_option, default="all", help="ids, e.g. '0 1 2' or 0-3 (all)")
    parser.add_argument("--format", choices=("png", "pdf"), default="png", help="format of the files (png)")
    parser.add_argument("--out", metavar="PREFIX", help="prefix of the file names (the first bag's name)")
    return parser.parse_args(arguments)


def observe(options: argparse.Namespace, bags: BagSet) -> Observations:
    """Read the bags. Raises: RecordingError if there is no robot in them."""
    observations = Observations(None if options.robots is None else set(options.robots))
    bags.read(observations.wants, observations.receive)
    if not observations.robots:
        wanted = "" if options.robots is None else f" with these ids ({', '.join(map(str, options.robots))})"
        raise RecordingError(f"{', '.join(bags.paths)}: no robot{wanted} in it; its topics: {bags.describe_topics()}")
    return observations


def draw(options: argparse.Namespace, observations: Observations, bags: BagSet) -> List[str]:
    """Write the figures; return the path of each, or why it is missing. Raises: RecordingError, also if all are."""
    from matplotlib import rc_context

    from .plots.figures import STYLE, Figures

    names = os.path.basename(bags.paths[0])
    if len(bags.paths) > 1:
        names += " and %d more" % (len(bags.paths) - 1)
    drawing = Figures(observations, bags.start_s, bags.end_s, names)
    prefix = options.out or os.path.splitext(bags.paths[0])[0]
    paths, missing = [], []
    for name, needed in FIGURES.items():
        path = f"{prefix}_{name}.{options.format}"
        with rc_context(STYLE):
            figure = getattr(drawing, "draw_" + name)()
        if figure is None:
            missing.append(f"no figure of {name}: nothing of {needed} in the recording")
            continue
        with replace_file(path) as file:
            figure.savefig(file, dpi=130, format=options.format)
        paths.append(path)
    if not paths:
        raise RecordingError(f"{names}: {'; '.join(missing)}")
    return paths + missing


def format_table(observations: Observations) -> List[str]:
    """Return a line for each robot, with headings."""
    robots = sorted(observations.robots.items())
    described = [{"ROBOT": "hero_%d" % robot_id, **describe_robot(robot)} for robot_id, robot in robots]
    rows = [list(described[0]), *(list(cells.values()) for cells in described)]
    widths = [max(map(len, column)) for column in zip(*rows)]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows]
    for robot_id, robot in robots:
        if robot.skipped:
            lines.append("hero_%d: skipped %d messages with nan, inf or absurd numbers" % (robot_id, robot.skipped))
    return lines


def describe_robot(robot: RobotObservations) -> Dict[str, str]:
    """Return the numbers of a robot by heading, "-" where the recording does not tell."""
    path = analysis.read_path(robot)
    intervals_s = np.diff(path.times_s)
    steady_s = intervals_s[intervals_s <= analysis.ODOMETRY_GAP_S]
    delays_ms = 1e3 * (path.times_s - path.stamps_s)
    errors = analysis.compute_odometry_errors(robot)
    localization = analysis.compute_localization_errors(robot)
    error = "-"
    if errors is not None:
        error = f"{errors.position_m[-1] * 1000.0:.0f} mm"
        if path.length_m > MIN_DISTANCE_M:
            error += f" ({100.0 * errors.position_m[-1] / path.length_m:.1f} % of the distance)"
    return {
        "DISTANCE": f"{path.length_m:.2f} m",
        "ODOM": f"{len(steady_s) / steady_s.sum():.1f} Hz" if steady_s.any() else "-",
        "LONGEST GAP": f"{intervals_s.max():.2f} s" if len(intervals_s) else "-",
        "MESSAGE DELAY": f"{np.median(delays_ms):.0f} ms" if len(delays_ms) else "-",
        "99 %": f"{np.percentile(delays_ms, 99):.0f} ms" if len(delays_ms) else "-",
        "RECONNECTS": "-" if robot.reconnects is None else "%d" % robot.reconnects,
        "FINAL ERROR": error,
        "LOCALIZATION RMS": "-"
        if localization is None
        else f"{1000.0 * np.sqrt(np.mean(localization.position_m**2)):.1f} mm",
    }


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Read, draw, print. Raises: RecordingError."""
    options = parse_options(arguments)
    import_optional("matplotlib", "python3-matplotlib")
    bags = BagSet(options.bags)
    observations = observe(options, bags)
    print("\n".join(format_table(observations)))
    print("\n".join(draw(options, observations, bags)))
