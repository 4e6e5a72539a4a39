"""What pages' requests do to robots and programs, and why they are refused; what is sent to robots, and how often."""

import json
import math
from types import SimpleNamespace
from unittest.mock import Mock, create_autospec

import pytest

from hero_client.ros import Drivers, StopStatus
from hero_monitor import page_requests
from hero_monitor.background import Background
from hero_monitor.control import drive_requests as commander_module
from hero_monitor.control import requests
from hero_monitor.control.drive_requests import DriveRequests
from hero_monitor.fleet_feed.placement import Placement
from hero_monitor.page_requests import PageRequests
from hero_monitor.serving.lesson import TEACHER, User
from hero_node import NodeError, Pose
from hero_node.files import EntryError

GOALS_AT_ONCE, HOLD_TIMEOUT_S, INERT_S, LISTENER_TIMEOUT_S = 100, 0.4, 2.0, 2.0
PROGRAMS_MAX = 20
AGE_MAX_S = {"drive": 0.4, "goal": 1.0, "start": 1.0, "record": 1.0, "release": 1.0}

NOW_MS = 5000000


class Page:
    """Notes what it is told."""

    def __init__(self, number=1):
        self.number, self.told, self.received = number, [], []
        self.picture, self.ended = None, []
        self.user, self.who = User("", TEACHER), "a teacher, page %d" % number

    def tell(self, level, text):
        self.told.append((level, text))

    def end_hold(self, pressed_ms):
        self.ended.append(pressed_ms)

    def acknowledge(self, request):
        self.received.append(request)

    def take(self):
        told, self.told = self.told, []
        return [text for _, text in told]


class Desk:
    """PageRequests with a fleet, a commander and programs that note what is asked of them."""

    def __init__(self, monkeypatch, control=True, lesson=None):
        self.lesson, self.noted, self.now_ms, self.pages = lesson, [], NOW_MS, [Page(1), Page(2)]
        self.may_drive, self.taken, self.submitted = True, set(), []
        self.drivers, self.ended_ms = {}, {}
        monkeypatch.setattr(page_requests, "read_clock_ms", lambda: self.now_ms)
        monkeypatch.setattr(page_requests.rospy, "get_name", lambda: "/hero_monitor")
        placement = Placement("world")
        placement.receive_transform("world", "hero_0/odom", Pose(1.0, 0.0, 0.0))
        self.feed = SimpleNamespace(
            robots={"hero_%d" % number: SimpleNamespace(id=number) for number in range(3)},
            stopped=False,
            placement=placement,
            read_stop=lambda: self.note("read_stop"),
        )
        commander = SimpleNamespace(
            stopped_ms=None,
            may_drive=lambda: self.may_drive,
            request_stop=lambda stop: self.note("request_stop", stop),
            dead_man=SimpleNamespace(
                release=lambda page, robot: self.note("end_drive", page, robot),
                stop=lambda robot: self.note("stop_robot", robot),
                end_hold=lambda robot, now_ms: self.note("end_hold", robot, now_ms) or self.drivers.get(robot),
                end_all_holds=lambda now_ms: self.note("end_all_holds", now_ms),
                is_over=lambda robot, pressed_ms: pressed_ms <= self.ended_ms.get(robot, -1),
            ),
            prepare=lambda robot: self.note("prepare", robot),
            drive=lambda page, robot, *speeds: self.note("drive", page, robot, *speeds) or robot not in self.taken,
            send_goal=None,
        )
        self.commander = commander
        background = SimpleNamespace(submit=self.submit, warn=lambda text, *period_s: self.note("warn", text))
        parameters = SimpleNamespace(control=control, record_folder="/tmp/recordings")
        self.requests = PageRequests(
            parameters,
            self.feed,
            commander,
            background,
            lambda call, *arguments: call(*arguments),
            lambda: self.note("broadcast"),
            self.lesson,
        )
        self.requests.activity = SimpleNamespace(
            note=lambda who, request, robots=(): self.noted_users.append((who, request, *robots)),
            note_drive=lambda who, robots: self.noted_users.append((who, "drive", *robots)),
        )
        self.started, self.recording, self.noted_users = [], None, []
        self.requests.programs = self.programs = SimpleNamespace(
            paths={"random_walk": "/walk", "follow": "/follow", "swarm_go_to": "/go", "record": "/record"},
            count=0,
            driver="",
            find_driver=lambda robots: self.programs.driver,
            find_robots=lambda number: {4: ["hero_1"], 5: ["hero_1", "hero_2"]}.get(number, []),
            start=lambda child, arguments: self.started.append((child, arguments)),
            end=lambda number: self.note("end", number),
            end_all=lambda: self.note("end_all"),
            end_those_of=lambda robots: self.note("end_those_of", *robots),
            find_recording=lambda: self.recording,
        )

    def note(self, *words):
        self.noted.append(words)

    def submit(self, function, *arguments):
        future = SimpleNamespace(calls=[], add_done_callback=lambda call: future.calls.append(call))
        self.submitted.append((arguments, future))
        return future

    def take(self):
        noted, self.noted = self.noted, []
        return noted

    def ask(self, do, page=0, age_s=0.0, **fields):
        """Send a request; return what the page is told."""
        request = {"do": do, "heard_ms": self.now_ms - round(1e3 * age_s), **fields}
        self.requests.receive(self.pages[page], json.dumps(request))
        return self.pages[page].take()


