"""Accuracy and cost of the overhead camera on rendered images, beside what the stock method makes of them.

The camera is calibrated as a user does it: by views of a board, by reference tags whose places are a little wrong,
and by robots that turn and drive. Then robots stand all over the field, drive straight, and drive circles. The stock
method has the same tags and the same lens: a homography of the floor, or the pose of the single tag; stamps of arrival;
and tags that sit exactly in the robots' centers. The nodes are measured by localization_nodes. Run it with script/bench
localization.
"""

import argparse
import itertools
import math
import tempfile
from typing import Callable, Dict, List, NamedTuple, Sequence, Tuple, Union

import cv2
import numpy as np
from localization_nodes import measure_nodes
from measuring import print_machine

from hero_localization.calibration.arena_calibration import average_tags, calibrate_arena
from hero_localization.calibration.lens_calibration import BoardView, calibrate_lens
from hero_localization.calibration.robot_calibration import CALIBRATION_DRIVE, calibrate_robot
from hero_localization.camera.camera_model import Camera, Intrinsics
from hero_localization.filter.pose_filter import make_covariance
from hero_localization.filter.pose_hypothesis import StampedPose
from hero_localization.filter.swarm_localizer import SwarmLocalizer
from hero_localization.prints.boards import list_board_corners
from hero_localization.prints.tag_images import DEFAULT_SIZE_M
from hero_localization.simulated_camera.camera_node import scale
from hero_localization.simulated_camera.renderer import CameraRenderer
from hero_localization.simulated_camera.view import CameraOptions, PrintedTag
from hero_localization.tracking.detectors import create_detector
from hero_localization.tracking.tag_pose import DEFAULT_HEIGHT_M, TagCorners, TagLayout, fit_squares, locate
from hero_localization.tracking.tag_search import TagSearch
from hero_node import Pose, measure_distance, wrap_angle
from hero_sim.stepped import StepSwarm
from hero_sim.world import load_arena

OPTIONS = CameraOptions()
DELAY_S = OPTIONS.delay_s + OPTIONS.delay_jitter_s / 2.0
FRAME_S = 1.0 / OPTIONS.rate_hz
FIELD_M = (2.5, 1.4)
GRID = (4, 3)
WALLS_M = (1.6, 0.95)
"""Half of the arena: no robot comes to a wall."""
REFERENCES_M = ((-1.3, -0.7), (1.3, -0.7), (1.3, 0.7), (-1.3, 0.7), (0.0, -0.72), (0.0, 0.72))
BOARD_IMAGES = 24
CORNER_SD_PX = 0.15
PLACEMENTS = 20
COVERED_S = 2.0
FOUND_AGAIN_S = 0.2
METHODS = ("plane", "filter", "floor homography", "single-tag pose")
PARTS = ("accuracy", "nodes")


class Measured(NamedTuple):
    """Errors of one method in one situation: distance (m) and yaw (rad) of each pose."""

    distances_m: List[float]
    yaws_rad: List[float]

    def add(self, found: Sequence[float], true: Union[Sequence[float], np.ndarray]) -> None:
        """Take one pose that was found (x, y, yaw), and the true one."""
        self.distances_m.append(math.hypot(found[0] - true[0], found[1] - true[1]))
        self.yaws_rad.append(wrap_angle(found[2] - true[2]))

    def describe(self) -> str:
        """Return rms and worst distance (mm), and yaw (degrees rms)."""
        if not self.distances_m:
            return "%26s" % "-"
        distances_mm, yaws_deg = 1e3 * np.array(self.distances_m), np.degrees(self.yaws_rad)
        return f"{_rms(distances_mm):7.2f} {distances_mm.max():7.1f} {_rms(yaws_deg):10.2f}"


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def describe_arena() -> str:
    """Return an arena whose robots start on a grid, far enough from each other for what they drive."""
    x_m, y_m = WALLS_M
    corners = [[-x_m, -y_m], [x_m, -y_m], [x_m, y_m], [-x_m, y_m], [-x_m, -y_m]]
    lines = [f"walls_m: [{corners}]", "starts_m_deg:"]
    for row_m in np.linspace(-0.4, 0.35, GRID[1]):
        lines += [f"  - [{column_m:.3f}, {row_m:.3f}, 0]" for column_m in np.linspace(-0.7, 0.9, GRID[0])]
    return "\n".join(lines)


