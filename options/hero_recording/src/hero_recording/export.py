"""Program export: writes recordings as tables (CSV), a folder per robot and a file per kind of message.

What is written is in OUT.part until it is complete.
"""

import argparse
import csv
import os
import shutil
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Dict, Optional, Sequence, Tuple

from hero_node import raise_file_limit
from hero_node.files import name_file, read_fleet_file
from hero_node.parameters import robot_ids_option

from .bags.bag_set import BagSet
from .bags.tables import TABLES, Row, declare_tables, is_exported, read_rows
from .bags.topics import Message
from .errors import RecordingError

TIME_COLUMN = "time_s"


class CsvFiles(ExitStack):
    """All tables of an export, in a folder per robot, open until close().

    Attributes:
        rows: how many rows were written, by robot and kind.
    """

    def __init__(self, folder: str) -> None:
        """Write to folder, which is created."""
        super().__init__()
        raise_file_limit()  # 100 robots have a thousand tables
        self.rows: Dict[Tuple[int, str], int] = {}
        self._folder = folder
        self._writers: Dict[Tuple[int, str], Any] = {}

    def add(self, robot_id: int, kind: str, row: Row) -> None:
        """Add a row. Raises: OSError if a file cannot be written."""
        key = robot_id, kind
        if key not in self._writers:
            path = Path(self._folder, "hero_%d" % robot_id, kind + ".csv")
            path.parent.mkdir(parents=True, exist_ok=True)
            file = self.enter_context(path.open("w", encoding="utf-8", newline=""))
            self._writers[key] = csv.writer(file)
            self._writers[key].writerow((TIME_COLUMN, *TABLES[kind]))
        self._writers[key].writerow(row)
        self.rows[key] = self.rows.get(key, 0) + 1


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="export", description="Export recordings to tables.")
    parser.add_argument("bags", nargs="+", metavar="FILE.bag", help="the bags of one recording, in any order")
    parser.add_argument("--out", metavar="PATH", help="output path (the first bag's name); must not exist")
    parser.add_argument("--robots", type=robot_ids_option, default="all", help="ids, e.g. '0 1 2' or 0-3 (all)")
    return parser.parse_args(arguments)


def export_tables(bags: BagSet, options: argparse.Namespace, folder: str) -> str:
    """Write tables into a new folder; return what was written. Raises: RecordingError if that is nothing. OSError."""
    files = CsvFiles(folder)

    def receive(message: Message) -> None:
        for robot_id, kind, row in read_rows(*message):
            if options.robots is None or robot_id in options.robots:
                files.add(robot_id, kind, row)

    with name_file(folder), files:
        bags.read(is_exported, receive)
    if not files.rows:
        text = "%s: nothing of these robots in it; its topics: %s"
        raise RecordingError(text % (", ".join(bags.paths), bags.describe_topics()))
    robots = {robot_id for robot_id, _ in files.rows}
    return "%d robots, %d tables, %d rows" % (len(robots), len(files.rows), sum(files.rows.values()))


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Export. Raises: RecordingError. OSError."""
    declare_tables(read_fleet_file().topics)
    options = parse_options(arguments)
    bags = BagSet(options.bags)
    out = os.path.abspath(options.out or os.path.splitext(bags.paths[0])[0])
    if os.path.exists(out):
        raise RecordingError(f"{out} exists already; move it away or choose another --out")
    part = out + ".part"
    os.makedirs(part)
    incomplete = os.path.join(part, os.path.basename(out))
    try:
        written = export_tables(bags, options, incomplete)
        os.rename(incomplete, out)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    print(f"{out}: {written}")
