"""XML-RPC calls to the ROS master and to nodes, with a time limit: rospy would wait for ever."""

import errno
import http.client
import urllib.parse
import xmlrpc.client
from typing import Any
from xml.parsers.expat import ExpatError

import rosgraph
import rospy

from ..errors import NodeError

MASTER_TIMEOUT_S = 3.0
"""A master answers within milliseconds, under load within a second."""

SUCCESS = 1
"""First part of an answer of the master (ROS Master API)."""

CALL_ERRORS = (OSError, OverflowError, ValueError, http.client.HTTPException, xmlrpc.client.Error, ExpatError)
"""Raised by calls to anything but a master or node; two of them by an address that a node registered as its own."""


class MasterRefusalError(NodeError):
    """The ROS master answered, and refused what was asked."""


class LimitedTransport(xmlrpc.client.Transport):
    """XML-RPC over HTTP with a time limit."""

    def make_connection(self, host: Any) -> Any:
        """Return a connection that gives up after MASTER_TIMEOUT_S."""
        connection = super().make_connection(host)
        connection.timeout = MASTER_TIMEOUT_S
        return connection

    def single_request(self, *arguments: Any, **options: Any) -> Any:
        """Send a request; a timeout gets an error number, because rospy's shutdown fails on an error without one."""
        try:
            return super().single_request(*arguments, **options)
        except OSError as error:
            if error.errno is not None:
                raise
            raise OSError(errno.ETIMEDOUT, f"no answer within {MASTER_TIMEOUT_S:g} s") from None


def read_master_uri() -> str:
    """Return the address of the ROS master. Raises: NodeError where there can never be one."""
    try:
        uri: str = rosgraph.get_master_uri()
    except ValueError as error:  # of __master:=
        raise NodeError(str(error)) from None
    try:
        parts = urllib.parse.urlsplit(uri)
        if parts.scheme == "http" and parts.port and (parts.hostname or "").encode("idna"):
            return uri
    except ValueError:  # a port beyond 65535, half an IPv6 address, a host with two dots
        pass
    raise NodeError(f"ROS_MASTER_URI is {uri!a}, but must be like http://localhost:11311")


def ask_master(method: str, *arguments: Any) -> Any:
    """Return the value of a method of the master. Raises: MasterRefusalError, NodeError if it does not answer."""
    uri = read_master_uri()
    try:
        with xmlrpc.client.ServerProxy(uri, transport=LimitedTransport()) as master:
            code, text, value = getattr(master, method)(rospy.get_name(), *arguments)
    except CALL_ERRORS as error:
        raise NodeError(f"no ROS master at {uri!r} ({error})") from None
    if code != SUCCESS:
        raise MasterRefusalError(f"the ROS master refuses {method}: {text}")
    return value


def check_master() -> None:
    """Raise NodeError with what to do if no ROS master answers."""
    read_master_uri()
    try:
        ask_master("getPid")
    except NodeError as error:
        remedy = "start roslaunch hero_bringup hero_bringup.launch first, or set ROS_MASTER_URI, for example to"
        raise NodeError(f"{error}: {remedy} http://localhost:11311") from None


def find_running_node(default_name: str) -> str:
    """Return the full name that this node will have, if a node of that name answers, else an empty string.

    For the time before rospy.init_node(), to which default_name is passed, and which would end the other node.
    """
    name: str = rosgraph.names.resolve_name(rospy.names.get_mappings().get("__name", default_name), rospy.get_name())
    try:
        with xmlrpc.client.ServerProxy(ask_master("lookupNode", name), transport=LimitedTransport()) as node:
            node.getPid(name)
    except (NodeError, *CALL_ERRORS):
        return ""
    return name