WALK = {"program": "random_walk", "robots": ["hero_0", "hero_1"], "values": {"linear_m_s": 0.1, "angular_rad_s": 1.0}}
DRIVE = {"robots": ["hero_0", "hero_1"], "linear": 0.1, "angular": -1.0, "pressed_ms": NOW_MS - 1000}
GOAL = {"robots": ["hero_0"], "x": 2.0, "y": 0.5}
MOVING = (("drive", DRIVE), ("goal", GOAL), ("start", WALK))


@pytest.fixture(name="desk")
def make_desk(monkeypatch):
    return Desk(monkeypatch)


def test_a_button_drives_each_robot_of_its_page(desk):
    assert desk.ask("drive", **DRIVE) == []
    assert desk.take() == [("drive", 1, "hero_0", 0.1, -1.0), ("drive", 1, "hero_1", 0.1, -1.0)]
    desk.taken = {"hero_1"}
    assert desk.ask("drive", **DRIVE) == ["hero_1 is driven from another page"]
    assert desk.pages[0].ended == [], "the others are driven"
    desk.taken = {"hero_0", "hero_1"}
    assert desk.ask("drive", **DRIVE) == ["hero_0, hero_1 are driven from another page"]
    assert desk.pages[0].ended == [NOW_MS - 1000]
    desk.take()
    assert desk.ask("end_drive", page=1, robots=["hero_0", "hero_7"]) == []
    assert desk.take() == [("end_drive", 2, "hero_0"), ("end_drive", 2, "hero_7")]


def test_what_makes_robots_move_is_refused_with_the_reason(monkeypatch, desk):
    viewing = Desk(monkeypatch, control=False)
    for do, fields in MOVING:
        assert viewing.ask(do, **fields) == ["this monitor is view only: start it with control:=true to drive robots"]
        absent = {**fields, "robots": ["hero_7"]}
        assert desk.ask(do, **absent) == ["hero_7 is not connected"]
        desk.feed.stopped = True
        assert desk.ask(do, **fields) == ["all robots are stopped: release them first"]
        desk.feed.stopped, desk.may_drive = False, False
        assert desk.ask(do, **fields) == ["all robots are stopped: release them first"]
        desk.may_drive, desk.programs.driver = True, "random walk drives hero_0: end it first"
        assert desk.ask(do, **fields) == ([] if do == "goal" else [desk.programs.driver])
        desk.programs.driver = ""
        late_s = AGE_MAX_S[do] + 0.01
        assert desk.ask(do, age_s=late_s, **fields) == (
            [] if do == "drive" else ["the request was delayed: nothing was done"]
        )
    assert desk.ask("drive", **{**DRIVE, "robots": ["hero_7", "hero_8"]}) == ["hero_7, hero_8 are not connected"]
    assert viewing.ask("record", on=True) == ["this monitor is view only: start it with control:=true to drive robots"]
    assert desk.noted == viewing.noted == [] and desk.started == viewing.started == []
    desk.requests.receive(desk.pages[0], "{")
    assert desk.pages[0].take() == ["invalid request (not JSON): reload the page"]
    assert "invalid request" in desk.ask("start", **{**WALK, "values": {}})[0]


