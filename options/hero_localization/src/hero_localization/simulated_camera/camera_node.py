"""The simulated overhead camera as a ROS node: images of the simulated robots, as a camera driver publishes them.

Needs OpenCV (python3-opencv). Renders only images that are subscribed to.
"""

import argparse
import math
import sys
import threading
from typing import Dict, List, Optional, Sequence, Tuple

import cv2
import numpy as np
import rospy
from geometry_msgs.msg import Point, TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from tf2_msgs.msg import TFMessage

from hero_node.parameters import within
from hero_node.ros import check_master, read_duration_clock_s
from hero_sim.world import Arena, build_default, load_arena

from ..camera.frame_source import keep_freed_memory
from ..errors import SettingsError
from .renderer import CameraRenderer
from .view import (
    FIRST_REFERENCE_ID,
    CameraOptions,
    PrintedTag,
    describe_references,
    find_part,
    hang_above,
    list_frames,
    list_references,
    list_seen,
    write_camera_file,
)

PROGRAM = "simulated_camera"
NODE = "camera"
FRAME_ID = "camera_optical"
JPEG_QUALITY = 90

MOUNT_ERROR_M, MOUNT_ERROR_RAD = 0.002, 0.03
PLACE_ERROR_M = 0.001
"""Standard deviations of what people glue on robots by eye, and lay out by tape."""

MISSED_S = 0.1
"""An image that this machine is so late for is dropped, as a camera does whose program is too slow."""


class TrueRobots:
    """The robots' true poses, by the simulator's topics."""

    def __init__(self, robot_ids: Sequence[int]) -> None:
        self._lock = threading.Lock()
        self._newest: Dict[int, List[Tuple[float, np.ndarray, np.ndarray]]] = {robot_id: [] for robot_id in robot_ids}
        for robot_id in robot_ids:
            topic = "/hero_%d/ground_truth" % robot_id
            rospy.Subscriber(topic, Odometry, self._receive, robot_id, queue_size=10, tcp_nodelay=True)

    def _receive(self, message: Odometry, robot_id: int) -> None:
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        pose = np.array((place.x, place.y, 2.0 * math.atan2(turn.z, turn.w)))
        speed = np.array((message.twist.twist.linear.x, message.twist.twist.angular.z))
        with self._lock:
            kept = self._newest[robot_id]
            kept.append((message.header.stamp.to_sec(), pose, speed))
            del kept[:-20]

    def find(self, stamp_s: float) -> Optional[Tuple[np.ndarray, np.ndarray]]:
        """Return the poses (N, 3) of all robots at stamp_s, and speeds (N, 2); None before each was heard of."""
        poses, speeds = [], []
        with self._lock:
            for kept in self._newest.values():
                if not kept:
                    return None
                at_s, pose, speed = min(kept, key=lambda item: abs(item[0] - stamp_s))
                moved_m, turned_rad = speed * np.clip(stamp_s - at_s, -0.1, 0.1)
                heading_rad = pose[2] + turned_rad / 2.0
                poses.append(pose + (moved_m * math.cos(heading_rad), moved_m * math.sin(heading_rad), turned_rad))
                speeds.append(speed)
        return np.array(poses), np.array(speeds)


