"""What pages receive: new state with short numbers; and what they send, checked."""

import json
import math

import pytest
from geometry_msgs.msg import Point, Point32, Polygon, PolygonStamped
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from hero_client.ros import RobotTrack
from hero_monitor.control.requests import RequestError, read_request
from hero_monitor.fleet_feed import drawings
from hero_monitor.fleet_feed.camera_picture import CameraPicture
from hero_monitor.fleet_feed.feed import encode_nearest
from hero_monitor.fleet_feed.page_state import PageState, encode_color, encode_pose, encode_range, shorten
from hero_monitor.fleet_feed.placement import Placement
from hero_node import Pose

APART_M, BYTES_MAX, LOG_LINES_AT_ONCE, LOG_LINES_KEPT = 1.0, 2000000, 100, 500
MAX_LINE_LENGTH, SILENT_S = 400, 3.0


def test_a_page_gets_each_part_of_the_state_once_until_it_changes():
    state, page = PageState(), {}
    state.put("poses", {"hero_0": [1, 2, 3]})
    state.put("fleet", {})
    assert json.loads(state.take_updates(page)) == {"poses": {"hero_0": [1, 2, 3]}, "fleet": {}}
    assert state.take_updates(page) is None
    state.put("poses", {"hero_0": [1, 2, 3]})
    assert state.take_updates(page) is None
    state.put("poses", {"hero_0": [1, 2, 4]})
    assert json.loads(state.take_updates(page)) == {"poses": {"hero_0": [1, 2, 4]}}


def test_a_page_that_missed_updates_gets_the_newest():
    state, quick, slow = PageState(), {}, {}
    for step in range(10):
        state.put("poses", {"hero_0": [step]})
        assert json.loads(state.take_updates(quick)) == {"poses": {"hero_0": [step]}}
    assert json.loads(state.take_updates(slow)) == {"poses": {"hero_0": [9]}}


def test_a_new_page_gets_the_newest_lines_and_a_slow_one_a_count():
    state, early = PageState(), {}
    state.log.append(1.0, 2, "node", "", "first")
    state.take_updates(early)
    for number in range(LOG_LINES_KEPT + 50):
        state.log.append(2.0, 2, "node", "hero_3", "line %d" % number)
    updates = json.loads(state.take_updates(early))["log"]
    assert len(updates["lines"]) == LOG_LINES_AT_ONCE
    assert updates["lines"][-1][-1] == "line %d" % (LOG_LINES_KEPT + 49)
    assert updates["missed"] == LOG_LINES_KEPT + 50 - LOG_LINES_AT_ONCE
    assert json.loads(state.take_updates({}))["log"]["missed"] == 0
    assert state.take_updates(early) is None


def test_lines_that_were_dropped_unread_count_as_missed():
    state, page = PageState(), {}
    state.log.append(1.0, 2, "node", "", "first")
    state.take_updates(page)
    state.log.skip(1000)
    state.log.append(1.0, 2, "node", "", "last")
    updates = json.loads(state.take_updates(page))["log"]
    assert (updates["missed"], len(updates["lines"])) == (1000, 1)


def test_log_lines_are_short_and_hold_nothing_that_cannot_be_printed():
    state = PageState()
    state.log.append(1.0, 2, "no\x1bde", "", "a\u202eb\n" + 1000 * "x")
    line = json.loads(state.take_updates({}))["log"]["lines"][0]
    assert line[3] == "no?de"
    assert line[5].startswith("a?b?x") and len(line[5]) <= 400


def test_numbers_are_integers_and_those_not_finite_have_a_code():
    assert encode_pose(Pose(0.1234, -1.0, math.pi)) == [123, -1000, 3142]
    assert encode_pose(Pose(math.nan, 0.0, 0.0)) is None
    assert [encode_range(range_m) for range_m in [0.1, math.inf, 0.0, math.nan]] == [100, None, 0, -1]
    assert encode_color(1.0, 0.5, 7.0) == "#ff80ff"
    assert encode_color(0.0, 0.0, 0.0) is None
    assert encode_color(math.nan, 1.0, 0.0) is None
    with pytest.raises(ValueError, match="JSON"):
        PageState().put("poses", math.nan)


@pytest.mark.parametrize("pose", [(1e306, 0.0, 0.0), (0.0, -2e4, 0.0), (math.inf, 0.0, 0.0), (0.0, 0.0, math.nan)])
def test_a_pose_that_cannot_be_drawn_is_none(pose):
    assert encode_pose(Pose(*pose)) is None
    assert encode_pose(None) is None
    assert encode_pose(Pose(1e4, -1e4, 0.0)) == [10000000, -10000000, 0]