def test_a_stop_always_counts_and_a_release_only_when_it_is_meant(monkeypatch):
    for control in (True, False):
        desk = Desk(monkeypatch, control)
        desk.feed.stopped = True
        assert desk.ask("stop", age_s=60.0) == []
        assert [words for words in desk.take() if words[0] != "warn"] == [
            ("request_stop", True),
            ("end_all",),
            ("end_all_holds", desk.now_ms),
            ("read_stop",),
            ("broadcast",),
        ]
        assert desk.pages[0].received == ["stop"]
        desk.commander.stopped_ms, desk.feed.stopped = desk.now_ms, True
        desk.now_ms += round(1e3 * INERT_S) - 1
        assert "robots were stopped less than 2 s ago" in desk.ask("release")[0]
        desk.now_ms += 1
        assert "the request was delayed" in desk.ask("release", age_s=AGE_MAX_S["release"] + 0.01)[0]
        assert desk.noted == [] and desk.pages[0].received == ["stop"]
        assert desk.ask("release") == []
        assert ("request_stop", False) in desk.take() and desk.pages[0].received == ["stop", "release"]


def test_programs_end_while_all_robots_are_stopped(desk):
    desk.requests.end_motions_of_stopped_robots()
    assert desk.take() == []
    for stopped, may_drive in ((True, True), (False, False)):
        desk.feed.stopped, desk.may_drive = stopped, may_drive
        desk.requests.end_motions_of_stopped_robots()
        assert desk.take() == [("end_all",), ("end_all_holds", NOW_MS)]
    desk.feed.stopped, desk.may_drive = False, True
    assert desk.ask("stop_some", robots=["hero_1", "hero_7"]) == []
    assert desk.take() == [("end_those_of", "hero_1", "hero_7"), ("end_hold", "hero_1", NOW_MS)]
    assert desk.ask("end", number=3) == [] and desk.take() == [("end", 3)]


def test_a_stop_of_one_robot_ends_its_hold_and_both_pages_are_told(desk):
    desk.drivers = {"hero_0": 1, "hero_1": 2}
    assert desk.ask("stop_some", page=1, robots=["hero_0", "hero_1", "hero_2"]) == [
        "stopped: hero_0; another page drove, and needs a new press to drive again"
    ]
    desk.take()
    desk.ended_ms = {"hero_0": NOW_MS}
    assert desk.ask("drive", **DRIVE) == ["hero_0 was stopped: let go, and press again to drive"]
    assert desk.take() == [] and desk.pages[0].ended == [DRIVE["pressed_ms"]], "its other robots are not driven either"
    desk.ended_ms["hero_1"] = NOW_MS
    assert desk.ask("drive", **DRIVE) == ["hero_0, hero_1 were stopped: let go, and press again to drive"]
    assert desk.ask("drive", **{**DRIVE, "pressed_ms": NOW_MS + 1}) == []
    assert [words[0] for words in desk.take()] == ["drive", "drive"]


def test_a_goal_is_sent_in_the_background_and_its_outcome_told(desk):
    assert desk.ask("goal", yaw=1.5, **GOAL) == [] == desk.ask("goal", **GOAL)
    (robot, frame, goal, with_heading), future = desk.submitted[0]
    assert (robot, frame, goal, with_heading) == ("hero_0", "hero_0/odom", pytest.approx((1.0, 0.5, 1.5)), True)
    assert desk.submitted[1][0][2:] == (pytest.approx((1.0, 0.5, 0.0)), False)
    for _ in range(GOALS_AT_ONCE - 2):
        assert desk.ask("goal", **GOAL) == []
    assert desk.ask("goal", **GOAL) == ["too many goals at once"]
    (tell,) = future.calls
    tell(SimpleNamespace(result=lambda: ("info", "hero_0 has a new goal")))
    assert desk.pages[0].told == [("info", "hero_0 has a new goal")]
    desk.pages[0].take()
    assert desk.ask("goal", **GOAL) == [] and len(desk.submitted) == GOALS_AT_ONCE + 1
    assert desk.ask("goal", **GOAL) == ["too many goals at once"], "one place for each that was answered"
    with pytest.raises(ArithmeticError):
        tell(SimpleNamespace(result=lambda: 1 / 0))
    assert desk.ask("goal", **GOAL) == [], "or failed"


