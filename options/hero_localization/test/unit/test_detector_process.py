"""The detector's process: same tags as in this process, wrong options named, ends with its parent, deaf to Ctrl-C."""

import math
import os
import signal
import socket
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("cv2")

from hero_localization.errors import DetectorError
from hero_localization.prints.tag_images import draw_tag
from hero_localization.tracking import detector_process
from hero_localization.tracking.detector_process import DetectorProcess
from hero_localization.tracking.detectors import create_detector
from hero_localization.tracking.tag_search import TagSearch
from hero_test.nonempty import nonempty

WIDTH_PX, HEIGHT_PX = 480, 360


def picture(left, top, tag_id=5):
    gray = np.full((HEIGHT_PX, WIDTH_PX), 255, np.uint8)
    cells = np.kron(draw_tag("36h11", tag_id), np.ones((5, 5), np.uint8))
    gray[top : top + len(cells), left : left + len(cells)] = cells
    return gray


@pytest.fixture
def process():
    socket.setdefaulttimeout(60.0)  # as rospy does
    try:
        started = DetectorProcess("aruco", "36h11", 2.0, WIDTH_PX, HEIGHT_PX)
    finally:
        socket.setdefaulttimeout(None)
    yield started
    started.close()


@pytest.mark.slow
def test_process_finds_what_a_search_in_this_process_does_and_ends(process):
    search = TagSearch(create_detector("aruco", "36h11", 2.0), WIDTH_PX, HEIGHT_PX)
    for index in range(10):
        gray = picture(100 + 4 * index, 200 - 3 * index)
        expected, found = search.search(gray, index / 30.0), process.search(gray, index / 30.0, {})
        assert [tag.tag_id for tag in found] == [tag.tag_id for tag in expected]
        assert all((tag.corners == same.corners).all() for tag, same in nonempty(zip(found, expected)))
    assert [tag.tag_id for tag in found] == [5]
    # Far from there, it is found where it is expected.
    (found,) = process.search(picture(400, 300), 10 / 30.0, {5: (419.5, 319.5, 40.0)})
    assert found.center == pytest.approx((419.5, 319.5), abs=0.5)
    with pytest.raises(ValueError, match="480"):
        process.search(picture(60, 60)[:100], 11 / 30.0, {})
    process.close()
    assert process._process.returncode == 0
    process.close()


@pytest.mark.slow
def test_detector_that_cannot_be_made_is_named(tmp_path, monkeypatch):
    (tmp_path / "apriltag.py").write_text("raise ImportError")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(DetectorError, match="apt install python3-apriltag"):
        DetectorProcess("apriltag", "36h11", 2.0, WIDTH_PX, HEIGHT_PX)


@pytest.mark.slow
def test_process_that_died_is_named(process):
    process._process.kill()
    with pytest.raises(DetectorError, match="ended with status -9"):
        process.search(picture(60, 60), 0.0, {})
    with pytest.raises(DetectorError, match="has ended"):
        process.search(picture(60, 60), 0.1, {})


@pytest.mark.slow
def test_process_is_deaf_to_ctrl_c_and_ends_when_its_parent_is_killed():
    """The child holds the parent's standard output: its end of file tells that both have ended."""
    program = (
        "import os, signal; import numpy as np;"
        "from hero_localization.tracking.detector_process import DetectorProcess;"
        "started = DetectorProcess('aruco', '36h11', 2.0, 480, 360);"
        "signal.signal(signal.SIGINT, signal.SIG_IGN); os.killpg(0, signal.SIGINT);"
        "print(started.search(np.zeros((360, 480), np.uint8), 0.0, {}), flush=True);"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-c", program]
    ended = subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, timeout=120, check=False, start_new_session=True
    )
    assert (ended.stdout.decode(), ended.returncode) == ("[]\n", -signal.SIGKILL)


class FakeConnection:
    """One end of a pipe, with what comes over it."""

    def __init__(self, *received):
        self.received, self.sent, self.polled_s = list(received), [], []

    def recv(self):
        if not self.received:
            raise EOFError
        return self.received.pop(0)

    def send(self, message):
        self.sent.append(message)

    def poll(self, timeout_s):
        self.polled_s.append(timeout_s)
        return False

    def close(self):
        self.sent.append("closed")


