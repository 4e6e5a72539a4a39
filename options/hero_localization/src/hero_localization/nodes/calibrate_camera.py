"""Program calibrate_camera: intrinsics (lens), extrinsics (arena), tags on robots. Prints errors and a verdict.

rosrun hero_localization calibrate_camera lens                  move the printed board through the image
rosrun hero_localization calibrate_camera lens --yaml FILE      take camera_calibration's result
rosrun hero_localization calibrate_camera arena                 from reference tags at known positions
rosrun hero_localization calibrate_camera robots --robots 0     robots turn and drive a little
"""

import argparse
import math
import sys
from functools import partial
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np
import rospy
from nav_msgs.msg import Odometry

from hero_client import Program, ProgramError, Robot
from hero_client.values import is_plausible, read_pose
from hero_node import HeroError, Pose, import_optional, say
from hero_node.parameters import robot_ids_option
from hero_node.ros import read_duration_clock_s

from ..calibration.arena_calibration import MIN_TAGS, average_tags, calibrate_arena, fit_references
from ..calibration.lens_calibration import (
    MIN_VIEWS,
    BoardView,
    LensCalibration,
    calibrate_lens,
    find_board,
    is_mirrored,
    load_lens,
)
from ..calibration.print_fit import refine_corners
from ..calibration.robot_calibration import CALIBRATION_DRIVE, RobotCalibration, calibrate_robot
from ..camera.camera_model import Intrinsics
from ..camera.frame_source import Frame, open_source
from ..errors import CalibrationError, DetectorError
from ..tracking import settings as camera_file
from ..tracking.detector_process import DetectorProcess
from ..tracking.detectors import find_print_mistake
from ..tracking.settings import Settings
from ..tracking.tag_corners import TagCorners
from ..tracking.tag_pose import fit_squares

MAX_VIEWS = 25
ENOUGH_VIEWS = 20
STILL_PX = 3.0
"""A board that moves by more than this between two images is blurred."""

NEW_PX = 40.0
"""A board whose corners are nearer than this to those of a view that was taken shows nothing new."""

ARENA_FRAMES = 30
FRAME_S = 10.0
WAIT_S = 0.1
HINT_S = 10.0
"""After this long without the board in an image, possible causes are printed."""

READY_S = 10.0
LOOK_S = 3.0
"""A robot whose tag is not seen within this time is not moved."""


class Images:
    """The newest image of the camera, for a program that works on one after another."""

    def __init__(self, options: argparse.Namespace, program: Program, settings: Settings) -> None:
        """Open the camera. Raises: FrameSourceError."""
        self._finder: Optional[DetectorProcess] = None
        self._program = program
        self.settings = settings
        self.source = open_source(options.image, options.device, options.size, options.rate, settings.controls)
        self._name = options.device or options.image

    def poll(self) -> Optional[Frame]:
        """Return the next image; None if none comes in a moment. Raises: ProgramError if the program is to end."""
        self._check_running()
        return self.source.poll(WAIT_S)

    def _check_running(self) -> None:
        if not self._program.running:
            raise ProgramError("ended before the calibration was complete: the file is as it was")

    def take(self) -> Frame:
        """Wait for the next image. Raises: CalibrationError if none comes; as poll()."""
        for _ in range(round(FRAME_S / WAIT_S)):
            frame = self.poll()
            if self.source.warning:
                say("  " + self.source.warning)
                self.source.warning = ""
            if frame is not None:
                return frame
        reason = self.source.problem or "is the camera's driver running?"
        raise CalibrationError(f"no image from {self._name} for {FRAME_S:g} s: {reason}")

    def find_tags(self, decimate: float, frame: Frame) -> List[TagCorners]:
        """Return the tags in an image; decimate of the first call counts.

        Raises: CalibrationError for another size than the lens has, DetectorError; ProgramError as poll().
        """
        settings, (height_px, width_px) = self.settings, frame.gray.shape
        if settings.lens is not None:
            settings.lens.check_size(height_px, width_px)
        if self._finder is None:
            # Not in this process: Ctrl-C during a detection would end it, and leave a robot driving.
            self._finder = DetectorProcess(settings.detector, settings.family, decimate, width_px, height_px)
        try:
            return self._finder.search(frame.gray, frame.stamp_s, {})
        except DetectorError:
            self._check_running()  # what ends this program may end the detector first
            raise

    @property
    def lens(self) -> Optional[Intrinsics]:
        """The intrinsics in the file, else those of camera_info; None if neither is known."""
        return self.settings.lens or self.source.lens

    def close(self) -> None:
        """Leave the camera, and end the search."""
        self.source.close()
        if self._finder is not None:
            self._finder.close()


