"""Wide lenses that plumb_bob does not explain, by the three ways in which a lens comes into a camera file.

Part of script/bench lab_camera.
"""

import math
import tempfile
from typing import Dict, List, Tuple

import numpy as np
import yaml
from lab_camera import FISHEYE, RATIONAL, LabCamera, LabTag
from sensor_msgs.msg import CameraInfo

from hero_localization.calibration.arena_calibration import calibrate_arena
from hero_localization.calibration.lens_calibration import BoardView, calibrate_lens, find_board, load_lens
from hero_localization.calibration.print_fit import refine_corners
from hero_localization.camera.camera_model import EQUIDISTANT, Camera, Intrinsics
from hero_localization.camera.camera_model import RATIONAL as RATIONAL_MODEL
from hero_localization.errors import CalibrationError, LocalizationError
from hero_localization.tracking.detectors import create_detector
from hero_localization.tracking.settings import describe_lens, load, update
from hero_localization.tracking.tag_pose import TagLayout, locate
from hero_node import Pose

HEIGHT_M, VIEWS, ROBOTS = 1.6, 24, 20
REFERENCES_M = ((-1.3, -0.7), (1.3, -0.7), (1.3, 0.7), (-1.3, 0.7), (0.0, -0.75), (0.0, 0.75))
TAPE_SD_M = 0.0007


def describe(lab: LabCamera) -> Tuple[Dict[str, object], str]:
    """Return the lab's lens as a file of camera_calibration holds it, and the model."""
    lens, (u, v) = lab.lens, lab.center_px
    model = EQUIDISTANT if lens.is_fisheye else RATIONAL_MODEL
    distortion = [lens.k1, lens.k2, 0.0, 0.0] + ([] if lens.is_fisheye else [0.0, lens.k4, 0.0, 0.0])
    matrix = [lens.focal_px, 0.0, u, 0.0, lens.focal_px, v, 0.0, 0.0, 1.0]
    content = {
        "image_width": lens.size_px[0],
        "image_height": lens.size_px[1],
        "camera_matrix": {"rows": 3, "cols": 3, "data": matrix},
        "distortion_model": model,
        "distortion_coefficients": {"rows": 1, "cols": len(distortion), "data": distortion},
    }
    return content, model


def take_lenses(lab: LabCamera, random: np.random.RandomState) -> Dict[str, Intrinsics]:
    """Return the lens by each way, read back from a camera file."""
    content, model = describe(lab)
    matrix, distortion = content["camera_matrix"]["data"], content["distortion_coefficients"]["data"]  # type: ignore
    info = CameraInfo(width=lab.lens.size_px[0], height=lab.lens.size_px[1], distortion_model=model)
    info.K, info.D = matrix, distortion
    lenses = {
        "camera_info": Intrinsics.from_camera_info(info.width, info.height, info.K, info.distortion_model, info.D)
    }
    with tempfile.TemporaryDirectory() as folder:
        with open(folder + "/lens.yaml", "w", encoding="utf-8") as file:
            yaml.safe_dump(content, file)
        lenses["YAML"] = load_lens(folder + "/lens.yaml")
        views: List[BoardView] = []
        while len(views) < VIEWS:
            at = np.array(lab.lens.size_px) * random.uniform(0.12, 0.88, 2)
            ray = lab._find_rays(at[None])[0]
            distance_m = random.uniform(0.2, 0.4) * lab.lens.focal_px / 1000.0
            tilt = random.choice((-1.0, 1.0), 2) * random.uniform(0.2, 0.6, 2)
            # The board faces the camera, then is tilted.
            turn = (tilt[0] - math.atan(ray[1]), tilt[1] + math.atan(ray[0]), random.uniform(-0.4, 0.4))
            gray = lab.render_board(turn, (*(ray * distance_m), distance_m), random)
            view = find_board(gray)
            if view is not None:
                views.append(view)
        lenses["board"] = calibrate_lens(views, *lab.lens.size_px).lens
        for way, lens in lenses.items():
            update(f"{folder}/{way}.yaml", describe_lens(lens))
        return {way: load(f"{folder}/{way}.yaml").lens for way in lenses}  # type: ignore


def measure_models(seeds: int) -> None:
    """Print errors of robots' poses with lenses of each model, by each way; then how others are refused."""
    for name, lens in {"equidistant, f 700": FISHEYE, "rational_polynomial, f 800": RATIONAL}.items():
        errors_m: Dict[str, List[float]] = {}
        kinds = set()
        for seed in range(seeds):
            random = np.random.RandomState(seed)
            lab = LabCamera(lens, (0.02, -0.03, HEIGHT_M))
            turns_rad = random.uniform(-3, 3, len(REFERENCES_M)).tolist()
            floor = [LabTag(100 + i, *REFERENCES_M[i], turn_rad, 0.1, 0.0) for i, turn_rad in enumerate(turns_rad)]
            robots: List[LabTag] = []
            while len(robots) < ROBOTS:
                x_m, y_m, yaw_rad = random.uniform((-1.2, -0.6, -3.0), (1.2, 0.6, 3.0)).tolist()
                if all(math.dist((x_m, y_m), (tag.x_m, tag.y_m)) > 0.13 for tag in robots + floor):
                    robots.append(LabTag(len(robots), x_m, y_m, yaw_rad))
            gray = lab.render(floor + robots, random)
            tags = create_detector(decimate=1.0).detect(gray)
            tape = random.normal(0.0, TAPE_SD_M, (len(floor), 2))
            references = {
                tag.tag_id: Pose(tag.x_m + x_m, tag.y_m + y_m, 0.0) for tag, (x_m, y_m) in zip(floor, tape.tolist())
            }
            for way, found in take_lenses(lab, random).items():
                kinds.add((way, found.model))
                try:
                    camera: Camera = calibrate_arena(found, refine_corners(gray, tags, "36h11"), references).camera
                except CalibrationError as error:
                    print(f"  {way}: {error}")
                    continue
                seen = locate(camera, tags, TagLayout(references=references)).robots
                errors_m.setdefault(way, []).extend(
                    math.dist(seen[tag.tag_id].pose[:2], tag[1:3]) for tag in robots if tag.tag_id in seen
                )
        for way, values in errors_m.items():
            rms_mm, worst_mm = 1e3 * math.sqrt(np.mean(np.square(values))), 1e3 * max(values)
            text = "lens %s by %s: %d poses, %.2f mm rms, worst %.1f; models %s"
            models = sorted(model for known, model in kinds if known == way)
            print(text % (name, way, len(values), rms_mm, worst_mm, ", ".join(models)), flush=True)
    lens_file = describe(LabCamera(FISHEYE))[0]
    with tempfile.TemporaryDirectory() as folder:
        with open(folder + "/lens.yaml", "w", encoding="utf-8") as file:
            yaml.safe_dump({**lens_file, "distortion_model": "thin_prism"}, file)
        matrix = (700, 0, 960, 0, 700, 540, 0, 0, 1)
        for way in (
            lambda: Intrinsics.from_camera_info(1920, 1080, matrix, "thin_prism", [0.1] * 12),
            lambda: load_lens(folder + "/lens.yaml"),
        ):
            try:
                way()
            except (ValueError, LocalizationError) as error:
                print(f"  refused: {error}")
