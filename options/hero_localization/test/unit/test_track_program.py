"""The program track: a detector that ends is an error, unless the program was to end with it."""

import contextlib
import math
import os
from types import SimpleNamespace
from unittest import mock

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from hero_localization.camera.camera_model import Camera, Intrinsics
from hero_localization.camera.device_controls import DeviceControls
from hero_localization.camera.frame_source import Frame
from hero_localization.errors import DetectorError, LocalizationError
from hero_localization.nodes import track
from hero_localization.tracking import settings as camera_file
from hero_localization.tracking.settings import Settings
from hero_localization.tracking.tag_pose import TagCorners, TagLayout, list_corners
from hero_msgs.msg import RobotPose, RobotPoses
from hero_node import Pose
from hero_node.parameters import check_parameters


@pytest.fixture
def end_detector(monkeypatch):
    """Return a function that runs track until its detector ends, with the program before or after it."""

    def run(is_requested):
        program, closed = SimpleNamespace(running=True), []

        def step():
            program.running = not is_requested
            raise DetectorError("the detector's process ended")

        node = SimpleNamespace(step=step, close=lambda: closed.append(True))
        monkeypatch.setattr(track, "Program", lambda name: contextlib.nullcontext(program))
        monkeypatch.setattr(track, "read_parameters", lambda declared: declared)
        monkeypatch.setattr(track, "TrackNode", lambda parameters: node)
        try:
            track.main()
        finally:
            assert closed

    return run


def test_a_detector_that_a_requested_end_ends_first_is_no_error(end_detector):
    end_detector(is_requested=True)


def test_a_detector_that_ends_by_itself_ends_track_with_an_error(end_detector):
    with pytest.raises(DetectorError, match="ended"):
        end_detector(is_requested=False)


def test_a_camera_is_not_called_uncalibrated_before_its_file_may_be_there(monkeypatch):
    node = track.TrackNode.__new__(track.TrackNode)
    node._tracker, node._path, node._opened_s = None, "camera.yaml", 5.0
    seen = []
    for now_s in (5.0, 5.0 + track.FILE_PATIENCE_S - 0.01, 5.0 + track.FILE_PATIENCE_S):
        monkeypatch.setattr(track, "time", SimpleNamespace(monotonic=lambda now_s=now_s: now_s))
        seen.append([(name, is_error) for name, _, is_error in node._list_problems(0.0)])
    assert seen == [[], [], [("camera", True)]]


@pytest.fixture(name="node")
def make_node(monkeypatch):
    """A node without ROS, whose camera file and log a test holds."""
    node = track.TrackNode.__new__(track.TrackNode)
    node._path, node._file_s, node._settings, node._tracker = "camera.yaml", 1.0, Settings(), "old tracker"
    node.file = SimpleNamespace(changed_s=1.0, loads=0, content=None)
    node._process, node._logged_s, node.lines = None, {}, []

    def load(path):
        assert path == "camera.yaml"
        node.file.loads += 1
        if isinstance(node.file.content, Exception):
            raise node.file.content
        return node.file.content

    monkeypatch.setattr(track.camera_file, "load", load)
    monkeypatch.setattr(track.camera_file, "find_change_s", lambda path: node.file.changed_s)
    node._start_tracker = lambda camera: setattr(node, "_tracker", ("tracker", node._settings, camera))
    for level in ("loginfo", "logwarn", "logerr"):
        monkeypatch.setattr(track.rospy, level, lambda text, level=level: node.lines.append((level[3:], text)))
    return node


def test_a_calibration_that_is_written_meanwhile_counts_at_once(node):
    for changed_s, camera in ((2.0, "camera"), (3.0, None)):
        node.file.changed_s, node.file.content = changed_s, Settings(camera=camera)
        node._follow_file()
        node._follow_file()
    assert node.file.loads == 2
    assert node._tracker[2] == "camera" and node._settings.camera == "camera", "one without a camera changes nothing"
    assert node.lines == [("info", "camera.yaml has changed, and counts from now on")]


def test_what_counts_only_when_track_starts_again_is_named(node):
    changes = {"controls": DeviceControls(gain=3)}, {"layout": TagLayout(height_m=0.08)}, {"delay_s": 0.1}
    for number, change in enumerate(changes):
        node._settings, node.file.changed_s, node.file.content = (
            Settings(),
            2.0 + number,
            Settings(camera="camera", **change),
        )
        node._follow_file()
    waits = "; exposure_s, gain, focus and the height of pictures from the next start on"
    told = "camera.yaml has changed, and counts from now on"
    assert node.lines == [("info", told + waits), ("info", told + waits), ("info", told)]


