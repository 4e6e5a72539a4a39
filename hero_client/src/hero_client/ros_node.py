"""Starts a ROS node or says in one line why not, and keeps every call to the ROS master short.

rospy waits for a master without a time limit, and a call that hangs holds a lock that other threads and the end of the
node wait for. rospy has no setting for either, so this file, and no other here, uses its internals.
"""

import errno
import http.client
import socket
import threading
import xmlrpc.client
from typing import Any
from xml.parsers.expat import ExpatError

import rosgraph
import rosgraph.roslogging
import rospy
from rospy.impl import tcpros_base
from rospy.impl.registration import RegManager, get_registration_listeners

from .texts import one_line
from .values.errors import NodeError

__all__ = [
    "MASTER_TIMEOUT_S",
    "SUCCESS",
    "LimitedTransport",
    "NodeMaster",
    "ask_master",
    "check_master",
    "end_without_delay",
    "start_ros_node",
]

MASTER_TIMEOUT_S = 3.0
"""A master answers within milliseconds, under load within a second."""

SUCCESS = 1
"""First part of an answer of the master (ROS Master API)."""


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
            raise OSError(errno.ETIMEDOUT, "no answer within %g s" % MASTER_TIMEOUT_S) from None


class NodeMaster(rospy.core._LockedServerProxy):
    """The ROS master, as rospy calls it for all topics and services of the node."""

    def _ServerProxy__request(self, methodname: str, params: Any) -> Any:  # noqa: N802 - the name that xmlrpc calls
        # rospy repeats a registration until it succeeds or the node has ended, with a lock that the end waits for.
        if methodname.startswith("register") and rospy.core.is_shutdown_requested():
            return SUCCESS, "the node ends", []
        return super()._ServerProxy__request(methodname, params)


def ask_master(method: str, *arguments: Any) -> Any:
    """Call a method of the ROS master (Master API) and return its value.

    Raises: NodeError if the master does not answer in time or refuses.
    """
    uri = ""
    try:
        uri = rosgraph.get_master_uri()
        with xmlrpc.client.ServerProxy(uri, transport=LimitedTransport()) as master:
            code, text, value = getattr(master, method)(rospy.get_name(), *arguments)
    except (OSError, OverflowError, ValueError, http.client.HTTPException, xmlrpc.client.Error, ExpatError) as error:
        raise NodeError("no ROS master at %r (%s)" % (uri, error)) from None
    if code != SUCCESS:
        raise NodeError("the ROS master refuses %s: %s" % (method, text))
    return value


def check_master() -> None:
    """Raise NodeError with what to do if no ROS master answers."""
    try:
        ask_master("getPid")
    except NodeError as error:
        raise NodeError(
            "%s: start roslaunch hero_bringup hero_bringup.launch first, or set ROS_MASTER_URI, for example to"
            " http://localhost:11311" % error
        ) from None


def start_ros_node(name: str, anonymous: bool = False) -> None:
    """Start the node of this process; signals stay with the caller.

    Raises: NodeError without a ROS master, without a directory for logs, for wrong remappings, or if a node of this
        name already runs, which ROS would end.
    """
    check_master()
    if not anonymous:
        _check_name(name)
    uri = rosgraph.get_master_uri()
    rospy.core._xmlrpc_cache[uri] = NodeMaster(uri, transport=LimitedTransport())
    _serve_each_connection_by_itself()
    try:
        rospy.init_node(name, anonymous=anonymous, disable_signals=True)
    except rosgraph.roslogging.LoggingException as error:
        raise NodeError("%s: set ROS_LOG_DIR to a directory" % error) from None
    except (rospy.ROSInitException, OSError, ValueError) as error:
        raise NodeError(one_line(error)) from None
    end_without_delay()


def _serve_each_connection_by_itself() -> None:
    """Let no program that connects delay another; for the time before rospy.init_node().

    rospy reads the headers of connections on the thread that accepts them, without a time limit: a driver that hangs
    while it connects would keep the next one from ever hearing of a stop.
    """
    server = tcpros_base.init_tcpros_server()
    serve = server._tcp_server_callback

    def serve_unless_gone(sock: socket.socket, address: Any) -> None:
        # rospy warns of what connects and leaves, as it does itself where it is told of a publisher twice at once.
        try:
            is_gone = not sock.recv(1, socket.MSG_PEEK)
        except OSError:
            is_gone = True
        if is_gone:
            sock.close()
        else:
            serve(sock, address)

    def serve_on_a_thread(*connection: Any) -> None:
        threading.Thread(target=serve_unless_gone, args=connection, name="connection", daemon=True).start()

    server._tcp_server_callback = serve_on_a_thread


def _check_name(default_name: str) -> None:
    """Raise NodeError if a node that answers has the name of this one; a registration of a dead node does not count."""
    name = rosgraph.names.resolve_name(rospy.names.get_mappings().get("__name", default_name), rospy.get_name())
    try:
        with xmlrpc.client.ServerProxy(ask_master("lookupNode", name), transport=LimitedTransport()) as node:
            node.getPid(name)
    except (NodeError, OSError, http.client.HTTPException, xmlrpc.client.Error, ExpatError):
        return
    raise NodeError("%s already runs: end it, or start this one with another __name:=" % name)


def end_without_delay() -> None:
    """Let this node end as soon as its topics are closed.

    rospy's registration thread, for which the interpreter waits, looks for the end only every 0.5 s: it is woken as
    the shutdown begins, too early, and sleeps again before rospy says that the node is down. Here it is woken after.
    """
    managers = [listener for listener in get_registration_listeners().listeners if isinstance(listener, RegManager)]

    def wake(reason: str) -> None:
        for manager in managers:
            with manager.cond:
                manager.cond.notify_all()

    rospy.core.add_shutdown_hook(wake)
