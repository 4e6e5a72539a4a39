"""Reads the private parameters of a node.

    parameters = read_parameters({"robots": robot_ids("0"), "linear_m_s": number(0.1, 0.0, 0.2, "m/s")})
"""

from typing import Any, Dict, Mapping

import rospy

from ..parameters import check_parameters

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
    return check_parameters(declared, given)
