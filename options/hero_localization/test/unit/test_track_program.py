"""The program track: a detector that ends is an error, unless the program was to end with it."""

import contextlib
import math
from types import SimpleNamespace
from unittest import mock

import cv2
import numpy as np
import pytest

from hero_localization.camera.camera_model import Camera, Intrinsics
from hero_localization.errors import DetectorError, LocalizationError
from hero_localization.nodes import track
from hero_localization.tracking.settings import Settings


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
    node._path, node._file_s, node._settings, node._tracker = "camera.yaml", 1.0, "old settings", "old tracker"
    node._logged_s, node.file, node.lines = {}, SimpleNamespace(changed_s=1.0, loads=0, content=None), []

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
        node.file.changed_s, node.file.content = changed_s, SimpleNamespace(camera=camera)
        node._follow_file()
        node._follow_file()
    assert node.file.loads == 2
    assert node._tracker[2] == "camera" and node._settings.camera == "camera", "one without a camera changes nothing"
    assert node.lines == [("info", "camera.yaml has changed, and counts from now on")]


def test_a_camera_file_that_cannot_be_read_is_told_of_once(node):
    node.file.changed_s, node.file.content = 2.0, LocalizationError("camera.yaml, line 3: no number")
    for _ in range(3):
        node._follow_file()
    assert node.file.loads == 1 and (node._settings, node._tracker) == ("old settings", "old tracker")
    assert node.lines == [("err", "camera.yaml, line 3: no number; the calibration before it counts")]
    node.file.changed_s, node.file.content = 3.0, SimpleNamespace(camera="camera")
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
