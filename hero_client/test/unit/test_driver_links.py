"""Connections to all drivers, with a ROS of the test's own: who is known, silent, stopped, asked, and forgotten."""

import math
from types import SimpleNamespace

import pytest

pytest.importorskip("rospy", reason="drivers are ROS nodes")
from hero_client.ros import drivers
from hero_client.ros.drivers import FIND_PERIOD_S, FORGET_S, REPEAT_PERIOD_S, SETTLE_LOOKS, SILENT_S, Drivers
from hero_client.ros.stop_status import CROSSING_S, TIME_LIMIT_S
from hero_msgs.msg import Robot, RobotArray
from hero_node import NodeError, ProgramError
from hero_node.texts import NAMES_SHOWN

A, B = "/hero_driver", "/lab/driver"


class Ros:
    """What drivers.py uses of ROS: topics by name, the master, and a clock that a test moves."""

    def __init__(self, monkeypatch):
        self.now_s, self.requests, self.subscribers, self.unregistered = 100.0, [], {}, []
        self.options = []
        self.connected, self.reporting = {A, B}, {A, B}
        self.known, self.is_master_there = [A], True
        for module, name, value in (
            (drivers.rospy, "Publisher", self._make_publisher),
            (drivers.rospy, "Subscriber", self._make_subscriber),
            (drivers.rospy, "on_shutdown", lambda call: None),
            (drivers.rospy, "resolve_name", lambda name: name),
            (drivers.time, "monotonic", lambda: self.now_s),
            (drivers.time, "sleep", self.sleep),
            (drivers.threading, "Thread", lambda **options: SimpleNamespace(start=lambda: None)),
            (drivers, "ask_master", self._ask_master),
        ):
            monkeypatch.setattr(module, name, value)
        self.drivers = Drivers()
        self.drivers._links = {A + "/robots": drivers._DriverLink(A, A + "/robots")}

    def sleep(self, duration_s):
        self.now_s += duration_s

    def _make_publisher(self, topic, *arguments, **options):
        self.options.append(options)
        name = topic.rpartition("/")[0]
        return SimpleNamespace(
            publish=lambda stopped: self.requests.append((name, stopped)),
            get_num_connections=lambda: int(name in self.connected),
            unregister=lambda: self.unregistered.append(topic),
        )

    def _make_subscriber(self, topic, kind, receive, **options):
        self.options.append(options)
        name = topic.rpartition("/")[0]
        self.subscribers[name] = receive
        return SimpleNamespace(
            get_num_connections=lambda: int(name in self.reporting), unregister=lambda: self.unregistered.append(topic)
        )

    def _ask_master(self, call, *arguments):
        if not self.is_master_there:
            raise NodeError("no ROS master")
        if call == "getPublishedTopics":
            others = [["/lab/driver/robots", "std_msgs/String"], ["/lab/driver/robot_list", RobotArray._type]]
            others.append(["/hero_0/robots", RobotArray._type])  # declared by a robot
            return [[name + "/robots", RobotArray._type] for name in self.known] + others
        return [
            [[name + "/robots", [name]] for name in self.known],
            [],
            [[name + "/stop", [name]] for name in self.known],
        ]

    def look(self):
        """Let the finder ask the master once."""
        self.drivers._look()
        self.drivers._looks += 1

    def ask(self):
        """Let the sender ask once; return the time until it asks again."""
        waits = []
        self.drivers._end = SimpleNamespace(is_set=lambda: bool(waits), set=lambda: None)
        self.drivers._wake = SimpleNamespace(wait=waits.append, clear=lambda: None, set=lambda: None)
        self.drivers._ask()
        return waits[0]

    def report(self, name, *robots, stopped=False, sender=None, model=""):
        """Let a driver report robots: (number, state), perhaps with a stop_state or an error."""
        message = RobotArray(stopped=stopped)
        for number, state, *more in robots:
            stop_state = more[0] if more else Robot.AT_REST
            message.robots.append(Robot(namespace="/hero_%d" % number, state=state, stop_state=stop_state, model=model))
        message._connection_header = {"callerid": sender or name}
        self.subscribers[name](message)


