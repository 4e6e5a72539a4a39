"""Program track: finds tagged robots and objects in the images of an overhead camera.

rosrun hero_localization track                                     /camera/image_raw
rosrun hero_localization track _image:=/camera/image_raw/compressed
rosrun hero_localization track _device:=/dev/video0
"""

import math
import re
import time
from typing import Any, Dict, List, Optional, Tuple

import cv2
import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point32, Polygon, PolygonStamped, Quaternion, Transform, TransformStamped, Vector3
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from hero_client import Program, read_parameters
from hero_msgs.msg import ObjectPose, ObjectPoses, RobotPose, RobotPoses
from hero_node import Pose
from hero_node.parameters import number, string

from ..camera.camera_model import Camera
from ..camera.frame_source import Frame, open_source
from ..errors import DetectorError, LocalizationError
from ..tracking import settings as camera_file
from ..tracking.detector_process import DetectorProcess
from ..tracking.floor_view import FloorView
from ..tracking.tag_pose import Sightings
from ..tracking.tracker import Tracker
from .outputs import make_status, publish_statuses

SILENT_S = 2.0
DIAGNOSTICS_PERIOD_S = 1.0
WAIT_S = 0.1
LOG_PERIOD_S = 30.0
"""Time between two lines on one problem."""

FILE_PATIENCE_S = 10.0
"""The pose of a camera is missed only after that: the simulated camera may just be writing its file."""

PICTURE_PERIOD_S = 0.2
JPEG_QUALITY = 75


class PictureOutput:
    """~picture, ~picture/compressed, and where its corners are in the common frame: ~picture/outline."""

    def __init__(self, frame_id: str, height_m: float) -> None:
        """height_m: of the robots' tags, which the view shows at their places."""
        self._frame_id = frame_id
        self._height_m = height_m
        self._shown_s = -math.inf
        self._view: Optional[FloorView] = None
        self._image = rospy.Publisher("~picture", Image, queue_size=1)
        self._jpeg = rospy.Publisher("~picture/compressed", CompressedImage, queue_size=1)
        self._outline = rospy.Publisher("~picture/outline", PolygonStamped, queue_size=1, latch=True)

    def show(self, tracker: Tracker, frame: Frame, now_s: float) -> None:
        """Publish an image and the tags in it if there is a subscriber, at most every PICTURE_PERIOD_S.

        Raises: SettingsError if the camera cannot see the floor.
        """
        publishers = [publisher for publisher in (self._image, self._jpeg) if publisher.get_num_connections()]
        if self._shown_s <= now_s < self._shown_s + PICTURE_PERIOD_S or not publishers:
            return
        self._shown_s = now_s
        if self._view is None or self._view.camera is not tracker.camera:
            self._view = FloorView(tracker.camera, self._height_m)
            left_m, low_m, right_m, high_m = self._view.box_m
            corners = ((left_m, low_m), (right_m, low_m), (right_m, high_m), (left_m, high_m))
            outline = Polygon([Point32(x_m, y_m, 0.0) for x_m, y_m in corners])
            header = Header(stamp=rospy.get_rostime(), frame_id=self._frame_id)
            self._outline.publish(PolygonStamped(header, outline))
        sightings = tracker.sightings
        unusable = set(sightings.unknown + sightings.doubled + list(sightings.misshapen)) if sightings else set()
        picture = self._view.draw(frame.gray, tracker.found, unusable)
        header = Header(stamp=rospy.Time.from_sec(tracker.taken_s(frame.stamp_s)), frame_id=self._frame_id)
        if self._image in publishers:
            height_px, width_px = picture.shape[:2]
            self._image.publish(Image(header, height_px, width_px, "bgr8", 0, 3 * width_px, picture.tobytes()))
        if self._jpeg in publishers:
            _, coded = cv2.imencode(".jpg", picture, (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))
            self._jpeg.publish(CompressedImage(header, "bgr8; jpeg compressed bgr8", coded.tobytes()))


