"""Videos of runs: each frame shows robots, objects and walls where they are, and the time."""

import numpy as np
import pytest
from PIL import Image

from hero_client.values import BODY_RADIUS_M
from hero_node import Pose
from hero_sim.scene import CYLINDER, Shape
from hero_sim.world import Area, list_outlines, load_arena
from hero_swarm import video
from hero_swarm.behavior import Behavior
from hero_swarm.experiments.errors import ExperimentError
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
