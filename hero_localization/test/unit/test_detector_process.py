"""The detector's process: same tags as in this process, wrong options named, ends with its parent, deaf to Ctrl-C."""

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
from hero_localization.tracking.detector_process import (
    DetectorProcess,
)
from hero_localization.tracking.detectors import create_detector
from hero_localization.tracking.tag_search import TagSearch

WIDTH_PX, HEIGHT_PX = 480, 360


def picture(left, top, tag_id=5):
    gray = np.full((HEIGHT_PX, WIDTH_PX), 255, np.uint8)
    cells = np.kron(draw_tag("36h11", tag_id), np.ones((5, 5), np.uint8))
    gray[top : top + len(cells), left : left + len(cells)] = cells
    return gray


@pytest.fixture
def process():
    started = DetectorProcess("aruco", "36h11", 2.0, WIDTH_PX, HEIGHT_PX)
    yield started
    started.close()


@pytest.mark.slow
def test_process_finds_what_a_search_in_this_process_does(process):
    search = TagSearch(create_detector("aruco", "36h11", 2.0), WIDTH_PX, HEIGHT_PX)
    for index in range(10):
        gray = picture(100 + 4 * index, 200 - 3 * index)
        expected, found = search.search(gray, index / 30.0), process.search(gray, index / 30.0, {})
        assert [tag.tag_id for tag in found] == [tag.tag_id for tag in expected]
        assert all((tag.corners == same.corners).all() for tag, same in zip(found, expected))
    assert [tag.tag_id for tag in found] == [5]


@pytest.mark.slow
def test_expected_places_go_over(process):
    for index in range(20):
        process.search(picture(60, 60), index / 30.0, {})
    (found,) = process.search(picture(400, 300), 20 / 30.0, {5: (419.5, 319.5)})
    assert found.center == pytest.approx((419.5, 319.5), abs=0.5)


@pytest.mark.slow
def test_process_answers_also_where_sockets_have_a_default_timeout():
    socket.setdefaulttimeout(60.0)  # as rospy does
    try:
        started = DetectorProcess("aruco", "36h11", 2.0, WIDTH_PX, HEIGHT_PX)
    finally:
        socket.setdefaulttimeout(None)
    found = [started.search(picture(100, 200), index / 5.0, {}) for index in range(3)]
    started.close()
    assert [tag.tag_id for tag in found[-1]] == [5]


@pytest.mark.slow
@pytest.mark.parametrize(("backend", "family", "words"), [("zbar", "36h11", "zbar"), ("aruco", "9h9", "9h9")])
def test_detector_that_cannot_be_made_is_named(backend, family, words):
    with pytest.raises(DetectorError, match=words):
        DetectorProcess(backend, family, 2.0, WIDTH_PX, HEIGHT_PX)


def test_process_that_died_is_named(process):
    process._process.kill()
    with pytest.raises(DetectorError, match="ended with status -9"):
        process.search(picture(60, 60), 0.0, {})
    with pytest.raises(DetectorError, match="has ended"):
        process.search(picture(60, 60), 0.1, {})


@pytest.mark.slow
def test_frame_of_another_size_is_refused(process):
    with pytest.raises(ValueError, match="480"):
        process.search(picture(60, 60)[:100], 0.0, {})


@pytest.mark.slow
def test_close_ends_the_process_and_is_safe_twice(process):
    process.close()
    assert process._process.returncode == 0
    process.close()


def run_program(lines):
    """Run a program that starts a detector's process, in a group of its own; return what it prints, and its status."""
    program = "import os, signal; import numpy as np;"
    program += "from hero_localization.tracking.detector_process import DetectorProcess;"
    program += "started = DetectorProcess('aruco', '36h11', 2.0, 480, 360);" + lines
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-c", program]
    ended = subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, timeout=120, check=False, start_new_session=True
    )
    return ended.stdout.decode(), ended.returncode


@pytest.mark.slow
def test_ctrl_c_in_the_terminal_leaves_the_process_to_its_parent():
    printed, status = run_program(
        "signal.signal(signal.SIGINT, signal.SIG_IGN); os.killpg(0, signal.SIGINT);"
        "print(started.search(np.zeros((360, 480), np.uint8), 0.0, {})); started.close()"
    )
    assert (printed, status) == ("[]\n", 0)


@pytest.mark.slow
def test_process_ends_when_its_parent_is_killed():
    """The child holds the parent's standard output: its end of file tells that both have ended."""
    assert run_program("print('up', flush=True); os.kill(os.getpid(), signal.SIGKILL)") == (
        "up\n",
        -signal.SIGKILL,
    )
