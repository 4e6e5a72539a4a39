"""Localization under the faults of a real lab: lenses that distort, people's mistakes, hands, knocks, late poses.

Images are those of lab_camera; ages and uncertainties are measured with robots stepped in process. Only the CPU times
depend on the machine. Started by script/bench.
"""

import argparse
import math
import time
from typing import Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import cv2
import numpy as np
from lab_camera import (
    LENS_A,
    LENS_B,
    REFERENCE_M,
    REFERENCES_M,
    SETUPS,
    TAPE_SD_M,
    LabCamera,
    LabLens,
    LabTag,
    find_camera,
    make_lab,
)
from lab_filter import measure_ages, measure_uncertainty
from lab_heights import measure_heights
from lab_lenses import measure_models
from measuring import print_machine

from hero_localization.calibration.arena_calibration import average_tags, calibrate_arena
from hero_localization.calibration.lens_calibration import BoardView, calibrate_lens, find_board
from hero_localization.calibration.print_fit import refine_corners
from hero_localization.camera.camera_model import Camera
from hero_localization.errors import CalibrationError
from hero_localization.filter.pose_filter import make_covariance
from hero_localization.filter.pose_hypothesis import StampedPose
from hero_localization.filter.swarm_localizer import RobotState, SwarmLocalizer
from hero_localization.prints.tag_images import DEFAULT_SIZE_M
from hero_localization.tracking.detectors import create_detector, create_fine_detectors
from hero_localization.tracking.settings import Settings
from hero_localization.tracking.tag_pose import (
    DEFAULT_HEIGHT_M,
    TagCorners,
    TagLayout,
    find_smallest_side,
    list_corners,
)
from hero_localization.tracking.tag_search import TagSearch
from hero_localization.tracking.tracker import Tracker
from hero_node import Pose

FRAME_S = 1.0 / 30.0
TAGS = 50
WARM_FRAMES, FRAMES, RENDERED = 75, 40, 10
"""Before counting, the whole image has been searched once."""

CAMERAS = {
    "f 1391, k1 -0.32": LabCamera(),
    "f 1391, k1 -0.32, gamma 2.2": LabCamera(gamma=2.2),
    "f 900, k1 -0.38": LabCamera(LENS_B, (0.02, -0.03, 1.5)),
    "f 900, k1 -0.38, gamma 2.2": LabCamera(LENS_B, (0.02, -0.03, 1.5), gamma=2.2),
    "f 1391, tilted by 12 degrees": LabCamera(tilt_rad=(0.157, 0.14, 0.3)),
    "f 1150, k1 -0.28": LabCamera(LabLens(1150.0, -0.28, 0.09)),
}

ROBOT_PLACES_M = [(x_m, y_m) for x_m in (-0.8, -0.3, 0.3, 0.8) for y_m in (-0.3, 0.2)]
HAND_M_S = 0.5


def place_tags(lab: LabCamera, random: np.random.RandomState, count: int = TAGS) -> List[LabTag]:
    """Return robots' tags wholly within the image, by chance."""
    size_px, tags = np.array(lab.lens.size_px), []  # type: np.ndarray, List[LabTag]
    angles = np.linspace(0.0, math.tau, 16)
    rim_m = 0.0375 * np.column_stack((np.cos(angles), np.sin(angles)))
    while len(tags) < count:
        place = lab.find_points(random.uniform((0.0, 0.0), size_px)[None], 0.076)[0]
        rim = place + rim_m
        pixels = lab.project(np.column_stack((rim, np.full(len(rim), 0.076))))
        is_whole = (pixels > 2).all() and (pixels < size_px - 3).all()
        # Beyond the rim of the lens's model, no pixel shows a point.
        is_whole &= bool(np.abs(lab.find_points(pixels, 0.076) - rim).max() < 1e-4)
        if is_whole and all(math.dist(place, (tag.x_m, tag.y_m)) > 0.085 for tag in tags):
            tags.append(LabTag(len(tags), float(place[0]), float(place[1]), random.uniform(-math.pi, math.pi)))
    return tags


def create_search(lab: LabCamera) -> TagSearch:
    """Return the search as track runs it."""
    smallest_px = find_smallest_side(find_camera(lab), DEFAULT_SIZE_M, DEFAULT_HEIGHT_M)
    return TagSearch(
        create_detector("apriltag", "36h11", 2.0), *lab.lens.size_px, create_fine_detectors("36h11"), smallest_px
    )


