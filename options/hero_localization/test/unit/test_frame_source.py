"""Images from topics and videos become gray; what cannot be used or opened is named; the newest image counts."""

import ctypes
import os
import re
import subprocess
import sys
import threading

import cv2
import numpy as np
import pytest
import rospy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from hero_localization.camera import frame_source
from hero_localization.camera.device_controls import DeviceControls
from hero_localization.camera.frame_source import TopicSource, open_source
from hero_localization.errors import FrameSourceError

RATE_HZ = 10.0
SLOW_S = 2.5 / RATE_HZ
SHADES = (40, 80, 120, 160)
TIMEOUT_S = 30.0
GRAY = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20


@pytest.fixture(autouse=True)
def _ros_time():
    rospy.rostime.set_rostime_initialized(True)


@pytest.fixture
def receivers(monkeypatch):
    """Return what is called with the messages of each topic."""
    found = {}
    monkeypatch.setattr(rospy, "Subscriber", lambda topic, kind, receive, **options: found.update({topic: receive}))
    return found


@pytest.fixture
def source(receivers):
    source = TopicSource("/camera/image_raw")
    source.receive = receivers["/camera/image_raw"]
    return source


def make_image(encoding, channels, padding=2):
    rows = np.pad(np.repeat(GRAY, channels, axis=1), ((0, 0), (0, padding)))
    image = Image(height=3, width=4, encoding=encoding, step=rows.shape[1], data=rows.tobytes())
    image.header.stamp, image.header.seq = rospy.Time(7), 9
    return image


@pytest.mark.parametrize(("encoding", "channels"), [("mono8", 1), ("bgr8", 3), ("rgb8", 3), ("bgra8", 4)])
def test_pictures_become_gray(source, encoding, channels):
    source.receive(make_image(encoding, channels))
    frame = source.poll(0.0)
    assert (source.problem, frame.stamp_s, frame.number) == ("", 7.0, 9)
    np.testing.assert_array_equal(frame.gray, GRAY)


def test_unknown_encodings_are_named_until_a_usable_picture_comes(source):
    source.receive(make_image("bayer_rggb8", 1))
    assert source.poll(0.0) is None and "'bayer_rggb8', but must have one of mono8, " in source.problem
    source.receive(make_image("mono8", 1))
    assert source.poll(0.0) is not None and source.problem == ""


@pytest.mark.parametrize("change", [{"data": b"\0" * 10}, {"step": 3}, {"width": 0}, {"height": 0}])
def test_pictures_with_too_few_bytes_are_named(source, change):
    image = make_image("mono8", 1)
    for name, value in change.items():
        setattr(image, name, value)
    source.receive(image)
    text = "images of %d x %d pixels come with %d bytes" % (image.width, image.height, len(image.data))
    assert source.poll(0.0) is None and source.problem.startswith(text)


def test_compressed_pictures_are_decoded_and_broken_ones_named(receivers):
    source = TopicSource("/camera/image_raw/compressed")
    receive = receivers["/camera/image_raw/compressed"]
    for data in (b"", b"no image"):
        receive(CompressedImage(format="jpeg", data=data))
        assert source.poll(0.0) is None and "of the format 'jpeg' cannot be decoded" in source.problem
    message = CompressedImage(format="png", data=cv2.imencode(".png", GRAY)[1].tobytes())
    message.header.stamp = rospy.Time(7)
    receive(message)
    np.testing.assert_array_equal(source.poll(0.0).gray, GRAY)
    assert source.problem == ""


def test_only_the_newest_picture_is_decoded_and_counts_once(source):
    source.receive(make_image("bayer_rggb8", 1))
    source.receive(make_image("mono8", 1))
    assert source.poll(0.0) is not None and source.problem == ""
    assert source.poll(0.0) is None


def test_the_time_of_arrival_is_that_of_the_newest_picture(source, monkeypatch):
    monkeypatch.setattr(rospy, "get_time", lambda: 1234.5)
    source.receive(make_image("mono8", 1))
    assert source.arrived_s == 1234.5


def test_camera_info_beside_the_pictures_tells_the_lens(receivers):
    for topic in ("/camera/image_raw", "/camera/image_raw/compressed"):
        source = TopicSource(topic)
        receive = receivers["/camera/camera_info"]
        assert source.lens is None
        matrix = [900.0, 0.0, 320.0, 0.0, 901.0, 240.0, 0.0, 0.0, 1.0]
        receive(CameraInfo(width=640, height=480, K=matrix, distortion_model="plumb_bob", D=[0.1] * 5))
        assert (source.lens.width_px, source.lens.height_px, source.lens.matrix[1, 1]) == (640, 480, 901.0)
        receive(CameraInfo())
        assert source.lens is None, "one that is not calibrated"


