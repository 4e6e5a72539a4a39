"""Program plot: bags -> figures of all robots, and a table in words.

rosrun hero_recording plot hero_2026-11-21-10-00-00_0.bag
"""

import argparse
import importlib.util
import os
import sys
from typing import Callable, Dict, List, Optional, Sequence

from hero_client import command_line
from hero_client.program import ProgramError, parse_robot_ids

from . import analysis
from .bags import BagSet
from .errors import RecordingError
from .observations import Observations
from .progress import Progress

FIGURES = ("paths", "speeds", "delays", "connections", "errors")
FORMATS = ("png", "pdf")
SMALLEST_WAY_M = 0.05
"""Below this a share of the way says nothing."""


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="plot", description="Draw what bags hold of the robots.")
    parser.add_argument("bags", nargs="+", metavar="FILE.bag", help="the bags of one recording, in any order")
    parser.add_argument("--robots", default="all", help="ids, e.g. '0 1 2' or 0-3 (all)")
    parser.add_argument(
        "--figures",
        default=",".join(FIGURES),
        metavar="LIST",
        help="which, with commas between (%(default)s)",
    )
    parser.add_argument(
        "--format", choices=FORMATS, default="png", help="png: a file each; pdf: one file (png)"
    )
    parser.add_argument("--out", metavar="PREFIX", help="begin of the files' names (the first bag's name)")
    parser.add_argument(
        "--arena", metavar="FILE", help="arena file of hero_sim to draw, for recordings without one"
    )
    options = parser.parse_args(arguments)
    options.figures = [name for name in options.figures.split(",") if name]
    for name in options.figures:
        if name not in FIGURES:
            parser.error("--figures %s: known are %s" % (name, ",".join(FIGURES)))
    try:
        options.robots = parse_robot_ids("robots", options.robots)
    except ProgramError as error:
        parser.error(str(error).replace("~", "--"))
    return options


def observe(options: argparse.Namespace, bags: BagSet) -> Observations:
    """Read the bags. Raises: RecordingError if there is no robot in them."""
    observations = Observations(None if options.robots is None else set(options.robots))
    bags.read(observations.wants, observations.receive)
    if not observations.robots:
        wanted = (
            "" if options.robots is None else " with these ids (%s)" % ", ".join(map(str, options.robots))
        )
        raise RecordingError(
            "%s: no robot%s in it; its topics: %s"
            % (", ".join(bags.paths), wanted, ", ".join(sorted(bags.topics)[:8]) or "none")
        )
    if options.arena is not None:
        read_arena(options.arena, observations)
    return observations


def read_arena(path: str, observations: Observations) -> None:
    """Take walls and obstacles from an arena file. Raises: RecordingError."""
    from hero_sim.errors import SimulatorError
    from hero_sim.world.arena_file import load_arena

    try:
        arena = load_arena(path)
    except SimulatorError as error:
        raise RecordingError(str(error)) from error
    observations.walls_m = [tuple(row) for row in arena.segments_m.tolist()]
    observations.circles_m = [tuple(row) for row in arena.circles_m.tolist()]


def draw(options: argparse.Namespace, observations: Observations, bags: BagSet) -> List[str]:
    """Write the figures; return the names of the files. Raises: RecordingError."""
    import matplotlib

    matplotlib.use("Agg")  # no display is needed, and none is opened
    from matplotlib.backends.backend_pdf import PdfPages

    from .figures import Figures

    names = os.path.basename(bags.paths[0])
    if len(bags.paths) > 1:
        names += " and %d more" % (len(bags.paths) - 1)
    drawing = Figures(observations, bags.start_s, bags.end_s, names)
    makers: Dict[str, Callable[[], Optional[object]]] = {
        "paths": drawing.draw_paths,
        "speeds": drawing.draw_speeds,
        "delays": drawing.draw_delays,
        "connections": drawing.draw_connections,
        "errors": drawing.draw_errors,
    }
    prefix = options.out or os.path.splitext(bags.paths[0])[0]
    figures = [(name, makers[name]()) for name in options.figures]
    figures = [(name, figure) for name, figure in figures if figure is not None]
    if not figures:
        raise RecordingError("%s: nothing to draw of %s" % (names, ", ".join(options.figures)))
    try:
        if options.format == "pdf":
            path = prefix if prefix.endswith(".pdf") else prefix + ".pdf"
            with PdfPages(path) as pages:
                for _, figure in figures:
                    pages.savefig(figure)
            return [path]
        paths = []
        for name, figure in figures:
            path = "%s_%s.png" % (prefix, name)
            figure.savefig(path, dpi=130)
            paths.append(path)
        return paths
    except OSError as error:
        raise RecordingError(
            "%s cannot be written: %s; choose another --out" % (error.filename or prefix, error.strerror)
        ) from error


def format_table(observations: Observations) -> List[str]:
    """Return the robots in numbers, a line each."""
    rows = [
        [
            "ROBOT",
            "WAY",
            "ODOM",
            "LONGEST GAP",
            "MESSAGE DELAY",
            "99 %",
            "COMMAND TO MOTION",
            "RECONNECTS",
            "ERROR AT THE END",
        ]
    ]
    for robot_id, robot in sorted(observations.robots.items()):
        summary = analysis.summarise(robot_id, robot)
        error = format_number("%.0f mm", summary.error_m, 1e3)
        if summary.error_m is not None and summary.way_m > SMALLEST_WAY_M:
            error += " (%.1f %% of the way)" % (100.0 * summary.error_m / summary.way_m)
        rows.append(
            [
                "hero_%d" % robot_id,
                "%.2f m" % summary.way_m,
                format_number("%.1f Hz", summary.odometry_hz),
                format_number("%.2f s", summary.longest_gap_s),
                format_number("%.0f ms", summary.message_delay_s, 1e3),
                format_number("%.0f ms", summary.slow_message_delay_s, 1e3),
                format_number("%.0f ms", summary.motion_delay_s, 1e3),
                format_number("%d", summary.reconnects),
                error,
            ]
        )
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows]
    for robot_id, robot in sorted(observations.robots.items()):
        if robot.left_out:
            lines.append(
                "hero_%d: %d messages left out: they hold nan, inf or absurd numbers" % (robot_id, robot.left_out)
            )
    return lines


def format_number(text: str, value: Optional[float], factor: float = 1.0) -> str:
    """Return a number in words, "-" for one that is not known."""
    return "-" if value is None else text % (value * factor)


def run(options: argparse.Namespace) -> None:
    """Read, draw, print. Raises: RecordingError."""
    if importlib.util.find_spec("matplotlib") is None:
        raise RecordingError(
            "matplotlib is missing; install it: apt install python3-matplotlib, or pip install matplotlib"
        )
    bags = BagSet(options.bags, Progress())
    observations = observe(options, bags)
    print("\n".join(format_table(observations)))
    for path in draw(options, observations, bags):
        print(path)


def main() -> None:
    """Run the program plot."""
    command_line.run(lambda: run(parse_options(sys.argv[1:])), RecordingError)
