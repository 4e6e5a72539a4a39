"""Writes tables as CSV, a folder per robot and a file per kind; npz and parquet are made from the complete CSV.

Only one table is in memory at a time, and no file stays open: a recording of 100 robots has a thousand tables.
"""

import csv
import os
from typing import Any, Callable, Dict, List, Tuple

import numpy as np

from hero_node import import_optional

from .bags.tables import TABLES, TEXT_COLUMNS, Row
from .errors import explain_write_errors

BATCH_ROWS = 4096
"""Buffered rows of a table: 8 numbers take some 0.8 MB."""

TIME_COLUMN = "time_s"

TABLE_FORMATS = CSV, NPZ, PARQUET = "csv", "npz", "parquet"

Columns = Dict[str, Any]
"""Arrays by name: numbers as float64, the rest as text."""


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

    def path(self, robot_id: int, kind: str) -> str:
        """Return the file of a table."""
        return os.path.join(self._folder, "hero_%d" % robot_id, kind + ".csv")

    def _write(self, robot_id: int, kind: str) -> None:
        key = (robot_id, kind)
        rows = self._buffers.pop(key)
        path = self.path(robot_id, kind)
        with explain_write_errors(path):
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with open(path, "a", encoding="utf-8", newline="") as file:
                writer = csv.writer(file)
                if key not in self.rows:
                    writer.writerow((TIME_COLUMN, *TABLES[kind]))
                writer.writerows(rows)
        self.rows[key] = self.rows.get(key, 0) + len(rows)


def load_writer(name: str) -> Callable[[str, Columns], None]:
    """Return what writes columns into a file of another format. Raises: ProgramError without its library."""
    if name == NPZ:
        return lambda path, columns: np.savez_compressed(path, **columns)
    requirement = "pyarrow<20"  # which takes the numpy of Debian 12, too
    arrow, parquet = (import_optional(module, requirement) for module in ("pyarrow", "pyarrow.parquet"))
    return lambda path, columns: parquet.write_table(arrow.table(columns), path)


def convert_csv(path: str, suffix: str, write: Callable[[str, Columns], None]) -> None:
    """Replace a CSV file by one with the suffix, with an array per column."""
    target = os.path.splitext(path)[0] + suffix
    with explain_write_errors(target):
        write(target, _read_columns(path))
        os.remove(path)


def _read_columns(path: str) -> Columns:
    with open(path, encoding="utf-8", newline="") as file:
        reader = csv.reader(file)
        names = next(reader)
        columns = zip(*reader)
        return {
            name: np.array(column) if name in TEXT_COLUMNS else np.array(column, dtype=np.float64)
            for name, column in zip(names, columns)
        }
