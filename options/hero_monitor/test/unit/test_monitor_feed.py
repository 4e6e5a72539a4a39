"""ROS messages become what pages show: rows, places, lights and goals, the outcome of a stop, and what is silent."""

import json
import math
from collections import deque
from concurrent.futures import Future
from io import BytesIO
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, PoseStamped, TransformStamped
from rosgraph_msgs.msg import Log
from std_msgs.msg import ColorRGBA
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from hero_client.ros import RobotListener, RobotTrack, StopStatus, find_lost_commands
from hero_monitor.fleet_feed import feed as feed_module
from hero_monitor.fleet_feed import robot_feed as robot_feed_module
from hero_monitor.fleet_feed.feed import (
    FleetFeed,
    describe_arena,
    describe_stop_of_others,
    find_true_poses,
    measure_extent,
)
from hero_monitor.fleet_feed.placement import Placement
from hero_monitor.fleet_feed.robot_feed import RobotFeed
from hero_msgs.msg import Robot, RobotArray, RobotPose, RobotPoses
from hero_node import NodeError, Pose, Velocity
from hero_node.ros import MasterWatch
from hero_test.nonempty import nonempty

FORGOTTEN_S, LIGHT_S, LOG_LINES_KEPT, LOG_LINES_PER_READ = 10.0, 15.0, 500, 40
LOOK_PERIOD_S, MARKERS_MAX, MAX_LINE_LENGTH, REACHED_M = 3.0, 2000, 400, 0.02
ROBOTS_MAX, ROW_PERIOD_S, SILENT_S = 1000, 0.5, 1.8

NOW_S = 100.0


class Newest:
    """A subscription whose newest message a test gives."""

    def __init__(self, topic, message_class):
        self.topic, self.message_class = topic, message_class
        self.message, self.is_closed, self.has_publisher = None, False, True

    def take(self):
        taken, self.message = self.message, None
        return taken

    def close(self):
        self.is_closed = True


class Fleet:
    """A FleetFeed with drivers and subscriptions of the test's own."""

    def __init__(self, monkeypatch):
        self.now_s, self.report, self.count, self.status = NOW_S, None, 0, None
        self.answering, self.names, self.found = {"/hero_driver": True}, ["/hero_driver"], "/hero_driver"
        drivers = SimpleNamespace(
            find_answering=lambda limit_s: dict(self.answering),
            count=lambda: self.count,
            read=lambda: self.report,
            stop_status=lambda: self.status,
            names=lambda: self.names,
            find=lambda namespace: self.found,
        )
        monkeypatch.setattr(feed_module, "Drivers", lambda: drivers)
        monkeypatch.setattr(feed_module, "NewestMessage", Newest)
        monkeypatch.setattr(feed_module, "RobotFeed", self.make_robot_feed)
        self.master = create_autospec(MasterWatch, instance=True, is_lost=False)
        monkeypatch.setattr(feed_module, "MasterWatch", lambda: self.master)
        monkeypatch.setattr(feed_module.rospy, "Subscriber", create_autospec(rospy.Subscriber))
        monkeypatch.setattr(feed_module, "time", SimpleNamespace(monotonic=lambda: self.now_s, time=lambda: 1.7e9))
        monkeypatch.setattr(feed_module.rospy, "get_name", lambda: "/hero_monitor")
        monkeypatch.setattr(feed_module, "find_lost_commands", create_autospec(find_lost_commands, return_value=[]))
        self.feed = FleetFeed("world", SimpleNamespace(submit=self.submit, warn=lambda *said: None))
        rospy.Subscriber.assert_called_once_with("/rosout", rospy.AnyMsg, self.feed._keep_log_line, queue_size=100)

    def make_robot_feed(self, namespace):
        listener = SimpleNamespace(track=RobotTrack(), ranges_m=[0.1, math.inf], values={"battery": 3.70414})
        return SimpleNamespace(
            name=namespace.strip("/"),
            listener=listener,
            light=None,
            is_closed=False,
            read_newest=lambda: None,
            find_goal=lambda placement: None,
            close=lambda: None,
        )

    def submit(self, function, *arguments):
        done = Future()
        done.set_result(function(*arguments))
        return done

    def receive(self, *robots, stopped=False):
        self.report = RobotArray(robots=list(robots), stopped=stopped, listening="10.42.0.1:11411")
        self.report.header.stamp = rospy.Time(1000)
        self.count += 1

    def subscribe(self):
        self.feed.read()
        self.feed.update_subscriptions(True, True)

    def put(self, topic, message):
        self.feed._scene[topic].message = message

    def read(self):
        """Return all parts of the state, after a turn."""
        self.feed.read()
        return json.loads(self.feed.page_state.take_updates({}))