def test_a_camera_file_that_cannot_be_read_is_told_of_once(node):
    node.file.changed_s, node.file.content = 2.0, LocalizationError("camera.yaml, line 3: no number")
    for _ in range(3):
        node._follow_file()
    assert node.file.loads == 1 and (node._settings, node._tracker) == (Settings(), "old tracker")
    assert node.lines == [("err", "camera.yaml, line 3: no number; the calibration before it counts")]
    node.file.changed_s, node.file.content = 3.0, Settings(camera="camera")
    node._follow_file()
    assert node._tracker[2] == "camera"


def test_each_kind_of_problem_is_logged_every_thirty_seconds(node):
    for now_s, name, text, is_error in (
        (100.0, "camera", "no image for 3 s", True),
        (101.0, "camera", "no image for 4.5 s", True),
        (102.0, "hero_3", "its tag is misshapen", False),
        (102.0, "hero_4", "its tag is misshapen", False),
        (129.9, "camera", "no image for 33 s", True),
        (130.0, "camera", "no image for 33 s", True),
        (99.0, "camera", "no image for 2 s", True),
    ):
        node._log(name, text, is_error, now_s)
    assert node.lines == [
        ("err", "camera: no image for 3 s"),
        ("warn", "hero_3: its tag is misshapen"),
        ("warn", "hero_4: its tag is misshapen"),
        ("err", "camera: no image for 33 s"),
        ("err", "camera: no image for 2 s"),
    ], "also after ROS time went back"


def test_time_without_images_is_no_longer_than_the_node_runs(monkeypatch):
    node = track.TrackNode.__new__(track.TrackNode)
    node._tracker, node._opened_s = SimpleNamespace(list_problems=list), 5.0
    node._source = SimpleNamespace(problem="", warning="", arrived_s=0.0)
    for opened_s, text in ((1.0, None), (3.0, "no image for 3 s: is the camera's driver running?")):
        monkeypatch.setattr(track, "time", SimpleNamespace(monotonic=lambda opened_s=opened_s: 5.0 + opened_s))
        assert node._list_problems(1.8e9) == ([] if text is None else [("camera", text, True)])
    node._source.arrived_s = 1.8e9 - 1.9
    assert node._list_problems(1.8e9) == [], "nor longer than since the last one"


@pytest.mark.parametrize("turn_rad", [(math.pi, 0.0, 0.0), (3.0, 0.2, -0.4), (0.0, 0.0, 0.0)])
def test_the_place_of_the_camera_is_published(monkeypatch, turn_rad):
    monkeypatch.setattr(track.rospy, "get_name", lambda: "/track_2")
    monkeypatch.setattr(track.rospy, "get_rostime", lambda: track.rospy.Time(7))
    lens = Intrinsics(640, 480, np.diag((500.0, 500.0, 1.0)), np.zeros(5))
    camera = Camera(lens, cv2.Rodrigues(np.array(turn_rad))[0], np.array((0.1, -0.2, 2.2)))
    node = track.TrackNode.__new__(track.TrackNode)
    node._settings, node._frame_id, node._tf = Settings(camera=camera), "map", mock.Mock()
    node._start_tracker(camera)
    ((message,),) = [call.args for call in node._tf.publish.call_args_list]
    (found,) = message.transforms
    place, (x, y, z, w) = found.transform.translation, [getattr(found.transform.rotation, key) for key in "xyzw"]
    assert (found.header.frame_id, found.child_frame_id) == ("map", "track_2_camera")
    assert (place.x, place.y, place.z) == (0.1, -0.2, 2.2) and x * x + y * y + z * z + w * w == pytest.approx(1.0)
    # The optical axis, z of the camera's frame, as the quaternion turns it into map.
    axis = (2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y))
    assert axis == pytest.approx(camera.rotation[2], abs=1e-9)
    assert node._tracker.camera is camera