class CameraNode:
    """Publishers of one camera, above the arena with its robots."""

    def __init__(self, options: argparse.Namespace) -> None:
        """Prepare the images. Raises: OptionError for an unusable arena. SettingsError for one that is too large."""
        size = (options.width, round(options.width * 9 / 16))
        camera = scale(CameraOptions(), *size)._replace(
            rate_hz=options.rate, delay_s=options.delay, exposure_s=options.exposure
        )
        arena = _load_arena(options)
        lain = list_references(arena, options.part[1])
        self._options = camera = hang_above(camera, find_part(arena, *options.part), lain, options.tag_size)
        self._stamps_arrival = options.stamps == "arrival"
        self._seed = options.seed
        robot_ids = list(range(options.first_id, options.first_id + options.count))
        random = np.random.RandomState(options.seed)
        errors = random.standard_normal((len(robot_ids), 3)) * (MOUNT_ERROR_M, MOUNT_ERROR_M, MOUNT_ERROR_RAD)
        tags = [PrintedTag(robot_id, options.tag_size, 0.076, *error) for robot_id, error in zip(robot_ids, errors)]
        offs_m = random.standard_normal((len(lain), 2)) * PLACE_ERROR_M
        references = [
            tag._replace(x_m=tag.x_m + off_x_m, y_m=tag.y_m + off_y_m) for tag, (off_x_m, off_y_m) in zip(lain, offs_m)
        ]
        self._renderer = CameraRenderer(camera, arena, tags, references, options.seed)
        if options.write_file:
            write_camera_file(options.write_file, camera.geometry, tags, list_seen(camera.geometry, references))
        self._hand_m: Optional[Tuple[float, float]] = None
        self._true = TrueRobots(robot_ids)
        rospy.Subscriber("~hand", Point, self._receive_hand)
        # The reference tags lie at places of the simulator's world: for RViz, which shows its walls.
        transform = TransformStamped(child_frame_id="world")
        transform.header.stamp, transform.header.frame_id = rospy.get_rostime(), "map"
        transform.transform.rotation.w = 1.0
        self._world = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        self._world.publish(TFMessage([transform]))
        self._image = rospy.Publisher("camera/image_raw", Image, queue_size=1)
        self._jpeg = rospy.Publisher("camera/image_raw/compressed", CompressedImage, queue_size=1)
        self._info = rospy.Publisher("camera/camera_info", CameraInfo, queue_size=1)

    def _receive_hand(self, point: Point) -> None:
        self._hand_m = (point.x, point.y) if math.isfinite(point.x) and math.isfinite(point.y) else None

    def run(self) -> None:
        """Publish images until ROS ends."""
        for taken_s, arrival_s in list_frames(self._options, read_duration_clock_s(), self._seed):
            wait_s = arrival_s - read_duration_clock_s()
            if wait_s > 0.0:
                rospy.sleep(wait_s)
            if rospy.is_shutdown():
                return
            now_s, ros_s = read_duration_clock_s(), rospy.get_time()
            if now_s - arrival_s < MISSED_S:
                taken_ros_s = ros_s - (now_s - taken_s)
                self._publish(rospy.Time.from_sec(ros_s if self._stamps_arrival else taken_ros_s), taken_ros_s)

    def _publish(self, stamp: rospy.Time, taken_s: float) -> None:
        found = self._true.find(taken_s)
        if found is None:
            return
        if self._info.get_num_connections():
            info = CameraInfo(height=self._options.height_px, width=self._options.width_px)
            info.distortion_model, info.D = "plumb_bob", list(self._options.distortion)
            matrix = self._options.geometry.lens.matrix
            info.K, info.R = matrix.ravel().tolist(), np.eye(3).ravel().tolist()
            info.P = np.hstack((matrix, np.zeros((3, 1)))).ravel().tolist()
            info.header.stamp, info.header.frame_id = stamp, FRAME_ID
            self._info.publish(info)
        is_raw, is_jpeg = self._image.get_num_connections() > 0, self._jpeg.get_num_connections() > 0
        if not (is_raw or is_jpeg):
            return
        gray = self._renderer.render(*found, self._hand_m)
        if is_raw:
            image = Image(height=gray.shape[0], width=gray.shape[1], encoding="mono8", step=gray.shape[1])
            image.header.stamp, image.header.frame_id = stamp, FRAME_ID
            image.data = gray.tobytes()
            self._image.publish(image)
        if is_jpeg:
            _, coded = cv2.imencode(".jpg", gray, (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))
            jpeg = CompressedImage(format="mono8; jpeg compressed mono8", data=coded.tobytes())
            jpeg.header.stamp, jpeg.header.frame_id = stamp, FRAME_ID
            self._jpeg.publish(jpeg)


def scale(camera: CameraOptions, width_px: int, height_px: int) -> CameraOptions:
    """Return the same camera with another number of pixels."""
    share = width_px / camera.width_px
    (fx, fy), (cx, cy) = camera.focal_px, camera.center_px
    return camera._replace(
        width_px=width_px,
        height_px=height_px,
        focal_px=(fx * share, fy * share),
        center_px=((cx + 0.5) * share - 0.5, (cy + 0.5) * share - 0.5),
        blur_px=camera.blur_px * share,
    )


def _load_arena(options: argparse.Namespace) -> Arena:
    return load_arena(options.arena) if options.arena else build_default(options.count)


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog=PROGRAM, description="A simulated camera above the simulated robots.")
    add = parser.add_argument
    add("--count", type=within(1, 500, int), default=1, metavar="N", help="number of robots (%(default)s)")
    add("--first-id", type=within(0, 500, int), default=0, metavar="K", help="id of the first robot (%(default)s)")
    add("--arena", metavar="FILE", help="the simulator's arena")
    text = "width of the images, 16:9 (%(default)s)"
    add("--width", type=within(160, 4096, int), default=1920, metavar="PX", help=text)
    add("--rate", type=within(0.5, 120.0), default=30.0, metavar="HZ", help="images per second (%(default)s)")
    add("--delay", type=within(0.0, 5.0), default=0.07, metavar="S", help="delay from capture to arrival (%(default)s)")
    add("--exposure", type=within(0.0, 0.1), default=0.008, metavar="S", help="exposure time (%(default)s)")
    add("--stamps", choices=("capture", "arrival"), default="capture", help="timestamp source (%(default)s)")
    add("--tag-size", type=within(0.01, 0.2), default=0.04, metavar="M", help="side of the robots' tags (%(default)s)")
    text = "see part K of N of the arena along x, and 0.2 m beyond (1 1)"
    add("--part", type=within(1, 4, int), nargs=2, default=(1, 1), metavar=("K", "N"), help=text)
    text = "print the reference tags for the camera file, and exit"
    add("--print-references", action="store_true", help=text)
    add("--write-file", metavar="FILE", help="write a camera file, calibrated without error")
    add("--seed", type=int, default=0, help="seed of noise, dropped images and tag placement (%(default)s)")
    options = parser.parse_args(arguments)
    if options.part[0] > options.part[1]:
        parser.error("--part %d %d: there are no more parts than the second says" % tuple(options.part))
    return options


def main() -> None:
    """Run the camera until ROS ends."""
    options = parse_options(rospy.myargv(sys.argv)[1:])
    if options.first_id + options.count > FIRST_REFERENCE_ID:
        raise SettingsError("tags from %d on are reference tags: take lower ids" % FIRST_REFERENCE_ID)
    if options.print_references:
        print(describe_references(list_references(_load_arena(options), options.part[1])))
        return
    check_master()
    keep_freed_memory()
    rospy.init_node(NODE)
    CameraNode(options).run()
