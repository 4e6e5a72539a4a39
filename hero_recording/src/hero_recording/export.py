"""Program export: writes robots' messages in bags as CSV, a folder per robot and a file per message type.

The tables are in FOLDER.part until all of them are complete.
"""

import argparse
import csv
import os
import shutil
import sys
from typing import Dict, List, Optional, Sequence, Set, Tuple

from hero_node import command_line
from hero_node.parameters import robot_ids_option

from .bags import BagSet
from .errors import RecordingError
from .options import list_of
from .tables import TABLES, Row, is_exported, read_rows
from .topics import Message

PART_SUFFIX = ".part"

BATCH_ROWS = 4096
"""Buffered rows of a table: 8 numbers take some 0.8 MB."""


class CsvFiles:
    """All tables of an export, in a folder per robot.

    Attributes:
        rows: how many rows were written, by robot and kind.
    """

    def __init__(self, folder: str) -> None:
        """Write to folder, which must exist."""
        self.rows: Dict[Tuple[int, str], int] = {}
        self._folder = folder
        self._buffers: Dict[Tuple[int, str], List[Row]] = {}

    def add(self, robot_id: int, kind: str, row: Row) -> None:
        """Add a row. Raises: RecordingError if a file cannot be written."""
        buffer = self._buffers.setdefault((robot_id, kind), [])
        buffer.append(row)
        if len(buffer) >= BATCH_ROWS:
            self._write(robot_id, kind)

    def flush(self) -> None:
        """Write all buffered rows. Raises: RecordingError if a file cannot be written."""
        for robot_id, kind in list(self._buffers):
            self._write(robot_id, kind)

    def _write(self, robot_id: int, kind: str) -> None:
        key = (robot_id, kind)
        rows = self._buffers.pop(key)
        path = os.path.join(self._folder, "hero_%d" % robot_id, kind + ".csv")
        try:
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with open(path, "a", encoding="utf-8", newline="") as file:
                writer = csv.writer(file)
                if key not in self.rows:
                    writer.writerow(("time_s", *TABLES[kind]))
                writer.writerows(rows)
        except OSError as error:
            raise RecordingError("%s cannot be written: %s" % (path, error.strerror or error)) from error
        self.rows[key] = self.rows.get(key, 0) + len(rows)


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="export", description="Export recordings of robots to CSV.")
    parser.add_argument("bags", nargs="+", metavar="FILE.bag", help="the bags of one recording, in any order")
    parser.add_argument("--out", metavar="FOLDER", help="where the tables go (the first bag's name); must not exist")
    parser.add_argument("--robots", type=robot_ids_option, default="all", help="ids, e.g. '0 1 2' or 0-3 (all)")
    every, text = ",".join(TABLES), "which, separated by commas (%(default)s)"
    parser.add_argument("--tables", type=list_of(TABLES), default=every, metavar="LIST", help=text)
    return parser.parse_args(arguments)


def write_tables(bags: BagSet, robot_ids: Optional[Set[int]], kinds: Set[str], files: CsvFiles) -> None:
    """Write all rows of these robots and kinds. Raises: RecordingError if there are none."""

    def receive(message: Message) -> None:
        for robot_id, kind, row in read_rows(*message):
            if kind in kinds and (robot_ids is None or robot_id in robot_ids):
                files.add(robot_id, kind, row)

    bags.read(is_exported, receive)
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