@pytest.fixture(name="ros")
def make_ros(monkeypatch):
    return Ros(monkeypatch)


def test_only_the_driver_itself_is_believed(ros):
    assert ros.drivers.read() is None and ros.drivers.count() == 0
    ros.report(A, (0, Robot.READY), sender="/hero_0")
    assert ros.drivers.read() is None and ros.drivers.count() == 0
    ros.report(A, (0, Robot.READY))
    assert [robot.namespace for robot in ros.drivers.read().robots] == ["/hero_0"] and ros.drivers.count() == 1


def test_only_the_newest_report_and_request_wait_and_are_sent_at_once(ros):
    assert ros.options == [{"queue_size": 1, "tcp_nodelay": True}] * 2


def test_drivers_are_found_and_forgotten_when_they_have_gone(ros):
    ros.known = [A, B]
    ros.look()
    assert ros.drivers.names() == [A, B]
    ros.report(B, (1, Robot.READY))
    reporting, ros.reporting, ros.is_master_there = ros.reporting, set(), False
    ros.look()
    assert B in ros.drivers.names(), "of a master that is away is known what it said"
    ros.known, ros.reporting, ros.is_master_there = [], reporting, True
    ros.look()
    assert ros.drivers.names() == [B], "no longer listed, but connected"
    ros.reporting = set()
    ros.is_master_there = False
    ros.look()
    assert set(ros.drivers._links) == {A + "/robots", B + "/robots"}, "the master may come back"
    ros.is_master_there = True
    ros.look()
    assert set(ros.drivers._links) == {A + "/robots"}, "the usual one may be started again"
    assert ros.unregistered == [B + "/stop_request", B + "/robots"] and ros.drivers.names() == [A]


def test_robots_that_are_gone_are_dismissed_by_each_driver_that_answers(ros, monkeypatch):
    ros.known, asked = [A, B], []
    ros.look()

    def call(name):
        asked.append(name)
        if name.startswith(A):
            raise drivers.rospy.ServiceException("it has just ended")

    monkeypatch.setattr(drivers.rospy, "ServiceProxy", lambda name, kind: lambda: call(name))
    ros.drivers.dismiss_gone()
    assert asked == [A + "/dismiss_gone", B + "/dismiss_gone"]


def test_all_drivers_are_settled_when_each_has_reported_or_had_the_time(ros):
    ros.known = [A, B]
    assert not ros.drivers.is_settled
    ros.report(A, (0, Robot.READY))
    assert not ros.drivers.is_settled, "the master has not told who there is"
    assert ros.drivers.knows("/hero_0") and not ros.drivers.knows("/hero_1")
    ros.look()
    assert not ros.drivers.is_settled
    ros.report(B, (1, Robot.READY))
    assert ros.drivers.is_settled and ros.drivers.knows("/hero_7")
    ros.drivers._links[B + "/robots"].report = None
    for looks in range(1, SETTLE_LOOKS + 1):
        ros.drivers._looks = looks
        assert ros.drivers.is_settled == ros.drivers.knows("/hero_7") == (looks == SETTLE_LOOKS)


def test_a_driver_that_is_silent_longer_than_others_is_dropped(ros):
    ros.known = [A, B]
    ros.look()
    ros.report(A, (0, Robot.READY), stopped=True)
    for silent_s, is_there in ((FORGET_S - 0.1, True), (0.2, False)):
        ros.now_s += silent_s
        ros.report(B, (1, Robot.READY), stopped=True)
        assert [robot.namespace for robot in ros.drivers.read().robots] == ["/hero_0", "/hero_1"][1 - is_there :]
        assert ros.drivers.is_robot_stopped("/hero_0") == ros.drivers.is_stopped(A) == is_there
        assert ros.drivers.is_robot_stopped("/hero_1") and ros.drivers.is_stopped(B)
        assert not ros.drivers.read().stopped, "one is silent"
    ros.report(A, (0, Robot.READY), stopped=True)
    assert ros.drivers.read().stopped
    ros.now_s += 100.0
    assert len(ros.drivers.read().robots) == 2, "all are silent: perhaps this program was"