class Bench:
    """A whole node without ROS and without a detector, below a camera that looks straight down.

    sent: messages by topic. heard: topics with a subscriber.
    """

    def __init__(self, monkeypatch, tmp_path):
        self.sent, self.heard, self.now_s = {}, set(), 50.0
        monkeypatch.setattr(track.rospy, "Publisher", self.advertise)
        monkeypatch.setattr(track.rospy, "Subscriber", mock.Mock())
        monkeypatch.setattr(track.rospy, "get_time", lambda: self.now_s)
        monkeypatch.setattr(track.rospy, "get_rostime", lambda: track.rospy.Time(7))
        monkeypatch.setattr(track.rospy, "get_name", lambda: "/track")
        monkeypatch.setattr(track.rospy, "logwarn", lambda line: None)
        self.source = mock.Mock(problem="", warning="", arrived_s=50.0)
        monkeypatch.setattr(track, "open_source", mock.create_autospec(track.open_source, return_value=self.source))
        self.detector = mock.create_autospec(track.DetectorProcess, instance=True)
        self.start = mock.create_autospec(track.DetectorProcess, return_value=self.detector)
        monkeypatch.setattr(track, "DetectorProcess", self.start)
        lens = Intrinsics(640, 480, np.array(((500.0, 0, 320.0), (0, 500.0, 240.0), (0, 0, 1.0))), np.zeros(5))
        self.camera = Camera(lens, np.diag((1.0, -1.0, -1.0)), np.array((0.1, 0.0, 1.076)))
        path = str(tmp_path / "camera.yaml")
        seen = {100: Pose(0.3, 0.2, 0.0), 101: Pose(-0.2, 0.2, 0.0)}
        places = {tag_id: [*pose[:2], 0] for tag_id, pose in seen.items()}
        camera_file.update(path, {"references": places, "objects": {50: "box"}, "delay_s": 0.06, "decimate": 1.5})
        camera_file.update(path, camera_file.describe_camera(self.camera, seen))
        self.node = track.TrackNode(check_parameters(track.PARAMETERS, {"file": path, "frame": "/map"}))

    def advertise(self, topic, kind, queue_size, latch=False):
        messages = self.sent[topic] = []
        return mock.Mock(publish=messages.append, get_num_connections=lambda: int(topic in self.heard))

    def see(self, *tags, shift_m=0.0):
        """Take an image of the reference tags, of which all seem shifted, and of tags: (id, x, y, size)."""
        shown = [(100, 0.3 + shift_m, 0.2, 0.1, 0.0), (101, -0.2 + shift_m, 0.2, 0.1, 0.0)]
        shown += [(*tag, 0.076) for tag in tags]
        self.detector.search.return_value = [
            TagCorners(tag_id, self.camera.project(list_corners(Pose(x_m, y_m, 0.0), size_m, height_m)))
            for tag_id, x_m, y_m, size_m, height_m in shown
        ]
        self.source.poll.return_value = Frame(self.now_s, np.full((480, 640), 100, np.uint8), 3)
        for messages in self.sent.values():
            messages.clear()
        self.node.step()
        return self.sent


@pytest.fixture(name="bench")
def make_bench(monkeypatch, tmp_path):
    bench = Bench(monkeypatch, tmp_path)
    assert bench.see()["~measured_poses"] == [], "the first image is a second old when its detector has started"
    assert bench.start.call_args.args == (
        track.camera_file.DEFAULT_BACKEND,
        "36h11",
        1.5,
        640,
        480,
        pytest.approx(20.0),
    )
    return bench


def test_an_image_tells_where_robots_and_objects_were_when_it_was_taken(bench):
    bench.heard = {"~objects"}
    sent = bench.see((3, 0.2, -0.1, 0.04), (50, 0.0, 0.1, 0.04), (2, 0.0, -0.1, 0.04))
    ((report,), (objects,)) = sent["~measured_poses"], sent["~objects"]
    assert report.header.frame_id == "map" and report.header.stamp.to_sec() == pytest.approx(49.94)
    assert [(robot.id, robot.state) for robot in report.robots] == [(2, RobotPose.TRACKED), (3, RobotPose.TRACKED)]
    robot = report.robots[1]
    assert (robot.x, robot.y, robot.yaw) == pytest.approx((0.2, -0.1, 0.0), abs=1e-6)
    assert robot.stamp == report.header.stamp and 5e-4 < robot.position_sd < 1e-3 and 0.003 < robot.yaw_sd < 0.01
    assert [(found.name, found.x, found.y) for found in objects.objects] == [
        ("box", pytest.approx(0.0, abs=1e-6), pytest.approx(0.1))
    ]
    assert bench.see((2, 0.0, -0.1, 0.04), shift_m=0.02)["~measured_poses"][0].robots[0].state == RobotPose.LOST
    bench.heard = set()
    assert bench.see((50, 0.0, 0.1, 0.04))["~objects"] == []


