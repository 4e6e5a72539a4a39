"""Cameras as recorded: stamps, damaged images, reads that hang, devices that vanish; and their controls."""

import threading
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import rospy

from hero_localization.camera import device_controls, frame_source
from hero_localization.camera.device_controls import DeviceControls
from hero_localization.camera.frame_source import DeviceSource, FrameSource

SIZE_PX = (64, 48)
TIMEOUT_S = 30.0
DEVICE = "/dev/null"
"""Exists, and is no camera."""

BOOTED_S = 1e9
"""ROS time at 0 s of the clock that stamps images."""

DAMAGED = None
ODD = np.zeros((24, 64, 3), np.uint8)


def image(shade):
    return np.full((48, 64, 3), shade, np.uint8)


class Recording:
    """Stands in for cv2.VideoCapture: what read() gave, by openings; each opening after the last one fails.

    A read is (s since the one before, image, stamp in s of the monotonic clock); an opening of None fails.
    """

    def __init__(self, *openings):
        self.openings, self.reads, self.opened, self.now_s = list(openings), [], 0, 100.0
        self.kept, self.is_played, self.stamp_s = [], threading.Event(), 0.0
        self.is_taken = False

    def __call__(self, path, backend):
        if not self.openings:
            self.is_played.set()
        self.reads = self.openings.pop(0) if self.openings else None
        if self.is_taken:  # a device opens for one at a time
            self.reads = None
        self.opened += self.isOpened()
        self.is_taken = self.is_taken or self.isOpened()
        return self

    def isOpened(self):  # noqa: N802 - OpenCV's name
        return self.reads is not None

    def set(self, name, value):
        pass

    def get(self, name):
        return 1e3 * self.stamp_s

    def read(self):
        if not self.reads:
            return False, None
        after_s, picture, self.stamp_s = self.reads.pop(0)
        self.now_s += after_s
        return picture is not None, picture

    def release(self):
        self.is_taken = False

    def keep(self, source, picture):
        stamp_s, gray, number = picture
        self.kept.append((round(stamp_s - BOOTED_S, 3), int(gray.mean()), number))


@pytest.fixture
def play(monkeypatch):
    """Return a function that plays openings to their end, and returns the recording and the source."""

    def run(*openings, path="rtsp://camera", controls=DeviceControls(), min_backoff_s=0.0):  # noqa: B008
        recording = Recording(*openings)
        monkeypatch.setattr(frame_source.cv2, "VideoCapture", recording)
        monkeypatch.setattr(frame_source.time, "monotonic", lambda: recording.now_s)
        monkeypatch.setattr(rospy, "get_time", lambda: BOOTED_S + recording.now_s)
        monkeypatch.setattr(FrameSource, "_keep", lambda source, picture: recording.keep(source, picture))
        monkeypatch.setattr(frame_source, "MIN_BACKOFF_S", min_backoff_s)
        source = DeviceSource(path, SIZE_PX, 30.0, controls)
        try:
            assert recording.is_played.wait(TIMEOUT_S)
        finally:
            source.close()
            source.close()
        return recording, source

    return run


def test_images_bear_the_time_at_which_they_were_taken(play):
    recording, _ = play([(1.0, image(10), 100.97), (1.0, image(20), 101.96)])
    assert recording.kept == [(100.97, 10, 0), (101.96, 20, 1)]


@pytest.mark.parametrize("stamp_s", [0.0, 1.7e9, float("nan"), 102.0])
def test_stamps_of_another_clock_count_as_the_time_of_arrival(play, stamp_s):
    recording, _ = play([(1.0, image(10), stamp_s)])
    assert recording.kept == [(101.0, 10, 0)]


def test_damaged_images_are_left_out_without_opening_the_camera_again(play):
    reads = [(1.0, image(10), 0), (0.1, DAMAGED, 0), (0.1, ODD, 0), (0.1, DAMAGED, 0), (0.1, image(20), 0)]
    recording, _ = play(reads)
    assert (recording.kept, recording.opened) == ([(101.0, 10, 0), (101.4, 20, 4)], 1)


