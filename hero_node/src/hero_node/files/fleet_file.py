"""The file of a lab's fleet, fleet.yaml in ROS_HOME: notes on its robots, and topics of theirs that are shown.

robots:
  - {id: 3, name: Ada, note: squeaks, broken: true, place: shelf 2, owner: Kim}
topics:
  - {name: battery, topic: battery, type: std_msgs/Float32, field: data, unit: V}
run_time_h: 3
"""

import os
from typing import Dict, NamedTuple, Tuple

from .marked_yaml import Entry, load_entries


class RobotNotes(NamedTuple):
    """Notes on one robot."""

    name: str = ""
    note: str = ""
    broken: bool = False
    place: str = ""
    owner: str = ""

    @property
    def text(self) -> str:
        """Text that tables show beside a robot."""
        return ", ".join(filter(None, (self.name, "BROKEN" if self.broken else "", self.note)))


class ExtraTopic(NamedTuple):
    """A topic below /hero_N, of which a field is shown under a name."""

    name: str
    topic: str
    type: str
    field: str
    unit: str = ""


class FleetFile(NamedTuple):
    """Contents of the file; run_time_h: hours for which a battery lasts, 0 where that is not known."""

    robots: Dict[int, RobotNotes] = {}
    topics: Tuple[ExtraTopic, ...] = ()
    run_time_h: float = 0.0


def name_fleet_file() -> str:
    """Return the path of the file."""
    return os.path.join(os.path.expanduser(os.environ.get("ROS_HOME") or "~/.ros"), "fleet.yaml")


def read_fleet_file(path: str = "") -> FleetFile:
    """Return what a file says, by default that of ROS_HOME; nothing if there is none. Raises: EntryError."""
    path = path or name_fleet_file()
    if not os.path.exists(path):
        return FleetFile()
    content = load_entries(path, "robots: [{id: 3, name: Ada}]", may_be_empty=True).mapping(FleetFile._fields)
    robots = [_read_robot(entry) for entry in content["robots"].entries()] if "robots" in content else []
    topics = [
        ExtraTopic(**_read_texts(entry.mapping(ExtraTopic._fields, ("name", "topic", "type", "field"))))
        for entry in (content["topics"].entries() if "topics" in content else ())
    ]
    run_time_h = content["run_time_h"].number(0.0, 1000.0, "h") if "run_time_h" in content else 0.0
    return FleetFile(dict(robots), tuple(topics), run_time_h)


def _read_robot(entry: Entry) -> Tuple[int, RobotNotes]:
    fields = entry.mapping(("id", *RobotNotes._fields), ("id",))
    robot_id = fields.pop("id").whole(0, 10**9)
    broken = fields.pop("broken", None)
    if broken is not None and not isinstance(broken.value, bool):
        broken.refuse("true or false")
    return robot_id, RobotNotes(broken=broken is not None and broken.value, **_read_texts(fields))


def _read_texts(fields: Dict[str, Entry]) -> Dict[str, str]:
    return {name: str(field.value) for name, field in fields.items()}