def test_an_impossible_range_is_an_invalid_reading():
    assert [encode_range(range_m) for range_m in [3e38, -3e38, 1e306]] == [-1, -1, -1]


@pytest.fixture()
def placement():
    placement = Placement("world")
    placement.receive_transform("world", "hero_0/odom", Pose(1.0, 2.0, math.pi / 2))
    placement.receive_transform("/elsewhere", "hero_1/odom", Pose(5.0, 5.0, 0.0))
    placement.receive_transform("world", "hero_2/base_link", Pose(5.0, 5.0, 0.0))
    return placement


def test_a_pose_on_the_map_and_back_is_the_same(placement):
    pose = Pose(0.3, -0.2, 0.5)
    on_map = placement.to_map("hero_0", pose)
    assert on_map == pytest.approx((1.2, 2.3, 0.5 + math.pi / 2))
    frame, goal = placement.to_goal("hero_0", on_map)
    assert frame == "hero_0/odom"
    assert goal == pytest.approx(pose)


def test_robots_without_a_map_transform_are_placed_side_by_side(placement):
    placement.set_robots(["hero_0", "hero_1", "hero_2"])
    assert placement.knows("hero_0") and not placement.knows("hero_1") and not placement.knows("hero_2")
    origin = Pose(0.0, 0.0, 0.0)
    one, other = placement.to_map("hero_1", origin), placement.to_map("hero_2", origin)
    assert (one.x_m, other.x_m) == (-APART_M / 2, APART_M / 2)


def test_localized_robots_are_placed_in_one_frame_and_others_side_by_side(placement):
    odom, pose = Pose(0.3, 0.0, 0.0), Pose(4.0, -1.0, math.pi / 2)
    placement.localize("/map", {"hero_1": (pose, odom)})
    placement.set_robots(["hero_0", "hero_1"])
    assert (placement.frame, placement.is_localized) == ("map", True)
    assert placement.knows("hero_1") and not placement.knows("hero_0")
    assert placement.to_map("hero_1", odom) == pytest.approx(pose)
    assert placement.to_map("hero_1", Pose(0.4, 0.0, 0.0)) == pytest.approx((4.0, -0.9, math.pi / 2))
    assert placement.to_goal("hero_1", Pose(1.0, 2.0, 3.0)) == ("map", Pose(1.0, 2.0, 3.0))
    assert placement.to_goal("hero_0", Pose(0.5, 0.0, 0.0)) == ("hero_0/odom", Pose(0.5, 0.0, 0.0))


def test_without_localization_the_map_is_as_before_it(placement):
    placement.localize("map", {"hero_1": (Pose(4.0, -1.0, 0.0), Pose(0.0, 0.0, 0.0))})
    placement.localize("", {})
    assert (placement.frame, placement.is_localized) == ("world", False)
    assert placement.knows("hero_0") and not placement.knows("hero_1")


@pytest.mark.parametrize(
    "ranges_m, shown",
    [
        ((), "-"),
        ((math.inf, math.inf), "free"),
        ((math.inf, math.nan), "not calibrated"),
        ((0.12345, math.inf), 0.123),
        ((0.1, 0.0), 0.0),
    ],
)
def test_the_nearest_obstacle_is_a_distance_or_a_word(ranges_m, shown):
    track = RobotTrack()
    track.receive_proximity(ranges_m)
    assert encode_nearest(track) == shown


JPEG = b"\xff\xd8picture"


def make_outline(*corners, frame="map"):
    outline = PolygonStamped(polygon=Polygon([Point32(x, y, 0.0) for x, y in corners]))
    outline.header.frame_id = frame
    return outline


def test_a_picture_lies_on_the_map_of_its_frame_and_on_no_other():
    picture = CameraPicture()
    assert picture.describe("map", 0.0) is None
    picture.receive(CompressedImage(data=JPEG), 10.0)
    assert picture.jpeg == JPEG
    assert picture.describe("map", 10.1) is None, "its place is not known"
    picture.receive(CompressedImage(data=JPEG), 10.15)  # sooner than pages fetch pictures
    picture.receive_outline(make_outline((-1.0, -0.5), (1.0, -0.5), (1.0, 0.5), (-1.0, 0.5)))
    picture.receive(CompressedImage(data=JPEG), 10.2)
    assert picture.describe("map", 10.3) == {"number": 2, "box": [-1000, -500, 1000, 500]}
    assert picture.describe("world", 10.3) is None
    picture.receive_outline(make_outline((0.0, 0.0), (math.nan, 1.0), (1.0, 1.0), (1e30, 0.0)))
    assert picture.describe("map", 10.3) is None