def calibrate_lens_by_board(options: argparse.Namespace, images: Images, program: Program) -> int:
    """Collect views of the board, and calibrate. Return the exit code."""
    say("move the board slowly through the whole image, near and far, tilted by 30 to 45 degrees; hold still between")
    views: List[BoardView] = []
    wanted = options.views or MAX_VIEWS
    size = (0, 0)
    last: Optional[BoardView] = None
    found_s = program.now_s
    result: Optional[LensCalibration] = None
    while len(views) < wanted and (result is None or result.problems):
        frame = images.take()
        size = (frame.gray.shape[1], frame.gray.shape[0])
        view = find_board(frame.gray)
        if view is not None:
            found_s = program.now_s
        elif program.now_s > found_s + HINT_S:
            found_s = program.now_s
            if is_mirrored(frame.gray):
                raise CalibrationError("images are mirrored: switch that off in the camera or its driver")
            text = "no board in the images (mean shade %.0f of 255): hold it near, flat, in good light"
            say(text % frame.gray.mean())
        is_still = view is not None and last is not None and _measure_shift(view, last) < STILL_PX
        last = view
        if view is None or not (is_still or options.views):
            continue
        if any(_measure_shift(view, other) < NEW_PX for other in views):
            continue
        views.append(view)
        if len(views) < ENOUGH_VIEWS:
            say("%d of at least %d images" % (len(views), min(ENOUGH_VIEWS, wanted)))
            continue
        result = calibrate_lens(views, *size)
        say(f"{len(views)} images: {result.problems[0] if result.problems else 'enough'}")
    result = result or calibrate_lens(views, *size)
    say(f"error {result.rms_px:.2f} px rms, focal length known to {100.0 * result.focal_error:.2f} %")
    return _finish(options.file, camera_file.describe_lens(result.lens), result.problems)


def _measure_shift(view: BoardView, other: BoardView) -> float:
    """Return by how many pixels the corners that both views show moved, on average; inf if they share none."""
    _, here, there = np.intersect1d(view.ids, other.ids, return_indices=True)
    if not len(here):
        return math.inf
    return float(np.linalg.norm(view.pixels[here] - other.pixels[there], axis=1).mean())


def import_lens(options: argparse.Namespace) -> int:
    """Take the intrinsics in a YAML file of camera_calibration. Return the exit code. Raises: CalibrationError."""
    lens = load_lens(options.yaml)
    say(f"focal lengths {lens.matrix[0, 0]:.1f} and {lens.matrix[1, 1]:.1f} px")
    return _finish(options.file, camera_file.describe_lens(lens), [])


def calibrate_extrinsics(options: argparse.Namespace, images: Images) -> int:
    """Calibrate the camera pose (extrinsics). Return the exit code."""
    settings = images.settings
    frames: List[Sequence[TagCorners]] = []
    while len(frames) < ARENA_FRAMES:
        frame = images.take()
        frames.append(images.find_tags(1.0, frame))
    lens = images.lens
    if lens is None:
        reason = f" ({images.source.lens_problem})" if images.source.lens_problem else ""
        raise CalibrationError(f"{options.file} holds no lens{reason}: calibrate_camera lens comes first")
    lens.check_size(*frame.gray.shape)
    layout = settings.layout
    tags = refine_corners(frame.gray, average_tags(frames), settings.family)
    try:
        result = calibrate_arena(lens, tags, layout.references, layout.reference_size_m)
    except CalibrationError as error:
        hint = find_print_mistake(frame.gray, settings.family)
        raise CalibrationError(f"{error}{'; ' + hint if hint else ''}") from None
    for tag_id, residual_m in sorted(result.residuals_m.items()):
        say("tag %d: %.1f mm%s" % (tag_id, 1e3 * residual_m, " (left out)" if tag_id in result.left_out else ""))
    height_m = result.camera.position_m[2]
    say(f"residual {1000.0 * result.rms_m:.1f} mm rms; the camera is {height_m:.2f} m above the floor")
    fits = fit_references(result.camera, tags, layout.references)
    seen = {fit.tag_id: fit.pose for fit in fits}
    parts = camera_file.describe_camera(result.camera, seen, result.sd_m)
    return _finish(options.file, parts, result.problems)


def calibrate_robot_tags(options: argparse.Namespace, images: Images, program: Program) -> int:
    """Turn and drive robots, one after another, and measure how their tags sit. Return the exit code."""
    layout = images.settings.layout
    robots: Sequence[int] = options.robots
    tags = layout.find_tags(robots)
    results: Dict[int, RobotCalibration] = {}
    problems: List[str] = []
    for robot_id in robots:
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
        say(
            "hero_%d: tag %.1f mm ahead, %.1f mm left, turned by %.1f degrees; delay %.0f ms; %.1f mm rms"
            % (
                robot_id,
                1e3 * result.mount.x_m,
                1e3 * result.mount.y_m,
                math.degrees(result.mount.yaw_rad),
                1e3 * result.delay_s,
                1e3 * result.rms_m,
            )
        )
        problems += ["hero_%d: %s" % (robot_id, problem) for problem in result.problems]
    if not results:
        raise CalibrationError("; ".join(problems))
    mounts = {**layout.mounts, **{tag_id: result.mount for tag_id, result in results.items()}}
    described = {tag_id: camera_file.describe_pose(mount) for tag_id, mount in mounts.items()}
    delay_s = float(np.median([result.delay_s for result in results.values()]))
    return _finish(options.file, {"mounts": described, "delay_s": round(delay_s, 4)}, problems)


