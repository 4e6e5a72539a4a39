"""Program fit: fits the simulator to robots, from recordings to the error file of its option --errors."""

import argparse
import sys
from typing import Optional, Sequence

from hero_node.files import write_file
from hero_sim.world import load_arena

from .experiments.errors import ExperimentError
from .fitting.robot_fit import describe_fit, fit_robot


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="fit", description="Fit the simulator to the robots of recordings.")
    parser.add_argument("bags", nargs="+", metavar="BAG", help="recordings of odometry, commands and poses")
    parser.add_argument(
        "--arena", metavar="FILE", help="walls of the recordings, in the frame of the poses: fits infrared sensors, too"
    )
    parser.add_argument("--out", metavar="FILE", default="robots.errors", help="error file (%(default)s)")
    return parser.parse_args(arguments)


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Fit each robot, print what was found, and write the file; return 1 if a robot was left out.

    Raises: ExperimentError if no robot could be fitted: then nothing is written.
    """
    options = parse_options(arguments)
    from .recording_reader import read_recordings  # imports rosbag, where there is ROS, which takes long

    arena = load_arena(options.arena) if options.arena else None
    lines = ["# slip cannot be told from smaller wheels: it is the usual one, and wheels are fitted with it"]
    found, left_out = len(lines), 0
    for robot_id, recordings in sorted(read_recordings(options.bags).items()):
        try:
            own = describe_fit(fit_robot(recordings, arena), robot_id)
        except ValueError as error:
            print("hero_%d: left out: %s" % (robot_id, error), file=sys.stderr)
            left_out = 1
            continue
        print("\n".join(own))
        lines += own
    if len(lines) == found:
        raise ExperimentError(f"no robot could be fitted; {options.out} is as it was")
    write_file(options.out, ("\n".join(lines) + "\n").encode())
    print(f"written: {options.out}")
    return left_out
