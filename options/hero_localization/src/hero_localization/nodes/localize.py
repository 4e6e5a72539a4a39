"""Program localize: filters odometry and measured poses into poses of all robots in one frame.

rosrun hero_localization localize                                      poses on /hero_N/measured_pose
rosrun hero_localization localize _pose_topic:=/vrpn_client_node/hero_{id}/pose
"""

import threading
from functools import partial
from typing import Any, Callable, Dict, List, Optional, Tuple

import numpy as np
import rospy
from tf2_msgs.msg import TFMessage

from hero_client import Program, ProgramError, read_parameters
from hero_client.ros import share_drivers
from hero_client.values import is_plausible
from hero_msgs.msg import RobotPose, RobotPoses
from hero_node import Pose
from hero_node.parameters import flag, number, robot_ids, string

from ..filter.pose_filter import make_covariance
from ..filter.pose_hypothesis import StampedPose
from ..filter.swarm_localizer import PUBLISH_RATE_HZ, SwarmLocalizer
from ..tracking.tag_pose import DEFAULT_HEIGHT_M
from .inputs import PoseInput, describe_source, subscribe_odometry
from .outputs import Outputs

DIAGNOSTICS_PERIOD_S = 1.0
UNKNOWN_S = 3.0
"""Time for which the tag of an unknown robot is named after it was seen."""

MAX_SD = 1e3
"""Largest standard deviation of a position (m) or heading (rad); a larger one is invalid."""


class LocalizationNode:
    """Inputs, filters and outputs of all robots; robots that join a driver are added."""

    def __init__(self, parameters: Dict[str, Any]) -> None:
        """Start with the robots of ~robots. Raises: ProgramError for a topic without {id}."""
        self._frame = str(parameters["frame"]).lstrip("/")
        self._pose_topic = str(parameters["pose_topic"])
        if "{id}" not in self._pose_topic:
            text = '~pose_topic is %r, but must hold {id}, such as "/hero_{id}/measured_pose"'
            raise ProgramError(text % self._pose_topic)
        self._pose_frame = str(parameters["pose_frame"]).lstrip("/") or self._frame
        self._covariance = make_covariance(parameters["position_sd_m"], parameters["heading_sd_rad"])
        self._chosen: Optional[List[int]] = parameters["robots"]
        self._lock = threading.Lock()  # inputs come on threads of rospy
        self._localizer = SwarmLocalizer(parameters["correct_clocks"])
        self._outputs = Outputs(self._frame)
        self._is_extrapolating: bool = parameters["extrapolate"]
        self._inputs: Dict[int, PoseInput] = {}
        self._next_diagnostics_s = 0.0
        self._unknown_s: Dict[int, float] = {}
        self._image_used = threading.Event()
        self._add_robots(self._chosen or [])
        self._swarm_topic = str(parameters["swarm_topic"])
        rospy.Subscriber(self._swarm_topic, RobotPoses, self._receive_swarm, queue_size=10, tcp_nodelay=True)
        rospy.Subscriber("/tf_static", TFMessage, self._note_cameras, queue_size=10)

    def _add_robots(self, ids: List[int]) -> None:
        for robot_id in ids:
            if robot_id in self._inputs:
                continue
            with self._lock:
                self._localizer.add_robots([robot_id])
            self._outputs.add_robot(robot_id)
            topic = self._pose_topic.replace("{id}", str(robot_id))
            warn = partial(rospy.logwarn_throttle, 10.0)
            follow = partial(self._call, self._localizer.add_odometry, robot_id)
            subscribe_odometry("/hero_%d" % robot_id, follow)
            correct = partial(self._call, self._localizer.add_measurement, robot_id)
            self._inputs[robot_id] = PoseInput(topic, self._pose_frame, self._covariance, correct, warn)

    def _call(self, work: Callable[..., List[str]], *values: Any) -> None:
        """Call a method of the localizer with these values and the time, and log the lines that it returns."""
        with self._lock:
            lines = work(*values, rospy.get_time())
        for line in lines:
            rospy.loginfo(line)

    def _note_cameras(self, message: TFMessage) -> None:
        """Note where the cameras are whose programs publish that, among other things that never move."""
        for transform in message.transforms:
            if transform.header.frame_id.lstrip("/") == self._frame:
                place = transform.transform.translation
                with self._lock:  # camera files are not read here: tags 1 cm off the usual height change 0.5 %
                    node = message._connection_header["callerid"]
                    self._localizer.heights.cameras_m[node] = np.array((place.x, place.y, place.z - DEFAULT_HEIGHT_M))

    def _receive_swarm(self, report: RobotPoses) -> None:
        """Take the poses of all robots that one image shows."""
        if report.header.frame_id.lstrip("/") not in ("", self._frame):
            text = "%s is in the frame %r, but must be in %r: give its publisher and this node the same ~frame"
            rospy.logwarn_throttle(10.0, text % (self._swarm_topic, report.header.frame_id, self._frame))
            return
        source, measured = describe_source(self._swarm_topic, report), []
        for robot in report.robots:
            pose = Pose(robot.x, robot.y, robot.yaw)
            if robot.id not in self._inputs:
                self._unknown_s[robot.id] = rospy.get_time()
            if robot.id in self._inputs and robot.state == RobotPose.TRACKED and is_plausible(pose):
                is_told = 0.0 < robot.position_sd < MAX_SD and 0.0 < robot.yaw_sd < MAX_SD
                covariance = make_covariance(robot.position_sd, robot.yaw_sd) if is_told else self._covariance
                measured.append((robot.id, StampedPose(robot.stamp.to_sec(), pose, covariance, source, is_told)))
        self._call(self._use_image, report, measured)
        self._image_used.set()

    def _use_image(self, report: RobotPoses, measured: List[Tuple[int, StampedPose]], now_s: float) -> List[str]:
        lines = [line for pair in measured for line in self._localizer.add_measurement(*pair, now_s)]
        lost = [robot.id for robot in report.robots if robot.state == RobotPose.LOST]
        self._localizer.distrust(report.header.stamp.to_sec(), lost, now_s)
        return lines

    def step(self, period_s: float) -> None:
        """Wait for the poses of an image, or for period_s, and publish."""
        self._image_used.wait(period_s)
        self._image_used.clear()
        if self._chosen is None:
            report = share_drivers().read()
            self._add_robots(sorted(robot.id for robot in report.robots if robot.id >= 0) if report else [])
        now_s = rospy.get_time()
        self._call(self._localizer.find_lost)
        with self._lock:
            is_due = not self._next_diagnostics_s - DIAGNOSTICS_PERIOD_S <= now_s < self._next_diagnostics_s
            robots = self._localizer.list_robots(now_s, self._is_extrapolating, is_due)
            problems = self._localizer.list_source_problems() if is_due else {}
        self._outputs.publish(robots)
        if is_due:
            self._next_diagnostics_s = now_s + DIAGNOSTICS_PERIOD_S
            # Robots whose tags are seen, but which no driver knows.
            unknown = [
                robot_id
                for robot_id, seen_s in sorted(self._unknown_s.copy().items())
                if self._chosen is None and abs(now_s - seen_s) < UNKNOWN_S and robot_id not in self._inputs
            ]
            self._outputs.publish_diagnostics(robots, unknown, problems)


