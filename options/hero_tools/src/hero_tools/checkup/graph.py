"""The ROS master, the connections to it and back, and the robots.

The return path is tried: the node rosout runs beside the master and must connect to a node here that has /rosout.
"""

import contextlib
import os
import time
import urllib.parse
from typing import List, Optional, Sequence, Tuple

import rosgraph
import rosgraph.roslogging
import rospy
from rosgraph_msgs.msg import Log

from hero_client.ros import Drivers, find_lost_commands
from hero_client.values import STATES, describe_counts, describe_gone, describe_stop_origin
from hero_msgs.msg import Robot, RobotArray
from hero_node import NodeError, find_source_address, is_loopback
from hero_node.ros import ask_master, read_master_uri

from ..inventory import VERSIONS, list_differences
from .network import HOST_REMEDY, Address, is_own, resolve
from .points import LINES_MAX, REPORT_TIMEOUT_S, Finding, fail, ok, wait_until, warn

CONNECT_TIMEOUT_S = 3.0
CLEAN_UP = "did it end without a word? rosnode cleanup"


def read_master_host() -> str:
    """Return the host of ROS_MASTER_URI; empty if that is no address of a master."""
    with contextlib.suppress(NodeError):
        return urllib.parse.urlsplit(read_master_uri()).hostname or ""
    return ""


def fail_master_uri() -> Finding:
    """Return the finding of a ROS_MASTER_URI that is no address of a master."""
    text = f"ROS_MASTER_URI is {rosgraph.get_master_uri()!a}, but must be like http://ADDRESS:11311"
    return fail(text, "export ROS_MASTER_URI=http://localhost:11311")


def check_variables(own: Optional[Sequence[Address]]) -> Finding:
    """Check the variables by which nodes find each other."""
    if not read_master_host():
        return fail_master_uri()
    ip, hostname = os.environ.get("ROS_IP", ""), os.environ.get("ROS_HOSTNAME", "")
    addresses = [found.address for found in own or []]
    if ip and own is not None and ip not in addresses and not ip.startswith("127."):
        remedy = f"export ROS_IP={addresses[0] if addresses else '127.0.0.1'}"
        return fail(f"ROS_IP is {ip!a}, which is not an address of this PC", remedy)
    text = f"master {rosgraph.get_master_uri()}, ROS_IP {ip or '-'}, ROS_HOSTNAME {hostname or '-'}"
    if ip and not hostname and "ROS_HOSTNAME" in os.environ:
        return warn(text + ": ROS_HOSTNAME is set but empty, which hides ROS_IP", "unset ROS_HOSTNAME")
    if ip and hostname:
        return warn(text + ": ROS_HOSTNAME takes precedence over ROS_IP", "unset ROS_HOSTNAME")
    return ok(text)


def check_own_name(own: Sequence[Address]) -> Finding:
    """Check whether other PCs find the nodes of this PC by the name that they register."""
    name = rosgraph.network.get_host_name()
    found = resolve(name)
    master = resolve(read_master_host() or "localhost")
    is_remote = bool(master) and not any(is_own(address, own) for address in master)
    address = find_source_address(next(iter(master))) if is_remote else ""
    export = "export ROS_IP=%s" % (address or (own[0].address if own else "127.0.0.1"))
    remedy = [export] if is_remote else ["one PC: export ROS_HOSTNAME=localhost", "several PCs: " + export]
    source = "ROS_IP or ROS_HOSTNAME" if rosgraph.network.get_address_override() else "the host name"
    text = f"nodes here register as {ascii(name)[1:-1]} ({source})"
    if not found:
        return fail(text + ", which cannot be resolved: topics are listed but nothing arrives", *remedy)
    if not any(is_own(entry, own) for entry in found):
        return fail(f"{text}, which leads to {', '.join(sorted(found))}: not this PC", *remedy)
    if is_remote and all(entry.startswith("127.") for entry in found):
        return fail(f"{text}: the master's PC would connect to itself ({', '.join(sorted(found))})", *remedy)
    return ok(text)


