"""The ROS master, the way to it and back, and the robots -> findings.

"And back" is tried, not guessed: the node rosout runs beside the master and subscribes to /rosout, so it must be able
to connect to a node here. That it has done so is what the point `way_back` waits for.
"""

import http.client
import os
import threading
import time
import urllib.parse
import xmlrpc.client
from typing import Any, Dict, List, Optional, Sequence, Set, Tuple

import rosgraph
import rosgraph.roslogging
import rospy
from rosgraph_msgs.msg import Log

from hero_msgs.msg import Robot, RobotArray

from .finding import FAIL, OK, WARN, Finding
from .network import HOST_REMEDY, Address, find_source_address, is_loopback, is_own, resolve

CALL_TIMEOUT_S = 0.6
BACK_TIMEOUT_S = 0.8
ROBOTS_TIMEOUT_S = 0.8
NODES_ASKED = 30
CALLER = "/hero_check"
STATES = {Robot.JOINING: "joining", Robot.READY: "ready", Robot.AWAY: "away", Robot.REFUSED: "refused"}

NO_LOGS = Finding("", WARN, "not looked at: without a folder for logs no node starts (point disk)")


class BoundedTransport(xmlrpc.client.Transport):
    """Calls that end after CALL_TIMEOUT_S."""

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """Connect with a time limit."""
        return http.client.HTTPConnection(host, timeout=CALL_TIMEOUT_S)


def call(uri: str, method: str, *arguments: Any) -> Any:
    """Call the master's or a node's API and return its value.

    Raises: OSError, http.client.HTTPException, xmlrpc.client.Error.
    """
    proxy = xmlrpc.client.ServerProxy(uri, transport=BoundedTransport())
    code, message, value = getattr(proxy, method)(CALLER, *arguments)
    if code != 1:
        raise OSError(message)
    return value


CALL_ERRORS = (OSError, http.client.HTTPException, xmlrpc.client.Error, ValueError, TypeError)


def read_master_uri() -> Tuple[str, int]:
    """Return host and port of ROS_MASTER_URI.

    Raises: ValueError with what is wrong.
    """
    uri = rosgraph.get_master_uri()
    try:
        parts = urllib.parse.urlsplit(uri)
        if parts.scheme == "http" and parts.hostname and parts.port:
            return parts.hostname, parts.port
    except ValueError:
        pass  # a port beyond 65535, half an IPv6 address
    raise ValueError("ROS_MASTER_URI is %s, but must be like http://ADDRESS:11311" % ascii(uri))


def check_variables(own: Optional[Sequence[Address]]) -> List[Finding]:
    """Look at the variables by which nodes find each other."""
    point = "ros_environment"
    try:
        read_master_uri()
    except ValueError as error:
        return [Finding(point, FAIL, str(error), ["export ROS_MASTER_URI=http://localhost:11311"])]
    ip, hostname = os.environ.get("ROS_IP", ""), os.environ.get("ROS_HOSTNAME", "")
    addresses = [found.address for found in own or []]
    if ip and own is not None and ip not in addresses and not ip.startswith("127."):
        says = "ROS_IP is %s, which is not an address of this PC" % ascii(ip)
        return [
            Finding(point, FAIL, says, ["export ROS_IP=%s" % (addresses[0] if addresses else "127.0.0.1")])
        ]
    says = "master %s, ROS_IP %s, ROS_HOSTNAME %s" % (rosgraph.get_master_uri(), ip or "-", hostname or "-")
    if ip and not hostname and "ROS_HOSTNAME" in os.environ:
        return [
            Finding(
                point,
                WARN,
                says + ": ROS_HOSTNAME is set but empty, which hides ROS_IP",
                ["unset ROS_HOSTNAME"],
            )
        ]
    if ip and hostname:
        return [Finding(point, WARN, says + ": ROS_HOSTNAME wins over ROS_IP", ["unset ROS_HOSTNAME"])]
    return [Finding(point, OK, says)]


