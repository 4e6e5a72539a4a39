"""Videos of runs: each frame shows robots, objects and walls where they are, and the time."""

import itertools
from contextlib import nullcontext
from types import SimpleNamespace
from unittest.mock import create_autospec

import numpy as np
import pytest
from PIL import Image

from hero_client.values import BODY_RADIUS_M
from hero_node import Pose
from hero_recording import step_recorder
from hero_sim.scene import ARROW, CUBE, CYLINDER, TEXT, Shape
from hero_sim.world import Area, list_outlines, load_arena
from hero_sim.world.arena import build_rectangle
from hero_swarm import show, video
from hero_swarm.behavior import Behavior
from hero_swarm.experiments.computing.cell_setup import CellSetup
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.experiment_file import parse_experiment
from hero_swarm.trial import OPEN, Trial
from hero_test.nonempty import nonempty

BLUE, FLOOR = [0, 115, 178], [200, 200, 200]


class Straight(Behavior):
    rate_hz = 10.0

    def step(self, sensed, memory, random):
        return 0.1, 0.0, memory


def make_trial(arena=OPEN):
    starts = np.array([[(-0.5, 0.0, 0.0), (0.5, -0.7, np.pi / 2.0)]])
    return Trial(Straight(), arena, 2, (1,), starts=starts, errors=0.0)


@pytest.fixture(name="drawn")
def catch_frames(tmp_path, monkeypatch):
    """Frames that are drawn, each with its time and shapes; files are written in a folder of the test."""
    drawn, draw = [], video.draw_frame

    def draw_and_keep(limits_m, time_s, shapes):
        image = draw(limits_m, time_s, shapes)
        drawn.append((np.asarray(image), time_s, shapes))
        return image

    monkeypatch.setattr(video, "draw_frame", draw_and_keep)
    monkeypatch.chdir(str(tmp_path))
    return drawn


def test_frames_are_a_tenth_of_a_second_of_the_video_apart(drawn):
    video.write_video(make_trial(), 2.0, 4.0, "run.GIF")
    assert [time_s for _, time_s, _ in drawn] == pytest.approx([0.0, 0.4, 0.8, 1.2, 1.6])
    first_m, last_m = (drawn[number][2][0].pose.x_m for number in (0, -1))
    assert first_m == -0.5 and last_m == pytest.approx(-0.36, abs=0.05)
    with Image.open("run.GIF") as written:
        assert (written.size, written.n_frames, written.info["duration"]) == ((600, 600), 5, 100)
    with pytest.raises(ExperimentError, match="--video run.mp4: must end with .gif; ffmpeg -i"):
        video.write_video(make_trial(), 0.2, 1.0, "run.mp4")


def test_a_video_that_is_stopped_leaves_no_file(tmp_path, monkeypatch):
    draw = create_autospec(video.draw_frame, side_effect=[Image.new("RGB", (8, 8)), KeyboardInterrupt])
    monkeypatch.setattr(video, "draw_frame", draw)
    with pytest.raises(KeyboardInterrupt):
        video.write_video(make_trial(), 0.5, 1.0, str(tmp_path / "run.gif"))
    assert draw.call_count == 2 and not list(tmp_path.iterdir())


def test_a_video_shows_the_arena_or_where_robots_were():
    shape = Shape("robots", 0, CYLINDER, (0.0, 0.0, 0.0, 1.0), Pose(0.0, 1.0, 0.0), 0.0, (0.1, 0.1, 0.1))
    frames = [[shape, shape._replace(pose=Pose(2.0, -1.0, 0.0))], [shape._replace(pose=Pose(-3.0, 0.5, 0.0))]]
    assert video._find_limits(OPEN, frames).tolist() == [[-3.2, -1.2], [2.2, 1.2]]
    box = load_arena("box")
    (low_m, high_m), bounds_m = video._find_limits(box, frames), box.bounds_m
    assert low_m.tolist() == (bounds_m[:2] - 0.2).tolist() and high_m.tolist() == (bounds_m[2:] + 0.2).tolist()


