"""Writes rows into one CSV file per robot and table; rows are buffered, and each file is open only to append."""

import csv
import os
from typing import Dict, List, Tuple

from .errors import RecordingError
from .tables import TABLES, Row

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
