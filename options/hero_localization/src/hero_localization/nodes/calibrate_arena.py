"""Part arena of calibrate_camera: the camera pose (extrinsics) from reference tags at known positions."""

import argparse

from hero_node import say

from ..calibration.arena_calibration import average_tags, calibrate_arena
from ..calibration.print_fit import refine_corners
from ..errors import CalibrationError
from ..tracking.detectors import find_print_mistake
from ..tracking.settings import describe_camera
from ..tracking.tag_pose import fit_squares
from .calibration_images import Images, finish

ARENA_FRAMES = 30


def calibrate_extrinsics(options: argparse.Namespace, images: Images) -> int:
    """Calibrate the camera pose. Return the exit code. Raises: CalibrationError."""
    settings, layout, found = images.settings, images.settings.layout, []
    for _ in range(ARENA_FRAMES):
        frame = images.take()
        found.append(images.find_tags(frame))
    lens = settings.lens or images.source.lens
    if lens is None:
        reason = f" ({images.source.lens_problem})" if images.source.lens_problem else ""
        raise CalibrationError(f"{options.file} holds no lens{reason}: calibrate_camera lens comes first")
    lens.check_size(*frame.gray.shape)
    tags = refine_corners(frame.gray, average_tags(found), settings.family)
    try:
        result = calibrate_arena(lens, tags, layout.references, layout.reference_size_m)
    except CalibrationError as error:
        hint = find_print_mistake(frame.gray, settings.family)
        raise CalibrationError(f"{error}{'; ' + hint if hint else ''}") from None
    for tag_id, residual_m in sorted(result.residuals_m.items()):
        say("tag %d: %.1f mm%s" % (tag_id, 1e3 * residual_m, " (left out)" if tag_id in result.left_out else ""))
    height_m = result.camera.position_m[2]
    say(f"residual {1000.0 * result.rms_m:.1f} mm rms; the camera is {height_m:.2f} m above the floor")
    seen = [tag for tag in tags if tag.tag_id in layout.references]
    poses = {fit.tag_id: fit.pose for fit in fit_squares(result.camera, seen, 0.0)}
    return finish(options.file, describe_camera(result.camera, poses, result.sd_m), result.problems)
