"""Reads ROS parameters for robots, in the form that rosserial sends them.

Integers and booleans, floats and texts, alone or in lists. A robot reads below its own namespace only,
unless ~namespace_policy is any. May block; runs on a worker.
"""

import xmlrpc.client
from typing import Any, List, NamedTuple, Optional

import rosgraph
import rospy


class ParameterAnswer(NamedTuple):
    """The three lists of rosserial_msgs/RequestParam; a robot gets empty ones for what is not there."""

    ints: List[int]
    floats: List[float]
    strings: List[str]


EMPTY_ANSWER = ParameterAnswer([], [], [])


class ParameterRefusedError(Exception):
    """A parameter cannot be given to a robot; the text says which and why."""


def resolve_parameter(name: str, namespace: str, may_leave: bool) -> str:
    """Return the full name of what the robot in namespace calls name. Raises: ParameterRefusedError."""
    if name.startswith("~"):
        return "%s/%s" % (namespace, name[1:].lstrip("/"))
    if not name.startswith("/"):
        return "%s/%s" % (namespace, name)
    if may_leave or name.startswith(namespace + "/"):
        return name
    raise ParameterRefusedError(
        "parameter %s lies outside %s (~namespace_policy is robot)" % (ascii(name[:100]), namespace)
    )


def read_parameter(full_name: str) -> ParameterAnswer:
    """Return the value of a ROS parameter. Raises: ParameterRefusedError."""
    try:
        value = rospy.get_param(full_name, None)
    except (rospy.ROSException, rosgraph.MasterException, OSError, xmlrpc.client.Error) as error:
        text = "parameter %s cannot be read: %s" % (ascii(full_name[:100]), error)
        raise ParameterRefusedError(text) from error
    if value is None:
        raise ParameterRefusedError("parameter %s is not set" % ascii(full_name[:100]))
    answer = convert_parameter(value)
    if answer is None:
        raise ParameterRefusedError(
            "parameter %s is %s; robots can read numbers, texts and lists of one of them"
            % (ascii(full_name[:100]), type(value).__name__)
        )
    return answer


def convert_parameter(value: Any) -> Optional[ParameterAnswer]:
    """Return value as a robot can read it, None if it cannot."""
    values = value if isinstance(value, list) else [value]
    if all(isinstance(entry, (bool, int)) for entry in values):
        return ParameterAnswer([int(entry) for entry in values], [], [])
    if all(isinstance(entry, (int, float)) and not isinstance(entry, bool) for entry in values):
        return ParameterAnswer([], [float(entry) for entry in values], [])
    if all(isinstance(entry, str) for entry in values):
        return ParameterAnswer([], [], list(values))
    return None
