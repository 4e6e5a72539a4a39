"""Videos of runs: each frame shows robots, objects and walls where they are, and the time."""

import numpy as np
import pytest

from hero_client.values import BODY_RADIUS_M
from hero_sim.world import list_outlines, load_arena
from hero_swarm import video
from hero_swarm.behavior import Behavior
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.trial import OPEN, Trial
from hero_test.nonempty import nonempty


class Straight(Behavior):
    rate_hz = 10.0

    def step(self, sensed, memory, random):
        return 0.1, 0.0, memory


def make_trial(arena=OPEN):
    starts = np.array([[(-0.5, 0.0, 0.0), (0.5, -0.7, np.pi / 2.0)]])
    return Trial(Straight(), arena, 2, (1,), starts=starts, errors=0.0)


@pytest.fixture(name="written")
def catch_frames(monkeypatch):
    """What the writers of files are given: [(path, frames), ...]."""
    written = []
    for name in ("_write_gif", "_write_with_ffmpeg"):
        monkeypatch.setattr(
            video, name, lambda path, images, name=name: written.append((name, path, list(map(np.asarray, images))))
        )
    return written


def test_frames_are_a_tenth_of_a_second_of_the_video_apart(written, monkeypatch):
    shown, draw = [], video.draw_frame
    monkeypatch.setattr(video, "draw_frame", lambda *frame: shown.append(frame[2:]) or draw(*frame))
    video.write_video(make_trial(), 2.0, 4.0, "run.gif")
    ((writer, path, frames),) = written
    assert (writer, path, len(frames)) == ("_write_gif", "run.gif", 5)
    assert frames[0].shape == (600, 600, 3)
    assert [time_s for time_s, *_ in shown] == pytest.approx([0.0, 0.4, 0.8, 1.2, 1.6])
    assert shown[0][1][0, 0] == -0.5 and shown[-1][1][0, 0] == pytest.approx(-0.36, abs=0.05)
    monkeypatch.setattr(video.shutil, "which", lambda name: "/usr/bin/" + name)
    video.write_video(make_trial(), 0.2, 1.0, "run.MP4")
    assert written[1][:2] == ("_write_with_ffmpeg", "run.MP4")
    monkeypatch.setattr(video.shutil, "which", lambda name: None)
    with pytest.raises(ExperimentError, match="apt install ffmpeg, or write a .gif"):
        video.write_video(make_trial(), 0.2, 1.0, "run.mp4")


def test_a_video_shows_the_arena_or_where_robots_were():
    frames = [(np.array([(0.0, 1.0, 0.0), (2.0, -1.0, 0.0)]), None, None), (np.array([(-3.0, 0.5, 0.0)]), None, None)]
    assert video._find_limits(OPEN, frames).tolist() == [[-3.2, -1.2], [2.2, 1.2]]
    box = load_arena("box")
    (low_m, high_m), bounds_m = video._find_limits(box, frames), box.bounds_m
    assert low_m.tolist() == (bounds_m[:2] - 0.2).tolist() and high_m.tolist() == (bounds_m[2:] + 0.2).tolist()


@pytest.mark.parametrize("name", ["obstacles", "discs", "box"])
def test_obstacles_and_objects_are_shown_where_they_are(name, written):
    trial = make_trial(load_arena(name))
    edges_m, discs_m = list_outlines(trial.rows.world.list_objects())
    circles_m = [*trial.rows.world.arena.circles_m.tolist(), *discs_m]
    places_m = [circle_m[:2] for circle_m in circles_m]
    places_m += [((x1_m + x2_m) / 2.0, (y1_m + y2_m) / 2.0) for x1_m, y1_m, x2_m, y2_m in edges_m]
    video.write_video(trial, 0.05, 1.0, "run.gif")
    ((_, _, (frame,)),) = written
    scale, middle = len(frame) / (float(trial.rows.world.arena.bounds_m[2]) + 0.2) / 2.0, len(frame) // 2
    pixels = [(middle - round(scale * y_m), middle + round(scale * x_m)) for x_m, y_m in places_m]
    around = [frame[row - 2 : row + 3, column - 2 : column + 3] for row, column in pixels]
    assert around and all((patch == (0xC0, 0x7A, 0x2E)).all(axis=2).any() for patch in around)


def test_each_frame_replaces_the_one_before(written):
    trial = make_trial(load_arena("empty"))
    video.write_video(trial, 3.0, 10.0, "run.gif")
    ((_, _, (first, *_, last)),) = written
    scale, middle = len(first) / (float(trial.rows.world.arena.bounds_m[2]) + 0.2) / 2.0, len(first) // 2
    rear = middle, middle + round(scale * (-0.5 - 0.02))
    assert first[rear].tolist() == [0x00, 0x72, 0xB2] and last[rear].tolist() == [0xFF] * 3


def test_a_frame_shows_robots_with_their_noses_and_the_time():
    limits_m, poses = np.array([(0.0, 0.0), (3.0, 3.0)]), np.array([(1.0, 2.0, 0.0), (2.0, 1.0, np.pi / 2.0)])
    frame = np.asarray(video.draw_frame(OPEN, limits_m, 1.25, poses, [], []))
    for x_m, y_m, yaw_rad in nonempty(poses.tolist()):
        ahead, side = np.array((np.cos(yaw_rad), np.sin(yaw_rad))), np.array((-np.sin(yaw_rad), np.cos(yaw_rad)))
        for distance_m, color in ((-0.8, (0x00, 0x72, 0xB2)), (0.6, (0xFF, 0xFF, 0xFF)), (-1.5, (0xFF, 0xFF, 0xFF))):
            column, row = (
                np.array((x_m, 3.0 - y_m)) * 200.0 + np.array((1, -1)) * 200.0 * distance_m * BODY_RADIUS_M * ahead
            )
            assert tuple(frame[int(round(row)), int(round(column))]) == color, distance_m
        column, row = np.array((x_m, 3.0 - y_m)) * 200.0 + np.array((1, -1)) * 200.0 * 0.6 * BODY_RADIUS_M * side
        assert tuple(frame[int(round(row)), int(round(column))]) == (0x00, 0x72, 0xB2)
    assert (frame[10:30, 10:60] == 0).any(), "the time"
