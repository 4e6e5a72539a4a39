"""The program track: a detector that ends is an error, unless the program was to end with it."""

import contextlib
from types import SimpleNamespace

import pytest

from hero_localization.errors import DetectorError
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