SD_TEXT = "standard deviation, in x and y each, of poses that come without covariance; `track` tells its own"

PARAMETERS = {
    "robots": robot_ids("all", "ids; all: those of all drivers"),
    "frame": string("map", "the common frame"),
    "pose_topic": string(
        "/hero_{id}/measured_pose",
        "poses of one robot from elsewhere: geometry_msgs/PoseStamped, PoseWithCovarianceStamped, or nav_msgs/Odometry",
    ),
    "pose_frame": string("", "name of `~frame` in these poses, such as world; empty: the same"),
    "swarm_topic": string("/track/measured_poses", "hero_msgs/RobotPoses of `track`"),
    "position_sd_m": number(0.002, 1e-5, 1.0, "m", SD_TEXT),
    "heading_sd_rad": number(0.01, 1e-5, 10.0, "rad", "the same of their yaw"),
    "correct_clocks": flag(True, "stamps of measured poses that are 10 ms off odometry's, or more, are corrected"),
    "extrapolate": flag(
        False, "publish where robots are at that time, not at their newest odometry, 7 mm behind at 0.2 m/s"
    ),
    "rate_hz": number(PUBLISH_RATE_HZ, 1.0, 100.0, "Hz", "minimum publish rate; poses of an image come at once"),
}


def main() -> None:
    """Localize robots until the program is to end. Raises: ProgramError for a wrong parameter."""
    with Program("localization") as program:
        parameters = read_parameters(PARAMETERS)
        node = LocalizationNode(parameters)
        while program.running:
            node.step(1.0 / parameters["rate_hz"])
