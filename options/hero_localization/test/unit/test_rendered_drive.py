"""A robot that is stepped below simulated cameras, from their rendered images to calibrations and poses."""

import math
import re
from contextlib import nullcontext
from types import SimpleNamespace

import pytest
import rospy
from geometry_msgs.msg import Point, Pose, PoseWithCovariance, Quaternion
from nav_msgs.msg import Odometry
from std_msgs.msg import Header

from hero_localization.calibration.arena_calibration import average_tags, calibrate_arena
from hero_localization.camera.frame_source import Frame
from hero_localization.filter.pose_filter import make_covariance
from hero_localization.filter.pose_hypothesis import StampedPose
from hero_localization.filter.swarm_localizer import SwarmLocalizer
from hero_localization.nodes import calibrate_camera, calibrate_robots
from hero_localization.simulated_camera.renderer import CameraRenderer
from hero_localization.simulated_camera.view import CameraOptions, PrintedTag
from hero_localization.tracking import settings
from hero_localization.tracking.detectors import create_detector
from hero_localization.tracking.settings import Settings
from hero_localization.tracking.tag_pose import TagLayout
from hero_localization.tracking.tag_search import TagSearch
from hero_localization.tracking.tracker import Tracker
from hero_node import geometry
from hero_sim.stepped import StepSwarm
from hero_sim.world import load_arena

HEIGHT_M = 0.9
OPTIONS = CameraOptions(
    width_px=480, height_px=240, focal_px=(460.0, 460.0), center_px=(238.0, 121.0), position_m=(0.0, 0.0, HEIGHT_M)
)
FIELD_M = 480.0 / 460.0 * (HEIGHT_M - 0.076)
"""What a camera sees of the plane of the robots' tags, from left to right."""

ARENA = """
walls_m: [[[-2, -1], [2, -1], [2, 1], [-2, 1], [-2, -1]]]
starts_m_deg: [[0.1, 0.0, 0]]
"""
PICTURE_S = 0.1
MAX_OFF_M, MAX_OFF_RAD = 0.008, 0.04
"""Two of the small images' pixels; a jump from one camera to the other by a mistake is far more."""
PLACES_M = ((-0.35, -0.16), (0.35, -0.16), (0.35, 0.16), (-0.35, 0.16))
"""Of a camera's reference tags, from the place below it."""


class Scene:
    """One robot, stepped, in an arena.

    Attributes:
        on_odometry: called with the stamp and the pose of each reading.
        true_at: true pose at each of these stamps, and of each image.
    """

    def __init__(self, folder):
        self.path = str(folder / "arena.yaml")
        (folder / "arena.yaml").write_text(ARENA)
        self.swarm = StepSwarm(count=1, seed=3, arena=self.path)
        self.rows = self.swarm.rows
        self.on_odometry, self.true_at = [], {}
        self.rows.on_cycle.append(self.note_odometry)

    def note_odometry(self, rows):
        for stamp_ms, pose in zip(self.rows.odometry_ms[rows].tolist(), self.rows.odometry[rows].tolist()):
            self.true_at[stamp_ms / 1e3] = self.true
            for receive in self.on_odometry:
                receive(stamp_ms / 1e3, geometry.Pose(*pose))

    @property
    def taken_s(self):
        """The time for which the simulator knows the true pose."""
        return self.rows.world.time_ms / 1e3

    @property
    def true(self):
        return geometry.Pose(*self.rows.world.poses[0].tolist())

    def render(self, renderer):
        return renderer.render(self.rows.world.poses, self.rows.world.measure_body_speeds())


class TrackedCamera:
    """A camera at x_m, calibrated by its own images of four reference tags, and its tracker."""

    def __init__(self, scene, x_m, first_reference):
        options = OPTIONS._replace(position_m=(x_m, 0.0, HEIGHT_M))
        floor = [
            PrintedTag(first_reference + index, 0.1, 0.0, x_m + place_m[0], place_m[1])
            for index, place_m in enumerate(PLACES_M)
        ]
        references = {tag.tag_id: geometry.Pose(tag.x_m, tag.y_m, 0.0) for tag in floor}
        self.renderer = CameraRenderer(options, load_arena(scene.path), [PrintedTag(0)], floor, first_reference)
        detector = create_detector(decimate=1.0)
        frames = [detector.detect(scene.render(self.renderer)) for _ in range(5)]
        camera = calibrate_arena(options.geometry.lens, average_tags(frames), references).camera
        self.tracker = Tracker(Settings(layout=TagLayout(references=references)), camera)
        self.search = TagSearch(detector, options.width_px, options.height_px)

    def look(self, scene):
        """Return what the next image shows of robot 0, or None."""
        scene.true_at[scene.taken_s] = scene.true
        tags = self.search.search(scene.render(self.renderer), scene.taken_s)
        return self.tracker.take(tags, scene.taken_s, 0).robots.get(0)


