"""The inventory of a lab: every robot of the drivers and of fleet.yaml, as a table, JSON or CSV. Pure."""

import csv
import io
import json
from typing import Any, Dict, List, Mapping, Sequence

from hero_node import make_printable
from hero_node.files import FleetFile, KeptCalibration, RobotNotes

from .fleet_rows import RobotRow

COLUMNS = (
    *("id", "name", "state", "model", "firmware", "hardware", "config", "address", "uptime_s"),
    *("calibrated", "velocity_error", "broken", "note", "place", "owner"),
)

LOW_SHARE = 0.8
"""Share of the usual run time from which a robot is to be charged."""

VERSIONS = ("firmware", "hardware", "config")


def list_inventory(
    rows: Sequence[RobotRow], file: FleetFile, calibrations: Mapping[str, KeptCalibration]
) -> List[Dict[str, Any]]:
    """Return a row with COLUMNS per robot, by id; robots of the file that no driver knows are ABSENT."""
    by_id = {row.robot.id: row for row in rows if row.robot.id >= 0 and row.state != "REFUSED"}
    return [
        _make_row(number, by_id.get(number), file.robots.get(number, RobotNotes()), calibrations.get(f"hero_{number}"))
        for number in sorted({*by_id, *file.robots})
    ]


def _make_row(number: int, row: Any, notes: RobotNotes, kept: Any) -> Dict[str, Any]:
    known = {"state": "ABSENT", **dict.fromkeys(("model", *VERSIONS, "address"), ""), "uptime_s": None}
    if row is not None:
        robot = row.robot
        known = {"state": row.state, "address": robot.address, "uptime_s": round(robot.uptime.to_sec())}
        known.update((name, getattr(robot, name)) for name in ("model", *VERSIONS))
    errors = kept.values.get("velocity_errors", (None, None)) if kept else (None, None)
    calibration = {"calibrated": kept.date if kept else "", "velocity_error": errors[1]}
    values = {"id": number, **known, **notes._asdict(), **calibration}
    return {name: values[name] for name in COLUMNS}


def list_differences(inventory: Sequence[Mapping[str, Any]]) -> List[str]:
    """Return a line for each version that differs between robots."""
    lines = []
    for name in VERSIONS:
        owners: Dict[str, List[str]] = {}
        for row in inventory:
            if row[name]:
                owners.setdefault(row[name], []).append(str(row["id"]))
        if len(owners) > 1:
            parts = (f"{value} ({', '.join(ids)})" for value, ids in sorted(owners.items()))
            lines.append(f"{name} differs: {'; '.join(parts)}")
    return lines


def list_warnings(inventory: Sequence[Mapping[str, Any]], run_time_h: float) -> List[str]:
    """Return the versions that differ, and a line for each robot that has run for long."""
    lines = list_differences(inventory)
    for row in inventory:
        hours = (row["uptime_s"] or 0) / 3600.0
        if run_time_h and hours >= LOW_SHARE * run_time_h:
            lines.append(f"hero_{row['id']} has run for {hours:.1f} h of about {run_time_h:g} h: charge it")
    return lines


def format_inventory(inventory: Sequence[Mapping[str, Any]], style: str, warnings: Sequence[str]) -> str:
    """Return the inventory as table, json or csv."""
    if style == "json":
        return json.dumps({"robots": list(inventory), "warnings": list(warnings)})
    if style == "csv":
        written = io.StringIO()
        writer = csv.DictWriter(written, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(inventory)
        return written.getvalue().rstrip("\n")
    cells = [[name.upper() for name in COLUMNS]]
    cells += [
        ["" if row[name] is None or row[name] is False else make_printable(str(row[name])) for name in COLUMNS]
        for row in inventory
    ]
    widths = [max(map(len, column)) for column in zip(*cells)]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip() for line in cells]
    return "\n".join([*lines, *map(make_printable, warnings)])
