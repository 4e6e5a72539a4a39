"""The simulated overhead camera as a ROS node: images of the simulated robots, as a camera driver publishes them.

With --board it shows the calibration board at changing poses instead. Needs OpenCV (python3-opencv). Renders only
images that are subscribed to.
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

from ..errors import SettingsError
from ..prints.tag_images import FAMILIES
from .board_renderer import BoardRenderer, list_board_places
from .lab_setup import describe_references, find_first_reference, hang_above, list_references, write_camera_file
from .renderer import CameraRenderer
from .view import CameraOptions, PrintedTag, list_frames

PROGRAM = "simulated_camera"
NODE = "camera"
FRAME_ID = "camera_optical"
JPEG_QUALITY = 90

MOUNT_ERROR_M, MOUNT_ERROR_RAD = 0.002, 0.03
PLACE_ERROR_M = 0.001
"""Standard deviations of what people glue on robots by eye, and lay out by tape."""

BOARD_PICTURES = 4
"""The board is held for this many images at each place."""

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

    def find(self, stamp_s: float) -> Tuple[List[int], np.ndarray, np.ndarray]:
        """Return the ids of the robots that were heard of, their poses (N, 3) at stamp_s, and speeds (N, 2)."""
        ids, poses, speeds = [], [], []
        with self._lock:
            for robot_id, kept in self._newest.items():
                if kept:
                    at_s, pose, speed = min(kept, key=lambda item: abs(item[0] - stamp_s))
                    moved_m, turned_rad = speed * np.clip(stamp_s - at_s, -0.1, 0.1)
                    heading_rad = pose[2] + turned_rad / 2.0
                    step = (moved_m * math.cos(heading_rad), moved_m * math.sin(heading_rad), turned_rad)
                    ids.append(robot_id)
                    poses.append(pose + step)
                    speeds.append(speed)
        return ids, np.array(poses).reshape(-1, 3), np.array(speeds).reshape(-1, 2)


class RobotScene:
    """The arena with its robots."""

    def __init__(self, options: argparse.Namespace, camera: CameraOptions, arena: Arena) -> None:
        """Prepare the images."""
        self._ids = list(range(options.first_id, options.first_id + options.count))
        random = np.random.RandomState(options.seed)
        errors = np.array((MOUNT_ERROR_M, MOUNT_ERROR_M, MOUNT_ERROR_RAD)) * (not options.perfect)
        tags = [
            PrintedTag(robot_id, options.tag_size, 0.076, x_m, y_m, yaw_rad, options.family)
            for robot_id, (x_m, y_m, yaw_rad) in zip(self._ids, random.standard_normal((len(self._ids), 3)) * errors)
        ]
        references = []
        for tag in list_references(arena, options.family):
            off_m = random.standard_normal(2) * PLACE_ERROR_M * (not options.perfect)
            references.append(tag._replace(x_m=tag.x_m + off_m[0], y_m=tag.y_m + off_m[1]))
        self._renderer = CameraRenderer(camera, arena, tags, references, options.seed)
        self._hand_m: Optional[Tuple[float, float]] = None
        self._true = TrueRobots(self._ids)
        rospy.Subscriber("~hand", Point, self._receive_hand)
        if options.write_file:
            write_camera_file(options.write_file, camera.geometry, tags, references)
        # The reference tags lie at places of the simulator's world: for RViz, which shows its walls.
        transform = TransformStamped(child_frame_id="world")
        transform.header.stamp, transform.header.frame_id = rospy.get_rostime(), "map"
        transform.transform.rotation.w = 1.0
        self._world = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        self._world.publish(TFMessage([transform]))

    def _receive_hand(self, point: Point) -> None:
        self._hand_m = (point.x, point.y) if math.isfinite(point.x) and math.isfinite(point.y) else None

    @property
    def is_complete(self) -> bool:
        """Return whether the simulator has told where each robot is."""
        return len(self._true.find(0.0)[0]) == len(self._ids)

    def render(self, taken_s: float) -> np.ndarray:
        """Return the image (H, W), 8 bit, that was taken at a time."""
        _, poses, speeds = self._true.find(taken_s)
        return self._renderer.render(poses, speeds, self._hand_m)


class BoardScene:
    """The board for the lens, held into the image at one place after another."""

    is_complete = True

    def __init__(self, options: argparse.Namespace, camera: CameraOptions) -> None:
        self._random = np.random.RandomState(options.seed)
        self._renderer = BoardRenderer(camera)
        self._places = list_board_places(camera, self._random)
        self._place = next(self._places)
        self._shown = 0

    def render(self, taken_s: float) -> np.ndarray:
        """Return the next image (H, W), 8 bit."""
        del taken_s
        if self._shown == BOARD_PICTURES:
            self._place, self._shown = next(self._places), 0
        self._shown += 1
        return self._renderer.render(*self._place, self._random)


class CameraNode:
    """Publishers of one camera."""

    def __init__(self, options: argparse.Namespace) -> None:
        """Prepare the images. Raises: OptionError for an unusable arena. SettingsError for one that is too large."""
        size = (options.width, round(options.width * 9 / 16))
        camera = _scale(CameraOptions(), *size)._replace(
            rate_hz=options.rate, delay_s=options.delay, exposure_s=options.exposure
        )
        arena = _load_arena(options)
        self._options = hang_above(camera, arena, list_references(arena, options.family), options.tag_size)
        self._matrix = self._options.geometry.lens.matrix
        self._scene = BoardScene(options, self._options) if options.board else RobotScene(options, self._options, arena)
        self._stamps_arrival = options.stamps == "arrival"
        self._seed = options.seed
        self._image = rospy.Publisher("camera/image_raw", Image, queue_size=1)
        self._jpeg = rospy.Publisher("camera/image_raw/compressed", CompressedImage, queue_size=1)
        self._info = rospy.Publisher("camera/camera_info", CameraInfo, queue_size=1)

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
        if not self._scene.is_complete:
            return
        if self._info.get_num_connections():
            info = CameraInfo(height=self._options.height_px, width=self._options.width_px)
            info.distortion_model, info.D = "plumb_bob", list(self._options.distortion)
            info.K = self._matrix.ravel().tolist()
            info.R = np.eye(3).ravel().tolist()
            info.P = np.hstack((self._matrix, np.zeros((3, 1)))).ravel().tolist()
            info.header.stamp, info.header.frame_id = stamp, FRAME_ID
            self._info.publish(info)
        is_raw, is_jpeg = self._image.get_num_connections() > 0, self._jpeg.get_num_connections() > 0
        if not (is_raw or is_jpeg):
            return
        gray = self._scene.render(taken_s)
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


def _scale(camera: CameraOptions, width_px: int, height_px: int) -> CameraOptions:
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
    add("--family", choices=sorted(FAMILIES), default="36h11", help="family of the tags (%(default)s)")
    add("--tag-size", type=within(0.01, 0.2), default=0.04, metavar="M", help="side of the robots' tags (%(default)s)")
    add("--board", action="store_true", help="show the calibration board at changing poses")
    add("--perfect", action="store_true", help="place all tags exactly")
    text = "print the reference tags for the camera file, and exit"
    add("--print-references", action="store_true", help=text)
    add("--write-file", metavar="FILE", help="write a camera file, calibrated without error")
    add("--seed", type=int, default=0, help="seed of noise, dropped images and tag placement (%(default)s)")
    return parser.parse_args(arguments)


def main() -> None:
    """Run the camera until ROS ends."""
    options = parse_options(rospy.myargv(sys.argv)[1:])
    first_reference = find_first_reference(options.family)
    if options.first_id + options.count > first_reference:
        raise SettingsError("tags from %d on are reference tags: take lower ids" % first_reference)
    if options.print_references:
        print(describe_references(list_references(_load_arena(options), options.family)))
        return
    check_master()
    rospy.init_node(NODE)
    CameraNode(options).run()