@pytest.mark.slow
@pytest.mark.parametrize("gap_m", [-0.2, 0.15])
def test_a_robot_that_changes_cameras_keeps_one_continuous_pose(tmp_path, gap_m):
    scene = Scene(tmp_path)
    cameras = [TrackedCamera(scene, 0.0, 100), TrackedCamera(scene, FIELD_M + gap_m, 110)]
    localizer, lines, seen_by = SwarmLocalizer(), [], []
    localizer.add_robots([0])

    def follow(stamp_s, pose):
        lines.extend(localizer.add_odometry(0, stamp_s, pose, stamp_s))

    scene.on_odometry.append(follow)
    while len(seen_by) < 20 or seen_by[-10:] != [(False, True)] * 10:
        assert len(seen_by) < 200, seen_by
        scene.swarm[0].drive(0.15, 0.0)
        scene.swarm.sleep(PICTURE_S)
        sightings = [camera.look(scene) for camera in cameras]
        for seen in sightings:
            if seen is not None:
                measured = StampedPose(scene.taken_s, seen.pose, make_covariance(seen.position_sd_m, seen.yaw_sd_rad))
                lines += localizer.add_measurement(0, measured, scene.taken_s)
        lines += localizer.find_lost(scene.taken_s)
        seen_by.append(tuple(seen is not None for seen in sightings))
        (robot,) = localizer.list_robots(scene.taken_s)
        if robot.estimate is None:  # its first poses wait for odometry of their time
            continue
        true, pose = scene.true_at[robot.estimate.stamp_s], robot.estimate.pose
        assert math.hypot(pose.x_m - true.x_m, pose.y_m - true.y_m) < MAX_OFF_M, seen_by
        assert abs(geometry.wrap_angle(pose.yaw_rad - true.yaw_rad)) < MAX_OFF_RAD, seen_by
    assert seen_by[0] == (True, False)
    assert ((True, True) in seen_by) == (gap_m < 0.0)
    assert lines[0].startswith("hero_0 found at")
    assert any("lost" in line for line in lines) == (gap_m > 0.0), lines
    assert not [line for line in lines if "moved by hand" in line or "corrected" in line], lines


class SteppedPictures:
    """Images of a scene for calibrate_camera; time passes while it waits for one."""

    def __init__(self, scene, renderer, path):
        self.scene, self.renderer, self.settings = scene, renderer, settings.load(path)
        self.detector = create_detector(decimate=1.0)

    def poll(self):
        self.scene.swarm.sleep(PICTURE_S)
        return Frame(self.scene.taken_s, self.scene.render(self.renderer), 0)

    take = poll

    def find_tags(self, frame):
        return self.detector.detect(frame.gray)


def make_odometry(stamp_s, pose):
    half_rad = pose.yaw_rad / 2.0
    turn = Quaternion(0.0, 0.0, math.sin(half_rad), math.cos(half_rad))
    place = PoseWithCovariance(pose=Pose(Point(pose.x_m, pose.y_m, 0.0), turn))
    return Odometry(header=Header(stamp=rospy.Time.from_sec(stamp_s)), pose=place)


@pytest.mark.slow
@pytest.mark.parametrize(("yaw_rad", "height_m"), [(0.05, 0.076), (math.pi - 0.05, 0.081), (0.05, 0.071)])
def test_calibrating_robots_names_tags_upside_down_or_at_a_wrong_height(
    tmp_path, monkeypatch, capsys, yaw_rad, height_m
):
    scene, path = Scene(tmp_path), str(tmp_path / "camera.yaml")
    place_m = (scene.true.x_m, scene.true.y_m, HEIGHT_M)
    options = OPTIONS._replace(width_px=240, center_px=(121.0, 118.0), position_m=place_m)
    floor = [PrintedTag(100 + side, 0.08, 0.0, place_m[0], place_m[1] + 0.15 * side) for side in (-1, 1)]
    robot = PrintedTag(0, height_m=height_m, yaw_rad=yaw_rad)
    renderer = CameraRenderer(options, load_arena(scene.path), [robot], floor)
    references = {"references": {tag.tag_id: [tag.x_m, tag.y_m, 0.0] for tag in floor}, "reference_size_m": 0.08}
    settings.update(path, {**references, **settings.describe_camera(renderer.camera, {})})

    def subscribe(topic, kind, receive, **others):
        scene.on_odometry.append(lambda *reading: receive(make_odometry(*reading)))
        return SimpleNamespace(unregister=scene.on_odometry.clear)

    monkeypatch.setattr(rospy, "Subscriber", subscribe)
    monkeypatch.setattr(calibrate_robots, "read_duration_clock_s", lambda: scene.swarm.now_s)
    monkeypatch.setattr(calibrate_robots, "Robot", lambda robot_id: nullcontext(scene.swarm[robot_id]))
    program = SimpleNamespace(sleep=None)
    parsed = calibrate_camera.parse_options(["robots", "--robots", "0", "--file", path])
    status = calibrate_robots.calibrate_robot_tags(parsed, SteppedPictures(scene, renderer, path), program)
    text, is_turned, is_off = capsys.readouterr().out, yaw_rad > 1.0, height_m != 0.076
    assert status == int(is_turned or is_off), text
    assert ("hero_0: the tag is on upside down" in text) == is_turned, text
    told = re.findall("tags are ([0-9]+) mm above the floor by their size, not 76", text)
    assert [float(found) for found in told] == pytest.approx([1e3 * height_m] * is_off, abs=1.0), text
    assert settings.load(path).layout.mounts[0].yaw_rad == pytest.approx(yaw_rad, abs=0.03)
