"""Program export: writes what bags hold of the robots as CSV, a folder per robot and a file per kind of message.

    rosrun hero_recording export hero_2026-11-21-10-00-00_0.bag

The tables are in FOLDER.part until all of them are complete.
"""

import argparse
import os
import shutil
import sys
from typing import Optional, Sequence, Set

from hero_client import command_line

from . import tables
from .bags import BagSet, Message
from .csv_files import CsvFiles
from .errors import RecordingError
from .options import list_of, robot_ids

PART_SUFFIX = ".part"


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="export", description="Export recordings of robots to CSV.")
    parser.add_argument("bags", nargs="+", metavar="FILE.bag", help="the bags of one recording, in any order")
    parser.add_argument("--out", metavar="FOLDER", help="where the tables go (the first bag's name); must not exist")
    parser.add_argument("--robots", type=robot_ids, default="all", help="ids, e.g. '0 1 2' or 0-3 (all)")
    every, text = ",".join(tables.TABLES), "which, separated by commas (%(default)s)"
    parser.add_argument("--tables", type=list_of(tables.TABLES), default=every, metavar="LIST", help=text)
    return parser.parse_args(arguments)


def write_tables(bags: BagSet, robot_ids: Optional[Set[int]], kinds: Set[str], files: CsvFiles) -> None:
    """Write all rows of these robots and kinds. Raises: RecordingError if there are none."""

    def receive(message: Message) -> None:
        for robot_id, kind, row in tables.read_rows(*message):
            if kind in kinds and (robot_ids is None or robot_id in robot_ids):
                files.add(robot_id, kind, row)

    bags.read(tables.is_exported, receive)
    files.flush()
    if not files.rows:
        raise RecordingError(
            "%s: nothing of these robots and tables in it; its topics: %s"
            % (", ".join(bags.paths), bags.describe_topics())
        )


def run(options: argparse.Namespace) -> None:
    """Export. Raises: RecordingError."""
    bags = BagSet(options.bags)
    folder = os.path.abspath(options.out or os.path.splitext(bags.paths[0])[0])
    if os.path.exists(folder):
        raise RecordingError("%s exists already; move it away or choose another --out" % folder)
    part = folder + PART_SUFFIX
    try:
        os.makedirs(part)
    except OSError as error:
        raise RecordingError(
            "%s cannot be created: %s; choose another --out" % (part, error.strerror)
        ) from error
    robot_ids = None if options.robots is None else set(options.robots)
    files = CsvFiles(part)
    try:
        write_tables(bags, robot_ids, set(options.tables), files)
        os.rename(part, folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    robots = {robot_id for robot_id, _ in files.rows}
    print("%s: %d robots, %d tables, %d rows" % (folder, len(robots), len(files.rows), sum(files.rows.values())))


def main() -> None:
    """Run the program export."""
    command_line.run(lambda: run(parse_options(sys.argv[1:])), RecordingError)
