"""Tells whether a node of one's own name already runs, which ROS would end in favor of a second one."""

import http.client
import xmlrpc.client
from typing import Any
from xml.parsers.expat import ExpatError

import rosgraph
import rospy

ANSWER_LIMIT_S = 3.0
"""A node or ROS master that has not answered by then is taken for dead."""


class LimitedTransport(xmlrpc.client.Transport):
    """XML-RPC over HTTP with a time limit."""

    def make_connection(self, host: Any) -> Any:
        """Return a connection that gives up after ANSWER_LIMIT_S."""
        connection = super().make_connection(host)
        connection.timeout = ANSWER_LIMIT_S
        return connection


def find_running_node(default_name: str) -> str:
    """Return the full name that this node will have, if a node of that name answers, else an empty string.

    Call it before rospy.init_node(). A registration that a dead node left behind does not count.

    default_name: the name that is passed to rospy.init_node(); remappings and the namespace are applied.
    """
    name: str = rosgraph.names.resolve_name(rospy.names.get_mappings().get("__name", default_name), rospy.get_name())
    try:
        with xmlrpc.client.ServerProxy(rosgraph.get_master_uri(), transport=LimitedTransport()) as master:
            _, _, uri = master.lookupNode(name, name)  # type: ignore[misc]
        if not uri:
            return ""
        with xmlrpc.client.ServerProxy(str(uri), transport=LimitedTransport()) as node:
            node.getPid(name)
    except (OSError, http.client.HTTPException, xmlrpc.client.Error, ExpatError):
        return ""
    return name
