"""Starts and ends a ROS node, or says in one line why not, without waiting for a master or program that hangs.

rospy waits for a master without limit, and a call that hangs holds a lock that others wait for; it has no setting for
either, so this file uses its internals.
"""

import threading
from typing import Any, List, Optional

import rosgraph
import rosgraph.roslogging
import rospy
from rospy.impl.registration import RegManager, get_registration_listeners

from ..errors import NodeError
from ..texts import one_line
from .connections import limit_xmlrpc_connections, open_tcpros_server
from .master import SUCCESS, LimitedTransport, check_master, find_running_node


class NodeMaster(rospy.core._LockedServerProxy):
    """The ROS master, as rospy calls it for all topics and services of the node."""

    def _ServerProxy__request(self, methodname: str, params: Any) -> Any:  # noqa: N802 - the name that xmlrpc calls
        # rospy repeats a registration until it succeeds or the node has ended, with a lock that the end waits for.
        if methodname.startswith("register") and rospy.core.is_shutdown_requested():
            return SUCCESS, "the node ends", []
        return super()._ServerProxy__request(methodname, params)


def limit_master_calls() -> None:
    """Give rospy's calls to the master a time limit; for the time before rospy.init_node()."""
    uri = rosgraph.get_master_uri()
    rospy.core._xmlrpc_cache[uri] = NodeMaster(uri, transport=LimitedTransport())


def start_ros_node(name: str, anonymous: bool = False) -> None:
    """Start the node of this process; signals stay with the caller.

    Raises: NodeError: no ROS master, no directory for logs, wrong remappings, or a node of this name already runs.
    """
    check_master()
    # A name that is given (__name:=) is never made anonymous.
    running = find_running_node(name) if not anonymous or "__name" in rospy.names.get_mappings() else ""
    if running:
        raise NodeError(f"{running} already runs: end it, or start this one with another __name:=")
    limit_master_calls()
    limit_xmlrpc_connections()
    open_tcpros_server(lambda host, text: rospy.logwarn(text))
    init_ros_node(name, anonymous)
    end_without_delay()


def init_ros_node(name: str, anonymous: bool = False, arguments: Optional[List[str]] = None) -> None:
    """Call rospy.init_node(), which waits for a master without limit; arguments replace the command line's.

    Raises: NodeError without a directory for logs, or for wrong remappings.
    """
    try:
        rospy.init_node(name, argv=arguments, anonymous=anonymous, disable_signals=True)
    except (rosgraph.roslogging.LoggingException, NotADirectoryError, PermissionError) as error:
        raise NodeError(f"no log can be written ({one_line(error)}): set ROS_LOG_DIR to a directory") from None
    except TypeError:  # of the parameter server, which takes no nil: _x:= and _x:=~ hold none, nor does _x:=::
        text = "a private parameter (_name:=value) has no value for YAML: quote it twice, as in _host:='\"::\"'"
        raise NodeError(text) from None
    except (rospy.ROSInitException, OSError, ValueError) as error:
        raise NodeError(one_line(error)) from None


def end_without_delay() -> None:
    """End this node as soon as its topics are closed.

    rospy's registration thread, for which the interpreter waits, looks for the end every 0.5 s. It is woken as the
    shutdown begins, too early; here it is woken after.
    """
    managers = [listener for listener in get_registration_listeners().listeners if isinstance(listener, RegManager)]

    def wake(reason: str) -> None:
        for manager in managers:
            with manager.cond:
                manager.cond.notify_all()

    rospy.core.add_shutdown_hook(wake)


def end_ros_node(reason: str, timeout_s: float) -> None:
    """Tell ROS that this node ends; a master that does not answer holds it up for timeout_s at most."""
    ending = threading.Thread(target=rospy.signal_shutdown, args=(reason,), name="shutdown", daemon=True)
    ending.start()
    ending.join(timeout_s)
