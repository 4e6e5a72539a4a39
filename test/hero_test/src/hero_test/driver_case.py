"""What the rostests of the driver share: waiting for conditions, watching topics, and drivers with own parameters."""

import os
import re
import unittest
import xmlrpc.client
from typing import Dict, Tuple

import rosgraph
import rospy
from geometry_msgs.msg import Twist
from rosgraph_msgs.msg import Log as RosLog

from hero_msgs.msg import Robot, RobotArray
from hero_test.fake_robot import FakeRobot
from hero_test.processes import Program, find_program
from hero_test.waiting import wait_for

NODE = "/hero_driver"


def list_publishers(topic):
    """Return the nodes that publish a topic, by the master."""
    return dict(rosgraph.Master("/test").getSystemState()[0]).get(topic, [])


def list_connections(node):
    """Return what node itself says of its connections: (id, peer, "i" or "o", transport, topic, ...) each."""
    api = xmlrpc.client.ServerProxy(rosgraph.Master("/test").lookupNode(node))
    return api.getBusInfo("/test")[2]


def has_connection(node, topic, reader):
    """Return whether node itself says that it sends topic to a node whose name holds reader."""
    return any(entry[2] == "o" and entry[4] == topic and reader in entry[1] for entry in list_connections(node))


def receives_topic(node, topic):
    """Return whether node itself says that it receives topic."""
    return any(entry[2] == "i" and entry[4] == topic for entry in list_connections(node))


class Recorder:
    """All messages of one topic, in order of arrival."""

    def __init__(self, topic, message_class, connected=True):
        """With connected, return only when a publisher is connected."""
        self.topic = topic
        self.messages = []
        self.subscriber = rospy.Subscriber(
            topic, message_class, self.messages.append, queue_size=None, tcp_nodelay=True
        )
        if connected:
            self.wait_connected()

    def wait_connected(self):
        """Wait until a publisher sends to this recorder, and knows it: the two sides learn it one by one."""
        wait_for(
            lambda: any(has_connection(node, self.topic, rospy.get_name()) for node in list_publishers(self.topic)),
            "a publisher of " + self.topic,
        )

    def wait_count(self, count):
        """Wait for so many messages; return them."""
        wait_for(
            lambda: len(self.messages) >= count,
            lambda: "%d messages on %s, got %d" % (count, self.topic, len(self.messages)),
        )
        return self.messages

    def wait_message(self, condition, what):
        """Return the first message that condition() likes."""
        return wait_for(lambda: next(filter(condition, list(self.messages)), None), what)


def wait_payloads(robot, name, count=1):
    """Return the first payloads that a robot received on a topic or service, once it has so many."""
    wait_for(
        lambda: len(robot.payloads_on(name)) >= count,
        lambda: "%d payloads on %s at %s, got %d" % (count, name, robot.name, len(robot.payloads_on(name))),
    )
    return robot.payloads_on(name)[:count]


def wait_packets(robot, topic_id, count=1):
    """Return the first payloads that a robot received under an id, once it has so many."""
    wait_for(
        lambda: len(robot.payloads_with_id(topic_id)) >= count,
        lambda: "%d packets %d at %s" % (count, topic_id, robot.name),
    )
    return robot.payloads_with_id(topic_id)[:count]


def make_command(linear_m_s, angular_rad_s=0.0):
    """Return a Twist."""
    twist = Twist()
    twist.linear.x = linear_m_s
    twist.angular.z = angular_rad_s
    return twist


def make_publisher(topic, message_class, connected=True):
    """Return a publisher that is connected to the driver."""
    publisher = rospy.Publisher(topic, message_class, queue_size=200, tcp_nodelay=True)
    if connected:
        wait_for(lambda: publisher.get_num_connections() > 0, "a subscriber of " + topic)
    return publisher


def list_driver_topics(namespace, node=NODE):
    """Return the topics and services below namespace that the driver offers, by the master."""
    state = rosgraph.Master("/test").getSystemState()
    return sorted(name for part in state for name, nodes in part if name.startswith(namespace + "/") and node in nodes)