def project_tags(lab: LabCamera, tags: Sequence[LabTag]) -> Dict[int, Tuple[float, float, float]]:
    """Return the pixels of the tags' centers, and their side, by id."""
    corners = [list_corners(Pose(*tag[1:4]), tag.size_m, tag.height_m) for tag in tags]
    seen = [TagCorners(tag.tag_id, lab.project(points_m)) for tag, points_m in zip(tags, corners)]
    return {tag.tag_id: (*tag.center.tolist(), tag.side_px) for tag in seen}


def run_search(
    lab: LabCamera, tags: Sequence[LabTag], images: Sequence[np.ndarray], frames: int, is_losing: bool = False
) -> Tuple[float, float]:
    """Return the share of tags that are found, and ms of CPU per image; is_losing: one after another is covered."""
    search, expected = create_search(lab), project_tags(lab, tags)
    found, cpu_s = 0, 0.0
    for index in range(WARM_FRAMES + frames):
        image = images[index % len(images)]
        if is_losing and index >= WARM_FRAMES and index % 30 < 15:
            u, v = map(int, expected[(index // 30 * 7) % len(tags)][:2])
            image = image.copy()
            image[max(0, v - 35) : v + 35, max(0, u - 35) : u + 35] = 110
        start_s = time.process_time()
        seen = search.search(image, index * FRAME_S, expected)
        if index >= WARM_FRAMES:
            cpu_s += time.process_time() - start_s
            found += len({tag.tag_id for tag in seen} & set(expected))
    return found / (frames * len(tags)), 1e3 * cpu_s / frames


def measure_tags(seeds: int) -> None:
    """Print the share of tags that are found, with each camera; then the cost while tags are lost."""
    print("tags found of %d, ms of CPU per image, smallest side" % TAGS)
    for name, lab in CAMERAS.items():
        results = []
        for seed in range(seeds):
            random = np.random.RandomState(seed)
            tags = place_tags(lab, random)
            results.append(run_search(lab, tags, [lab.render(tags, random) for _ in range(RENDERED)], FRAMES))
        share, cpu_ms = np.mean(results, axis=0)
        smallest_px = find_smallest_side(find_camera(lab), DEFAULT_SIZE_M, DEFAULT_HEIGHT_M)
        print(f"  {name:32} {100.0 * share:6.2f} % {cpu_ms:6.1f} ms {smallest_px:5.0f} px", flush=True)


def measure_load(seeds: int) -> None:
    """Print the CPU of the search for many tags in large images, and for some in many images."""
    wide = LabCamera(LENS_A._replace(focal_px=2.0 * LENS_A.focal_px, size_px=(3840, 2160)))
    for lab, count, rate_hz in ((wide, 100, 30.0), (LabCamera(), 20, 60.0)):
        results = []
        for seed in range(seeds):
            random = np.random.RandomState(seed)
            tags = place_tags(lab, random, count)
            results.append(run_search(lab, tags, [lab.render(tags, random) for _ in range(3)], FRAMES))
        share, cpu_ms = np.mean(results, axis=0)
        text = "%d tags in images of %d px at %.0f Hz: %.2f %% found, %.1f ms of CPU per image, %.2f cores"
        print(text % (count, lab.lens.size_px[0], rate_hz, 100.0 * share, cpu_ms, cpu_ms * rate_hz / 1e3), flush=True)


def measure_shadows(seeds: int) -> None:
    """Print the share of tags that are found where the edge of a shadow crosses each, and in bad light."""
    lens = LENS_A._replace(size_px=(960, 540))
    small = LENS_B._replace(size_px=(640, 360))
    cameras = {
        "f 1391": LabCamera(lens),
        "f 1391, gamma 2.2": LabCamera(lens, gamma=2.2),
        "f 900, 2.1 m": LabCamera(small, (0.02, -0.03, 2.1)),
        "f 900, 2.1 m, gamma 2.2": LabCamera(small, (0.02, -0.03, 2.1), gamma=2.2),
        "f 1391, noise 20": LabCamera(lens, noise=20.0),
        "f 1391, blur 1.8 px": LabCamera(lens, blur_px=1.8),
    }
    print(
        "tags found, by the light that a shadow leaves on one side of an edge across each tag, and ms of CPU per image"
    )
    for name, lab in cameras.items():
        shares = []
        for shade in (1.0, 0.6, 0.4, 0.25):
            results = []
            for seed in range(seeds):
                random = np.random.RandomState(seed)
                tags = [
                    tag._replace(shade=shade, edge_rad=random.uniform(-3, 3), edge_m=random.uniform(-0.014, 0.014))
                    for tag in place_tags(lab, random, 20)
                ]
                results.append(run_search(lab, tags, [lab.render(tags, random) for _ in range(3)], FRAMES))
            share, cpu_ms = np.mean(results, axis=0)
            shares.append(f"x {shade:g}: {100.0 * share:.1f} % {cpu_ms:.0f} ms")
        print(f"  {name:32} {', '.join(shares)}", flush=True)


def measure_losses(seeds: int) -> None:
    """Print the cost while a tag after another is covered for half a second, by that of none."""
    lab = CAMERAS["f 1391, k1 -0.32"]
    for seed in range(seeds):
        random = np.random.RandomState(seed)
        tags = place_tags(lab, random)
        images = [lab.render(tags, random) for _ in range(6)]
        costs_ms = [run_search(lab, tags, images, 180, is_losing)[1] for is_losing in (False, True)]
        text = "losses: %.1f ms per image with none lost, %.1f ms with one each second, ratio %.2f"
        print(text % (*costs_ms, costs_ms[1] / costs_ms[0]), flush=True)


# -- mistakes ---------------------------------------------------------------------------------------------------


class Scene(NamedTuple):
    """A lab's reference tags as the camera sees them, and their measured places."""

    camera: Camera
    seen: List[TagCorners]
    places: Dict[int, Pose]


def see_references(seed: int, lens: LabLens, height_m: float, **faults: float) -> Scene:
    """Render and detect the reference tags."""
    random = np.random.RandomState(seed)
    lab = make_lab(random, lens, height_m, **faults)
    tags = [
        LabTag(100 + index, x_m, y_m, random.uniform(-3, 3), REFERENCE_M, 0.0)
        for index, (x_m, y_m) in enumerate(REFERENCES_M)
    ]
    detector, frames = create_detector("apriltag", "36h11", 1.0), []
    for _ in range(3):
        image = lab.render(tags, random)
        frames.append(detector.detect(image))
    errors_m = random.normal(0.0, TAPE_SD_M, (len(tags), 2))
    places = {tag.tag_id: Pose(tag.x_m + x_m, tag.y_m + y_m, 0.0) for tag, (x_m, y_m) in zip(tags, errors_m)}
    return Scene(find_camera(lab), refine_corners(image, average_tags(frames), "36h11"), places)


def _move(places: Dict[int, Pose], change: Callable[[int, float, float], Tuple[float, float]]):  # type: ignore
    return {tag_id: Pose(*change(tag_id, pose.x_m, pose.y_m), 0.0) for tag_id, pose in places.items()}


def list_mistakes(places: Dict[int, Pose], random: np.random.RandomState) -> Iterator[Tuple[str, str, Dict[int, Pose]]]:
    """Yield mistakes of people, what a message must name, and the places with it; an empty one: nothing is wrong."""
    one, other = sorted(random.choice(sorted(places), 2, replace=False))
    yield "no mistake", "", places
    yield "tape 2 % long", "of their size", _move(places, lambda _, x, y: (x / 1.02, y / 1.02))
    yield "tape 1 % long", "of their size", _move(places, lambda _, x, y: (x / 1.01, y / 1.01))
    yield "tape 1 % short", "of their size", _move(places, lambda _, x, y: (x * 1.01, y * 1.01))
    swapped = {**places, one: places[other], other: places[one]}
    yield "two swapped", "tags %d and %d swapped" % (one, other), swapped
    yield "y the wrong way", "y the wrong way", _move(places, lambda _, x, y: (x, -y))
    yield "mm", "in m, not in mm", _move(places, lambda _, x, y: (1e3 * x, 1e3 * y))
    yield "cm", "in m, not in mm or cm", _move(places, lambda _, x, y: (1e2 * x, 1e2 * y))
    for off_mm in (5, 6, 8, 10, 20, 100):
        angle_rad, wrong = random.uniform(0.0, math.tau), int(random.choice(sorted(places)))
        right, off_m = places[wrong], 1e-3 * off_mm
        x_m, y_m = right.x_m + off_m * math.cos(angle_rad), right.y_m + off_m * math.sin(angle_rad)
        moved = {**places, wrong: Pose(x_m, y_m, 0.0)}
        yield "one %d mm off" % off_mm, "%d " % wrong, moved  # alone or beside one that may be it as well


def measure_mistakes(seeds: int) -> None:
    """Print how often each mistake is named."""
    for name, (lens, height_m, faults) in SETUPS.items():
        counts: Dict[str, List[bool]] = {}
        for seed in range(seeds):
            scene = see_references(seed, lens, height_m, **faults)
            for mistake, words, places in list_mistakes(scene.places, np.random.RandomState(seed)):
                try:
                    text = "; ".join(calibrate_arena(scene.camera.lens, scene.seen, places).problems)
                except CalibrationError as error:
                    text = str(error)
                counts.setdefault(mistake, []).append(words in text if words else not text)
        sides_px = [tag.side_px for tag in scene.seen]
        print(f"mistakes named, {name} (tags of {min(sides_px):.0f} to {max(sides_px):.0f} px)")
        shares = ["%s %d/%d" % (what, sum(right), len(right)) for what, right in counts.items()]
        print("  " + ", ".join(shares), flush=True)


# -- hands and knocks -------------------------------------------------------------------------------------------


class Lab:
    """Robots at rest below a camera, followed as track and localize do."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.RandomState(seed)
        self.lab, self.now_s, self.lines = LabCamera(), 0.0, []  # type: LabCamera, float, List[str]
        self.robots = [LabTag(index, *place, self.random.uniform(-3, 3)) for index, place in enumerate(ROBOT_PLACES_M)]
        self.floor = [LabTag(100 + i, *place, 0.0, REFERENCE_M, 0.0) for i, place in enumerate(REFERENCES_M)]
        references = {tag.tag_id: Pose(tag.x_m, tag.y_m, 0.0) for tag in self.floor}
        settings = Settings(layout=TagLayout(references=references), seen_references=references)
        self.tracker, self.search = Tracker(settings, find_camera(self.lab)), create_search(self.lab)
        self.localizer = SwarmLocalizer()
        self.localizer.add_robots(range(len(self.robots)))
        for _ in range(round(2.5 / FRAME_S)):
            self.step()
        self.lines.clear()

    def step(self) -> None:
        """Take an image."""
        self.now_s += FRAME_S
        for tag in self.robots:
            self.lines += self.localizer.add_odometry(tag.tag_id, self.now_s, Pose(0.0, 0.0, 0.0), self.now_s)
        expected = self.tracker.project(
            {robot.robot_id: robot.estimate.pose for robot in self.localizer.list_robots(self.now_s) if robot.estimate}
        )
        image = self.lab.render(self.robots + self.floor, self.random)
        tags = self.search.search(image, self.now_s, expected)
        sightings = self.tracker.take(tags, self.now_s, 0, expected)
        for robot_id, seen in sightings.robots.items():
            if not self.tracker.is_moved:
                covariance = make_covariance(seen.position_sd_m, seen.yaw_sd_rad)
                measurement = StampedPose(self.now_s, seen.pose, covariance)
                self.lines += self.localizer.add_measurement(robot_id, measurement, self.now_s)
        if self.tracker.is_moved:
            self.localizer.distrust(self.now_s, list(sightings.robots), self.now_s)
        self.lines += self.localizer.find_lost(self.now_s)

    def list_wrong(self, limit_m: float = 0.01) -> List[int]:
        """Return the robots that are off by more than this, and not marked."""
        return [
            robot.robot_id
            for robot in self.localizer.list_robots(self.now_s)
            if robot.state is RobotState.TRACKED
            and robot.estimate is not None
            and math.dist(robot.estimate.pose[:2], self.robots[robot.robot_id][1:3]) > limit_m
        ]


def measure_knocks(seeds: int) -> None:
    """Print how long after a knock the camera is named, and what else is said."""
    knocks = {
        "1 cm aside": {"position_m": (0.03, -0.03, 2.2)},
        "0.5 degrees": {"tilt_rad": (math.radians(5.5), math.radians(-3.3), 0.02)},
    }
    for name, change in knocks.items():
        for seed in range(seeds):
            lab = Lab(seed)
            lab.lab, start_s = lab.lab._replace(**change), lab.now_s
            named_s: Optional[float] = None
            wrong = 0.0
            for _ in range(45):
                lab.step()
                wrong += FRAME_S * bool(lab.list_wrong(0.006))
                problems = lab.tracker.list_problems()
                if named_s is None and any("the camera moved" in problem.text for problem in problems):
                    named_s = lab.now_s - start_s
            text = "knock, %s: named after %s s; a pose over 6 mm off was TRACKED for %.2f s; lines on robots: %s"
            print(text % (name, f"{named_s:.2f}" if named_s else "never", wrong, lab.lines or "none"), flush=True)


def measure_hands(seeds: int) -> None:
    """Print for how long a robot that is carried in open view is marked as tracked though it is elsewhere."""
    for seed in range(seeds):
        lab, wrong_s, longest_s = Lab(seed), 0.0, 0.0
        for index in range(45):
            if index < 20:
                tag = lab.robots[3]
                lab.robots[3] = tag._replace(x_m=tag.x_m + HAND_M_S * FRAME_S, yaw_rad=tag.yaw_rad + 0.03)
            lab.step()
            wrong_s = wrong_s + FRAME_S if lab.list_wrong() else 0.0
            longest_s = max(longest_s, wrong_s)
        text = "hand: over 10 mm off and TRACKED for %.2f s at most; wrong at the end: %s; %s"
        print(text % (longest_s, lab.list_wrong() or "none", "; ".join(lab.lines)), flush=True)


# -- the lens ---------------------------------------------------------------------------------------------------


def collect_views(lab: LabCamera, random: np.random.RandomState, count: int) -> List[BoardView]:
    """Return the board held all over the image, tilted, as people do it."""
    views: List[BoardView] = []
    size_px = np.array(lab.lens.size_px)
    while len(views) < count:
        index = len(views)
        at = size_px * (0.2 + 0.3 * (index % 3), 0.22 + 0.28 * (index // 3 % 3)) + random.normal(0.0, 60.0, 2)
        distance_m = random.uniform(0.3, 0.55) * lab.lens.focal_px / 1391.0
        tilt_rad = random.choice((-1.0, 1.0), 2) * random.uniform(0.1, 0.6, 2)
        ray = (at - lab.center_px) / lab.lens.focal_px
        position_m = (*(ray * distance_m), distance_m)
        view = find_board(lab.render_board((*tilt_rad, random.uniform(-0.4, 0.4)), position_m, random))
        if view is not None:
            views.append(view)
    return views


def measure_lenses(seeds: int) -> None:
    """Print the true and the told error of the focal length of each calibration."""
    for name, lens in {"f 1391, k1 -0.32": LENS_A, "f 900, k1 -0.38": LENS_B}.items():
        true, told = [], []
        for seed in range(seeds):
            random = np.random.RandomState(seed)
            result = calibrate_lens(collect_views(LabCamera(lens), random, 20), *lens.size_px)
            true += (np.diagonal(result.lens.matrix)[:2] / lens.focal_px - 1.0).tolist()
            told.append(result.focal_error)
        rms_true, rms_told = (100.0 * math.sqrt(np.mean(np.square(values))) for values in (true, told))
        text = "lens, %s, %d calibrations of 20 images: focal length off by %.3f %% rms, told %.3f %%, ratio %.2f"
        print(text % (name, seeds, rms_true, rms_told, rms_true / rms_told), flush=True)


PARTS: Dict[str, Callable[[int], None]] = {
    "tags": measure_tags,
    "load": measure_load,
    "shadows": measure_shadows,
    "losses": measure_losses,
    "mistakes": measure_mistakes,
    "heights": measure_heights,
    "knocks": measure_knocks,
    "hands": measure_hands,
    "ages": lambda seeds: measure_ages(),
    "uncertainty": measure_uncertainty,
    "lenses": measure_lenses,
    "models": measure_models,
}


def main() -> None:
    """Run the program."""
    parser = argparse.ArgumentParser(prog="script/bench lab_camera", description=__doc__)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--seeds", type=int, default=2, help="scenes of each kind (%(default)s)")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    print_machine()
    for name in options.only:
        PARTS[name](options.seeds)


if __name__ == "__main__":
    main()
