"""Reads the private parameters of a node.

    parameters = read_parameters({"robots": robot_ids("0"), "linear_m_s": number(0.1, 0.0, 0.2, "m/s")})
"""

from typing import Any, Dict, Mapping

import rospy

from ..errors import ProgramError
from ..parameters import Parameter

__all__ = ["read_parameters"]


def read_parameters(declared: Mapping[str, Any]) -> Dict[str, Any]:
    """Return the node's private parameters, checked, with defaults for those that are not set.

    declared: name -> a Parameter, or a default that needs no check.
    Raises: ProgramError for a value that fails its check, or a name that is not declared, with those that are.
    """
    try:
        given = rospy.get_param("~", {})
    except KeyError:
        given = {}
    unknown = sorted(set(given) - set(declared))
    if unknown:
        raise ProgramError("unknown parameter ~%s; known are: %s" % (unknown[0], ", ".join(sorted(declared))))
    values = {}
    for name, parameter in declared.items():
        if isinstance(parameter, Parameter):
            values[name] = parameter.check(name, given.get(name, parameter.default))
        else:
            values[name] = given.get(name, parameter)
    return values