def check_master(own: Sequence[Address]) -> Finding:
    """Check whether the master answers at ROS_MASTER_URI."""
    host = read_master_host()
    if not host:
        return fail_master_uri()
    uri = rosgraph.get_master_uri()
    addresses = resolve(host)
    if not addresses:
        return fail(
            f"{uri}: the name {host} cannot be resolved",
            "export ROS_MASTER_URI=http://ADDRESS_OF_THE_MASTER_PC:11311",
            f"or a line 'ADDRESS {host}' in /etc/hosts",
        )
    try:
        ask_master("getPid")
    except NodeError as error:
        start = "roslaunch hero_bringup hero_bringup.launch starts one"
        away = f"is that PC on, is a master running there, is its port open? ping {host}"
        return fail(str(error), start if any(is_own(address, own) for address in addresses) else away)
    return ok("answers at " + uri)


def check_commands() -> Finding:
    """Check whether a program sends commands that no robot hears."""
    lost = find_lost_commands()
    return warn("commands are lost", *lost[:LINES_MAX]) if lost else ok("no commands are lost")


class OwnNode:
    """This program as a node: a publisher on /rosout, and the drivers; both from start() on."""

    _publisher: rospy.Publisher
    _drivers: Drivers

    def start(self) -> Finding:
        """Start the node, and listen to the drivers; the other points need it."""
        try:
            rospy.init_node("hero_check", anonymous=True, disable_signals=True, disable_rosout=True)
        except rosgraph.roslogging.LoggingException as error:
            return fail(str(error), "export ROS_LOG_DIR=/a/directory/of/yours")
        self._publisher = rospy.Publisher("/rosout", Log, queue_size=1)
        self._drivers = Drivers()
        return ok("started as " + rospy.get_name())

    def check_return_path(self) -> Finding:
        """Check whether rosout, which runs beside the master, connects to this node."""
        if wait_until(lambda: self._publisher.get_num_connections() > 0, CONNECT_TIMEOUT_S):
            return ok("nodes beside the master can connect to nodes here")
        subscribers = dict(ask_master("getSystemState")[1]).get("/rosout", [])
        if not subscribers:
            return warn("not tried: no node rosout runs beside the master", "start the master by roscore or roslaunch")
        return fail(
            f"{subscribers[0]} lists this node but did not connect to it within {CONNECT_TIMEOUT_S:.1f} s",
            "export ROS_IP=THE_ADDRESS_OF_THIS_PC (point own_name)",
            "a firewall here may drop connections from that PC",
        )

    def check_robots(self) -> Finding:
        """Print which robots the drivers report."""
        wait_until(lambda: self._drivers.is_settled, REPORT_TIMEOUT_S)
        silent = self._drivers.find_silent()
        if silent:
            text = f"no report comes from {', '.join(silent)}, which the ROS master lists"
            return fail(text, CLEAN_UP, "points own_name and return_path say more")
        reports = self._drivers.read_each()
        if not reports:
            return warn("no driver runs", "roslaunch hero_bringup hero_bringup.launch")
        described = [describe_report(driver, report) for driver, report in sorted(reports.items())]
        text = "; ".join(text for text, _ in described)
        remedies = [line for _, lines in described for line in lines]
        return warn(text, *remedies[:LINES_MAX]) if remedies else ok(text)


def describe_report(driver: str, report: RobotArray) -> Tuple[str, List[str]]:
    """Return one line on a driver's robots, and a line for each that cannot be driven."""
    ready = [robot for robot in report.robots if robot.state == Robot.READY]
    text = f"{driver}: {describe_counts(report)}"
    text += ", the driver listens on %s" % (report.listening or "no port")
    versions = sorted({robot.firmware for robot in ready if robot.firmware})
    if versions:
        text += ", firmware " + ", ".join(versions)
    lines = list_differences([{"id": robot.id, **{name: getattr(robot, name) for name in VERSIONS}} for robot in ready])
    if report.stopped:
        origin = describe_stop_origin(report, time.time())
        lines.append(
            f"all robots are stopped {origin}".strip() + f"; to release them: rosservice call {driver}/stop false"
        )
    if report.gone:
        dismiss = f"rosservice call {driver}/dismiss_gone"
        lines.append(f"{describe_gone(report, time.time())}: switch them on, or list them no longer: {dismiss}")
    for robot in report.robots:
        if robot.state != Robot.READY:
            error = ": " + robot.last_error if robot.last_error else ""
            name, state = robot.namespace or "a robot", STATES.get(robot.state, "?")
            lines.append(f"{name} at {robot.address} is {state}{error}")
    if not report.robots:
        is_local = is_loopback(report.listening.rpartition(":")[0])
        general = "robots must be on and connect to this PC: point addresses, firewall (docs/network.md)"
        lines = [HOST_REMEDY if is_local else general]
    return text, lines