def make_memory(gray):
    memory = os.memfd_create("test")
    os.ftruncate(memory, gray.size)
    os.write(memory, gray.tobytes())
    return memory


def test_the_process_answers_with_what_it_finds():
    memory = make_memory(picture(100, 200))
    options = ("aruco", "36h11", 2.0, WIDTH_PX, HEIGHT_PX, 20.0)
    connection = FakeConnection(options, (0.0, {}), (0.1, {5: (119.5, 219.5, 40.0)}))
    with pytest.raises(EOFError):
        detector_process.serve(connection, memory)
    os.close(memory)
    ready, *answers = connection.sent
    assert ready is None
    for tag_ids, corners in nonempty(answers):
        assert tag_ids == [5] and corners.shape == (1, 4, 2)
        assert corners[0].mean(axis=0) == pytest.approx((119.5, 219.5), abs=0.5)
    assert len(answers) == 2


@pytest.mark.parametrize(
    ("backend", "fine", "smallest_px", "decimate"),
    [
        ("apriltag", ["fine 16h5"], 9.0, 1.5),
        ("aruco", [], 9.0, 1.5),
        ("aruco", [], 35.9, 1.5),
        ("aruco", [], 36.0, 2.25),
        ("aruco", [], 48.0, 3.0),
        ("aruco", [], math.inf, 1.5),
    ],
)
def test_only_apriltag_is_fine_and_large_tags_are_decimated(backend, fine, smallest_px, decimate, monkeypatch):
    made = []
    monkeypatch.setattr(detector_process, "create_detector", lambda *given: given)
    monkeypatch.setattr(detector_process, "create_fine_detectors", lambda family: ["fine " + family])
    monkeypatch.setattr(detector_process, "TagSearch", lambda *given: made.append(given))
    memory = make_memory(np.zeros((4, 6), np.uint8))
    with pytest.raises(EOFError):
        detector_process.serve(FakeConnection((backend, "16h5", 1.5, 6, 4, smallest_px)), memory)
    os.close(memory)
    assert made == [((backend, "16h5", decimate), 6, 4, fine, smallest_px)]


def test_a_detector_that_cannot_be_made_is_told_to_the_parent(monkeypatch):
    monkeypatch.setitem(sys.modules, "apriltag", None)
    memory, connection = make_memory(np.zeros((4, 6), np.uint8)), FakeConnection(("apriltag", "16h5", 1.5, 6, 4, 9.0))
    detector_process.serve(connection, memory)
    os.close(memory)
    (problem,) = connection.sent
    assert "apt install python3-apriltag" in problem


def test_the_process_ends_with_its_connection(monkeypatch):
    served, ends = [], [EOFError(), OSError(104, "Connection reset by peer"), ValueError("a bug")]

    def serve(connection, memory):
        served.append((connection, memory))
        raise ends.pop(0)

    monkeypatch.setattr(detector_process, "serve", serve)
    monkeypatch.setattr(detector_process, "Connection", lambda number: number)
    monkeypatch.setattr(sys, "argv", ["detector_process", "7", "8"])
    for _ in range(2):
        detector_process.main()
    with pytest.raises(ValueError, match="a bug"):
        detector_process.main()
    assert served == [(7, 8)] * 3


def test_a_process_that_hangs_is_named_and_killed():
    calls, connection = [], FakeConnection()

    class Hanging:
        def wait(self, timeout_s=None):
            calls.append(("wait", timeout_s))
            if timeout_s is not None:
                raise subprocess.TimeoutExpired("detector", timeout_s)

        def kill(self):
            calls.append("kill")

    hanging = DetectorProcess.__new__(DetectorProcess)
    hanging._connection, hanging._process = connection, Hanging()
    hanging._shape, hanging._frame = (2, 3), np.zeros((2, 3), np.uint8)
    with pytest.raises(DetectorError, match="did not answer for 60 s: start again"):
        hanging.search(np.full((2, 3), 7, np.uint8), 1.5, {3: (1.0, 2.0)})
    assert connection.sent == [(1.5, {3: (1.0, 2.0)}), "closed"] and connection.polled_s == [60.0]
    assert calls == [("wait", 5.0), "kill", ("wait", None)] and (hanging._frame == 7).all()
    with pytest.raises(DetectorError, match="has ended"):
        hanging.search(np.zeros((2, 3), np.uint8), 1.6, {})
