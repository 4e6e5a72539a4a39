"""All that a page is shown of one fleet, as it is sent: numbers are rounded, and nothing is left out."""

import math
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import CompressedImage
from test_monitor_feed import Fleet, make_marker, make_row
from test_monitor_page_state import JPEG, make_drawing, make_outline
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from hero_client.ros import StopStatus
from hero_msgs.msg import RobotPoses
from hero_node import Pose, Velocity

SILENT_S = 1.8


@pytest.fixture(name="fleet")
def make_fleet(monkeypatch):
    """Two robots: hero_3 with all that a robot may have, and hero_10, of which only its driver tells."""
    fleet = Fleet(monkeypatch)
    fleet.feed.lab_file = SimpleNamespace(robots={3: SimpleNamespace(text="its wheel squeaks")})
    known = {"address": "10.42.0.7:4242", "firmware": "2.1", "model": "hero", "hardware": "b", "config": "c"}
    first = make_row(3, bytes_per_s=4000.6, clock_offset=-0.012345, **known)
    first.since, first.uptime = rospy.Time(940, 600_000_000), rospy.Duration(61, 700_000_000)
    fleet.receive(make_row(10), first)
    fleet.subscribe()
    feed = fleet.feed._feeds["/hero_3"]
    track = feed.listener.track
    track.receive_pose(Pose(0.0, 0.0, 0.0))
    fleet.now_s += 0.6
    fleet.read()
    track.receive_pose(Pose(0.3, 0.4071, 0.5))
    track.velocity, track.odometry.total = Velocity(-0.12345, 1.23456), track.odometry.total + 30
    track.receive_proximity([math.inf, 0.25049])
    feed.light, feed.find_goal, feed.read_newest = "#ff0000", lambda _: Pose(2.0, 3.0, 0.25), Mock()
    place = TransformStamped(child_frame_id="hero_3/odom")
    place.header.frame_id, place.transform.translation.x, place.transform.rotation.w = "world", 1.0, 1.0
    robot = [make_marker(Marker.ARROW, 1, 1, 1, ns=name, text="hero_3", id=3) for name in ("headings", "names")]
    health = DiagnosticStatus(name="hero_driver: hero_3", level=1, message="low voltage")
    for topic, message in (
        ("/tf_static", TFMessage([place])),
        ("/diagnostics", DiagnosticArray(status=[health])),
        ("/hero_sim/arena", MarkerArray([make_marker(Marker.CUBE, 0.5, 0.02, 0.1)])),
        ("/hero_sim/object_markers", MarkerArray([make_marker(Marker.CYLINDER, 0.1, 0.1, 0.1)])),
        ("/hero_sim/markers", MarkerArray(robot)),
        ("/track/picture/outline", make_outline((-1, -1), (1, -1), (1, 1), (-1, 1), frame="world")),
        ("/track/picture/compressed", CompressedImage(data=JPEG)),
        ("/behavior/markers", make_drawing("one", "world")),
    ):
        fleet.put(topic, message)
    fleet.now_s += 1.3
    fleet.status = StopStatus("warn", "releasing", False)
    fleet.read()
    assert feed.read_newest.call_count == 1
    fleet.now_s += 0.8
    return fleet


def test_a_page_gets_all_of_a_fleet(fleet):
    state = fleet.read()
    assert len(state.pop("drawings")) == 4
    first, second = state["fleet"].pop("robots")
    assert state == {
        "stop": {"level": "warn", "text": "releasing", "is_final": False, "reads": 2},
        "fleet": {
            "driver": True, "listening": "10.42.0.1:11411", "stopped": False, "counts": "2 of 2 robots ready",
            "frame": "world", "localized": False,
        },
        "picture": {"number": 1, "box": [-1000, -1000, 1000, 1000]},
        "poses": {"hero_3": [1300, 407, 500]},
        "ranges": {"hero_3": [100, None]},
        "lights": {"hero_3": "#ff0000"},
        "goals": {"hero_3": [2000, 3000, 250]},
        "losses": [],
        "arena": {"boxes": [[1000, 0, 0, 500, 20, None]], "circles": [], "extent": [750, 0, 1250, 0]},
        "objects": {"boxes": [], "circles": [[1000, 0, 50, None]]},
        "ground_truth": {"hero_3": [1000, 0, 0]},
    }  # fmt: skip
    assert first == {
        "name": "hero_3", "id": 3, "address": "10.42.0.7:4242", "state": "READY", "known": True, "stop": "at rest",
        "firmware": "2.1", "model": "hero", "hardware": "b", "config": "c", "since": 59, "uptime": 62, "reconnects": 0,
        "bytes": 4001, "odom": 14.3, "speed": 0.123, "turn": 1.235, "distance": 0.51, "nearest": 0.25, "dropped": 0,
        "bad": 0, "clock": -0.0123, "error": "", "source": "odometry", "note": "its wheel squeaks",
        "values": {"battery": 3.7041}, "health": [1, "low voltage"],
    }  # fmt: skip
    unknown = dict.fromkeys(("address", "firmware", "model", "hardware", "config", "error", "source", "note"), "")
    nothing = dict.fromkeys(("uptime", "reconnects", "bytes", "odom", "distance", "dropped", "bad", "clock"), 0)
    assert second == {
        **unknown, **nothing, "name": "hero_10", "id": 10, "state": "READY", "known": True, "stop": "at rest",
        "since": None, "speed": None, "turn": None, "nearest": "-", "values": {"battery": 3.7041}, "health": [0, ""],
    }  # fmt: skip


def test_localization_that_no_page_listened_to_is_not_lost(fleet):
    fleet.put("/localization/poses", RobotPoses())
    fleet.read()
    fleet.feed.update_subscriptions(False, False)
    fleet.now_s += SILENT_S + 0.1
    fleet.read()
    fleet.feed.update_subscriptions(True, False)
    assert fleet.read()["losses"] == []
