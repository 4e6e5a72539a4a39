"""Images from topics become gray; what cannot be used or opened is named; the newest image counts."""

import ctypes
import io
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
from hero_localization.camera.frame_source import MAX_HEAD_BYTES, TopicSource, UncopiedImage, open_source
from hero_localization.errors import FrameSourceError

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


@pytest.mark.parametrize(("rows", "frame_id"), [(3, "camera"), (3, ""), (MAX_HEAD_BYTES, "c" * 300), (0, "camera")])
def test_the_data_of_a_message_is_not_copied(source, rows, frame_id):
    sent = Image(height=rows, width=4, encoding="mono8", step=4, data=bytes(index % 251 for index in range(4 * rows)))
    sent.header.stamp, sent.header.seq, sent.header.frame_id = rospy.Time(7, 5), 9, frame_id
    stream = io.BytesIO()
    sent.serialize(stream)
    received = UncopiedImage().deserialize(stream.getvalue())
    assert isinstance(received.data, memoryview) and bytes(received.data) == sent.data
    for field in ("header", "height", "width", "encoding", "is_bigendian", "step"):
        assert getattr(received, field) == getattr(sent, field)
    source.receive(received)
    frame = source.poll(0.0)
    assert (frame is None) == (rows == 0) and (frame is None or frame.gray.tobytes() == sent.data)


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
        assert source.lens is None and source.lens_problem == "", "one that is not calibrated"
        receive(CameraInfo(width=640, height=480, K=matrix, distortion_model="plumb_bob", D=[0.1] * 3))
        assert source.lens is None and source.lens_problem.startswith("camera_info: a lens of the model 'plumb_bob'")
        receive(CameraInfo(width=640, height=480, K=matrix, distortion_model="plumb_bob", D=[0.1] * 5))
        assert source.lens is not None and source.lens_problem == ""


def test_pictures_without_a_stamp_are_as_new_as_now(source, monkeypatch):
    monkeypatch.setattr(rospy, "get_rostime", lambda: rospy.Time(99))
    image = make_image("mono8", 1)
    image.header.stamp = rospy.Time(0)
    source.receive(image)
    assert source.poll(0.0).stamp_s == 99.0


def count_page_faults():
    """Return how many pages a process maps to hold four copies of a 4K image in color once more, and kept ones."""
    program = (
        "import resource\nfrom hero_localization.camera.frame_source import keep_freed_memory\n"
        "def count():\n    len([b'x' * 24883200 for _ in range(4)])\n"
        "    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        "count()\nbefore = count()\nprint(count() - before)\n"
        "keep_freed_memory()\ncount()\nbefore = count()\nprint(count() - before)"
    )
    return map(int, subprocess.check_output([sys.executable, "-c", program]).split())


@pytest.mark.slow
def test_the_memory_of_an_image_is_kept_for_the_next_one(receivers, monkeypatch):
    if not hasattr(ctypes.CDLL(None), "mallopt"):
        pytest.skip("not with glibc")
    given_back, kept_for_next = count_page_faults()
    assert given_back > 1000 > 100 > kept_for_next
    kept = []
    monkeypatch.setattr(frame_source, "keep_freed_memory", lambda: kept.append(True))
    TopicSource("/camera/image_raw")
    assert kept


@pytest.mark.parametrize(
    ("device", "reason"),
    [
        ("/dev/video-unplugged", "is no camera, or not plugged in; ls /dev/video* lists cameras"),
        ("/dev/", "is no camera, or not plugged in; ls /dev/video* lists cameras"),
        ("/dev/../{folder}/pipe", "is no camera, or not plugged in; ls /dev/video* lists cameras"),
        ("http://127.0.0.1:1/none", "cannot be opened: no camera, or another program uses it"),
        ("/dev/null", "cannot be opened: no camera, or another program uses it"),
    ],
)
def test_what_cannot_be_opened_is_told_with_the_reason(tmp_path, device, reason):
    device = device.format(folder=tmp_path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FrameSourceError, match=re.escape("%s %s" % (device, reason))):
        open_source("", device, "640x480", 30.0, DeviceControls())


def test_a_device_that_is_neither_in_dev_nor_an_address_is_refused():
    with pytest.raises(FrameSourceError, match="the device is 'video0', but must be such as /dev/video0, or a URL"):
        open_source("", "video0", "640x480", 30.0, DeviceControls())


def test_topics_are_subscribed_by_their_kind(monkeypatch):
    for topic, kind in (("/camera/image_raw", UncopiedImage), ("/camera/image_raw/compressed", CompressedImage)):
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


def test_a_device_or_an_address_is_opened_with_the_size_asked_for(monkeypatch):
    opened = []
    monkeypatch.setattr(frame_source, "DeviceSource", lambda *given: opened.append(given))
    for device in ("/dev/video0", "rtsp://camera/1"):
        open_source("", device, " 640 x 480", 15.0, DeviceControls())
    assert opened == [(device, (640, 480), 15.0, DeviceControls()) for device in ("/dev/video0", "rtsp://camera/1")]


def test_what_may_not_be_read_is_named_with_a_remedy(monkeypatch):
    monkeypatch.setattr(frame_source.os, "access", lambda path, mode: False)
    with pytest.raises(FrameSourceError, match="/dev/null may not be read by this user: sudo usermod -aG video"):
        open_source("", "/dev/null", "640x480", 30.0, DeviceControls())