def test_three_damaged_images_are_left_out_after_each_opening(play):
    hanging, damaged = (10.0, DAMAGED, 0), (0.1, DAMAGED, 0)
    recording, _ = play([hanging], [damaged] * 3 + [(0.1, image(20), 0)], [(0.1, image(30), 0)])
    assert ([shade for _, shade, _ in recording.kept], recording.opened) == ([20, 30], 3)


def test_a_read_that_hangs_opens_the_camera_again_at_once(play):
    recording, _ = play([(1.0, image(10), 0), (10.0, DAMAGED, 0), (0.1, image(15), 0)], [(1.0, image(20), 0)])
    assert [shade for _, shade, _ in recording.kept] == [10, 20]


def test_a_camera_that_vanishes_is_opened_again_until_it_gives_images(play):
    recording, source = play([(1.0, image(10), 0)], None, [], None, [(1.0, image(20), 0)])
    assert [shade for _, shade, _ in recording.kept] == [10, 20]
    assert source.problem.startswith("rtsp://camera cannot be opened")


class Camera:
    """The kernel's side of a camera with these controls; it takes values in steps, or not at all."""

    def __init__(self, **controls):
        self.values = {getattr(device_controls, name): value for name, value in controls.items()}
        self.steps, self.fixed = {}, set()

    def ioctl(self, device, request, data):
        control, value = device_controls._CONTROL.unpack(data)
        if control not in self.values:
            raise OSError(22, "Invalid argument")
        if request == 0xC008561C and control not in self.fixed:
            step = self.steps.get(control, 1)
            self.values[control] = value // step * step
        device_controls._CONTROL.pack_into(data, 0, control, self.values[control])


UVC = {"AUTO_EXPOSURE": 3, "EXPOSURE": 250, "AUTO_EXPOSURE_RATE": 1, "GAIN": 7, "FOCUS": 5}
UVC["AUTO_FOCUS"] = 1


@pytest.fixture
def warn(play, monkeypatch):
    """Return a function that opens a camera twice with these controls, and returns the warning."""

    def run(camera, *controls):
        monkeypatch.setattr(device_controls.fcntl, "ioctl", camera.ioctl)
        reads = [(1.0, image(10), 0)]
        return play(reads, list(reads), path=DEVICE, controls=DeviceControls(*controls))[1].warning

    return run


def test_a_camera_takes_the_controls_of_its_file(warn):
    camera = Camera(**UVC)
    assert warn(camera, 0.008, 30, 10) == ""
    taken = {"AUTO_EXPOSURE": 1, "EXPOSURE": 80, "AUTO_EXPOSURE_RATE": 0, "GAIN": 30, "FOCUS": 10}
    assert camera.values == Camera(**taken, AUTO_FOCUS=0).values


def test_automatic_exposure_and_focus_are_named_with_a_remedy(warn):
    assert warn(Camera(**UVC)) == (
        "the camera changes its exposure by itself: set exposure_s, such as 0.008, in the camera file; "
        "the camera changes its focus by itself: set focus in the camera file, then calibrate the lens"
    )
    assert warn(Camera(**{**UVC, "AUTO_EXPOSURE": 1, "AUTO_FOCUS": 0})) == warn(Camera()) == ""


def test_what_a_camera_makes_of_its_controls_is_read_back(warn):
    camera = Camera(**{name: value for name, value in UVC.items() if name != "GAIN"})
    camera.steps[device_controls.EXPOSURE] = 50
    camera.fixed = {device_controls.AUTO_FOCUS}
    assert warn(camera, 0.008, 30, 10).split("; ") == [
        "exposure_s: the camera has 0.005, not 0.008",
        "the camera has no gain to set: take it out of the camera file",
        "the camera changes its focus by itself: set focus in the camera file, then calibrate the lens",
    ]


def test_a_device_that_is_no_camera_has_no_controls():
    for request in (device_controls.SET_CONTROL, device_controls.GET_CONTROL):
        assert device_controls.call_control(DEVICE, request, device_controls.GAIN, 3) is None