def test_silence_begins_after_two_and_a_half_seconds_of_each_driver(ros):
    ros.known = [A, B]
    ros.look()
    ros.now_s += SILENT_S - 0.1
    assert ros.drivers.find_silent() == [], "they had no time to report yet"
    ros.now_s += 0.2
    assert ros.drivers.find_silent() == [A, B]
    ros.report(A)
    ros.now_s += SILENT_S - 0.1
    assert ros.drivers.find_silent() == [B] and ros.drivers.find_answering(SILENT_S) == {A: True}
    ros.now_s += 0.2
    assert ros.drivers.find_silent() == [A, B] and ros.drivers.find_answering(SILENT_S) == {A: False}
    ros.report(A)
    ros.reporting = set()
    assert ros.drivers.find_answering(SILENT_S) == {A: False}


def test_a_robot_is_stopped_with_its_driver_while_it_is_connected(ros):
    robots = [(0, Robot.READY), (1, Robot.JOINING), (2, Robot.AWAY), (3, Robot.REFUSED)]
    ros.report(A, *robots)
    assert not any(ros.drivers.is_robot_stopped("/hero_%d" % number) for number in range(4))
    ros.report(A, *robots, stopped=True)
    assert [ros.drivers.is_robot_stopped("/hero_%d" % number) for number in range(5)] == [
        True,
        True,
        False,
        False,
        False,
    ]


def test_the_model_of_a_robot_is_what_the_driver_that_knows_it_reports(ros):
    ros.known = [A, B]
    ros.look()
    ros.report(A, (0, Robot.READY))
    assert ros.drivers.find_model("/hero_0") == ros.drivers.find_model("/hero_1") == ""
    ros.report(B, (0, Robot.READY), model="hero_plus")
    assert ros.drivers.find_model("/hero_0") == "hero_plus"


def test_the_driver_of_a_robot_is_that_where_it_is_now(ros):
    ros.known = [A, B]
    ros.look()
    assert ros.drivers.find("/hero_0") == A
    ros.report(A, (0, Robot.AWAY), (1, Robot.REFUSED), (2, Robot.READY))
    ros.report(B, (0, Robot.JOINING), (1, Robot.AWAY), (2, Robot.REFUSED))
    assert [ros.drivers.find("/hero_%d" % number) for number in range(4)] == [B, B, A, A]


def test_why_a_robot_is_absent_is_told_by_its_driver(ros):
    assert ros.drivers.explain_absence("/hero_0").startswith("no driver answers; start one: roslaunch")
    ros.report(A, *((number, Robot.READY) for number in range(NAMES_SHOWN)), (77, Robot.AWAY))
    assert ros.drivers.explain_absence("/hero_77") == "the driver reports hero_77 as AWAY"
    ros.drivers._links[A + "/robots"].report.robots[-1].last_error = "left"
    assert ros.drivers.explain_absence("/hero_77") == "the driver reports hero_77 as AWAY: left"
    assert ros.drivers.explain_absence("/hero_99").startswith("connected are hero_0, ")
    assert "hero_9: is the robot on" in ros.drivers.explain_absence("/hero_99")
    ros.report(A, *((number, Robot.READY) for number in range(NAMES_SHOWN + 2)))
    assert "hero_6, hero_7 and 2 more: is the robot on" in ros.drivers.explain_absence("/hero_99")
    ros.report(A)
    assert ros.drivers.explain_absence("/hero_99") == "connected are no robots: is the robot on, and its id right?"


