"""Publishes what the tracker sees, from straight above, while there are subscribers."""

import math
from typing import Optional

import cv2
import rospy
from geometry_msgs.msg import Point32, Polygon, PolygonStamped
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from ..camera.frame_source import Frame
from ..tracking.floor_view import FloorView
from ..tracking.tracker import Tracker

PERIOD_S = 0.2
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
        """Publish an image and the tags in it if there is a subscriber, PERIOD_S after the last one at the earliest.

        Raises: SettingsError if the camera cannot see the floor.
        """
        publishers = [publisher for publisher in (self._image, self._jpeg) if publisher.get_num_connections()]
        if self._shown_s <= now_s < self._shown_s + PERIOD_S or not publishers:
            return
        self._shown_s = now_s
        if self._view is None or self._view.camera is not tracker.camera:
            self._view = FloorView(tracker.camera, self._height_m)
            self._publish_outline(self._view)
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

    def _publish_outline(self, view: FloorView) -> None:
        left_m, low_m, right_m, high_m = view.box_m
        corners = ((left_m, low_m), (right_m, low_m), (right_m, high_m), (left_m, high_m))
        header = Header(stamp=rospy.get_rostime(), frame_id=self._frame_id)
        self._outline.publish(PolygonStamped(header, Polygon([Point32(x_m, y_m, 0.0) for x_m, y_m in corners])))
