import math

import numpy as np
import pytest

from hero_sim.errors import OptionError
from hero_sim.robot_constants import BODY_RADIUS_M
from hero_sim.world import arena as arenas
from hero_sim.world.arena_file import SHIPPED, load_arena


def write(tmp_path, text):
    path = tmp_path / "arena.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("robots", [1, 2, 4, 10, 50, 100])
def test_the_default_field_has_room_to_drive_for_every_robot(robots):
    arena = arenas.build_default(robots)
    poses = arenas.place_robots(arena, robots, np.random.RandomState(0))
    assert arenas.measure_clearance(poses[:, :2], arena).min() > 0.15
    apart = np.hypot(*(poses[:, None, :2] - poses[:, :2]).transpose(2, 0, 1)) + np.eye(robots)
    assert apart.min() > 0.35
    ahead_m = poses[:, :2] + 0.15 * np.column_stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])))
    assert arenas.measure_clearance(ahead_m, arena).min() > BODY_RADIUS_M


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_arenas_take_ten_robots(name):
    arena = load_arena(name)
    poses = arenas.place_robots(arena, 10, np.random.RandomState(3))
    assert arena.name == name
    assert arenas.measure_clearance(poses[:, :2], arena).min() >= BODY_RADIUS_M


def test_a_file_is_read_with_all_its_parts(tmp_path):
    arena = load_arena(
        write(
            tmp_path,
            "name: mine\n"
            "walls_m: [[[0, 0], [1, 0], [1, 1]]]\n"
            "circles_m: [[0.5, 0.5, 0.1]]\n"
            "polygons_m: [[[0, 0], [0.2, 0], [0, 0.2]]]\n"
            "starts_m_deg: [[0.7, 0.7, 90]]\n"
            "bounds_m: [0, 0, 1, 1]\n",
        )
    )
    assert arena.name == "mine"
    assert arena.segments_m.shape == (5, 4)
    assert arena.circles_m.tolist() == [[0.5, 0.5, 0.1]]
    assert arena.starts == ((0.7, 0.7, math.pi / 2),)
    assert arena.bounds_m.tolist() == [0.0, 0.0, 1.0, 1.0]


@pytest.mark.parametrize(
    "text, words",
    [
        ("walls_m:\n  - [[0, 0], [1, b]]\n", "walls_m: [['0', '0'], ['1', 'b']] is not a list"),
        ("walls_m:\n  - [[0, 0]]\n", "at least 2 entries"),
        ("walls_m:\n  - [[0, 0], [1, 1, 1]]\n", "entries of 2 numbers"),
        ("walls_m:\n  - [0, 0, 1, 1]\n", "entries of 2 numbers"),
        ("walls_m: 3\n", "walls_m must be a list, not '3'"),
        ("wals_m: []\n", "unknown key 'wals_m'"),
        ("bounds_m: [0, 0, 1, 1]\ncircles_m:\n  - [0, 0, -1]\n", "radius"),
        ("bounds_m: [1, 0, 1, 1]\n", "minimum"),
        ("name: x\n", "needs bounds_m"),
        ("bounds_m: [0, 0, 1, nan]\n", "from -1000 to 1000"),
        ("bounds_m: [0, 0, 1, 1e9]\n", "from -1000 to 1000"),
        ("- 1\n", "a mapping"),
        ("", "a mapping"),
        ("a: [1\nb: 2\n", "line 2"),
    ],
)
def test_a_wrong_file_is_refused_with_file_and_reason(tmp_path, text, words):
    path = write(tmp_path, text)
    with pytest.raises(OptionError) as caught:
        load_arena(path)
    assert str(caught.value).startswith("arena %s: " % path)
    assert words in str(caught.value)


def test_a_file_that_is_not_there_is_refused_with_the_shipped_names():
    with pytest.raises(OptionError, match="empty, obstacles, maze, box, discs"):
        load_arena("/nowhere/at/all.yaml")


@pytest.mark.parametrize("second", ["[0.5, 0.01, 0]", "[0.53, 0.5, 0]", "[0.2, 0.8, 0]", "[0.8, 0.8, 0]"])
def test_a_start_that_touches_something_is_refused_by_its_place(tmp_path, second):
    path = write(
        tmp_path,
        "walls_m: [[[0, 0], [1, 0]]]\nbounds_m: [0, 0, 1, 1]\ncircles_m: [[0.2, 0.8, 0.1]]\n"
        "polygons_m: [[[0.7, 0.7], [0.9, 0.7], [0.9, 0.9], [0.7, 0.9]]]\n"
        "starts_m_deg:\n  - [0.5, 0.5, 0]\n  - %s\n" % second,
    )
    x, y, _ = second.strip("[]").split(", ")
    with pytest.raises(OptionError, match=r"arena\.yaml: the start at \(%s, %s\)" % (x, y)):
        load_arena(path)


def test_too_many_robots_are_refused(tmp_path):
    arena = load_arena(write(tmp_path, "bounds_m: [0, 0, 0.3, 0.3]\n"))
    with pytest.raises(OptionError, match="no free place"):
        arenas.place_robots(arena, 30, np.random.RandomState(0))


def test_no_robot_is_placed_inside_an_obstacle(tmp_path):
    square = "[[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]]"
    arena = load_arena(write(tmp_path, "bounds_m: [0, 0, 1, 1]\npolygons_m: [%s]\ncircles_m: []\n" % square))
    inside = arenas.measure_clearance(np.array([[0.5, 0.5], [0.05, 0.5]]), arena)
    assert inside[0] < 0 < inside[1]
