"""Program export: writes recordings as tables, a folder per robot and a file per message type.

What is written is in OUT.part until it is complete.
"""

import argparse
import os
import shutil
from typing import Optional, Sequence

from hero_node.files import read_fleet_file
from hero_node.parameters import robot_ids_option

from .bags.bag_set import BagSet
from .bags.tables import TABLES, declare_tables, is_exported, read_rows
from .bags.topics import Message
from .errors import RecordingError, explain_write_errors
from .options import list_of
from .table_files import CSV, TABLE_FORMATS, CsvFiles, convert_csv, load_writer


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="export", description="Export recordings to tables.")
    parser.add_argument("bags", nargs="+", metavar="FILE.bag", help="the bags of one recording, in any order")
    parser.add_argument("--out", metavar="PATH", help="output path (the first bag's name); must not exist")
    parser.add_argument("--robots", type=robot_ids_option, default="all", help="ids, e.g. '0 1 2' or 0-3 (all)")
    every, text = ",".join(TABLES), "which, separated by commas (%(default)s)"
    parser.add_argument("--tables", type=list_of(TABLES), default=every, metavar="LIST", help=text)
    parser.add_argument("--format", choices=TABLE_FORMATS, default=CSV, help="of the files (%(default)s)")
    return parser.parse_args(arguments)


def export_tables(bags: BagSet, options: argparse.Namespace, folder: str) -> str:
    """Write tables into a new folder and return what was written. Raises: RecordingError, also if that is nothing."""
    write = None if options.format == CSV else load_writer(options.format)
    files = CsvFiles(folder)

    def receive(message: Message) -> None:
        for robot_id, kind, row in read_rows(*message):
            if kind in options.tables and (options.robots is None or robot_id in options.robots):
                files.add(robot_id, kind, row)

    bags.read(is_exported, receive)
    files.flush()
    if not files.rows:
        raise RecordingError(
            "%s: nothing of these robots and tables in it; its topics: %s"
            % (", ".join(bags.paths), bags.describe_topics())
        )
    if write:
        for robot_id, kind in files.rows:
            convert_csv(files.path(robot_id, kind), "." + options.format, write)
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