def test_a_control_that_a_camera_lacks_leaves_no_file_open(monkeypatch):
    files = SimpleNamespace(open=lambda path, flags: 77, close=lambda file: closed.append(file), O_RDWR=2, O_NONBLOCK=0)
    closed = []
    monkeypatch.setattr(device_controls, "os", files)
    monkeypatch.setattr(device_controls.fcntl, "ioctl", Camera(GAIN=7).ioctl)
    found = [
        device_controls.call_control(DEVICE, device_controls.GET_CONTROL, control)
        for control in (device_controls.GAIN, device_controls.FOCUS)
    ]
    assert (found, closed) == ([7, None], [77, 77])


def test_a_camera_is_asked_for_small_images_of_one_size_and_rate(play, monkeypatch):
    asked, backends = {}, []
    monkeypatch.setattr(Recording, "set", lambda self, name, value: asked.update({name: value}))
    opened = Recording.__call__

    def open_recording(self, path, backend):
        backends.append((path, backend))
        return opened(self, path, backend)

    monkeypatch.setattr(Recording, "__call__", open_recording)
    play([(1.0, image(10), 0)], path="rtsp://camera")
    assert asked == {
        cv2.CAP_PROP_FOURCC: cv2.VideoWriter_fourcc(*"MJPG"), cv2.CAP_PROP_FRAME_WIDTH: 64,
        cv2.CAP_PROP_FRAME_HEIGHT: 48, cv2.CAP_PROP_FPS: 30.0, cv2.CAP_PROP_BUFFERSIZE: 2,
    }  # fmt: skip
    assert backends[0] == ("rtsp://camera", cv2.CAP_ANY)
    backends.clear()
    play([(1.0, image(10), 0)], path=DEVICE)
    assert backends[0] == (DEVICE, cv2.CAP_V4L2)


@pytest.mark.parametrize(("age_s", "stamp_s"), [(0.0, 101.0), (4.9, 96.1), (5.1, 101.0), (-0.1, 101.0)])
def test_an_image_is_at_most_five_seconds_old(play, age_s, stamp_s):
    recording, _ = play([(1.0, image(10), 101.0 - age_s)])
    assert recording.kept == [(stamp_s, 10, 0)]


@pytest.mark.parametrize(("slow_s", "failures", "opened"), [(0.1, 3, 1), (0.1, 4, 2), (0.9, 3, 1), (1.1, 1, 2)])
def test_four_failures_or_one_second_end_a_camera(play, slow_s, failures, opened):
    reads = [(0.1, DAMAGED, 0), (0.1, image(10), 0), *[(slow_s, DAMAGED, 0)] * failures, (0.1, image(20), 0)]
    recording, _ = play(reads, [(0.1, image(30), 0)])
    assert [shade for _, shade, _ in recording.kept] == ([10, 20, 30] if opened == 1 else [10, 30])


def test_a_camera_that_stays_away_is_opened_less_and_less_often(play, monkeypatch):
    waits_s = []

    class Ending(threading.Event):
        def wait(self, timeout=None):
            waits_s.append(timeout)
            return False

    threads = SimpleNamespace(Event=Ending, Thread=threading.Thread, Condition=threading.Condition)
    monkeypatch.setattr(frame_source, "threading", threads)
    play([(0.1, image(10), 0)], *[None] * 6, [(0.1, image(20), 0)], None, None, min_backoff_s=0.5)
    assert waits_s[:9] == [0.5, 1.0, 2.0, 4.0, 8.0, 8.0, 8.0, 0.5, 1.0]


def test_an_image_of_another_size_is_taken_after_a_camera_was_opened_again(play):
    recording, source = play([(0.1, image(10), 0)], [(0.1, ODD, 0)])
    assert [shade for _, shade, _ in recording.kept] == [10, 0]
    gray = DeviceSource._decode(source, (7.0, image(30), 4))
    assert (gray.stamp_s, gray.gray.shape, gray.number) == (7.0, (48, 64), 4)