def test_a_program_is_started_with_its_robots_and_their_topics_open(desk, monkeypatch):
    assert desk.ask("start", **WALK) == []
    ((child, arguments),) = desk.started
    assert (child.program, child.robots, child.places) == ("random_walk", ["hero_0", "hero_1"], [])
    assert '_robots:="0 1"' in arguments and desk.take() == [("prepare", "hero_0"), ("prepare", "hero_1")]
    child.end()
    desk.requests._stop_robots_of(child)
    assert desk.take() == [("stop_robot", "hero_0"), ("stop_robot", "hero_1")]
    formation = {"shape": "line", "spacing_m": 0.3, "turn_deg": 0.0, "x_m": 1.0, "y_m": 0.0, "linear_m_s": 0.08}
    go = {"program": "swarm_go_to", "robots": ["hero_0"], "values": formation}
    assert desk.ask("start", **go) == [] and desk.started[1][0].places == [(1.0, 0.0)]
    desk.started[1][0].end()
    for fields, says in (
        ({"robots": ["hero_0", "hero_1"]}, "swarm_go_to needs the robots' places, but that of hero_1 is unknown"),
        (
            {"program": "led_show", "values": {"pattern": "chase", "period_s": 4.0, "brightness": 1.0}},
            "led_show is not installed",
        ),
    ):
        assert says in desk.ask("start", **{**go, **fields})[0]
    desk.feed.placement.localize("map", {"hero_0": (Pose(0, 0, 0),) * 2, "hero_1": (Pose(0, 0, 0),) * 2})
    wide = {**go, "robots": ["hero_0", "hero_1"]}
    desk.programs.count = PROGRAMS_MAX - 1
    assert desk.ask("start", **wide) == [] and '_frame:="map"' in desk.started[2][1]
    desk.started[2][0].end()
    segregation = {"groups": 3.0, "own_m": 0.2, "others_m": 1.0, "max_linear_m_s": 0.1, "safety": "off"}
    desk.programs.paths["behavior_segregation"] = "/behavior"
    assert desk.ask("start", program="behavior_segregation", robots=["hero_0"], values=segregation) == []
    child, arguments = desk.started.pop()
    child.end()
    assert any('"groups": 3,' in argument for argument in arguments), "a whole number, however a page writes it"
    monkeypatch.setattr(page_requests, "place_robots", Mock(side_effect=EntryError("robots would touch")))
    assert desk.ask("start", **wide) == ["robots would touch"]
    desk.programs.count = PROGRAMS_MAX
    assert desk.ask("start", **wide) == ["20 programs run: end one first"] and len(desk.started) == 3


def test_a_recording_begins_once_and_ends_on_request(desk, monkeypatch):
    assert desk.ask("record", on=False) == [] and desk.started == []
    assert desk.ask("record", on=True) == []
    ((child, arguments),) = desk.started
    assert str(child.folder).startswith("/tmp/recordings/2") and arguments == ["--folder=%s" % child.folder]
    child.end()
    ended = []
    desk.recording = SimpleNamespace(end=lambda: ended.append("ended"))
    assert desk.ask("record", on=True) == [] and ended == []
    assert desk.ask("record", on=False) == [] and ended == ["ended"] and len(desk.started) == 1
    desk.recording = None
    del desk.programs.paths["record"]
    assert desk.ask("record", on=True) == ["hero_recording is not installed"]


