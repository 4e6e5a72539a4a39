"""Images of one camera, gray, with the time at which they were taken: from topics, a V4L2 device or a URL."""

import ctypes
import itertools
import os
import stat
import threading
import time
from typing import Any, NamedTuple, Optional, Tuple

import cv2
import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from ..errors import FrameSourceError
from .camera_model import Intrinsics
from .device_controls import DeviceControls, apply_controls

_ENCODINGS = {
    "mono8": (1, None),
    "8UC1": (1, None),
    "bgr8": (3, cv2.COLOR_BGR2GRAY),
    "8UC3": (3, cv2.COLOR_BGR2GRAY),
    "rgb8": (3, cv2.COLOR_RGB2GRAY),
    "bgra8": (4, cv2.COLOR_BGRA2GRAY),
    "rgba8": (4, cv2.COLOR_RGBA2GRAY),
}
"""Bytes of a pixel, and what makes it gray."""

_DEVICES = "/dev/"
_URL = "://"

PLAUSIBLE_AGE_S = 5.0
"""V4L2 stamps its buffers by the clock that does not jump; a time that is further from it is of another clock."""

MAX_FAILURES, HANG_S = 4, 1.0
"""Reads in a row without a whole image, or time of one read, that end a camera; a cable damages some images."""

MIN_BACKOFF_S, MAX_BACKOFF_S = 0.5, 8.0
"""Time between two attempts to open a camera that ended."""

READ_BYTES = 2**20
"""At once: of an image in smaller parts, each costs a turn of the interpreter; a larger buffer costs page faults."""

MAX_HEAD_BYTES = 2**14
"""Length of an image's message before its data, at most: the names of frame and encoding."""

_MEMORY = ((-3, 2**25), (-1, 2**29), (-8, 1))
"""Options of glibc's mallopt: M_MMAP_THRESHOLD, M_TRIM_THRESHOLD (bytes), M_ARENA_MAX."""


class Frame(NamedTuple):
    """One image (H, W), 8 bit, and the ROS time at which it was taken.

    number: among the source's images: gaps are those that did not get here.
    """

    stamp_s: float
    gray: np.ndarray
    number: int


class FrameSource:
    """Live images of a camera: only the newest is kept, and only images that are polled are decoded.

    lens: the intrinsics in camera_info; None without it.
    lens_problem: why they cannot be used; empty if they can, or there are none.
    problem: why there are no usable images, for users; empty if there are.
    warning: what may spoil images that come, for users; empty if nothing is known.
    arrived_s: when the newest image came; before, when the source was opened.
    """

    def __init__(self) -> None:
        self.lens: Optional[Intrinsics] = None
        self.problem = self.warning = self.lens_problem = ""
        self.arrived_s = rospy.get_time()
        self._arrival = threading.Condition()
        self._newest: Any = None

    def _keep(self, received: Any) -> None:
        """Keep an image that arrived on another thread, instead of one that was not polled yet."""
        self.arrived_s = rospy.get_time()
        with self._arrival:
            self._newest = received
            self._arrival.notify()

    def poll(self, timeout_s: float) -> Optional[Frame]:
        """Return the newest image, unless an earlier call did; None if none comes in time or is usable."""
        with self._arrival:
            if self._newest is None:
                self._arrival.wait(timeout_s)
            received, self._newest = self._newest, None
        return None if received is None else self._decode(received)

    def _decode(self, received: Any) -> Optional[Frame]:
        raise NotImplementedError

    def close(self) -> None:
        """Close the camera; may be called twice. Topics end with the node."""


def keep_freed_memory() -> None:
    """Keep memory of this process that images have used for the next ones.

    rospy copies each image three times, of which new memory, mapped page by page, takes two thirds of the time.
    """
    mallopt: Any = getattr(ctypes.CDLL(None), "mallopt", None)
    for option, value in _MEMORY if mallopt else ():  # other C libraries have none
        mallopt(option, value)


class UncopiedImage(Image):  # type: ignore[misc]
    """A sensor_msgs/Image whose data is a part of the message as it came: a copy takes a third of receiving it."""

    def deserialize(self, data: bytes) -> "UncopiedImage":
        """Take the fields of a message, of which the data comes last."""
        super().deserialize(data[:MAX_HEAD_BYTES])
        self.data: Any = memoryview(data)[min(len(data), MAX_HEAD_BYTES) - len(self.data) :]
        return self