@pytest.mark.parametrize("name", ["obstacles", "discs", "box"])
def test_obstacles_and_objects_are_shown_where_they_are(name, drawn):
    trial = make_trial(load_arena(name))
    edges_m, discs_m = list_outlines(trial.rows.world.list_objects())
    circles_m = [*trial.rows.world.arena.circles_m.tolist(), *discs_m]
    places_m = [circle_m[:2] for circle_m in circles_m]
    places_m += [((x1_m + x2_m) / 2.0, (y1_m + y2_m) / 2.0) for x1_m, y1_m, x2_m, y2_m in edges_m]
    video.write_video(trial, 0.05, 1.0, "run.gif")
    ((frame, _, _),) = drawn
    scale, middle = len(frame) / (float(trial.rows.world.arena.bounds_m[2]) + 0.2) / 2.0, len(frame) // 2
    pixels = [(middle - round(scale * y_m), middle + round(scale * x_m)) for x_m, y_m in places_m]
    around = [frame[row - 2 : row + 3, column - 2 : column + 3].reshape(-1, 3).tolist() for row, column in pixels]
    assert around and all([204, 128, 51] in patch or [153, 153, 153] in patch for patch in around)


def test_each_frame_replaces_the_one_before(drawn):
    trial = make_trial(load_arena("empty"))
    video.write_video(trial, 3.0, 10.0, "run.gif")
    (first, *_), *_, (last, *_) = drawn
    scale, middle = len(first) / (float(trial.rows.world.arena.bounds_m[2]) + 0.2) / 2.0, len(first) // 2
    rear = middle, middle + round(scale * (-0.5 - 0.02))
    assert first[rear].tolist() == BLUE and last[rear].tolist() == FLOOR


def test_a_frame_shows_areas_robots_with_noses_and_lights_and_the_time():
    spot = Area("spot", (0.5, 0.5, 0.3), (0.0, 0.0, 0.0))
    arena = OPEN._replace(bounds_m=np.array([-1.0, -1.0, 1.0, 1.0]), areas=(spot,))
    trial = make_trial(arena)
    trial.rows.send_light(np.array([1]), np.array([(1.0, 0.0, 0.0, 1.0)]))
    trial.rows.advance(100)
    frame = np.asarray(video.draw_frame(np.array([(-1.0, -1.0), (1.0, 1.0)]), 1.25, video._list_shapes(trial)))
    poses = trial.rows.world.poses.tolist()

    def look(x_m, y_m):
        return frame[int(round(300 - 300 * y_m)), int(round(300 + 300 * x_m))].tolist()

    assert look(0.5, 0.5) == [0, 0, 0] and look(-0.5, 0.5) == FLOOR
    for (x_m, y_m, yaw_rad), color in nonempty(list(zip(poses, (BLUE, [255, 0, 0])))):
        for share, seen in ((-0.8, color), (0.6, [255, 255, 255]), (-1.5, FLOOR)):
            reach_m = share * BODY_RADIUS_M
            assert look(x_m + reach_m * np.cos(yaw_rad), y_m + reach_m * np.sin(yaw_rad)) == seen, share
    assert (frame[10:30, 10:60] == 0).any(), "the time"