def _watch_robot(images: Images, program: Program, robot_id: int, tag_id: int) -> RobotCalibration:
    """Drive one robot, and return how its tag sits. Raises: CalibrationError if it cannot be seen; HeroError."""
    settings, camera = images.settings, images.settings.camera
    assert camera is not None
    odometry: List[Tuple[float, Pose]] = []
    seen: List[Tuple[float, Pose]] = []

    def watch(frame: Optional[Frame]) -> int:
        found = images.find_tags(settings.decimate, frame) if frame is not None else []
        tags = [tag for tag in found if tag.tag_id == tag_id]
        if frame is not None and len(tags) == 1:
            pose = fit_squares(camera, tags, settings.layout.height_m)[0].pose
            if is_plausible(pose):
                seen.append((frame.stamp_s, pose))
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
                    watch(images.poll())
        finally:
            subscriber.unregister()
    return calibrate_robot(seen, odometry)


def _keep_odometry(kept: List[Tuple[float, Pose]], message: Odometry) -> None:
    pose = read_pose(message.pose.pose)
    if pose is not None:
        kept.append((message.header.stamp.to_sec(), pose))


def _finish(path: str, parts: Dict[str, Any], problems: Sequence[str]) -> int:
    """Write the file, and print the verdict. Return the exit code."""
    camera_file.update(path, parts)
    for problem in problems:
        say("  " + problem)
    say(f"{'USE WITH CARE' if problems else 'good'}; written to {path}")
    return 1 if problems else 0


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    description = "Calibrate an overhead camera, in three steps."
    parser = argparse.ArgumentParser(prog="calibrate_camera", description=description)
    parser.add_argument("part", choices=("lens", "arena", "robots"), help="what to calibrate, in this order")
    parser.add_argument("--file", default=camera_file.DEFAULT_PATH, help="camera file (%(default)s)")
    parser.add_argument("--image", default="camera/image_raw", help="topic of the images (%(default)s)")
    parser.add_argument("--device", default="", help="instead of a topic: /dev/video0, a URL, or a video file")
    parser.add_argument("--size", default="1920x1080", help="size of a device's images (%(default)s)")
    parser.add_argument("--rate", type=float, default=30.0, help="rate of a device, Hz (%(default)s)")
    parser.add_argument("--yaml", metavar="FILE", help="lens: take the result of camera_calibration")
    parser.add_argument("--views", type=int, default=0, metavar="N", help="lens: take this many images, moving or not")
    parser.add_argument("--robots", type=robot_ids_option, default=None, help="robots: ids, such as '0 1 2' or 0-3")
    options = parser.parse_args(arguments)
    if options.part == "robots" and options.robots is None:
        parser.error("robots: name them, such as --robots 0-3; each turns on the spot and drives 0.12 m to and fro")
    if options.views and options.views < MIN_VIEWS:
        parser.error("--views %d: it takes at least %d images" % (options.views, MIN_VIEWS))
    return options


def _check_file(options: argparse.Namespace) -> Settings:
    """Return the settings of a file. Raises: CalibrationError if it lacks what a part needs, SettingsError."""
    settings = camera_file.load(options.file)
    count = len(settings.layout.references)
    if options.part == "arena" and count < MIN_TAGS:
        raise CalibrationError(
            "%s names %d reference tags, but it takes %d: write their places into it (x, y in m, yaw in degrees), such"
            " as  references: {100: [-0.9, -0.6, 0], 101: [0.9, -0.6, 0], ...}" % (options.file, count, MIN_TAGS)
        )
    if options.part == "robots" and settings.camera is None:
        raise CalibrationError(f"{options.file} has no camera pose (extrinsics): run calibrate_camera arena first")
    return settings


def main() -> int:
    """Calibrate; return the exit code. Raises: LocalizationError, ProgramError."""
    options = parse_options(rospy.myargv(sys.argv)[1:])
    if options.part == "lens" and options.yaml:
        return import_lens(options)
    settings = _check_file(options)
    if options.part == "arena":
        import_optional("scipy.optimize", "python3-scipy")  # print_fit does, but after all images
    with Program("calibrate_camera", anonymous=True) as program:
        images = Images(options, program, settings)
        try:
            if options.part == "lens":
                return calibrate_lens_by_board(options, images, program)
            if options.part == "arena":
                return calibrate_extrinsics(options, images)
            return calibrate_robot_tags(options, images, program)
        finally:
            images.close()
