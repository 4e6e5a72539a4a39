"""Program export: writes recordings as tables (CSV), a folder per robot and a file per kind of message.

What is written is in OUT.part until it is complete. No file stays open: a recording of 100 robots has a thousand
tables.
"""

import argparse
import csv
import os
import shutil
from typing import Dict, List, Optional, Sequence, Tuple

from hero_node.files import read_fleet_file
from hero_node.parameters import robot_ids_option

from .bags.bag_set import BagSet
from .bags.tables import TABLES, Row, declare_tables, is_exported, read_rows
from .bags.topics import Message
from .errors import RecordingError, explain_write_errors

BATCH_ROWS = 4096
"""Buffered rows of a table: 8 numbers take some 0.8 MB."""

TIME_COLUMN = "time_s"


class CsvFiles:
    """All tables of an export, in a folder per robot.

    Attributes:
        rows: how many rows were written, by robot and kind.
    """

    def __init__(self, folder: str) -> None:
        """Write to folder, which is created."""
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
        with explain_write_errors(path):
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with open(path, "a", encoding="utf-8", newline="") as file:
                writer = csv.writer(file)
                if key not in self.rows:
                    writer.writerow((TIME_COLUMN, *TABLES[kind]))
                writer.writerows(rows)
        self.rows[key] = self.rows.get(key, 0) + len(rows)


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="export", description="Export recordings to tables.")
    parser.add_argument("bags", nargs="+", metavar="FILE.bag", help="the bags of one recording, in any order")
    parser.add_argument("--out", metavar="PATH", help="output path (the first bag's name); must not exist")
    parser.add_argument("--robots", type=robot_ids_option, default="all", help="ids, e.g. '0 1 2' or 0-3 (all)")
    return parser.parse_args(arguments)


def export_tables(bags: BagSet, options: argparse.Namespace, folder: str) -> str:
    """Write tables into a new folder and return what was written. Raises: RecordingError, also if that is nothing."""
    files = CsvFiles(folder)

    def receive(message: Message) -> None:
        for robot_id, kind, row in read_rows(*message):
            if options.robots is None or robot_id in options.robots:
                files.add(robot_id, kind, row)

    bags.read(is_exported, receive)
    files.flush()
    if not files.rows:
        raise RecordingError(
            "%s: nothing of these robots in it; its topics: %s" % (", ".join(bags.paths), bags.describe_topics())
        )
    robots = {robot_id for robot_id, _ in files.rows}
    return "%d robots, %d tables, %d rows" % (len(robots), len(files.rows), sum(files.rows.values()))


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Export. Raises: RecordingError."""
    declare_tables(read_fleet_file().topics)
    options = parse_options(arguments)
    bags = BagSet(options.bags)
    out = os.path.abspath(options.out or os.path.splitext(bags.paths[0])[0])
    if os.path.exists(out):
        raise RecordingError(f"{out} exists already; move it away or choose another --out")
    part = out + ".part"
    with explain_write_errors(part):
        os.makedirs(part)
    incomplete = os.path.join(part, os.path.basename(out))
    try:
        written = export_tables(bags, options, incomplete)
        os.rename(incomplete, out)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    print(f"{out}: {written}")