def test_pictures_without_a_stamp_are_as_new_as_now(source, monkeypatch):
    monkeypatch.setattr(rospy, "get_rostime", lambda: rospy.Time(99))
    image = make_image("mono8", 1)
    image.header.stamp = rospy.Time(0)
    source.receive(image)
    assert source.poll(0.0).stamp_s == 99.0


def count_page_faults(prepare):
    """Return how many pages a process maps to hold four copies of a 4K image in color once more."""
    program = (
        "import resource\nfrom hero_localization.camera.frame_source import keep_freed_memory\n%s\n"
        "def count():\n    len([b'x' * 24883200 for _ in range(4)])\n"
        "    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        "count()\nbefore = count()\nprint(count() - before)"
    )
    return int(subprocess.check_output([sys.executable, "-c", program % prepare]))


def test_the_memory_of_an_image_is_kept_for_the_next_one(receivers, monkeypatch):
    if not hasattr(ctypes.CDLL(None), "mallopt"):
        pytest.skip("not with glibc")
    assert count_page_faults("") > 1000 > 100 > count_page_faults("keep_freed_memory()")
    kept = []
    monkeypatch.setattr(frame_source, "keep_freed_memory", lambda: kept.append(True))
    TopicSource("/camera/image_raw")
    assert kept


@pytest.fixture
def clock(monkeypatch):
    """Return the time of a clock that only goes on while somebody sleeps, and how far ROS is ahead, in a list."""
    now_s = [100.0, 0.0]

    def sleep(duration_s):
        now_s[0] += duration_s

    monkeypatch.setattr(frame_source, "read_duration_clock_s", lambda: now_s[0])
    monkeypatch.setattr(rospy, "get_time", lambda: now_s[0] + now_s[1])
    monkeypatch.setattr(frame_source.time, "sleep", sleep)
    return now_s


@pytest.fixture
def video(clock, tmp_path, monkeypatch):
    """Return a video of four shades in the home directory."""
    monkeypatch.setenv("HOME", str(tmp_path))
    writer = cv2.VideoWriter(str(tmp_path / "arena.avi"), cv2.VideoWriter_fourcc(*"MJPG"), RATE_HZ, (64, 48))
    for shade in SHADES:
        writer.write(np.full((48, 64, 3), shade, np.uint8))
    writer.release()
    source = open_source("", "~/arena.avi", "1920x1080", 30.0, DeviceControls())
    yield source
    source.close()
    source.close()


def test_a_video_is_played_on_when_the_clock_is_set(video, clock):
    for ahead_s in (0.0, -3600.0, 7200.0, 0.0):
        clock[1] = ahead_s
        assert video.poll(TIMEOUT_S).stamp_s == video.arrived_s == clock[0] + ahead_s
    assert clock[0] - 100.0 < len(SHADES) / RATE_HZ + 0.01


def test_a_video_is_played_in_real_time_to_its_end(video, clock, tmp_path):
    frames = [video.poll(TIMEOUT_S) for _ in SHADES]
    assert [frame.gray.shape for frame in frames] == [(48, 64)] * len(SHADES)
    assert np.allclose([frame.gray.mean() for frame in frames], SHADES, atol=3.0)
    assert np.allclose(np.diff([frame.stamp_s for frame in frames]), 1.0 / RATE_HZ, atol=1e-4)
    assert video.arrived_s == frames[-1].stamp_s == clock[0]
    assert video.poll(TIMEOUT_S) is None
    assert clock[0] == pytest.approx(frames[-1].stamp_s + TIMEOUT_S)
    assert video.problem == "%s gives no more images: the video has ended" % (tmp_path / "arena.avi")


def test_a_picture_of_a_video_that_is_due_later_comes_later(video, clock):
    first_s = video.poll(TIMEOUT_S).stamp_s
    assert video.poll(0.4 / RATE_HZ) is None
    assert clock[0] == pytest.approx(first_s + 0.4 / RATE_HZ)
    assert video.poll(TIMEOUT_S).stamp_s == pytest.approx(first_s + 1.0 / RATE_HZ, abs=1e-4)


def test_a_video_waits_for_a_slow_program(video, clock):
    stamps_s, numbers = [], []
    for _ in SHADES:
        frame = video.poll(TIMEOUT_S)
        stamps_s.append(frame.stamp_s)
        numbers.append(frame.number)
        clock[0] += SLOW_S
    assert numbers == list(range(len(SHADES)))
    assert np.allclose(np.diff(stamps_s), SLOW_S)