def check_own_name(own: Sequence[Address]) -> List[Finding]:
    """Look whether others find the nodes of this PC by the name that they give."""
    point = "own_name"
    name = rosgraph.network.get_host_name()
    found = resolve(name)
    source = "as ROS_IP or ROS_HOSTNAME says" if rosgraph.network.get_address_override() else "the host name"
    try:
        master_host, _ = read_master_uri()
    except ValueError:
        master_host = "localhost"
    master = resolve(master_host)
    remote = bool(master) and not any(is_own(address, own) for address in master)
    address = (find_source_address(next(iter(master))) if remote else None) or (
        own[0].address if own else "127.0.0.1"
    )
    remedy = ["export ROS_IP=%s" % address]
    if not remote:
        remedy = ["one PC: export ROS_HOSTNAME=localhost", "several PCs: export ROS_IP=%s" % address]
    says = "nodes here call themselves %s (%s)" % (ascii(name)[1:-1], source)
    if not found:
        return [
            Finding(
                point,
                FAIL,
                says + ", which cannot be resolved: topics are listed but nothing arrives",
                remedy,
            )
        ]
    if not any(is_own(entry, own) for entry in found):
        return [
            Finding(
                point, FAIL, "%s, which leads to %s: not this PC" % (says, ", ".join(sorted(found))), remedy
            )
        ]
    if remote and all(entry.startswith("127.") for entry in found):
        says += ", which means %s: the PC of the master would dial itself" % ", ".join(sorted(found))
        return [Finding(point, FAIL, says, remedy)]
    return [Finding(point, OK, says)]


def check_master(own: Sequence[Address]) -> List[Finding]:
    """Look whether the master answers at ROS_MASTER_URI."""
    point = "master"
    try:
        host, _ = read_master_uri()
    except ValueError as error:
        return [Finding(point, FAIL, str(error), ["export ROS_MASTER_URI=http://localhost:11311"])]
    uri = rosgraph.get_master_uri()
    addresses = resolve(host)
    if not addresses:
        remedy = [
            "export ROS_MASTER_URI=http://ADDRESS_OF_THE_MASTER_PC:11311",
            "or a line 'ADDRESS %s' in /etc/hosts" % host,
        ]
        return [Finding(point, FAIL, "%s: the name %s cannot be resolved" % (uri, host), remedy)]
    try:
        call(uri, "getUri")
    except CALL_ERRORS as error:
        if any(is_own(address, own) for address in addresses):
            return [
                Finding(
                    point,
                    WARN,
                    "no ROS master runs at %s" % uri,
                    ["roslaunch hero_bringup hero_bringup.launch starts one"],
                )
            ]
        remedy = ["is that PC on, is a master running there, is its port open? ping %s" % host]
        return [
            Finding(
                point, FAIL, "no ROS master answers at %s: %s" % (uri, " ".join(str(error).split())), remedy
            )
        ]
    return [Finding(point, OK, "answers at %s" % uri)]


def check_nodes() -> List[Finding]:
    """Look whether the nodes that the master lists can be reached by the names they gave."""
    point = "nodes"
    uri = rosgraph.get_master_uri()
    publishers, subscribers, services = call(uri, "getSystemState")
    names: Set[str] = {
        name for group in (publishers, subscribers, services) for _, users in group for name in users
    }
    nodes: Dict[str, str] = {}
    for name in sorted(names)[:NODES_ASKED]:
        try:
            nodes[name] = call(uri, "lookupNode", name)
        except OSError:  # it ended in between
            continue
    unknown, silent = [], []
    for name, node_uri in nodes.items():
        host = urllib.parse.urlsplit(node_uri).hostname or ""
        if not resolve(host):
            unknown.append("%s at %s" % (name, host))
            continue
        try:
            call(node_uri, "getPid")
        except CALL_ERRORS:
            silent.append("%s at %s" % (name, node_uri))
    if unknown:
        remedy = ["on the PC of that node: export ROS_IP=ITS_ADDRESS, and start the node again"]
        return [Finding(point, FAIL, "names that cannot be resolved here: " + ", ".join(unknown[:5]), remedy)]
    if silent:
        return [
            Finding(
                point,
                WARN,
                "listed but not reached: " + ", ".join(silent[:5]),
                ["ended without a word? rosnode cleanup", "on another PC: its ROS_IP, its firewall"],
            )
        ]
    return [Finding(point, OK, "%d of %d nodes asked, all answer" % (len(nodes), len(names)))]


def check_way_back(publisher: rospy.Publisher) -> List[Finding]:
    """Look whether rosout, which runs beside the master, has connected to this node."""
    point = "way_back"
    end_s = time.monotonic() + BACK_TIMEOUT_S
    while time.monotonic() < end_s:
        if publisher.get_num_connections():
            return [Finding(point, OK, "nodes beside the master can connect to nodes here")]
        time.sleep(0.02)
    subscribers = dict(call(rosgraph.get_master_uri(), "getSystemState")[1]).get("/rosout", [])
    if not subscribers:
        return [
            Finding(
                point,
                WARN,
                "not tried: no node rosout runs beside the master",
                ["start the master with roscore or roslaunch"],
            )
        ]
    says = "%s lists this node but did not connect to it within %.1f s" % (subscribers[0], BACK_TIMEOUT_S)
    return [
        Finding(
            point,
            FAIL,
            says,
            [
                "export ROS_IP=THE_ADDRESS_OF_THIS_PC (point own_name)",
                "a firewall here may drop connections from that PC",
            ],
        )
    ]


