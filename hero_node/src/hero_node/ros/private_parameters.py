"""Reads the private parameters of a node.

parameters = read_parameters({"robots": robot_ids("0"), "linear_m_s": number(0.1, 0.0, 0.2, "m/s")})
"""

import sys
from contextlib import suppress
from typing import Any, Dict, List, Mapping

import rosgraph
import rospy

from ..errors import ProgramError
from ..parameters.declared import check_parameters


def _list_own() -> List[str]:
    """Return the parameters that are given on the command line (_name:=value)."""
    names = [word.partition(rosgraph.names.REMAP)[0] for word in sys.argv[1:] if rosgraph.names.REMAP in word]
    return [name[1:] for name in names if name.startswith("_") and not name.startswith("__")]


def delete_own_parameters() -> None:
    """Take the command line's off the parameter server, where the next start would find them; a launch file's stay."""
    with suppress(OSError, rospy.ROSException):
        for name in _list_own():
            with suppress(KeyError):
                rospy.delete_param("~" + name)


def read_given() -> Dict[str, Any]:
    """Return the node's private parameters as they were given. Raises: ProgramError if the master does not answer."""
    try:
        given = rospy.get_param("~", {})
    except KeyError:
        return {}
    except (rosgraph.MasterException, OSError) as error:
        raise ProgramError(f"the ROS master cannot be asked for parameters: {error}") from error
    return given if isinstance(given, dict) else {}


def read_parameters(declared: Mapping[str, Any]) -> Dict[str, Any]:
    """Return the node's private parameters, as check_parameters(). Raises: ProgramError."""
    given = read_given()
    try:
        return check_parameters(declared, given)
    except ProgramError as error:
        if set(given) <= set(_list_own()):
            raise
        text = "%s; what a killed program or a launch file left on the parameter server: rosparam delete %s"
        raise ProgramError(text % (error, rospy.get_name())) from None