class Fleet:
    """The driver's report about its robots, as the newest message on ~robots."""

    def __init__(self, node=NODE):
        self.newest = None
        self._subscriber = rospy.Subscriber(node + "/robots", RobotArray, self._receive, tcp_nodelay=True)

    def _receive(self, message):
        self.newest = message

    def close(self):
        """End the subscription."""
        self._subscriber.unregister()

    @property
    def address(self):
        """Where robots dial, as (host, port)."""
        wait_for(lambda: self.newest is not None, "the driver's first report")
        port = int(self.newest.listening.rsplit(":", 1)[1])
        return ("127.0.0.1", port)

    def find(self, namespace, state=None):
        """Return the entry of a robot (in a state), None if there is none."""
        for robot in self.newest.robots if self.newest else ():
            if robot.namespace == namespace and (state is None or robot.state == state):
                return robot
        return None

    def wait(self, namespace, state, what="", condition=lambda robot: True):
        """Return the entry of a robot once it is in a state and condition() likes it."""

        def look():
            robot = self.find(namespace, state)
            return robot if robot is not None and condition(robot) else None

        return wait_for(look, lambda: "%s in state %d %s, last: %s" % (namespace, state, what, self.newest))

    def wait_ready(self, namespace):
        """Wait until a robot has joined."""
        return self.wait(namespace, Robot.READY)

    def wait_gone(self, namespace):
        """Wait until a robot is forgotten."""
        wait_for(lambda: self.find(namespace) is None, namespace + " to be forgotten")


class DriverCase(unittest.TestCase):
    """Tests of the driver that the .test file starts."""

    node = NODE
    fleet: "Fleet"
    rosout: "Recorder"
    address: Tuple[str, int]

    @classmethod
    def setUpClass(cls):
        cls.fleet = Fleet(cls.node)
        cls.rosout = Recorder("/rosout", RosLog, connected=False)
        wait_for(
            lambda: cls.node in dict(rosgraph.Master("/test").getSystemState()[0]).get("/rosout", []),
            "the driver",
        )
        cls.address = cls.fleet.address

    @classmethod
    def tearDownClass(cls):
        cls.fleet.close()

    def join(self, number, ready=True, **settings):
        """Return a robot that has dialled in, and joined with ready; it leaves after the test."""
        robot = FakeRobot(number, **settings)
        self.addCleanup(robot.close)
        robot.connect(self.address)
        if ready:
            self.fleet.wait_ready(robot.namespace)
        if ready and "declarations" not in settings:
            # A publisher that appears while rospy subscribes gets two connections, and loses what the first one holds.
            last = robot.namespace + "/velocity_controller/pid_calibration"
            wait_for(lambda: last in list_driver_topics(robot.namespace, self.node), last)
        return robot

    def find_logs(self, pattern):
        """Return the driver's log lines that match a pattern."""
        return [line for line in list(self.rosout.messages) if line.name == self.node and re.search(pattern, line.msg)]

    def wait_log(self, pattern):
        """Return the first line of the driver's log that matches a pattern."""
        return wait_for(
            lambda: self.find_logs(pattern),
            lambda: "%r among %s" % (pattern, [line.msg for line in self.rosout.messages]),
        )[0]


class DriverProcess(Program):
    """A driver with parameters of its own, for tests that end it or start it wrong; use it with `with`."""

    _count = 0

    def __init__(self, parameters=None, arguments=(), name="", prefix=(), environment=None):
        """Start it; parameters: name -> value, any free port unless they say otherwise.

        prefix: a command that starts it, such as prlimit; environment: variables that it has besides ours.
        """
        DriverProcess._count += 1
        self.node = "/" + (name or "driver_%d_%d" % (os.getpid(), DriverProcess._count))
        for key, value in {"port": 0, **(parameters or {})}.items():
            rospy.set_param("%s/%s" % (self.node, key), value)
        executable = find_program("hero_driver", "hero_driver")
        command = [*prefix, executable, "__name:=" + self.node[1:], *arguments]
        super().__init__(*command, environment=environment)
        self.fleet = Fleet(self.node)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.fleet.close()
        self.end()

    @property
    def address(self):
        """Where robots dial, as (host, port)."""
        wait_for(
            lambda: self.fleet.newest is not None or self.process.poll() is not None,
            "the driver's first report",
        )
        if self.fleet.newest is None:
            raise AssertionError("the driver ended: %s" % self.lines)
        return self.fleet.address


class OwnDriverCase(unittest.TestCase):
    """Tests that start drivers with parameters of their own."""

    _shared: Dict[str, "DriverProcess"]

    @classmethod
    def setUpClass(cls):
        cls._shared = {}

    @classmethod
    def tearDownClass(cls):
        for driver in cls._shared.values():
            driver.__exit__()

    def share(self, **parameters):
        """Return the driver of all tests of the class with these parameters; each test has robots of its own."""
        key = repr(sorted(parameters.items()))
        if key not in self._shared:
            self._shared[key] = DriverProcess(parameters)
        return self._shared[key]

    def start(self, **parameters):
        """Return a driver, which ends after the test."""
        driver = DriverProcess(parameters)
        self.addCleanup(driver.__exit__)
        return driver

    def dial(self, driver, number=0, ready=True, **settings):
        """Return a robot that has dialled driver, and joined with ready; it leaves after the test."""
        robot = FakeRobot(number, **settings)
        self.addCleanup(robot.close)
        robot.connect(driver.address)
        if ready:
            driver.fleet.wait_ready(robot.namespace)
        return robot