class TrackNode:
    """The tracker, its inputs and outputs."""

    def __init__(self, parameters: Dict[str, Any]) -> None:
        """Read the camera's file and open its images. Raises: LocalizationError."""
        self._path = str(parameters["file"])
        self._settings = camera_file.load(self._path)
        self._file_s = camera_file.find_change_s(self._path)
        self._frame_id = str(parameters["frame"]).lstrip("/")
        camera = self._settings.camera
        self._tracker: Optional[Tracker] = None
        self._tf = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        if camera is not None:
            self._start_tracker(camera)
        self._process: Optional[DetectorProcess] = None
        self._expected: Dict[int, Pose] = {}
        self._diagnosed_s = -math.inf
        self._opened_s = time.monotonic()
        self._logged_s: Dict[str, float] = {}
        self._publisher = rospy.Publisher("~measured_poses", RobotPoses, queue_size=5)
        self._objects = rospy.Publisher("~objects", ObjectPoses, queue_size=5)
        self._pictures = PictureOutput(self._frame_id, self._settings.layout.height_m)
        self._diagnostics = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=2)
        rospy.Subscriber(parameters["poses_topic"], RobotPoses, self._expect, queue_size=2, tcp_nodelay=True)
        image, device, size_px = (str(parameters[name]) for name in ("image", "device", "size_px"))
        self._source = open_source(image, device, size_px, parameters["rate_hz"], self._settings.controls)

    def _start_tracker(self, camera: Camera) -> None:
        """Track with this camera, and publish where it is: its frame is named after this node."""
        self._tracker = Tracker(self._settings, camera)
        turn = cv2.Rodrigues(camera.rotation.T)[0].ravel()
        half_rad = max(float(np.linalg.norm(turn)), 1e-9) / 2.0
        turn *= math.sin(half_rad) / (2.0 * half_rad)
        transform = Transform(Vector3(*camera.position_m), Quaternion(*turn, math.cos(half_rad)))
        header = Header(stamp=rospy.get_rostime(), frame_id=self._frame_id)
        frame_id = rospy.get_name().strip("/") + "_camera"
        self._tf.publish(TFMessage([TransformStamped(header, frame_id, transform)]))

    def _expect(self, report: RobotPoses) -> None:
        self._expected = {
            robot.id: Pose(robot.x, robot.y, robot.yaw) for robot in report.robots if robot.state != RobotPose.UNKNOWN
        }

    def step(self) -> None:
        """Work on the newest image, or wait a moment for it.

        Raises: LocalizationError for a detector that cannot be started or has ended, and for unusable images.
        """
        frame = self._source.poll(WAIT_S)
        if frame is not None and self._tracker is not None:
            self._take_frame(self._tracker, frame)
        now_s = rospy.get_time()
        if not self._diagnosed_s <= now_s < self._diagnosed_s + DIAGNOSTICS_PERIOD_S:
            self._diagnosed_s = now_s
            self._follow_file()
            self._publish_diagnostics(now_s)

    def _follow_file(self) -> None:
        """Take the camera file again if a calibration wrote it."""
        changed_s = camera_file.find_change_s(self._path)
        if changed_s == self._file_s:
            return
        self._file_s = changed_s
        try:
            settings = camera_file.load(self._path)
        except LocalizationError as error:
            rospy.logerr(f"{error}; the calibration before it counts")
            return
        if settings.camera is not None:
            before, self._settings = self._settings, settings
            if self._process is not None and settings[:3] != before[:3]:  # of another detector
                self._process.close()
                self._process = None
            self._start_tracker(settings.camera)
            waits = (settings.controls, settings.layout.height_m) != (before.controls, before.layout.height_m)
            wait = "; exposure_s, gain, focus and the height of pictures from the next start on" if waits else ""
            rospy.loginfo(f"{self._path} has changed, and counts from now on{wait}")

    def _take_frame(self, tracker: Tracker, frame: Frame) -> None:
        height_px, width_px = frame.gray.shape
        tracker.camera.lens.check_size(height_px, width_px)
        if self._process is None:
            settings = self._settings
            self._process = DetectorProcess(
                settings.detector, settings.family, settings.decimate, width_px, height_px, tracker.smallest_px
            )
            return  # by now the image is a second old
        expected = tracker.project(self._expected)
        tags = self._process.search(frame.gray, frame.stamp_s, expected)
        tracker.quality.measure(frame.gray, tracker.found)
        self._publish(tracker, tracker.take(tags, frame.stamp_s, frame.number, expected), frame.stamp_s)
        self._pictures.show(tracker, frame, rospy.get_time())

    def _publish(self, tracker: Tracker, sightings: Sightings, stamp_s: float) -> None:
        stamp = rospy.Time.from_sec(tracker.taken_s(stamp_s))
        report = RobotPoses()
        report.header.stamp, report.header.frame_id = stamp, self._frame_id
        for robot_id, seen in sorted(sightings.robots.items()):
            state = RobotPose.LOST if tracker.is_moved else RobotPose.TRACKED
            report.robots.append(RobotPose(robot_id, state, stamp, *seen.pose, seen.position_sd_m, seen.yaw_sd_rad))
        self._publisher.publish(report)
        if self._objects.get_num_connections():
            objects = [ObjectPose(name, *seen.pose) for name, seen in sorted(sightings.objects.items())]
            self._objects.publish(ObjectPoses(report.header, objects))

    def _publish_diagnostics(self, now_s: float) -> None:
        statuses: List[DiagnosticStatus] = []
        for name, text, is_error in self._list_problems(now_s):
            level = DiagnosticStatus.ERROR if is_error else DiagnosticStatus.WARN
            statuses.append(make_status(name, level, text))
            self._log(name, text, is_error, now_s)
        if not any(status.hardware_id == "camera" for status in statuses) and self._tracker is not None:
            text = f"{self._tracker.describe_rate()}, {len(self._tracker.found)} tags"
            statuses.append(make_status("camera", DiagnosticStatus.OK, text))
        publish_statuses(self._diagnostics, statuses)

    def _log(self, name: str, text: str, is_error: bool, now_s: float) -> None:
        """Log a problem unless its last line, with other figures perhaps, is younger than LOG_PERIOD_S."""
        kind = name + re.sub("[0-9.]+", "", text)
        logged_s = self._logged_s.get(kind, -math.inf)
        if not logged_s <= now_s < logged_s + LOG_PERIOD_S:
            self._logged_s[kind] = now_s
            (rospy.logerr if is_error else rospy.logwarn)(f"{name}: {text}")

    def _list_problems(self, now_s: float) -> List[Tuple[str, str, bool]]:
        if self._tracker is None:
            if time.monotonic() < self._opened_s + FILE_PATIENCE_S:
                return []
            text = "not calibrated: %s has no camera pose (extrinsics); rosrun hero_localization calibrate_camera"
            return [("camera", text % self._path, True)]
        if self._source.problem:
            return [("camera", self._source.problem, True)]
        # No longer than this node runs: simulated time begins with a jump from 0.
        silent_s = min(now_s - self._source.arrived_s, time.monotonic() - self._opened_s)
        if silent_s > SILENT_S:
            text = "no image for %.0f s: is the camera's driver running?"
            return [("camera", text % silent_s, True)]
        warnings = [("camera controls", self._source.warning, False)] if self._source.warning else []
        return [*warnings, *self._tracker.list_problems()]

    def close(self) -> None:
        """End the detector and leave the camera; may be called twice."""
        self._source.close()
        if self._process is not None:
            self._process.close()


PARAMETERS = {
    "image": string(
        "camera/image_raw", "sensor_msgs/Image or CompressedImage (`.../compressed`), with its camera_info beside it"
    ),
    "device": string("", "instead: a V4L2 device such as `/dev/video0`, or the URL of a network camera"),
    "size_px": string("1920x1080", "of the images of a device"),
    "rate_hz": number(30.0, 1.0, 240.0, "Hz", "of a device"),
    "file": string(camera_file.DEFAULT_PATH, "[camera file](#camera-file)"),
    "frame": string("map", "the common frame"),
    "poses_topic": string("/localization/poses", "where robots are expected: windows of an image are searched first"),
}


def main() -> None:
    """Track until the program is to end. Raises: ProgramError, LocalizationError."""
    with Program("track") as program:
        parameters = read_parameters(PARAMETERS)
        node = TrackNode(parameters)
        try:
            while program.running:
                node.step()
        except DetectorError:
            if program.running:  # what ends this program may end the detector first
                raise
        finally:
            node.close()