def make_row(number, state=Robot.READY, **fields):
    return Robot(id=number, namespace="/hero_%d" % number, state=state, stop_state=Robot.AT_REST, **fields)


@pytest.fixture(name="fleet")
def make_fleet(monkeypatch):
    return Fleet(monkeypatch)


def test_a_row_says_what_the_driver_and_the_odometry_say(fleet):
    row = make_row(3, bytes_per_s=4000.6, clock_offset=-0.01234, reconnects=2)
    row.since, row.uptime = rospy.Time(940), rospy.Duration(61)
    row.dropped_messages, row.bad_packets, row.last_error = 5, 6, "e" * 500
    fleet.receive(row)
    fleet.subscribe()
    track = fleet.feed._feeds["/hero_3"].listener.track
    for pose in (Pose(0.0, 0.0, 0.0), Pose(0.3, 0.4, 0.0)):
        track.receive_pose(pose)
    track.velocity = Velocity(-0.1234, 1.23456)
    track.receive_proximity([math.inf, 0.25])
    fleet.now_s += ROW_PERIOD_S
    (before,) = fleet.read()["fleet"]["robots"]
    assert (before["odom"], before["speed"], before["turn"]) == (0.0, None, None), "not measured yet"
    track.odometry.total += 30
    fleet.now_s += ROW_PERIOD_S
    state = fleet.read()["fleet"]
    assert (state["driver"], state["listening"], state["stopped"], state["frame"]) == (
        True,
        "10.42.0.1:11411",
        False,
        "world",
    )
    (shown,) = state["robots"]
    expected = {
        "name": "hero_3", "id": 3, "state": "READY", "known": True, "stop": "at rest", "since": 60, "uptime": 61,
        "reconnects": 2, "speed": 0.123, "turn": 1.235, "bytes": 4001, "distance": 0.5, "dropped": 5, "bad": 6,
        "clock": -0.0123, "source": "", "health": [0, ""], "nearest": 0.25, "values": {"battery": 3.7041},
    }  # fmt: skip
    assert {name: shown[name] for name in expected} == expected and len(shown["error"]) == MAX_LINE_LENGTH


def test_rows_are_renewed_by_reports_answers_and_twice_a_second(fleet):
    fleet.receive(make_row(0))
    fleet.read()
    fleet.receive(make_row(0), make_row(1))
    assert len(fleet.read()["fleet"]["robots"]) == 2
    fleet.report = None  # not read again without a new report
    fleet.answering = {"/hero_driver": False}
    assert fleet.read()["fleet"]["driver"] is False
    fleet.now_s += 0.9 * ROW_PERIOD_S
    fleet.feed.placement.localize("map", {"hero_0": (Pose(0, 0, 0),) * 2})
    assert fleet.read()["fleet"]["frame"] == "world"
    fleet.now_s += 0.2 * ROW_PERIOD_S
    assert fleet.read()["fleet"]["frame"] == "map"
    fleet.receive(*(make_row(number) for number in range(ROBOTS_MAX + 1)))
    assert len(fleet.read()["fleet"]["robots"]) == ROBOTS_MAX


