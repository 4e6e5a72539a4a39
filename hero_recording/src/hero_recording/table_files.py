"""Rows -> files: CSV, and Parquet where pyarrow is installed. Rows wait in memory until there are some thousand.

A table's file is opened for each batch (CSV) or kept open (Parquet, whose index stands at its end).
"""

import csv
import importlib
import importlib.util
import os
import resource
from typing import Any, Dict, List, Optional, Tuple

from .errors import RecordingError
from .tables import NUMBER, TABLES, Row

BATCH_ROWS = 4096
"""Rows of a table that wait in memory: 8 numbers take some 0.8 MB."""

CSV = "csv"
PARQUET = "parquet"
FORMATS = (CSV, PARQUET)

_TIME_NAMES = ("time_s", "stamp_s")


class CsvFile:
    """A table as text: a line of names, then a line per row."""

    def __init__(self, path: str, kind: str) -> None:
        """Begin the file at path (without suffix)."""
        self._path = path + ".csv"
        self._columns = TABLES[kind].columns
        with open(self._path, "w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerow(column.name for column in self._columns)

    def write(self, rows: List[Row]) -> None:
        """Add rows."""
        times = [column.name in _TIME_NAMES for column in self._columns]
        with open(self._path, "a", encoding="utf-8", newline="") as file:
            # Seconds since 1970 to the microsecond; other floats as short as they can be read back exactly.
            csv.writer(file).writerows(
                ["%.6f" % value if is_time else value for value, is_time in zip(row, times)] for row in rows
            )

    def close(self) -> None:
        """Do nothing: each batch is complete."""


class ParquetFile:
    """A table as columns, with the unit and the meaning of each in the metadata of its field."""

    def __init__(self, path: str, kind: str) -> None:
        """Begin the file at path (without suffix)."""
        self._arrow = importlib.import_module("pyarrow")
        self._columns = TABLES[kind].columns
        self._schema = self._arrow.schema(
            [
                self._arrow.field(
                    column.name,
                    self._arrow.float64() if column.kind == NUMBER else self._arrow.string(),
                    metadata={"unit": column.unit, "meaning": column.meaning},
                )
                for column in self._columns
            ]
        )
        self._writer: Any = importlib.import_module("pyarrow.parquet").ParquetWriter(
            path + ".parquet", self._schema
        )

    def write(self, rows: List[Row]) -> None:
        """Add rows."""
        arrays = [
            self._arrow.array(list(map(float, values)) if column.kind == NUMBER else values, field.type)
            for column, values, field in zip(self._columns, zip(*rows), self._schema)
        ]
        self._writer.write_table(self._arrow.Table.from_arrays(arrays, schema=self._schema))

    def close(self) -> None:
        """Write the index."""
        self._writer.close()


_KINDS: Dict[str, Any] = {CSV: CsvFile, PARQUET: ParquetFile}


def find_missing(formats: List[str]) -> Optional[str]:
    """Return what has to be installed first for these formats, in words; None if nothing is missing."""
    if PARQUET in formats and importlib.util.find_spec("pyarrow") is None:
        return (
            "Parquet needs pyarrow, which Debian does not have: python3 -m venv --system-site-packages VENV; "
            "VENV/bin/pip install pyarrow; then PYTHONPATH=$(echo VENV/lib/python3*/site-packages) before the "
            "command; or write CSV (--format csv)"
        )
    return None


class TableFiles:
    """All tables of an export, in a folder per robot.

    Attributes:
        rows: how many rows were written, by robot and kind.
    """

    def __init__(self, folder: str, formats: List[str]) -> None:
        """Write to folder, which must exist."""
        self.rows: Dict[Tuple[int, str], int] = {}
        self._folder = folder
        self._formats = formats
        self._waiting: Dict[Tuple[int, str], List[Row]] = {}
        self._files: Dict[Tuple[int, str], List[Any]] = {}
        # A hundred robots have more Parquet files open at once than a user's usual limit of 1024.
        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))

    def add(self, robot_id: int, kind: str, row: Row) -> None:
        """Add a row. Raises: RecordingError if a file cannot be written."""
        key = (robot_id, kind)
        rows = self._waiting.setdefault(key, [])
        rows.append(row)
        if len(rows) >= BATCH_ROWS:
            self._write(key)

    def _write(self, key: Tuple[int, str]) -> None:
        rows = self._waiting.pop(key)
        robot_id, kind = key
        folder = os.path.join(self._folder, "hero_%d" % robot_id)
        try:
            if key not in self._files:
                os.makedirs(folder, exist_ok=True)
                self._files[key] = [_KINDS[name](os.path.join(folder, kind), kind) for name in self._formats]
            for file in self._files[key]:
                file.write(rows)
        except OSError as error:
            raise RecordingError("%s cannot be written: %s" % (folder, error.strerror or error)) from error
        self.rows[key] = self.rows.get(key, 0) + len(rows)

    def close(self) -> None:
        """Write what waits, and end all files; safe twice. Raises: RecordingError."""
        for key in list(self._waiting):
            self._write(key)
        files, self._files = self._files, {}
        for group in files.values():
            for file in group:
                try:
                    file.close()
                except OSError as error:
                    raise RecordingError(
                        "%s cannot be written: %s" % (self._folder, error.strerror or error)
                    ) from error