class FleetSnapshot:
    """The newest list of robots of each driver."""

    def __init__(self) -> None:
        self.drivers: Dict[str, RobotArray] = {}
        uri = rosgraph.get_master_uri()
        types = dict(call(uri, "getTopicTypes"))
        # The master keeps the types of topics whose publishers have ended.
        published = [topic for topic, _ in call(uri, "getSystemState")[0]]
        self._topics = [topic for topic in published if types.get(topic) == RobotArray._type]
        self._subscribers = [
            rospy.Subscriber(topic, RobotArray, self._receive, callback_args=topic, queue_size=1)
            for topic in self._topics
        ]

    def _receive(self, message: RobotArray, topic: str) -> None:
        self.drivers[topic] = message

    def wait(self) -> None:
        """Wait until every driver was heard, or for ROBOTS_TIMEOUT_S."""
        end_s = time.monotonic() + ROBOTS_TIMEOUT_S
        while len(self.drivers) < len(self._topics) and time.monotonic() < end_s:
            time.sleep(0.02)

    @property
    def silent(self) -> List[str]:
        """Topics of drivers that are registered but say nothing."""
        return [topic for topic in self._topics if topic not in self.drivers]


def check_robots(fleet: FleetSnapshot) -> List[Finding]:
    """Say which robots the drivers report."""
    point = "robots"
    fleet.wait()
    if fleet.silent:
        return [
            Finding(
                point,
                FAIL,
                "nothing comes on %s although it is listed" % ", ".join(fleet.silent),
                ["has the driver ended? rosnode cleanup", "points own_name and way_back say more"],
            )
        ]
    if not fleet.drivers:
        return [Finding(point, WARN, "no driver runs", ["roslaunch hero_bringup hero_bringup.launch"])]
    findings = []
    for topic, message in sorted(fleet.drivers.items()):
        robots = message.robots
        ready = [robot for robot in robots if robot.state == Robot.READY]
        says = "%s: %d of %d robots ready, awaited on %s" % (
            topic,
            len(ready),
            len(robots),
            message.listening or "no port",
        )
        versions = sorted({robot.firmware for robot in ready if robot.firmware})
        if versions:
            says += ", firmware " + ", ".join(versions)
        troubled = [
            "%s at %s is %s%s"
            % (
                robot.namespace or "a robot",
                robot.address,
                STATES.get(robot.state, "?"),
                ": " + robot.last_error if robot.last_error else "",
            )
            for robot in robots
            if robot.state != Robot.READY
        ]
        if message.stopped:
            troubled.insert(
                0, "all robots are stopped; release them: rosservice call %s false" % topic.replace("/robots", "/stop")
            )
        if not robots:
            troubled = [
                HOST_REMEDY
                if is_loopback(message.listening.rpartition(":")[0])
                else "robots must be on, in this network, and dial this PC (point addresses): docs/troubleshooting.md"
            ]
        findings.append(Finding(point, WARN if troubled else OK, says, troubled[:10]))
    return findings


class OwnNode:
    """This program as a node of the graph, from the first use on."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._entered: Optional[Tuple[rospy.Publisher, FleetSnapshot]] = None

    def enter(self) -> Tuple[rospy.Publisher, FleetSnapshot]:
        """Return the publisher on /rosout and the robots; the first call starts the node."""
        with self._lock:
            if self._entered is None:
                rospy.init_node("hero_check", anonymous=True, disable_signals=True, disable_rosout=True)
                self._entered = rospy.Publisher("/rosout", Log, queue_size=1), FleetSnapshot()
            return self._entered

    def check_way_back(self) -> List[Finding]:
        """See check_way_back."""
        try:
            return check_way_back(self.enter()[0])
        except rosgraph.roslogging.LoggingException:
            return [NO_LOGS._replace(point="way_back")]

    def check_robots(self) -> List[Finding]:
        """See check_robots."""
        try:
            return check_robots(self.enter()[1])
        except rosgraph.roslogging.LoggingException:
            return [NO_LOGS._replace(point="robots")]