def test_a_refused_robot_is_shown_with_nothing_of_its_namesake(fleet):
    fleet.receive(make_row(0), make_row(0, Robot.REFUSED))
    fleet.subscribe()
    fleet.feed._health["hero_0"] = [1, "low voltage"]
    fleet.now_s += 1.0
    own, refused = fleet.read()["fleet"]["robots"]
    assert own["stop"] == "at rest" and own["health"] == [1, "low voltage"] and own["odom"] is not None
    assert (refused["stop"], refused["health"], refused["odom"], refused["state"]) == ("", [0, ""], None, "REFUSED")
    assert list(fleet.feed.robots) == ["hero_0"] and fleet.feed.robots["hero_0"].state == Robot.READY


def test_all_is_stopped_only_while_every_driver_says_so(fleet):
    fleet.answering = {"/hero_driver": True, "/lab": True}
    fleet.receive(make_row(0), stopped=True)
    assert fleet.read()["fleet"]["stopped"] and fleet.feed.stopped
    fleet.answering, fleet.found = {"/hero_driver": True, "/lab": False}, "/lab"
    state = fleet.read()["fleet"]
    assert (state["driver"], state["stopped"], state["robots"][0]["known"]) == (True, False, False)
    assert state["counts"] == "1 of 1 robots unknown"
    fleet.found = "/hero_driver"
    fleet.now_s += 1.0
    state = fleet.read()["fleet"]
    assert state["robots"][0]["known"] and state["counts"] == "0 of 1 robots ready, 1 stopped"
    fleet.answering = {"/hero_driver": False, "/lab": False}
    state = fleet.read()["fleet"]
    assert not state["driver"] and not state["robots"][0]["known"]


def test_topics_are_subscribed_to_while_pages_show_them(fleet):
    fleet.receive(make_row(0), make_row(1), make_row(2, Robot.REFUSED), Robot(state=Robot.JOINING))
    fleet.feed.read()
    for picture in (False, True):
        fleet.feed.update_subscriptions(True, picture)
        assert set(fleet.feed._feeds) == {"/hero_0", "/hero_1"}
        pictures = {"/track/picture/outline", "/track/picture/compressed"}
        assert pictures & set(fleet.feed._scene) == (pictures if picture else set())
        kinds = {topic: newest.message_class for topic, newest in fleet.feed._scene.items()}
        assert (kinds["/localization/poses"], kinds["/hero_sim/markers"]) == (RobotPoses, MarkerArray)
    fleet.receive(make_row(1))
    fleet.feed.read()
    fleet.feed.update_subscriptions(True, True)
    assert set(fleet.feed._feeds) == {"/hero_1"}
    pending, scene = Future(), dict(fleet.feed._scene)
    fleet.feed._change = pending
    fleet.feed.update_subscriptions(False, False)
    assert fleet.feed._feeds and not any(newest.is_closed for newest in scene.values()), "one change at a time"
    pending.set_result(None)
    fleet.feed.update_subscriptions(False, False)
    assert fleet.feed._feeds == fleet.feed._scene == {} and all(newest.is_closed for newest in nonempty(scene.values()))