class Scene:
    """Simulated robots below a simulated camera, and a search for their tags in its images."""

    def __init__(self, seed: int, tape_m: float) -> None:
        random = np.random.RandomState(seed)
        count = GRID[0] * GRID[1]
        errors = random.normal(0.0, (0.002, 0.002, 0.03), (count, 3))
        self.mounts = [PrintedTag(index, 0.04, 0.076, *error) for index, error in enumerate(errors)]
        floor = [PrintedTag(100 + index, 0.1, 0.0, *place) for index, place in enumerate(REFERENCES_M)]
        measured = [np.array((tag.x_m, tag.y_m)) + random.normal(0.0, tape_m, 2) for tag in floor]
        self.references = {tag.tag_id: Pose(float(x_m), float(y_m), 0.0) for tag, (x_m, y_m) in zip(floor, measured)}
        with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
            file.write(describe_arena())
            file.flush()
            self.swarm = StepSwarm(count=count, seed=seed, arena=file.name)
            self.renderer = CameraRenderer(OPTIONS, load_arena(file.name), self.mounts, floor, seed)
        self.search = TagSearch(create_detector(), OPTIONS.width_px, OPTIONS.height_px)
        self.odometry: List[List[Tuple[float, Pose]]] = [[] for _ in range(count)]
        self.true_at: List[Dict[float, np.ndarray]] = [{} for _ in range(count)]
        self.swarm.rows.on_cycle.append(self._note_odometry)

    def _note_odometry(self, rows: np.ndarray) -> None:
        for row in rows:
            stamp_s = float(self.swarm.rows.odometry_ms[row]) / 1e3
            self.odometry[row].append((stamp_s, Pose(*map(float, self.swarm.rows.odometry[row]))))
            self.true_at[row][stamp_s] = self.true[row].copy()

    @property
    def true(self) -> np.ndarray:
        """True poses (N, 3) at the present: the world is up to one step behind."""
        world = self.swarm.rows.world
        speeds = world.measure_body_speeds()
        since_s = (self.swarm.rows.now_ms - world.time_ms) / 1e3
        moved_m, turned_rad = since_s * speeds.T
        headings_rad = world.poses[:, 2] + turned_rad / 2.0
        step = (moved_m * np.cos(headings_rad), moved_m * np.sin(headings_rad), turned_rad)
        return world.poses + np.column_stack(step)

    def drive(
        self,
        parts: Sequence[Tuple[float, float, float]],
        see: Callable[[float, List[TagCorners]], object],
        is_covered: bool = False,
    ) -> None:
        """Drive all robots (duration s, m/s, rad/s), and see each image; is_covered: it shows no robot."""
        for duration_s, linear_m_s, angular_rad_s in parts:
            end_s = self.swarm.now_s + duration_s
            while self.swarm.now_s < end_s:
                for robot in self.swarm.robots:
                    robot.drive(linear_m_s, angular_rad_s)
                self.swarm.sleep(FRAME_S)
                # Images are taken at whole milliseconds, as all happens here.
                stamp_s = self.swarm.rows.now_ms / 1e3
                shown = slice(0, 0) if is_covered else slice(None)
                speeds = self.swarm.rows.world.measure_body_speeds()
                image = self.renderer.render(self.true[shown], speeds[shown])
                see(stamp_s, self.search.search(image, stamp_s))