def test_a_picture_that_is_old_or_none_is_not_shown():
    picture = CameraPicture()
    picture.receive_outline(make_outline((-1.0, -0.5), (1.0, -0.5), (1.0, 0.5), (-1.0, 0.5)))
    for now_s in (0.0, 0.2):
        picture.receive(CompressedImage(data=JPEG), now_s)
    assert picture.describe("map", 0.2)["number"] == 2 and picture.describe("map", 10.0) is None
    picture.receive(CompressedImage(data=b"\x89PNG"), 10.0)
    picture.receive(CompressedImage(data=JPEG.ljust(BYTES_MAX + 1)), 10.0)
    assert picture.describe("map", 10.0) is None
    picture.receive(CompressedImage(data=JPEG.ljust(BYTES_MAX)), 10.0)
    assert picture.describe("map", 10.0 + SILENT_S) is not None
    assert picture.describe("map", 10.0 + SILENT_S + 0.1) is None
    assert picture.jpeg == b""


def read(**fields):
    return read_request(json.dumps(fields))


@pytest.mark.parametrize(
    "request_fields",
    [
        {"do": "stop"},
        {"do": "stop", "heard_ms": 5},
        {"do": "release", "heard_ms": 5},
        {"do": "drive", "robots": ["hero_1", "hero_2"], "linear": -0.2, "angular": 8, "pressed_ms": 4, "heard_ms": 5},
        {"do": "end_drive", "robots": ["hero_1"]},
        {"do": "stop_some", "robots": ["hero_1"]},
        {"do": "start", "program": "led_show", "robots": ["hero_1"], "values": {}, "heard_ms": 5},
        {"do": "end", "number": 3},
        {"do": "record", "on": True, "heard_ms": 5},
        {"do": "goal", "robots": ["hero_1"], "x": 1, "y": 2, "heard_ms": 5},
        {"do": "goal", "robots": ["hero_1"], "x": 1, "y": 2, "yaw": 3, "heard_ms": 5},
        {"do": "goal", "robots": ["hero_1"], "x": 1, "y": 2, "yaw": None, "heard_ms": 5},
        {"do": "show", "picture": True},
    ],
)
def test_requests_of_the_page_are_parsed(request_fields):
    assert read(**request_fields) == request_fields


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "1",
        b"{}",
        "{}",
        "[" * 1900,
        " " * 17000,
        '{"do":"release"}',
        '{"do":"release","heard_ms":"1"}',
        '{"do":"drive","robots":["hero_0"],"linear":0.1,"angular":0,"pressed_ms":5}',
        '{"do":"drive","robots":["hero_0"],"linear":0.1,"angular":0,"heard_ms":5}',
        '{"do":"drive","robots":["hero_0"],"linear":0.3,"angular":0,"pressed_ms":5,"heard_ms":5}',
        '{"do":"drive","robots":["hero_0"],"linear":NaN,"angular":0,"pressed_ms":5,"heard_ms":5}',
        '{"do":"drive","robots":["hero_0"],"linear":0.1,"angular":1e999,"pressed_ms":5,"heard_ms":5}',
        '{"do":"drive","robots":["hero_0"],"linear":"0.1","angular":0,"pressed_ms":5,"heard_ms":5}',
        '{"do":"drive","robots":["hero_0"],"linear":true,"angular":0,"pressed_ms":5,"heard_ms":5}',
        '{"do":"drive","robots":[7],"pressed_ms":5,"heard_ms":5,"linear":0.1,"angular":0}',
        '{"do":"goal","robots":["hero_0"],"x":1,"heard_ms":5}',
        '{"do":"goal","robots":["hero_0"],"x":1,"y":1,"yaw":"north","heard_ms":5}',
        '{"do":"goal","robots":[""],"x":1,"y":1,"heard_ms":5}',
        '{"do":"goal","robots":["hero_0","hero_1"],"x":1,"y":1,"heard_ms":5}',
        '{"do":"end_drive","robots":[]}',
        '{"do":"stop_some","robots":["hero_0","hero_0"]}',
        '{"do":"start","program":"led_show","robots":["hero_0"],"values":[],"heard_ms":5}',
        '{"do":"record","on":true}',
        '{"do":"show"}',
        '{"do":"show","picture":0}',
        '{"do":"reboot"}',
        '{"do":["stop"],"stop":true}',
    ],
)
def test_an_invalid_request_is_refused(text):
    with pytest.raises(RequestError):
        read_request(text)