def test_places_come_from_static_transforms_and_from_localization(fleet):
    fleet.receive(make_row(0), make_row(1))
    fleet.subscribe()
    for feed in fleet.feed._feeds.values():
        feed.listener.track.receive_pose(Pose(0.1, 0.0, 0.0))
    transform = TransformStamped(child_frame_id="hero_0/odom")
    transform.header.frame_id = "world"
    transform.transform.translation.x, transform.transform.rotation.w = 1.0, 1.0
    broken = TransformStamped(child_frame_id="hero_1/odom")
    broken.header.frame_id, broken.transform.translation.x = "world", math.nan
    fleet.put("/tf_static", TFMessage([transform, broken]))
    state = fleet.read()
    assert state["poses"] == {"hero_0": [1100, 0, 0], "hero_1": [100, 0, 0]} and state["ranges"]["hero_0"] == [
        100,
        None,
    ]
    assert [row["source"] for row in state["fleet"]["robots"]] == ["", ""] and fleet.feed.placement.knows("hero_0")

    def localize(*poses):
        message = RobotPoses()
        message.header.frame_id = "map"
        message.robots = [RobotPose(id=number, state=state, x=x_m) for number, state, x_m in poses]
        fleet.put("/localization/poses", message)
        fleet.now_s += 1.0
        fleet.read()
        fleet.now_s += 1.0
        return fleet.read()

    tracked, lost, unknown = RobotPose.TRACKED, RobotPose.LOST, RobotPose.UNKNOWN
    state = localize((0, tracked, 2.0), (1, lost, 3.0))
    assert state["poses"] == {"hero_0": [2000, 0, 0], "hero_1": [3000, 0, 0]} and state["fleet"]["frame"] == "map"
    assert [row["source"] for row in state["fleet"]["robots"]] == ["camera", "odometry"]
    fleet.now_s += SILENT_S
    state = fleet.read()
    assert [row["source"] for row in state["fleet"]["robots"]] == ["unknown"] * 2
    assert [loss["source"] for loss in state["losses"]] == ["localization"]
    fleet.now_s += FORGOTTEN_S
    fleet.read()
    fleet.now_s += 1.0
    assert fleet.read()["fleet"]["frame"] == "world"
    assert localize((0, unknown, 2.0), (1, tracked, math.inf))["fleet"]["frame"] == "world"


def test_health_lights_and_goals_are_those_of_the_fleets_robots(fleet):
    fleet.receive(make_row(0))
    fleet.subscribe()
    said = [
        DiagnosticStatus(name="hero_driver: hero_0", level=1, message="low"),
        DiagnosticStatus(name="x: hero_9", level=2),
    ]
    fleet.put("/diagnostics", DiagnosticArray(status=said))
    feed = fleet.feed._feeds["/hero_0"]
    feed.light, feed.find_goal = "#ff0000", lambda placement: Pose(1.0, 2.0, 0.5)
    fleet.read()
    fleet.now_s += 1.0
    state = fleet.read()
    assert state["fleet"]["robots"][0]["health"] == [1, "low"] and list(fleet.feed._health) == ["hero_0"]
    assert state["lights"] == {"hero_0": "#ff0000"} and state["goals"] == {"hero_0": [1000, 2000, 500]}
    assert state["poses"] == state["ranges"] == {}, "no odometry yet"


def test_the_outcome_of_a_stop_is_that_of_a_page_or_a_program(fleet):
    assert fleet.read()["stop"] is None
    fleet.status = StopStatus("warn", "stopping", False)
    assert [fleet.read()["stop"]["reads"] for _ in range(3)] == [1, 2, 3], "shows that the monitor is alive"
    for status in (StopStatus("error", "NOT STOPPED", False), StopStatus("info", "stopped", True)):
        fleet.status = status
        assert fleet.read()["stop"] == {**status._asdict(), "reads": 0} and not fleet.feed.read_stop()
    fleet.status = None
    moving = make_row(0)
    moving.stop_state = Robot.MOVING
    fleet.receive(moving, make_row(1), stopped=True)
    fleet.read()
    assert fleet.read()["stop"]["text"] == "NOT STOPPED: hero_0 moves"
    for level, has_origin in (("info", True), ("error", False)):
        fleet.status = StopStatus(level, "the outcome", True)
        assert fleet.read()["stop"]["text"].startswith("the outcome (") == has_origin
    fleet.status, fleet.feed.stopper = None, "Ada"
    for name, shown in (("/hero_monitor", "Ada"), ("/hero_monitor_2", "hero_monitor_2"), ("/teleop", "teleop")):
        fleet.receive(make_row(0), stopped=True)
        fleet.report.stopped_by, fleet.report.stopped_since = name, rospy.Time(1000)
        fleet.read()
        assert fleet.read()["stop"]["text"].startswith(f"stopped by {shown} since ")
    assert describe_stop_of_others("by x", ["hero_0", "hero_1"]) == ("error", "NOT STOPPED: hero_0, hero_1 move", False)
    assert describe_stop_of_others("by teleop since 18:43", []) == ("info", "stopped by teleop since 18:43", True)
    assert describe_stop_of_others(None, []) is None


