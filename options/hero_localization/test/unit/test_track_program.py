"""The program track: a detector that ends is an error, unless the program was to end with it."""

import contextlib
from types import SimpleNamespace

import pytest

from hero_localization.errors import DetectorError, LocalizationError
from hero_localization.nodes import track


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
    monkeypatch.setattr(track, "Tracker", lambda settings, camera: ("tracker", settings, camera))
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
        (129.9, "camera", "no image for 33 s", True),
        (130.0, "camera", "no image for 33 s", True),
        (99.0, "camera", "no image for 2 s", True),
    ):
        node._log(name, text, is_error, now_s)
    assert node.lines == [
        ("err", "camera: no image for 3 s"),
        ("warn", "hero_3: its tag is misshapen"),
        ("err", "camera: no image for 33 s"),
        ("err", "camera: no image for 2 s"),
    ], "also after ROS time went back"