def find_lens(random: np.random.RandomState) -> Intrinsics:
    """Calibrate the lens by the corners of a board, a little off, that is held tilted all over the image."""
    views, lens, size_px = [], OPTIONS.geometry.lens, (OPTIONS.width_px, OPTIONS.height_px)
    corners_m = list_board_corners()
    for index in range(BOARD_IMAGES):
        tilt_rad = random.choice((-1.0, 1.0), 2) * random.uniform(0.25, 0.6, 2)
        rotation = cv2.Rodrigues(np.array((*tilt_rad, random.uniform(-0.3, 0.3))))[0]
        aim_px = np.array((0.18 + 0.32 * (index % 3), 0.2 + 0.3 * (index // 3 % 3))) * size_px
        place_m = random.uniform(0.35, 0.5) * np.append(lens.undistort(aim_px[None])[0], 1.0)
        points_m = (corners_m - corners_m.mean(axis=0)) @ rotation.T + place_m
        pixels = lens.distort(points_m[:, :2] / points_m[:, 2:])
        seen = np.flatnonzero(((pixels > 0.0) & (pixels < size_px)).all(axis=1))
        off_px = random.normal(0.0, CORNER_SD_PX, (len(seen), 2))
        views.append(BoardView(seen, (pixels[seen] + off_px).astype(np.float32)))
    result = calibrate_lens(views, OPTIONS.width_px, OPTIONS.height_px)
    verdict = "; ".join(result.problems) or "good"
    found_px, true_px = result.lens.matrix[0, 0], OPTIONS.focal_px[0]
    text = "lens: %d images, %.2f px rms, focal length %.1f px (true %.1f); %s"
    print(text % (len(views), result.rms_px, found_px, true_px, verdict))
    return result.lens


def find_camera(scene: Scene, lens: Intrinsics) -> Camera:
    """Calibrate the camera's place by the reference tags."""
    detector = create_detector(decimate=1.0)
    frames = [detector.detect(scene.renderer.render(scene.true)) for _ in range(5)]
    result = calibrate_arena(lens, average_tags(frames), scene.references)
    off_mm = 1e3 * np.linalg.norm(result.camera.position_m - scene.renderer.camera.position_m)
    verdict = "; ".join(result.problems) or "good"
    print(f"arena: {1000.0 * result.rms_m:.2f} mm rms, camera {off_mm:.1f} mm off; {verdict}")
    return result.camera


def find_layout(scene: Scene, camera: Camera) -> Tuple[TagLayout, float]:
    """Calibrate the robots' tags, and the delay of the camera."""
    seen: Dict[int, List[Tuple[float, Pose]]] = {tag.tag_id: [] for tag in scene.mounts}

    def see(stamp_s: float, tags: List[TagCorners]) -> None:
        ours = [tag for tag in tags if tag.tag_id in seen]
        for fit in fit_squares(camera, ours, DEFAULT_HEIGHT_M):
            seen[fit.tag_id].append((stamp_s, fit.pose))

    scene.drive(CALIBRATION_DRIVE, see)
    mounts, delays_s, off = {}, [], Measured([], [])
    for tag in scene.mounts:
        result = calibrate_robot(seen[tag.tag_id], scene.odometry[tag.tag_id])
        mounts[tag.tag_id] = result.mount
        delays_s.append(result.delay_s)
        off.add(result.mount, (tag.x_m, tag.y_m, tag.yaw_rad))
        if result.problems:
            print("hero_%d: %s" % (tag.tag_id, "; ".join(result.problems)))
    delay_s = float(np.median(delays_s))
    print(f"robots: delay {1000.0 * delay_s:.1f} ms; tags off by (mm rms, worst, deg rms) {off.describe()}")
    return TagLayout(mounts=mounts, references=scene.references), delay_s


class StockMethod:
    """The stock suite's two ways from tags to poses."""

    def __init__(self, scene: Scene, camera: Camera, tags: Sequence[TagCorners]) -> None:
        self._camera = camera
        known = [tag for tag in tags if tag.tag_id in scene.references]
        rays = camera.lens.undistort(np.array([tag.center for tag in known]))
        places_m = np.array([scene.references[tag.tag_id][:2] for tag in known])
        self._floor = cv2.findHomography(rays, places_m)[0]

    def locate(self, method: str, tag: TagCorners) -> Tuple[float, float, float]:
        """Return x, y (m) and yaw (rad) of a tag, which the stock method takes for the robot's."""
        if method == "floor homography":
            rays = self._camera.lens.undistort(tag.corners)
            corners_m = cv2.perspectiveTransform(rays[:, None], self._floor)[:, 0]
            center, up = corners_m.mean(axis=0), corners_m[:2].sum(axis=0) - corners_m[2:].sum(axis=0)
            return float(center[0]), float(center[1]), math.atan2(up[1], up[0])
        half_m = DEFAULT_SIZE_M / 2.0
        square = half_m * np.array(((-1, 1, 0), (1, 1, 0), (1, -1, 0), (-1, -1, 0)), dtype=float)
        lens = self._camera.lens
        _, turn, shift = cv2.solvePnP(
            square, tag.corners.copy(), lens.matrix, lens.distortion, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        place_m = self._camera.rotation.T @ shift.ravel() + self._camera.position_m
        up = self._camera.rotation.T @ cv2.Rodrigues(turn)[0][:, 1]
        return float(place_m[0]), float(place_m[1]), math.atan2(up[1], up[0])


def measure_standing(
    scene: Scene, camera: Camera, layout: TagLayout, stock: StockMethod, seed: int
) -> Dict[str, Measured]:
    """Place robots all over the field, and compare."""
    random = np.random.RandomState(seed + 1000)
    errors = {method: Measured([], []) for method in METHODS}
    detector = create_detector()
    for _ in range(PLACEMENTS):
        places = draw_places(random, len(scene.mounts))
        tags = detector.detect(scene.renderer.render(places))
        for robot, sighting in locate(camera, tags, layout).robots.items():
            errors["plane"].add(sighting.pose, places[robot])
        for tag in tags:
            if tag.tag_id < len(places):
                for method in METHODS[2:]:
                    errors[method].add(stock.locate(method, tag), places[tag.tag_id])
    print("standing: %d of %d tags found" % (len(errors["plane"].distances_m), PLACEMENTS * len(scene.mounts)))
    return errors


def draw_places(random: np.random.RandomState, count: int) -> np.ndarray:
    """Return poses (N, 3) in the field, far enough apart that no robot hides another."""
    places: List[np.ndarray] = []
    while len(places) < count:
        place = np.append(random.uniform(-0.5, 0.5, 2) * (np.array(FIELD_M) - 0.1), random.uniform(-math.pi, math.pi))
        if all(math.hypot(*(place[:2] - other[:2])) > 0.16 for other in places):
            places.append(place)
    return np.array(places)


class Localization:
    """Poses that localize computes from odometry and late images.

    Attributes:
        errors: of each pose at the present, half a second after the start or later.
        unannounced_m: the largest step of a pose that no line for people tells.
    """

    def __init__(self, scene: Scene, camera: Camera, layout: TagLayout, delay_s: float) -> None:
        self.errors = Measured([], [])
        self.unannounced_m = 0.0
        self._settled_s = scene.swarm.now_s + 0.5
        self._scene, self._camera, self._layout, self._delay_s = scene, camera, layout, delay_s
        self._localizer = SwarmLocalizer()
        self._localizer.add_robots(range(len(scene.mounts)))
        self._fed = [len(readings) for readings in scene.odometry]
        self._waiting: List[Tuple[float, Sequence[TagCorners]]] = []

    def see(self, stamp_s: float, tags: Sequence[TagCorners]) -> List[Sequence[TagCorners]]:
        """Take an image, and the odometry up to it; return the tags of the images that arrive now."""
        for robot, readings in enumerate(self._scene.odometry):
            for odometry_s, pose in readings[self._fed[robot] :]:
                self._localizer.add_odometry(robot, odometry_s, pose, stamp_s)
            self._fed[robot] = len(readings)
        self._waiting.append((stamp_s, tags))
        arrived = []
        while self._waiting and self._waiting[0][0] + DELAY_S <= stamp_s:
            taken_s, found = self._waiting.pop(0)
            arrived.append(found)
            self._correct(stamp_s, taken_s, found)
        self._localizer.find_lost(stamp_s)
        for robot, estimate in self._list_estimates(stamp_s).items():
            true = self._scene.true_at[robot].get(estimate.stamp_s)
            if stamp_s > self._settled_s and true is not None:
                self.errors.add(estimate.pose, true)
        return arrived

    def _list_estimates(self, now_s: float) -> Dict[int, StampedPose]:
        robots = self._localizer.list_robots(now_s)
        return {robot.robot_id: robot.estimate for robot in robots if robot.estimate is not None}

    def _correct(self, now_s: float, taken_s: float, tags: Sequence[TagCorners]) -> None:
        before = self._list_estimates(now_s)
        lines: Dict[int, List[str]] = {}
        for robot, sighting in locate(self._camera, tags, self._layout).robots.items():
            covariance = make_covariance(sighting.position_sd_m, sighting.yaw_sd_rad)
            measurement = StampedPose(taken_s - self._delay_s, sighting.pose, covariance)
            lines[robot] = self._localizer.add_measurement(robot, measurement, now_s)
        for robot, estimate in self._list_estimates(now_s).items():
            if robot in before and not lines.get(robot):
                step_m = measure_distance(before[robot].pose, estimate.pose)
                self.unannounced_m = max(self.unannounced_m, step_m)


def measure_driving(
    scene: Scene,
    camera: Camera,
    layout: TagLayout,
    delay_s: float,
    stock: StockMethod,
    parts: Sequence[Tuple[float, float, float]],
) -> Dict[str, Measured]:
    """Drive robots, and compare measured poses at their time, all others at the present."""
    errors = {method: Measured([], []) for method in METHODS}
    localization = Localization(scene, camera, layout, delay_s)
    errors["filter"] = localization.errors

    def see(stamp_s: float, tags: List[TagCorners]) -> None:
        for robot, sighting in locate(camera, tags, layout).robots.items():
            errors["plane"].add(sighting.pose, scene.true[robot])
        for tag in itertools.chain(*localization.see(stamp_s, tags)):
            if tag.tag_id < len(scene.mounts):
                for method in METHODS[2:]:
                    errors[method].add(stock.locate(method, tag), scene.true[tag.tag_id])

    scene.drive(parts, see)
    return errors


def measure_occlusion(
    scene: Scene, camera: Camera, layout: TagLayout, delay_s: float, speed: Tuple[float, float]
) -> Tuple[Measured, Measured, float]:
    """Drive robots forward, back and forward again (m/s, rad/s), all occluded while they drive back.

    Returns: errors while they are covered; from FOUND_AGAIN_S after it on; the largest step that is not said, m.
    """
    localization = Localization(scene, camera, layout, delay_s)
    counted = []
    for duration_s, direction, is_covered, is_counted in (
        (1.0, 1.0, False, False),
        (COVERED_S, -1.0, True, True),
        (FOUND_AGAIN_S, 1.0, False, False),
        (1.0, 1.0, False, True),
    ):
        localization.errors = Measured([], [])
        scene.drive([(duration_s, direction * speed[0], direction * speed[1])], localization.see, is_covered)
        if is_counted:
            counted.append(localization.errors)
    return counted[0], counted[1], localization.unannounced_m


def measure_accuracy(seed: int, tape_m: float) -> None:
    """Calibrate, measure, print."""
    scene = Scene(seed, tape_m)
    camera = find_camera(scene, find_lens(np.random.RandomState(seed)))
    layout, delay_s = find_layout(scene, camera)
    stock = StockMethod(scene, camera, create_detector(decimate=1.0).detect(scene.renderer.render(scene.true)))
    straight = ((1.0, 0.2, 0.0), (1.0, -0.2, 0.0)) * 3
    circles = ((3.0, 0.2, 2.5), (3.0, 0.2, -2.5))
    table = {
        "standing, whole field": measure_standing(scene, camera, layout, stock, seed),
        "0.2 m/s to and fro": measure_driving(scene, camera, layout, delay_s, stock, straight),
        "0.2 m/s in circles": measure_driving(scene, camera, layout, delay_s, stock, circles),
    }
    print("\n%-22s %-18s %7s %7s %10s" % ("", "method", "mm rms", "worst", "deg rms"))
    for name, errors in table.items():
        for method in METHODS:
            print(f"{name:22} {method:18} {errors[method].describe()}")
    print(f"\ncovered for {COVERED_S:g} s while driving 0.2 m/s")
    for name, speed in (("straight", (0.2, 0.0)), ("in circles", (0.2, 3.0))):
        covered, after, step_m = measure_occlusion(scene, camera, layout, delay_s, speed)
        print(f"{name:22} {'covered':18} {covered.describe()}")
        print("%-22s %-18s %s" % ("", "from %g s after" % FOUND_AGAIN_S, after.describe()))
        print(f"{'':22} largest step that is not reported: {1000.0 * step_m:.1f} mm")


def main() -> None:
    """Measure what the command line asks for."""
    parser = argparse.ArgumentParser(description="Accuracy and cost of the overhead camera, on rendered images.")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--seed", type=int, default=0)
    text = "error of the reference tags' places, mm (%(default)s)"
    parser.add_argument("--tape-mm", type=float, default=1.0, help=text)
    parser.add_argument("--count", type=int, default=50, help="robots that the nodes track (%(default)s)")
    text = "width of the nodes' images, px (%(default)s); 3840 takes 1 GB of memory"
    parser.add_argument("--width", type=int, default=1920, help=text)
    parser.add_argument("--rate", type=float, default=30.0, help="of the nodes' images, Hz (%(default)s)")
    text = "speed of the nodes' time, by that of the clock (%(default)s)"
    parser.add_argument("--speed", type=float, default=1.0, help=text)
    parser.add_argument("--seconds", type=float, default=20.0, help="for so long (%(default)s)")
    parser.add_argument("--rounds", type=int, default=1, help="of the nodes (%(default)s)")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    print_machine()
    if "accuracy" in options.only:
        measure_accuracy(options.seed, options.tape_mm / 1e3)
    if "nodes" in options.only:
        camera = scale(OPTIONS, options.width, options.width * 9 // 16)._replace(rate_hz=options.rate)
        measure_nodes(camera, options.count, options.seconds, options.rounds, options.speed)


if __name__ == "__main__":
    main()