def test_robots_that_are_gone_are_dismissed_in_the_background(desk):
    desk.feed.drivers = create_autospec(Drivers, instance=True)
    desk.requests._background = create_autospec(Background, instance=True)
    assert desk.ask("dismiss") == []
    desk.requests._background.submit.assert_called_once_with(desk.feed.drivers.dismiss_gone)


def test_a_page_says_what_it_shows(desk):
    assert desk.ask("show", page=1, picture=True) == []
    assert desk.pages[1].picture is True


class Ros:
    """What the commander uses of ROS; topics connect connect_s after they were opened."""

    def __init__(self, monkeypatch, connect_s=0.0):
        self.now_s, self.sent, self.connect_s, self.queued = 100.0, [], connect_s, []
        self.requests, self.status, self.listeners, self.master_fails = [], None, {}, False
        time = SimpleNamespace(monotonic=lambda: self.now_s, sleep=self.sleep)
        monkeypatch.setattr(commander_module, "time", time)
        monkeypatch.setattr(commander_module.rospy, "Publisher", self.open)
        monkeypatch.setattr(commander_module.rospy, "get_name", lambda: "/hero_monitor")
        monkeypatch.setattr(commander_module.rospy.Time, "now", staticmethod(lambda: commander_module.rospy.Time(7)))
        monkeypatch.setattr(commander_module, "ask_master", self.ask_master)
        monkeypatch.setattr(commander_module, "read_clock_ms", lambda: round(1e3 * self.now_s))
        drivers = SimpleNamespace(request_stop=self.requests.append, stop_status=lambda: self.status)
        background = SimpleNamespace(submit=lambda function, *arguments: self.queued.append((function, arguments)))
        self.commander = DriveRequests(drivers, background)

    def sleep(self, duration_s):
        self.now_s += duration_s

    def open(self, topic, kind, queue_size, tcp_nodelay):
        opened_s, own = self.now_s, int(topic.endswith("goal"))  # this node subscribes to goals, too
        assert (kind.__name__, queue_size, tcp_nodelay) == (("PoseStamped", 2) if own else ("Twist", 1)) + (True,)

        def count():
            self.commander.step()  # the pages' thread goes on
            return own + int(self.now_s - opened_s >= self.connect_s - 1e-9)

        return SimpleNamespace(publish=lambda message: self.sent.append((topic, message)), get_num_connections=count)

    def ask_master(self, call):
        if self.master_fails:
            raise NodeError("no ROS master")
        return [], [[topic, nodes] for topic, nodes in self.listeners.items()], []

    def work(self):
        """Do what was submitted to the background."""
        queued, self.queued = self.queued, []
        for function, arguments in queued:
            function(*arguments)

    def take(self):
        sent, self.sent = self.sent, []
        return [(topic, message.linear.x, message.angular.z) for topic, message in sent]


MOVE = ("hero_0", 0.1, 0.5)
TOPIC = "/hero_0/velocity_controller/cmd_vel"


def test_a_topic_is_opened_once_and_a_stop_waits_for_it(monkeypatch):
    ros = Ros(monkeypatch, connect_s=0.3)
    assert ros.commander.drive(1, *MOVE) and ros.commander.drive(1, *MOVE)
    assert len(ros.queued) == 1 and ros.take() == []
    ros.commander.dead_man.release(1, "hero_0")
    for _ in range(3):
        ros.commander.step()
    ros.work()
    assert ros.take() == [], "not lost: the topic was yet to be connected"
    assert ros.now_s == pytest.approx(100.3, abs=0.03)
    ros.commander.step()
    assert ros.take() == [(TOPIC, 0.0, 0.0)]
    ros.commander.step()
    assert ros.take() == []
    assert ros.commander.drive(1, *MOVE) and ros.take() == [(TOPIC, 0.1, 0.5)]


def test_a_driver_that_never_connects_is_waited_for_two_seconds(monkeypatch):
    ros = Ros(monkeypatch, connect_s=math.inf)
    ros.commander.prepare("hero_0")
    ros.work()
    assert ros.now_s == pytest.approx(100.0 + LISTENER_TIMEOUT_S, abs=0.03)
    ros.commander.drive(1, *MOVE)
    assert ros.take() == [(TOPIC, 0.1, 0.5)]


