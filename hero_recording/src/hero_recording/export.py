"""Program export: bags -> a table per robot and kind of message, as CSV or Parquet.

    rosrun hero_recording export hero_2026-11-21-10-00-00_0.bag

The tables lie in FOLDER.part until all of them are whole.
"""

import argparse
import os
import shutil
import sys
from typing import List, Optional, Sequence, Set

from hero_client import command_line
from hero_client.program import ProgramError, parse_robot_ids

from . import tables
from .bags import BagSet, Message
from .errors import RecordingError
from .progress import Progress
from .table_files import CSV, FORMATS, TableFiles, find_missing

PART_SUFFIX = ".part"


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="export", description="Write what bags hold of the robots as tables."
    )
    parser.add_argument("bags", nargs="*", metavar="FILE.bag", help="the bags of one recording, in any order")
    parser.add_argument(
        "--out", metavar="FOLDER", help="where the tables go (the first bag's name); must not exist"
    )
    parser.add_argument(
        "--format", default=CSV, metavar="LIST", help="csv, parquet, or csv,parquet (%(default)s)"
    )
    parser.add_argument("--robots", default="all", help="ids, e.g. '0 1 2' or 0-3 (all)")
    parser.add_argument(
        "--tables",
        default=",".join(tables.TABLES),
        metavar="LIST",
        help="which, with commas between (%(default)s)",
    )
    parser.add_argument(
        "--columns", action="store_true", help="list all tables, their columns and units, and end"
    )
    options = parser.parse_args(arguments)
    for name, known in (("format", FORMATS), ("tables", tuple(tables.TABLES))):
        words = [word for word in getattr(options, name).split(",") if word]
        for word in words:
            if word not in known:
                parser.error("--%s %s: known are %s" % (name, word, ", ".join(known)))
        setattr(options, name, words)
        if not words:
            parser.error("--%s: names none; known are %s" % (name, ", ".join(known)))
    try:
        options.robots = parse_robot_ids("robots", options.robots)
    except ProgramError as error:
        parser.error(str(error).replace("~", "--"))
    if not options.bags and not options.columns:
        parser.error("name at least one FILE.bag")
    return options


def describe_columns() -> List[str]:
    """Return a line for every column of every table."""
    lines = []
    for kind, table in tables.TABLES.items():
        lines.append(kind)
        lines += ["  %-24s %-12s %s" % (column.name, column.unit, column.meaning) for column in table.columns]
    return lines


def write_tables(bags: BagSet, robot_ids: Optional[Set[int]], kinds: Set[str], files: TableFiles) -> None:
    """Write all rows of the robots and kinds that are wanted. Raises: RecordingError."""

    def receive(message: Message) -> None:
        for robot_id, kind, row in tables.read_rows(*message):
            if kind in kinds and (robot_ids is None or robot_id in robot_ids):
                files.add(robot_id, kind, row)

    bags.read(tables.wants, receive)


def run(options: argparse.Namespace) -> None:
    """Do what the options say. Raises: RecordingError."""
    if options.columns:
        print("\n".join(describe_columns()))
        return
    missing = find_missing(options.format)
    if missing is not None:
        raise RecordingError(missing)
    bags = BagSet(options.bags, Progress())
    folder = os.path.abspath(options.out or os.path.splitext(bags.paths[0])[0])
    if os.path.exists(folder):
        raise RecordingError("%s exists already; move it away or choose another --out" % folder)
    part = folder + PART_SUFFIX
    try:
        os.makedirs(part)
    except OSError as error:
        raise RecordingError(
            "%s cannot be made: %s; choose another --out" % (part, error.strerror)
        ) from error
    try:
        files = TableFiles(part, options.format)
        write_tables(
            bags, None if options.robots is None else set(options.robots), set(options.tables), files
        )
        files.close()
        if not files.rows:
            raise RecordingError(
                "%s: nothing of these robots and tables in it; its topics: %s"
                % (", ".join(bags.paths), ", ".join(sorted(bags.topics)[:8]))
            )
        os.rename(part, folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    robots = {robot_id for robot_id, _ in files.rows}
    print(
        "%s: %d robots, %d tables, %d rows" % (folder, len(robots), len(files.rows), sum(files.rows.values()))
    )


def main() -> None:
    """Run the program export."""
    command_line.run(lambda: run(parse_options(sys.argv[1:])), RecordingError)