def test_a_stop_is_asked_for_until_each_driver_has_taken_it(ros):
    ros.known = [A, B]
    ros.look()
    assert ros.ask() is None and ros.drivers.stop_status() is None
    ros.drivers.request_stop(True)
    assert ros.ask() == REPEAT_PERIOD_S and ros.requests == [(A, True), (B, True)]
    ros.now_s += CROSSING_S + 0.01
    ros.report(A, (0, Robot.READY), stopped=True)
    ros.report(B, (1, Robot.READY), stopped=False)
    ros.requests.clear()
    assert ros.ask() == REPEAT_PERIOD_S and ros.requests == [(B, True)]
    assert ros.drivers.stop_status().text == "stopping"
    ros.report(B, (1, Robot.READY, Robot.MOVING), stopped=True)
    ros.requests.clear()
    assert ros.ask() is None and ros.requests == []
    ros.report(B, (1, Robot.READY), stopped=True)
    assert ros.drivers.stop_status() == ("info", "stopped, all wheels at rest", True)
    assert ros.drivers.wait_for_stop().is_final
    ros.drivers.check_stop()


def test_a_release_is_asked_for_once_over_a_connection(ros):
    ros.connected = set()
    ros.drivers.request_stop(False)
    ros.ask()
    assert ros.requests == [(A, False)]
    ros.connected = {A}
    for _ in range(2):
        ros.ask()
    assert ros.requests == [(A, False)] * 2, "nobody took the first one; the second one went out"


def test_who_does_not_stop_in_time_ends_the_program_with_an_error(ros):
    ros.drivers.request_stop(True)
    started_s = ros.now_s
    with pytest.raises(ProgramError, match="NOT STOPPED: driver hero_driver does not answer"):
        ros.drivers.check_stop()
    assert ros.now_s - started_s == pytest.approx(TIME_LIMIT_S, abs=0.03)
    ros.report(A, (0, Robot.READY), stopped=True)
    assert ros.drivers.stop_status().level == "info"
    ros.now_s += SILENT_S + 0.1
    assert ros.drivers.stop_status().text == "NOT STOPPED: driver hero_driver does not answer", "what it said is old"


def test_a_driver_that_was_left_is_asked_nothing(ros):
    link = ros.drivers._links[A + "/robots"]
    ros.report(A)
    assert link.is_connected and link.newest() is not None and link.newest(ros.now_s) is None
    for _ in range(2):
        link.close()
    assert not link.is_connected and not link.request_stop(True) and ros.requests == []
    assert math.isinf(drivers._DriverLink(B, B + "/robots").arrival_s)


def test_a_connection_that_is_being_closed_takes_no_request(monkeypatch):
    ros = Ros(monkeypatch)
    (link,) = ros.drivers._links.values()
    answers = []
    link._requests.unregister = lambda: answers.append(link.request_stop(True))
    link.close()
    assert answers == [False] and ros.requests == []


def run_finder(ros, monkeypatch, looks):
    """Let the thread that finds drivers look so many times, until the program ends."""
    waits_s = []

    def wait(duration_s):
        waits_s.append(duration_s)
        assert ros.drivers._looks == len(waits_s), "a look counts before the wait for the next one"

    ros.drivers._end = SimpleNamespace(is_set=lambda: len(waits_s) >= looks, wait=wait)
    ros.drivers._links = {}
    ros.drivers._find()
    return waits_s


def test_the_usual_driver_is_connected_to_whoever_is_found(ros, monkeypatch):
    ros.known = [B]
    assert run_finder(ros, monkeypatch, 2) == [FIND_PERIOD_S] * 2
    assert set(ros.drivers._links) == {A + "/robots", B + "/robots"} and ros.drivers._looks == 2
    assert sorted(ros.unregistered) == sorted(name + part for name in (A, B) for part in ("/stop_request", "/robots"))


def test_a_node_that_ends_leaves_its_topics_to_rospy(ros, monkeypatch):
    monkeypatch.setattr(drivers.rospy.core, "is_shutdown_requested", lambda: True)
    run_finder(ros, monkeypatch, 1)
    assert ros.unregistered == []


def test_where_the_usual_topic_is_remapped_no_other_driver_is_looked_for(ros, monkeypatch):
    ros.drivers._usual, ros.known = B + "/robots", [A]
    run_finder(ros, monkeypatch, 1)
    assert set(ros.drivers._links) == {B + "/robots"} and ros.drivers._has_found and ros.drivers.names() == [B]