def test_lines_of_the_log_are_counted_and_known_by_their_robot(fleet):
    fleet.receive(make_row(0))
    fleet.read()

    def say(node, text, count=1, at_s=9):
        buffer, line = BytesIO(), Log(name=node, level=2, msg=text)
        line.header.stamp = rospy.Time(at_s)
        line.serialize(buffer)
        message = SimpleNamespace(_connection_header={"md5sum": Log._md5sum}, _buff=buffer.getvalue())
        for _ in range(count):
            fleet.feed._keep_log_line(message)

    fleet.feed._keep_log_line(SimpleNamespace(_connection_header={"md5sum": "other"}, _buff=b"x"))
    for at_s, text in ((2, "hero_0 left (10.0.0.1:1)"), (1, "hero_0: voltage low"), (3, "hero_9: voltage low")):
        say("/hero_driver", text, at_s=at_s)
    say("/other", "hero_0: hello")
    lines = fleet.read()["log"]["lines"]
    assert [line[4] for line in lines] == ["hero_0", "hero_0", "", ""] and lines[0][3] == "hero_driver"
    assert [line[1] for line in lines] == [1.0, 2.0, 3.0, 9.0], "those that come at once, in the order of their stamps"
    fleet.feed._log_bytes.append(b"no line")
    say("/other", "hello")
    log = json.loads(fleet.feed.read() or fleet.feed.page_state.take_updates({"log": 4}))["log"]
    assert log["missed"] == 1 and [line[5] for line in log["lines"]] == ["hello"]
    say("/other", "much", LOG_LINES_PER_READ + 10)
    fleet.feed.read()
    assert fleet.feed.page_state.log.count == 6 + LOG_LINES_PER_READ + 10 and fleet.feed._log_bytes == deque()
    say("/other", "more", LOG_LINES_KEPT + 10)
    assert len(fleet.feed._log_bytes) == LOG_LINES_KEPT


def test_a_replay_is_drawn_while_it_runs(fleet):
    fleet.receive(make_row(0), make_row(1))
    fleet.subscribe()
    for number, feed in enumerate(fleet.feed._feeds.values()):
        feed.listener.track.receive_pose(Pose(0.1 * number, 0.0, 0.0))
    heading = make_marker(Marker.ARROW, 1, 1, 1, ns="headings")
    fleet.put("/hero_sim/replay", MarkerArray([heading, make_marker(9, 1, 1, 1, ns="names", text="hero_7")]))
    state = fleet.read()
    assert state["poses"] == {"hero_0": [-500, 0, 0], "hero_1": [600, 0, 0]}, "side by side"
    assert state["replay"] == {"hero_7": [1000, 0, 0]}
    fleet.now_s += FORGOTTEN_S + 0.1
    fleet.feed._scene["/hero_sim/replay"].has_publisher = False
    assert fleet.read()["replay"] == {}


def make_marker(kind, *scale, **fields):
    marker = Marker(type=kind, action=Marker.ADD, **fields)
    marker.pose.position.x, marker.pose.orientation.w = 1.0, 1.0
    marker.scale.x, marker.scale.y, marker.scale.z = scale
    return marker