def test_robots_are_expected_where_localize_says_unless_it_does_not_know(bench):
    states = RobotPose.TRACKED, RobotPose.LOST, RobotPose.UNKNOWN
    bench.node._expect(
        RobotPoses(robots=[RobotPose(id=number, state=state, x=0.1) for number, state in enumerate(states)])
    )
    bench.see()
    gray, stamp_s, expected = bench.detector.search.call_args.args
    assert gray.shape == (480, 640) and stamp_s == 50.0 and sorted(expected) == [0, 1]
    assert expected[0] == pytest.approx((320.0, 240.0, 20.0))


def test_the_picture_is_shown_five_times_a_second_to_those_who_look(bench):
    assert bench.see()["~picture"] == bench.sent["~picture/outline"] == []
    bench.heard = {"~picture/compressed"}
    sent = bench.see()
    (outline,), (jpeg,) = sent["~picture/outline"], sent["~picture/compressed"]
    assert sent["~picture"] == [] and jpeg.header.stamp.to_sec() == pytest.approx(49.94)
    assert (outline.header.frame_id, jpeg.header.frame_id) == ("map", "map")
    corners = [(point.x, point.y) for point in outline.polygon.points]
    box_m = 0.1 - 0.64, -0.478, 0.1 + 0.638, 0.48
    assert corners == [pytest.approx((box_m[x], box_m[y]), abs=1e-3) for x, y in ((0, 1), (2, 1), (2, 3), (0, 3))]
    bench.heard, shown = {"~picture"}, []
    for bench.now_s in (50.1, 50.19, 50.21, 50.3, 49.0):
        sent = bench.see((2, 0.0, -0.1, 0.04))
        shown.append(len(sent["~picture"]))
        assert sent["~picture/outline"] == [], "once for a camera"
    assert shown == [0, 0, 1, 0, 1], "also after time went back"
    (image,) = sent["~picture"]
    assert (image.encoding, image.step, len(image.data)) == ("bgr8", 3 * image.width, 3 * image.width * image.height)
    assert (image.width, image.height) == (1280, pytest.approx(960, abs=2))


def test_diagnostics_come_each_second_with_the_rate_or_with_problems(bench):
    bench.see()
    assert bench.sent["/diagnostics"] == []
    bench.now_s = 51.0
    (message,) = bench.see()["/diagnostics"]
    (status,) = message.status
    assert (status.level, status.message) == (DiagnosticStatus.OK, "1.0 images per second, 2 tags")
    assert bench.see()["/diagnostics"] == []
    bench.now_s, bench.source.warning = 52.5, "exposure"
    (message,) = bench.see((7, 0.0, 0.0, 0.06))["/diagnostics"]
    told = {status.name: (status.level, status.message[:12]) for status in message.status}
    assert told.pop("track: camera")[0] == DiagnosticStatus.OK
    assert told == {
        "track: camera controls": (DiagnosticStatus.WARN, "exposure"),
        "track: tag 7": (DiagnosticStatus.WARN, "measures 150"),
    }
    bench.now_s, bench.source.problem = 53.5, "unplugged"
    (message,) = bench.see()["/diagnostics"]
    assert [(status.level, status.message) for status in message.status] == [(DiagnosticStatus.ERROR, "unplugged")]


def test_another_family_in_the_camera_file_is_sought_by_another_detector(bench):
    for parts, count in (({"delay_s": 0.05}, 1), ({"family": "16h5"}, 2), ({"decimate": 2.5}, 3)):
        camera_file.update(bench.node._path, parts)
        os.utime(bench.node._path, (count, count))
        bench.now_s += 1.5
        for _ in range(3):
            bench.see()
        assert (bench.start.call_count, bench.detector.close.call_count) == (count, count - 1), parts
    assert bench.start.call_args.args[1:3] == ("16h5", 2.5) and len(bench.sent["~measured_poses"]) == 1


def test_the_end_leaves_the_camera_and_ends_the_detector(bench):
    bench.node.close()
    assert bench.source.close.called and bench.detector.close.called
