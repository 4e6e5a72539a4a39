"""Heights of robots' tags by their size beside reference tags, as calibrate_camera robots measures them.

Part of script/bench lab_camera.
"""

import math
from typing import Dict, List

import numpy as np
from lab_camera import REFERENCE_M, REFERENCES_M, SETUPS, TAPE_SD_M, LabTag, find_camera, make_lab

from hero_localization.calibration.arena_calibration import calibrate_arena
from hero_localization.calibration.print_fit import estimate_height, find_height_error, find_print_scale, refine_corners
from hero_localization.tracking.detectors import create_detector
from hero_localization.tracking.tag_pose import DEFAULT_HEIGHT_M, TagLayout
from hero_node import Pose

ROBOTS, IMAGES, STEP_M, SPEED_M_S = 3, 6, 0.015, 0.06
OFFS_M = (0.0, 0.005, -0.005, 0.015, -0.015)
"""By how much a camera file's height is wrong."""


def measure_heights(seeds: int) -> None:
    """Print errors of heights by some images of robots that drive, and how often a wrong one is named."""
    for name, (lens, height_m, faults) in SETUPS.items():
        errors_m: List[float] = []
        named = dict.fromkeys(OFFS_M, 0)
        for seed in range(seeds):
            random, detector = np.random.RandomState(seed), create_detector(decimate=1.0)
            lab = make_lab(random, lens, height_m, **faults)
            floor = [
                LabTag(100 + index, *place, random.uniform(-3, 3), REFERENCE_M, 0.0)
                for index, place in enumerate(REFERENCES_M)
            ]
            tape_m = random.normal(0.0, TAPE_SD_M, (len(floor), 2)).tolist()
            places = {tag.tag_id: Pose(tag.x_m + x, tag.y_m + y, 0.0) for tag, (x, y) in zip(floor, tape_m)}
            starts = random.uniform((-0.9, -0.45, -3.0), (0.9, 0.45, 3.0), (ROBOTS, 3)).tolist()
            layout, camera, scale = TagLayout(references=places), find_camera(lab), None
            heights_m: Dict[int, List[float]] = {}
            for step in range(IMAGES):
                robots = [
                    LabTag(index, x + STEP_M * step * math.cos(yaw), y + STEP_M * step * math.sin(yaw), yaw)
                    for index, (x, y, yaw) in enumerate(starts)
                ]
                gray = lab.render([*floor, *(tag._replace(speed_m_s=SPEED_M_S) for tag in robots)], random)
                tags = detector.detect(gray)
                if scale is None:
                    references = [tag for tag in tags if tag.tag_id in places]
                    camera = calibrate_arena(camera.lens, refine_corners(gray, references, "36h11"), places).camera
                    scale = find_print_scale(camera, gray, tags, layout, "36h11")
                    assert scale is not None, "no reference tag lies well within the image"
                for tag in tags:
                    if tag.tag_id < ROBOTS:
                        height = estimate_height(camera, gray, tag, scale, layout, "36h11")
                        heights_m.setdefault(tag.tag_id, []).append(height)
            error_m = float(np.median([np.median(values) for values in heights_m.values()])) - DEFAULT_HEIGHT_M
            errors_m.append(error_m)
            for off_m in OFFS_M:
                named[off_m] += abs(error_m - off_m) > find_height_error(camera, layout)
        rms_mm, worst_mm = 1e3 * math.sqrt(np.mean(np.square(errors_m))), 1e3 * max(map(abs, errors_m))
        told = ", ".join("%+.0f mm %d" % (1e3 * off_m, count) for off_m, count in named.items())
        text = "heights, %s: %.1f mm rms, worst %.1f; named of %d if wrong by: %s"
        print(text % (name, rms_mm, worst_mm, seeds, told), flush=True)