def test_walls_objects_and_places_go_when_the_simulator_has_ended(fleet):
    fleet.receive(make_row(0))
    fleet.subscribe()
    robot = [make_marker(Marker.ARROW, 1, 1, 1, ns=name, text="hero_0") for name in ("headings", "names")]
    message = MarkerArray([make_marker(Marker.CUBE, 0.5, 0.02, 0.1), *robot])
    nothing = {"boxes": [], "circles": []}
    no_arena = {**nothing, "extent": None}
    for part, topic, empty in (
        ("arena", "/hero_sim/arena", no_arena),
        ("objects", "/hero_sim/object_markers", nothing),
        ("ground_truth", "/hero_sim/markers", {}),
    ):
        fleet.put(topic, message)
        assert fleet.read()[part] != empty
        fleet.feed._scene[topic].has_publisher = False
        assert fleet.read()[part] == empty


def test_commands_that_no_robot_hears_and_goals_outside_the_walls_are_told(fleet, monkeypatch):
    lost = "/mine publishes /hero_0/cmd_vle, which no robot reads"
    find = create_autospec(find_lost_commands, side_effect=[[lost], NodeError("no ROS master")])
    monkeypatch.setattr(feed_module, "find_lost_commands", find)
    fleet.receive(make_row(0))
    fleet.subscribe()
    (loss,) = fleet.read()["losses"]
    assert loss["source"] == "commands" and loss["remedy"] == lost
    walls = [make_marker(Marker.CUBE, 2.0, 0.02, 0.1) for _ in range(2)]
    for marker, y_m in zip(walls, (-1.0, 1.0)):
        marker.pose.position = Point(0.0, y_m, 0.0)
    fleet.put("/hero_sim/arena", MarkerArray(walls))
    feed = fleet.feed._feeds["/hero_0"]
    feed.listener.track.receive_pose(Pose(0.5, 0.5, 0.0))
    for x_m, y_m, is_told in (
        (1.0, 1.0, False), (-1.0, -1.0, False), (0.9, 1.001, True), (0.9, -1.001, True), (1.001, 0.9, True),
        (-1.001, 0.9, True),
    ):  # fmt: skip
        goal = Pose(x_m, y_m, 0.0)
        feed.find_goal = lambda placement, goal=goal: goal
        told = [loss["remedy"] for loss in fleet.read()["losses"]]
        assert ("the goal of hero_0 lies outside the walls" in told) == is_told
    fleet.now_s += LOOK_PERIOD_S - 0.125
    fleet.read()
    assert find.call_count == 1
    fleet.now_s += 0.125
    assert fleet.read()["losses"][0]["remedy"] == lost, "a master that is gone tells nothing new"
    assert find.call_count == 2, "once in LOOK_PERIOD_S"


def test_a_lost_master_is_told_until_it_answers(fleet):
    assert fleet.master.start.called
    fleet.receive(make_row(0))
    fleet.master.is_lost = True
    assert [loss["source"] for loss in fleet.read()["losses"]] == ["master"]
    fleet.master.is_lost = False
    assert fleet.read()["losses"] == []
    fleet.receive(make_row(0))
    fleet.report.gone = [make_row(7, since=rospy.Time(1000))]
    (loss,) = fleet.read()["losses"]
    assert loss["source"] == "robots" and loss["cause"].startswith("7 gone since ")
    fleet.answering["/hero_driver"] = False
    assert [loss["source"] for loss in fleet.read()["losses"]] == ["driver"], "it cannot tell who is gone"