class TopicSource(FrameSource):
    """Subscription to the images and camera_info of a camera driver."""

    def __init__(self, topic: str) -> None:
        """topic: sensor_msgs/Image, or CompressedImage if it ends in /compressed; camera_info lies beside it."""
        super().__init__()
        keep_freed_memory()
        self._is_compressed = topic.endswith("/compressed")
        kind = CompressedImage if self._is_compressed else UncopiedImage
        rospy.Subscriber(topic, kind, self._keep, queue_size=1, buff_size=READ_BYTES, tcp_nodelay=True)
        base = topic[: -len("/compressed")] if self._is_compressed else topic
        rospy.Subscriber(base.rpartition("/")[0] + "/camera_info", CameraInfo, self._read_info, queue_size=1)

    def _read_info(self, info: CameraInfo) -> None:
        try:
            self.lens = Intrinsics.from_camera_info(info.width, info.height, info.K, info.distortion_model, info.D)
            self.lens_problem = ""
        except ValueError as error:
            self.lens = None  # the file's lens counts
            self.lens_problem = f"camera_info: {error}" if info.K[0] > 0.0 else ""

    def _decode(self, received: Any) -> Optional[Frame]:
        gray = self._decode_jpeg(received) if self._is_compressed else self._decode_image(received)
        if gray is None:
            return None
        self.problem = ""
        header = received.header
        return Frame((header.stamp if header.stamp else rospy.get_rostime()).to_sec(), gray, header.seq)

    def _decode_image(self, message: Image) -> Optional[np.ndarray]:
        channels, code = _ENCODINGS.get(message.encoding, (0, None))
        if not channels:
            self.problem = (
                f"images have the encoding {message.encoding!r}, but must have one of {', '.join(_ENCODINGS)}"
            )
            return None
        size = message.step * message.height
        if not 0 < message.width * channels <= message.step or not 0 < size <= len(message.data):
            text = "images of %d x %d pixels come with %d bytes: is the camera's driver in order?"
            self.problem = text % (message.width, message.height, len(message.data))
            return None
        rows = np.frombuffer(message.data, np.uint8, size).reshape(message.height, message.step)
        image = rows[:, : message.width * channels].reshape(message.height, message.width, channels)
        return image[:, :, 0] if code is None else cv2.cvtColor(image, code)

    def _decode_jpeg(self, message: CompressedImage) -> Optional[np.ndarray]:
        data = np.frombuffer(message.data, np.uint8)
        gray: Optional[np.ndarray] = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if len(data) else None
        if gray is None:
            text = f"compressed images of the format {message.format!r} cannot be decoded"
            self.problem = text + ": is the camera's driver in order?"
        return gray


class DeviceSource(FrameSource):
    """A V4L2 device such as /dev/video0, or the URL of a network camera; opened again whenever it ends."""

    def __init__(self, path: str, size_px: Tuple[int, int], rate_hz: float, controls: DeviceControls) -> None:
        """size_px: width and height to ask the device for. Raises: FrameSourceError if it cannot be opened."""
        super().__init__()
        self._path, self._size_px, self._rate_hz, self._controls = path, size_px, rate_hz, controls
        self._capture = self._open()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._read, name="camera", daemon=True)
        self._thread.start()

    def _open(self) -> Any:
        capture = _open_capture(self._path)
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter_fourcc(*"MJPG"))
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._size_px[0])
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._size_px[1])
        capture.set(cv2.CAP_PROP_FPS, self._rate_hz)
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 2)
        return capture

    def _read(self) -> None:
        shape: Optional[Tuple[int, ...]] = None
        backoff_s, failures = MIN_BACKOFF_S, 0
        for number in itertools.count():
            if self._ending.is_set():
                return
            asked_s = time.monotonic()
            is_read, image = self._capture.read()
            if is_read and image.size and image.shape == (shape or image.shape):
                age_s = time.monotonic() - self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0
                age_s = age_s if 0.0 <= age_s < PLAUSIBLE_AGE_S else 0.0  # the device may not tell
                self._keep((rospy.get_time() - age_s, image, number))
                backoff_s, failures, self.problem = MIN_BACKOFF_S, 0, ""
                if shape is None and self._path.startswith(_DEVICES):
                    self.warning = "; ".join(apply_controls(self._controls, self._path))
                shape = image.shape
                continue
            failures += 1
            if failures < MAX_FAILURES and time.monotonic() - asked_s < HANG_S:
                continue
            self._capture.release()
            self.problem = f"{self._path} gives no more images: is it plugged in? It is opened again"
            self._ending.wait(backoff_s)
            backoff_s, failures, shape = min(2.0 * backoff_s, MAX_BACKOFF_S), 0, None
            try:
                self._capture = self._open()
            except FrameSourceError as error:
                self.problem = str(error)

    def _decode(self, received: Tuple[float, np.ndarray, int]) -> Frame:
        stamp_s, image, number = received
        return Frame(stamp_s, cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image, number)

    def close(self) -> None:
        self._ending.set()
        self._thread.join(2.0)
        self._capture.release()


def _open_capture(path: str) -> Any:
    """Open a device or an address. Raises: FrameSourceError with what OpenCV does not tell."""
    is_device = path.startswith(_DEVICES)
    if is_device and not (os.path.exists(path) and stat.S_ISCHR(os.stat(path).st_mode)):  # a pipe would be waited for
        raise FrameSourceError(f"{path} is no camera, or not plugged in; ls /dev/video* lists cameras")
    if is_device and not os.access(path, os.R_OK):
        raise FrameSourceError(f"{path} may not be read by this user: sudo usermod -aG video $USER, and log in again")
    capture = cv2.VideoCapture(path, cv2.CAP_V4L2 if is_device else cv2.CAP_ANY)
    if not capture.isOpened():
        raise FrameSourceError(f"{path} cannot be opened: no camera, or another program uses it")
    return capture


def open_source(image: str, device: str, size_px: str, rate_hz: float, controls: DeviceControls) -> FrameSource:
    """Return the source of images: the device, such as /dev/video0, or URL if one is named, else the topic image.

    Raises: FrameSourceError for a device that cannot be opened, or an invalid size.
    """
    if not device:
        return TopicSource(rospy.resolve_name(image))
    if not device.startswith(_DEVICES) and _URL not in device:
        raise FrameSourceError(f"the device is {device!r}, but must be such as /dev/video0, or a URL")
    words = size_px.split("x")
    if len(words) != 2 or not all(word.strip().isdecimal() for word in words):
        raise FrameSourceError(f"the size of images is {size_px!r}, but must be such as 1920x1080")
    return DeviceSource(device, (int(words[0]), int(words[1])), rate_hz, controls)