def test_shapes_have_their_places_and_sizes_to_a_pixel():
    limits_m = np.array([(1.0, -2.0), (4.0, 0.0)])  # 200 pixels for each m, around (2.5, -1)
    for kind, pose, size_m, box in (
        (CYLINDER, Pose(2.0, -0.5, 0.3), (0.4, 0.4, 1.0), (160, 160, 240, 240)),
        (CUBE, Pose(3.0, -1.5, 0.0), (0.6, 0.1, 1.0), (340, 390, 460, 410)),
        (CUBE, Pose(3.0, -1.5, np.pi / 2.0), (0.6, 0.1, 1.0), (390, 340, 410, 460)),
        (CUBE, Pose(2.5, -1.0, np.pi / 4.0), (1.0, 0.001, 1.0), (229, 229, 371, 371)),
        (ARROW, Pose(3.0, -1.5, 0.0), (0.6, 0.1, 1.0), (400, 390, 520, 410)),
        (ARROW, Pose(3.0, -1.5, -np.pi / 2.0), (0.6, 0.1, 1.0), (390, 400, 410, 520)),
    ):
        shape = Shape("any", 0, kind, (1.0, 0.0, 0.5, 1.0), pose, 0.0, size_m)
        frame = np.asarray(
            video.draw_frame(limits_m, 0.0, [shape, shape._replace(kind=TEXT, pose=Pose(1.2, -1.0, 0.0))])
        )
        rows, columns = (np.abs(frame.astype(int) - (255, 0, 128)).max(axis=2) < 60).nonzero()
        found = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
        assert np.abs(np.subtract(found, box)).max() <= 2, (kind, pose, found)
    assert frame.shape == (600, 600, 3) and frame[599, 599].tolist() == FLOOR


def test_a_run_is_replayed_at_its_speed_as_the_simulator_shows_its_world(monkeypatch):
    replay = pytest.importorskip("hero_swarm.ros.replay", reason="the topics are ROS's")
    shown, rates_hz = {}, []

    def advertise(topic, kind, queue_size, latch):
        return SimpleNamespace(publish=shown.setdefault((topic, latch), []).append)

    program = SimpleNamespace(rate=lambda rate_hz: rates_hz.append(rate_hz) or itertools.count())
    monkeypatch.setattr(replay, "Program", lambda name: nullcontext(program))
    monkeypatch.setattr(replay.rospy, "Publisher", advertise)
    replay.replay(make_trial(build_rectangle(3.0, 3.0, 1)), 1.0, 2.0)
    arenas, objects, robots = (shown["/hero_sim/" + name, True] for name in ("arena", "object_markers", "replay"))
    assert rates_hz == [10.0] and len(robots) == len(objects) == 5
    assert len(arenas) == 1 and len(arenas[0].markers) == 4
    assert {marker.text for marker in robots[-1].markers} == {"", "hero_0", "hero_1"}
    places = [marker.pose.position for marker in robots[-1].markers if marker.ns == "robots"]
    after_m = 0.07  # in 0.8 s, from rest
    assert (places[0].x, places[1].y) == pytest.approx((after_m - 0.5, after_m - 0.7), abs=0.02)


@pytest.mark.parametrize("option", ["--video", "--bag", None])
def test_the_run_that_options_name_is_shown_as_they_say(monkeypatch, option):
    replay = pytest.importorskip("hero_swarm.ros.replay", reason="the topics are ROS's")
    text = "behavior: milling\nrobots: 2\ntime_s: 0.5\nseeds: {from: 4, count: 3}\nmetrics: [order]\n"
    experiment, setup, trial = parse_experiment(text, "e.yaml"), create_autospec(CellSetup, instance=True), make_trial()
    monkeypatch.setattr(show, "read_results", lambda folder: ("", experiment, {"code": "c0de"}))
    monkeypatch.setattr(show, "load_checked", lambda checked: "c0de")
    monkeypatch.setattr(show, "set_up", create_autospec(show.set_up, return_value=setup))
    for module, name in ((video, "write_video"), (replay, "replay"), (step_recorder, "StepRecorder")):
        monkeypatch.setattr(module, name, create_autospec(getattr(module, name)))
    setup.build_trial.return_value = trial
    show.main(["folder", "--seed", "5", "--speed", "3", *([option, "file"] if option else [])])
    setup.build_trial.assert_called_once_with([5])
    calls = {"--video": video.write_video, None: replay.replay, "--bag": step_recorder.StepRecorder}
    given = {"--video": (trial, 0.5, 3.0, "file"), None: (trial, 0.5, 3.0), "--bag": (trial.rows, range(2), "file")}
    for kind, shown in calls.items():
        assert [call.args for call in shown.call_args_list] == ([given[kind]] if kind == option else [])
    assert trial.rows.now_ms == (500 if option == "--bag" else 0), "the whole run is recorded"
