"""Part robots of calibrate_camera: how tags sit on their robots, which turn and drive a little; the camera's delay."""

import argparse
import math
from functools import partial
from typing import Dict, List, Optional, Tuple

import numpy as np
import rospy
from nav_msgs.msg import Odometry

from hero_client import Program, ProgramError, Robot
from hero_client.values import is_plausible, read_pose
from hero_node import HeroError, Pose, say
from hero_node.ros import read_duration_clock_s

from ..calibration.print_fit import PrintScale, estimate_height, find_height_error, find_print_scale
from ..calibration.robot_calibration import CALIBRATION_DRIVE, RobotCalibration, calibrate_robot
from ..camera.camera_model import Camera
from ..camera.frame_source import Frame
from ..errors import CalibrationError, DetectorError
from ..tracking.settings import describe_pose
from ..tracking.tag_pose import fit_squares
from .calibration_images import Images, finish

READY_S = 10.0
LOOK_S = 3.0
"""A robot whose tag is not seen within this time is not moved."""


def calibrate_robot_tags(options: argparse.Namespace, images: Images, program: Program) -> int:
    """Turn and drive robots, one after another, and measure how their tags sit. Return the exit code."""
    layout = images.settings.layout
    tags = layout.find_tags(options.robots)
    results: Dict[int, RobotCalibration] = {}
    problems: List[str] = []
    for robot_id in options.robots:
        tag_id = tags.get(robot_id)
        if tag_id is None:
            text = "hero_%d: tag %d is assigned to something else: name the robot's in tag_robots"
            problems.append(text % (robot_id, robot_id))
            continue
        try:
            result = results[tag_id] = _watch_robot(images, program, robot_id, tag_id)
        except (ProgramError, DetectorError):
            raise
        except HeroError as error:
            problems.append("hero_%d: %s" % (robot_id, error))
            say(problems[-1])
            continue
        mount, text = result.mount, "hero_%d: tag %.1f mm ahead, %.1f mm left, turned by %.1f degrees"
        text = text % (robot_id, 1e3 * mount.x_m, 1e3 * mount.y_m, math.degrees(mount.yaw_rad))
        say(f"{text}; delay {1e3 * result.delay_s:.0f} ms; {1e3 * result.rms_m:.1f} mm rms")
        problems += ["hero_%d: %s" % (robot_id, problem) for problem in result.problems]
    if not results:
        raise CalibrationError("; ".join(problems))
    heights_m = {tag_id: result.height_m for tag_id, result in results.items() if math.isfinite(result.height_m)}
    limit_m = find_height_error(_get_camera(images), layout)
    if layout.references and not heights_m:
        problems.append("tag_height_m is not checked: no reference tag lies well within the image")
    if heights_m:
        height_m = float(np.median(list(heights_m.values())))
        if abs(height_m - layout.height_m) <= limit_m:
            say(f"tag_height_m is right to {1e3 * limit_m:.0f} mm, as far as tags of this size tell")
        else:
            text = "tags are %.0f mm above the floor by their size, not %.0f: is tag_height_m right, all printed alike?"
            problems.append(text % (1e3 * height_m, 1e3 * layout.height_m))
        for tag_id, own_m in heights_m.items():
            if abs(own_m - height_m) > 2.0 * limit_m:  # either may be off
                text = "tag %d is %.0f mm above the floor by its size, others %.0f: printed alike, flat on its robot?"
                problems.append(text % (tag_id, 1e3 * own_m, 1e3 * height_m))
    mounts = {**layout.mounts, **{tag_id: result.mount for tag_id, result in results.items()}}
    described = {tag_id: describe_pose(mount) for tag_id, mount in mounts.items()}
    delay_s = float(np.median([result.delay_s for result in results.values()]))
    return finish(options.file, {"mounts": described, "delay_s": round(delay_s, 4)}, problems)


def _get_camera(images: Images) -> Camera:
    assert images.settings.camera is not None, "calibrate_camera refuses a file without"
    return images.settings.camera


def _watch_robot(images: Images, program: Program, robot_id: int, tag_id: int) -> RobotCalibration:
    """Drive one robot, and return how its tag sits. Raises: CalibrationError if it cannot be seen; HeroError."""
    camera, layout, family = _get_camera(images), images.settings.layout, images.settings.family
    odometry: List[Tuple[float, Pose]] = []
    seen: List[Tuple[float, Pose]] = []
    heights_m: List[float] = []
    scale: Optional[PrintScale] = None

    def watch(frame: Optional[Frame], is_measuring: bool = False) -> int:
        nonlocal scale
        found = images.find_tags(frame) if frame is not None else []
        tags = [tag for tag in found if tag.tag_id == tag_id]
        if frame is not None and len(tags) == 1:
            pose = fit_squares(camera, tags, layout.height_m)[0].pose
            if is_plausible(pose):
                seen.append((frame.stamp_s, pose))
            scale = scale or find_print_scale(camera, frame.gray, found, layout, family)
            if scale is not None and is_measuring:
                heights_m.append(estimate_height(camera, frame.gray, tags[0], scale, layout, family))
        return len(tags)

    with Robot(robot_id) as robot:
        robot.wait_until_ready(READY_S, program.sleep)
        robot.check_not_stopped()
        look_until_s, count = read_duration_clock_s() + LOOK_S, 0
        while not seen:
            count = max(count, watch(images.take()))
            if not seen and read_duration_clock_s() > look_until_s:
                reason = "appears more than once" if count else "is not in the image, or too dark"
                raise CalibrationError("tag %d %s; the robot was not moved" % (tag_id, reason))
        say("hero_%d turns left and right, and drives forward and back" % robot_id)
        # Not subscribe_odometry(): rospy would give its raw messages to Robot as well.
        keep = partial(_keep_odometry, odometry)
        subscriber = rospy.Subscriber("/hero_%d/odom" % robot_id, Odometry, keep, queue_size=30, tcp_nodelay=True)
        try:
            for duration_s, linear_m_s, angular_rad_s in CALIBRATION_DRIVE:
                end_s = read_duration_clock_s() + duration_s
                while read_duration_clock_s() < end_s:
                    robot.drive(linear_m_s, angular_rad_s)
                    watch(images.poll(), is_measuring=angular_rad_s == 0.0)  # a turn blurs the tag
        finally:
            subscriber.unregister()
    heights_m = [height_m for height_m in heights_m if math.isfinite(height_m)]
    return calibrate_robot(seen, odometry)._replace(height_m=float(np.median(heights_m)) if heights_m else math.nan)


def _keep_odometry(kept: List[Tuple[float, Pose]], message: Odometry) -> None:
    pose = read_pose(message.pose.pose)
    if pose is not None:
        kept.append((message.header.stamp.to_sec(), pose))