def test_silence_the_end_of_a_page_and_a_stop_of_all_stop_robots(monkeypatch):
    for end in (
        lambda ros: ros.sleep(HOLD_TIMEOUT_S + 0.01),
        lambda ros: ros.commander.dead_man.drop_page(1),
        lambda ros: ros.commander.dead_man.stop("hero_0"),
        lambda ros: ros.commander.request_stop(True),
        lambda ros: ros.commander.close(),
    ):
        ros = Ros(monkeypatch)
        ros.commander.drive(1, *MOVE)
        ros.work()
        ros.commander.drive(1, *MOVE)
        assert not ros.commander.drive(2, *MOVE)
        ros.commander.dead_man.drop_page(2)
        ros.commander.step()
        assert ros.take() == [(TOPIC, 0.1, 0.5)]
        end(ros)
        ros.commander.step()
        assert ros.take() == [(TOPIC, 0.0, 0.0)]
        assert ros.commander.drive(2, *MOVE)
    for end in (lambda: ros.commander.request_stop(True), ros.commander.close):
        ros.commander.drive(2, *MOVE)
        ros.take()
        end()
        assert ros.take() == [(TOPIC, 0.0, 0.0)], "at once, not at the next step"


def test_the_clock_of_holds_is_in_ms_and_runs_while_the_pc_sleeps(monkeypatch):
    monkeypatch.setattr(requests.time, "clock_gettime", {requests.time.CLOCK_BOOTTIME: 12.3456}.__getitem__)
    assert requests.read_clock_ms() == 12346


def test_pages_may_drive_when_the_outcome_of_a_stop_is_known(monkeypatch):
    ros = Ros(monkeypatch)
    assert ros.commander.may_drive() and ros.commander.stopped_ms is None
    for status in (StopStatus("warn", "stopping", False), StopStatus("info", "released", True)):
        ros.status = status
        assert ros.commander.may_drive() == status.is_final
    ros.commander.request_stop(False)
    assert ros.commander.stopped_ms is None
    assert ros.commander.dead_man.is_over("hero_0", 100000), "a release ends holds, too"
    assert not ros.commander.dead_man.is_over("hero_0", 100001)
    ros.now_s += 1.0
    ros.commander.request_stop(True)
    assert ros.commander.dead_man.is_over("hero_0", 101000)
    assert ros.requests == [False, True] and ros.commander.stopped_ms == 101000


def test_a_goal_is_sent_to_a_program_that_takes_it(monkeypatch):
    ros = Ros(monkeypatch, connect_s=0.5)

    def send(with_heading):
        return ros.commander.send_goal("hero_12", "map", Pose(1.0, 2.0, math.pi / 2.0), with_heading)

    ros.listeners = {"/hero_12/goal": ["/hero_monitor"]}
    level, text = send(True)
    assert level == "error" and "no program takes goals for hero_12" in text and "go_to_goal.launch robots:=12" in text
    ros.listeners = {"/hero_12/goal": ["/hero_monitor", "/go_to_goal"]}
    assert send(True) == ("info", "hero_12 has a new goal")
    assert ros.now_s == pytest.approx(100.5, abs=0.03), "as soon as it is connected"
    assert send(False)[0] == "info" and ros.now_s < 100.6
    (_, turned), (topic, free) = ros.sent
    assert topic == "/hero_12/goal" and turned.header.frame_id == "map" and turned.header.stamp.secs == 7
    assert (turned.pose.position.x, turned.pose.position.y) == (1.0, 2.0)
    assert (turned.pose.orientation.z, turned.pose.orientation.w) == pytest.approx((math.sqrt(0.5),) * 2)
    assert (free.pose.orientation.z, free.pose.orientation.w) == (0.0, 0.0)
    ros.listeners["/hero_12/goal"].append("/another")
    send(False)
    assert ros.now_s == pytest.approx(100.5 + LISTENER_TIMEOUT_S, abs=0.05), "one that hangs is waited for this long"
    ros.master_fails = True
    assert send(False) == ("error", "no ROS master")