def make_drawing(name, frame="map", end_m=1.0):
    """Return two beams, one of which sees something, and the metric of a behavior."""
    beams = Marker(ns="/%s/sees" % name, type=Marker.LINE_LIST)
    beams.points = [Point(0.0, 0.0, 0.0), Point(end_m, 0.0, 0.0), Point(0.0, 0.5, 0.0), Point(0.0, 1.0, 0.0)]
    beams.colors = [ColorRGBA(1.0, 0.0, 0.0, 1.0)] * 2 + [ColorRGBA(0.0, 0.0, 1.0, 1.0)] * 2
    line = Marker(ns="/%s/line" % name, type=Marker.LINE_STRIP, color=ColorRGBA(0.0, 1.0, 0.0, 1.0))
    line.points = [Point(0.0, 0.0, 0.0), Point(0.1, 0.2, 0.0), Point(math.nan, 0.0, 0.0), Point(0.2, 0.1, 0.0)]
    text = Marker(ns="/%s/metric" % name, type=Marker.TEXT_VIEW_FACING, text="order 0.91")
    text.pose.position, text.scale.z = Point(0.5, 1.5, 0.0), 0.05
    markers = [beams, line, text]
    for marker in markers:
        marker.header.frame_id = frame
    return MarkerArray(markers)


def test_beams_and_metric_of_each_behavior_are_drawn_while_it_runs():
    found = drawings.Drawings()
    found.receive(make_drawing("one"), 10.0)
    assert found.describe("map", 10.5) == [
        {"lines": [[[0, 0], [1000, 0]]], "color": "#ff0000", "isBeam": True},
        {"lines": [[[0, 500], [0, 1000]]], "color": "#0000ff", "isBeam": True},
        {"lines": [[[0, 0], [100, 200], [200, 100]]], "color": "#00ff00", "isBeam": False},
        {"text": "order 0.91", "at": [500, 1500, 50], "color": "#000000"},
    ]
    found.receive(make_drawing("two", end_m=2.0), 11.0)
    assert len(found.describe("map", 11.0)) == 8
    assert found.describe("odom", 11.0) == []
    assert len(found.describe("map", 12.0)) == 8
    assert len(found.describe("map", 12.5)) == 4, "the first one has ended"
    assert found.describe("map", 20.0) == []
    plain = make_drawing("one")
    plain.markers[0].colors = []
    plain.markers[0].color = ColorRGBA(1.0, 1.0, 1.0, 1.0)
    found.receive(plain, 30.0)
    lines = [[[0, 0], [1000, 0]], [[0, 500], [0, 1000]]]
    assert found.describe("map", 30.0)[0] == {"lines": lines, "color": "#ffffff", "isBeam": True}


def test_drawings_that_no_page_can_show_are_left_out():
    found = drawings.Drawings()
    wrong = make_drawing("one", end_m=math.inf)
    wrong.markers[1].points = [Point(0.0, 0.0, 0.0)] * (drawings.POINTS_MAX + 1)
    wrong.markers[2].scale.z = math.nan
    found.receive(wrong, 0.0)
    assert [drawn["color"] for drawn in found.describe("map", 0.0)] == ["#0000ff"]
    del wrong.markers[1].points[drawings.POINTS_MAX :]
    found.receive(wrong, 0.0)
    assert [drawn["color"] for drawn in found.describe("map", 0.0)] == ["#0000ff", "#00ff00"]
    found.receive(MarkerArray(), 0.0)
    wrong.markers[0].points[2].x = math.nan
    wrong.markers[1].action, wrong.markers[2].scale.z = Marker.DELETE, 0.05
    found.receive(wrong, 0.0)
    assert [drawn.get("text") for drawn in found.describe("map", 0.0)] == ["order 0.91"]
    found.receive(MarkerArray(wrong.markers[2:] * 21), 0.0)
    assert len(found.describe("map", 0.0)) == 20


def test_codes_for_drivers_reach_teachers_only():
    state, teacher, pupil = PageState(), {}, {}
    state.put("lesson", {"drivers": [["120934", ["hero_3"]]]})
    state.put("fleet", {})
    assert set(json.loads(state.take_updates(pupil, "lesson"))) == {"fleet"}
    assert state.take_updates(pupil, "lesson") is None
    assert set(json.loads(state.take_updates(teacher))) == {"fleet", "lesson"}


def test_texts_and_ranges_are_cut_at_their_limits():
    assert shorten("x" * MAX_LINE_LENGTH) == "x" * MAX_LINE_LENGTH
    assert shorten("x" * (MAX_LINE_LENGTH + 1)) == "x" * (MAX_LINE_LENGTH - 3) + "..."
    assert [encode_range(range_m) for range_m in [100.0, 100.1, -0.5, 0.0]] == [100000, -1, -1, 0]