@pytest.mark.parametrize(
    ("device", "reason"),
    [
        ("/dev/video-of-nobody", "does not exist; ls /dev/video* lists cameras"),
        ("{folder}/arena.avi", "does not exist"),
        ("{folder}", "is a folder, but must be a camera or a video"),
        ("{folder}/pipe", "is a pipe, socket or file of another kind, but must be a video file"),
        ("/dev/../{folder}/pipe", "is a pipe, socket or file of another kind, but must be a camera"),
        (__file__, "cannot be opened: no video that OpenCV can read"),
        ("/dev/null", "cannot be opened: no camera, or another program uses it"),
    ],
)
def test_what_cannot_be_opened_is_told_with_the_reason(tmp_path, device, reason):
    device = device.format(folder=tmp_path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FrameSourceError, match=re.escape("%s %s" % (device, reason))):
        open_source("", device, "640x480", 30.0, DeviceControls())


def test_topics_are_subscribed_by_their_kind(monkeypatch):
    for topic, kind in (("/camera/image_raw", Image), ("/camera/image_raw/compressed", CompressedImage)):
        kinds = {}
        monkeypatch.setattr(rospy, "Subscriber", lambda name, kind, receive, **_: kinds.update({name: kind}))  # noqa: B023
        TopicSource(topic)
        assert kinds == {topic: kind, "/camera/camera_info": CameraInfo}


def test_a_source_came_last_when_it_was_opened(source, monkeypatch, receivers):
    monkeypatch.setattr(rospy, "get_time", lambda: 77.0)
    assert TopicSource("/camera/image_raw").arrived_s == 77.0
    assert source.lens is None and source.problem == source.warning == ""


def test_an_image_is_waited_for(source):
    thread = threading.Timer(0.0, source.receive, (make_image("mono8", 1),))
    thread.start()
    assert source.poll(TIMEOUT_S).number == 9
    thread.join()


def test_colors_are_weighed_as_eyes_do(source):
    for encoding, channels, red in (("rgb8", 3, 0), ("bgr8", 3, 2), ("8UC3", 3, 2), ("rgba8", 4, 0), ("bgra8", 4, 2)):
        image = make_image(encoding, channels)
        rows = np.zeros((3, image.step), np.uint8)
        rows[:, red : 4 * channels : channels] = 200
        image.data = rows.tobytes()
        source.receive(image)
        assert set(source.poll(0.0).gray.ravel()) == {60}, encoding
    source.receive(make_image("8UC1", 1))
    np.testing.assert_array_equal(source.poll(0.0).gray, GRAY)


def test_an_image_may_fill_its_rows_and_its_bytes_exactly(source):
    image = make_image("mono8", 1, padding=0)
    source.receive(image)
    np.testing.assert_array_equal(source.poll(0.0).gray, GRAY)
    image.data += b"more"
    source.receive(image)
    np.testing.assert_array_equal(source.poll(0.0).gray, GRAY)


@pytest.mark.parametrize("size_px", ["1920", "1920x", "x1080", "1920x1080x3", "1920 x -1", "largexsmall"])
def test_a_size_that_is_none_is_named(size_px):
    with pytest.raises(FrameSourceError, match="the size of images is '%s', but must be such as 1920x1080" % size_px):
        open_source("", "/dev/null", size_px, 30.0, DeviceControls())


def test_a_video_that_comes_too_late_goes_on_from_then(video, clock):
    first = video.poll(TIMEOUT_S)
    clock[0] += 5.0
    second, third = video.poll(TIMEOUT_S), video.poll(TIMEOUT_S)
    assert second.stamp_s == first.stamp_s + 5.0
    assert third.stamp_s == pytest.approx(second.stamp_s + 1.0 / RATE_HZ, abs=1e-4)


def test_a_device_or_an_address_is_opened_with_the_size_asked_for(monkeypatch):
    opened = []
    monkeypatch.setattr(frame_source, "DeviceSource", lambda *given: opened.append(given))
    for device in ("/dev/video0", "rtsp://camera/1"):
        open_source("", device, " 640 x 480", 15.0, DeviceControls())
    assert opened == [(device, (640, 480), 15.0, DeviceControls()) for device in ("/dev/video0", "rtsp://camera/1")]


def test_what_may_not_be_read_is_named_with_a_remedy_for_devices(monkeypatch, tmp_path):
    monkeypatch.setattr(frame_source.os, "access", lambda path, mode: False)
    with pytest.raises(FrameSourceError, match="/dev/null may not be read by this user: sudo usermod -aG video"):
        open_source("", "/dev/null", "640x480", 30.0, DeviceControls())
    with pytest.raises(FrameSourceError, match="may not be read by this user$"):
        open_source("", __file__, "640x480", 30.0, DeviceControls())
