"""Program calibrate_camera: intrinsics (lens), extrinsics (arena), tags on robots. Prints errors and a verdict."""

import argparse
import sys
from typing import Sequence

import rospy

from hero_client import Program
from hero_node import import_optional
from hero_node.parameters import robot_ids_option

from ..calibration.arena_calibration import MIN_TAGS
from ..errors import CalibrationError
from ..tracking import settings as camera_file
from ..tracking.settings import Settings
from .calibrate_arena import calibrate_extrinsics
from .calibrate_lens import calibrate_lens_by_board, import_lens
from .calibrate_robots import calibrate_robot_tags
from .calibration_images import Images


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    description = "Calibrate an overhead camera, in three steps."
    parser = argparse.ArgumentParser(prog="calibrate_camera", description=description)
    parser.add_argument("part", choices=("lens", "arena", "robots"), help="what to calibrate, in this order")
    parser.add_argument("--file", default=camera_file.DEFAULT_PATH, help="camera file (%(default)s)")
    parser.add_argument("--image", default="camera/image_raw", help="topic of the images (%(default)s)")
    parser.add_argument("--device", default="", help="instead of a topic: /dev/video0, or a URL")
    parser.add_argument("--size", default="1920x1080", help="size of a device's images (%(default)s)")
    parser.add_argument("--rate", type=float, default=30.0, help="rate of a device, Hz (%(default)s)")
    parser.add_argument("--yaml", metavar="FILE", help="lens: take the result of camera_calibration")
    parser.add_argument("--robots", type=robot_ids_option, default=None, help="robots: ids, such as '0 1 2' or 0-3")
    options = parser.parse_args(arguments)
    if options.part == "robots" and options.robots is None:
        parser.error("robots: name them, such as --robots 0-3; each turns on the spot and drives 0.12 m to and fro")
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
    if options.part != "lens":
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
