"""The lab's fleet.yaml for programs over ROS: types of the topics that it declares, and fields of their messages."""

from functools import lru_cache, reduce
from typing import Any, Optional, Type

import roslib.message

from hero_node import ProgramError
from hero_node.files import ExtraTopic, FleetFile, read_fleet_file


@lru_cache(maxsize=None)
def load_fleet_file() -> FleetFile:
    """Return fleet.yaml, read once. Raises: EntryError for a mistake in the file. ProgramError for a missing type."""
    found = read_fleet_file()
    for topic in found.topics:
        read_field(find_class(topic)(), topic)
    return found


def find_class(topic: ExtraTopic) -> Type[Any]:
    """Return the class of a topic's messages. Raises: ProgramError."""
    found: Optional[Type[Any]] = roslib.message.get_message_class(topic.type)
    if found is None:
        raise ProgramError(f"fleet.yaml: {topic.name}: the type {topic.type} is not installed, or not built")
    return found


def read_field(message: Any, topic: ExtraTopic) -> Any:
    """Return the field of a message that is shown. Raises: ProgramError."""
    try:
        return reduce(getattr, topic.field.split("."), message)
    except AttributeError:
        raise ProgramError(f"fleet.yaml: {topic.name}: {topic.type} has no field {topic.field}") from None