def test_arena_and_ground_truth_are_drawn_in_millimeters():
    box, disc = make_marker(Marker.CUBE, 0.5, 0.02, 0.1), make_marker(Marker.CYLINDER, 0.1, 0.1, 0.1)
    gone, other = make_marker(Marker.CUBE, 1.0, 1.0, 1.0), make_marker(Marker.SPHERE, 1.0, 1.0, 1.0)
    gone.action = Marker.DELETE
    odd = make_marker(Marker.CUBE, math.nan, 1.0, 1.0)
    disc.pose.position.y = 2.0
    shown = describe_arena(MarkerArray([odd, gone, other, box, disc]))
    assert shown == {"boxes": [[1000, 0, 0, 500, 20, None]], "circles": [[1000, 2000, 50, None]]}
    painted = [make_marker(kind, 0.5, 0.2, 0.1, ns="areas") for kind in (Marker.CUBE, Marker.CYLINDER)]
    for marker in painted:
        marker.color.r, marker.color.g, marker.color.b = 1.0, 0.5, 0.0
    areas = describe_arena(MarkerArray(painted))
    assert areas == {"boxes": [[1000, 0, 0, 500, 200, "#ff8000"]], "circles": [[1000, 0, 250, "#ff8000"]]}
    walls = [[0, -900, 0, 1800, 20, None], [900, 0, 1571, 1800, 20, None]]
    assert measure_extent([[100, 200, 524, 1000, 20, None]], []) == [-333, -50, 533, 450], "turned by 30 degrees"
    assert measure_extent([], [[100, 200, 30, None]]) == [70, 170, 130, 230] and measure_extent([], []) is None
    assert measure_extent(walls, [[-500, 950, 100, None], [0, -950, 70, None]]) == [-900, -1020, 900, 1050]
    assert len(describe_arena(MarkerArray([box] * (MARKERS_MAX + 1)))["boxes"]) == MARKERS_MAX
    heading, name = (
        make_marker(Marker.ARROW, 1, 1, 1, ns="headings", id=3),
        make_marker(9, 1, 1, 1, ns="names", id=3, text="hero_3"),
    )
    alone = make_marker(9, 1, 1, 1, ns="names", id=4, text="hero_4")
    assert find_true_poses(MarkerArray([heading, name, alone])) == {"hero_3": [1000, 0, 0]}


def test_a_light_goes_out_and_a_goal_is_drawn_until_reached(monkeypatch):
    time = SimpleNamespace(now_s=NOW_S)
    monkeypatch.setattr(robot_feed_module, "time", SimpleNamespace(monotonic=lambda: time.now_s))
    monkeypatch.setattr(robot_feed_module, "NewestMessage", Newest)
    listener = create_autospec(RobotListener, instance=True, track=RobotTrack())
    monkeypatch.setattr(robot_feed_module, "RobotListener", lambda namespace: listener)
    feed, placement = RobotFeed("/hero_0"), Placement("world")
    placement.receive_transform("world", "hero_0/odom", Pose(1.0, 0.0, 0.0))
    feed._led.message = ColorRGBA(1.0, 0.0, 0.0, 1.0)
    for after_s, is_lit in ((0.0, True), (LIGHT_S, True), (0.125, False)):
        time.now_s += after_s
        feed.read_newest()
        assert feed.light == ("#ff0000" if is_lit else None)
    assert listener.read_newest.call_count == 3
    assert (feed._led.topic, feed._led.message_class) == ("/hero_0/led", ColorRGBA)
    assert (feed._goals.topic, feed._goals.message_class) == ("/hero_0/goal", PoseStamped)

    def send(frame, x_m):
        goal = PoseStamped()
        goal.header.frame_id, goal.pose.position.x, goal.pose.orientation.w = frame, x_m, 1.0
        feed._goals.message = goal
        feed.read_newest()

    for frame, x_m, shown_m in (
        ("hero_0/odom", 0.5, 1.5),
        ("/world", 0.5, 0.5),
        ("map", 0.5, None),
        ("world", math.nan, None),
    ):
        send(frame, x_m)
        found = feed.find_goal(placement)
        assert (None if found is None else found.x_m) == shown_m
    send("world", 1.5)
    for x_m, is_shown in ((0.5 - REACHED_M - 0.001, True), (0.5 - REACHED_M + 0.001, False), (0.3, False)):
        listener.track.receive_pose(Pose(x_m, 0.0, 0.0))
        assert (feed.find_goal(placement) is not None) == is_shown, "once reached, it is no longer drawn"
