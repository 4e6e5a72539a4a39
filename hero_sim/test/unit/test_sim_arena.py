import math
import os

import numpy as np
import pytest

from hero_node import Pose
from hero_node.robot_constants import BODY_RADIUS_M
from hero_sim import scene
from hero_sim.errors import OptionError
from hero_sim.world import arena as arenas
from hero_sim.world import arena_file
from hero_sim.world.arena_file import SHIPPED, load_arena, locate_arena
from hero_sim.world.robot_errors import draw_errors
from hero_sim.world.world import World


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


AREA = "bounds_m: [0, 0, 1, 1]\nareas: [{name: nest, %s}]\n"
OBJECT = "bounds_m: [0, 0, 1, 1]\nobjects: [{mass_kg: 0.2, friction: 0.3, %s}]\n"


def test_areas_lamps_and_objects_of_a_file_are_where_it_says(tmp_path):
    arena = load_arena(
        write(
            tmp_path,
            "bounds_m: [-2, -2, 2, 2]\nlamps_m: [[0.1, 0.2], [3, 4]]\nareas:\n"
            "  - {name: nest, rectangle_m: [-1, -0.5, 1, 0.5], color: 0.25}\n"
            "  - {name: food, circle_m: [1, 0, 0.2], color: [0, 0.5, 1]}\nobjects:\n"
            "  - {circle_m: [0.5, 0.6, 0.05], mass_kg: 0.03, friction: 0.4}\n"
            "  - {polygon_m: [[1, 1], [1.2, 1], [1.2, 1.1], [1, 1.1]], mass_kg: 0.1, friction: 0.3}\n",
        )
    )
    assert arena.lamps_m.tolist() == [[0.1, 0.2], [3.0, 4.0]] and arena.name == "arena.yaml"
    assert arena.areas == (
        arenas.Area("nest", (-1.0, -0.5, 1.0, 0.5), (0.25,) * 3),
        arenas.Area("food", (1.0, 0.0, 0.2), (0.0, 0.5, 1.0)),
    )
    disc, box = arena.objects
    assert disc.pose == (0.5, 0.6, 0.0) and disc.shape.radius_m == 0.05
    assert disc.friction_n == pytest.approx(0.03 * 0.4 * 9.81)
    assert box.pose == pytest.approx((1.1, 1.05, 0.0)) and box.friction_n == pytest.approx(0.1 * 0.3 * 9.81)
    assert np.ravel(box.corners_m) == pytest.approx([1.0, 1.0, 1.2, 1.0, 1.2, 1.1, 1.0, 1.1])
    assert locate_arena("/a/b.yaml", "maze") == "maze" and locate_arena("/a/b.yaml", "") == ""
    assert locate_arena("/a/b.yaml", "c.yaml") == "/a/c.yaml"


def test_files_of_an_arena_are_read_as_asked():
    read = []

    def give(path):
        read.append(path)
        return b"name: yes\nbounds_m: [0, 0, 1, 1]\n"

    assert load_arena("/packed/mine.yaml", give).name == "yes" and read == ["/packed/mine.yaml"]
    load_arena("maze", give)
    assert read[1].endswith("/world/arenas/maze.yaml")


def test_a_closed_wall_is_the_rim_only_if_it_reaches_as_far_as_all_others(tmp_path):
    ring = "[[-1, -1], [1, -1], [1, 1], [-1, 1], %s]"
    for walls, rims in (
        (ring % "[-1, -1]", 1),
        (ring % "[-1, 0.9]", 0),
        ("%s, [[0, 0], [0.5, 0], [0, 0.5], [0, 0]]" % ring % "[-1, -1]", 1),
        ("%s, [[0, 0], [1.1, 0]]" % ring % "[-1, -1]", 0),
        ("[[-1, -1], [1, 1], [-1, -1]]", 0),
    ):
        arena = load_arena(write(tmp_path, "walls_m: [%s]\n" % walls))
        assert len(arena.rims_m) == rims, walls
        assert arena.bounds_m.tolist() == [-1.0, -1.0, 1.1 if "1.1" in walls else 1.0, 1.0]
    arena = load_arena(
        write(tmp_path, "walls_m: [%s]\npolygons_m: [[[0, 0], [0, -1.5], [1, 0]]]\n" % ring % "[-1, -1]")
    )
    assert arena.rims_m == () and arena.bounds_m.tolist() == [-1.0, -1.5, 1.0, 1.0]


@pytest.mark.parametrize(
    "text, words",
    [
        ("walls_m:\n  - [[0, 0], [1, b]]\n", ", line 2: walls_m is 'b', but must be a number from -1000 to 1000"),
        ("walls_m:\n  - [[0, 0]]\n", "line 2: walls_m is a list, but must be a list of at least 2 points"),
        ("walls_m:\n  - [[0, 0], [1, 1, 1]]\n", "a list of 2 numbers: x and y"),
        ("walls_m:\n  - [0, 0, 1, 1]\n", "a list of 2 numbers: x and y"),
        ("walls_m: 3\n", "walls_m is '3', but must be a list"),
        ("wals_m: []\n", "line 1: unknown 'wals_m'; allowed are: name, "),
        ("bounds_m: [0, 0, 1, 1]\ncircles_m:\n  - [0, 0, -1]\n", "radius"),
        ("bounds_m: [1, 0, 1, 1]\n", "minimum"),
        ("name: x\n", "needs bounds_m"),
        ("bounds_m: [0, 0, 1, nan]\n", "from -1000 to 1000"),
        ("bounds_m: [0, 0, 1, 1e9]\n", "from -1000 to 1000"),
        ("- 1\n", "must hold names and values"),
        ("", "must hold names and values"),
        ("a: [1\nb: 2\n", "line 2"),
        ('name: "a\\eb"\nbounds_m: [0, 0, 1, 1]\n', "line 1: name is 'a\\x1bb', but must be one line of text"),
        ("bounds_m: [0, 1, 1, 1]\n", "bounds_m is a list, but must be [x min, y min, x max, y max], each minimum less"),
        (
            AREA % "circle_m: [0, 0, 0], color: 1",
            "circle_m is a list, but must be a circle whose radius is more than 0",
        ),
        (
            AREA % "circle_m: [0, 0, 1], rectangle_m: [0, 0, 1, 1], color: 1",
            "a mapping with circle_m or rectangle_m, name",
        ),
        (AREA % "color: 1", "a mapping with circle_m or rectangle_m, name, and color or picture"),
        (AREA % "circle_m: [0, 0, 1]", "a mapping with circle_m or rectangle_m, name, and color or picture"),
        (AREA % "circle_m: [0, 0, 1], color: 1, picture: a.png", "name, and color or picture"),
        (
            AREA % "circle_m: [0, 0, 1], picture: a.png",
            "picture is 'a.png', but must be left out, or have a rectangle_m",
        ),
        (
            AREA % "circle_m: [0, 0, 1], color: 1.01",
            "is '1.01', but must be a number from 0 to 1 (gray), or [red, green,",
        ),
        (AREA % "circle_m: [0, 0, 1], color: [0, 0, -0.1]", "color is '-0.1', but must be a number from 0 to 1"),
        (
            AREA % "rectangle_m: [0, 0, 0, 1], color: 1",
            "rectangle_m is a list, but must be [x min, y min, x max, y max]",
        ),
        (AREA % "rectangle_m: [0, 1, 1, 1], color: 1", "each minimum less than its maximum"),
        (OBJECT % "circle_m: [0, 0, 1], polygon_m: [[0, 0], [1, 0], [0, 1]]", "a mapping with circle_m or polygon_m"),
        (OBJECT % "", "circle_m or polygon_m, mass_kg and friction"),
        (OBJECT % "circle_m: [0, 0, 0]", "a radius must be more than 0, not 0"),
        (OBJECT % "polygon_m: [[0, 0], [1, 0]]", "polygon_m is a list, but must be a list of at least 3 points [x, y]"),
        (
            OBJECT % "polygon_m: [[0, 0], [0, 1], [1, 0]]",
            "corners must be those of a convex polygon, counter-clockwise",
        ),
        (OBJECT.replace("0.2", "0") % "circle_m: [0, 0, 1]", "mass_kg must be more than 0, not 0"),
        (
            OBJECT.replace("0.3", "1001") % "circle_m: [0, 0, 1]",
            "friction is '1001', but must be a number from -1000 to",
        ),
        ("bounds_m: [0, 0, 1, 1]\npolygons_m: [[[0, 0], [1, 1]]]\n", "a list of at least 3 points [x, y]"),
        (
            "bounds_m: [0, 0, 1, 1]\nlamps_m: [[0, 0, 1]]\n",
            "lamps_m is a list, but must be a list of 2 numbers: x and y",
        ),
    ],
)
def test_a_wrong_file_is_refused_with_file_and_reason(tmp_path, text, words):
    path = write(tmp_path, text)
    with pytest.raises(OptionError) as caught:
        load_arena(path)
    assert str(caught.value).startswith("arena %s" % path)
    assert words in str(caught.value) and "shipped" not in str(caught.value)


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
    with pytest.raises(OptionError, match=r"arena\.yaml, line 7: the start at \(%s, %s\)" % (x, y)):
        load_arena(path)


@pytest.mark.slow
def test_too_many_robots_are_refused(tmp_path):
    arena = load_arena(write(tmp_path, "bounds_m: [0, 0, 0.3, 0.3]\n"))
    with pytest.raises(OptionError, match="no free place"):
        arenas.place_robots(arena, 30, np.random.RandomState(0))


def test_no_robot_is_placed_inside_an_obstacle(tmp_path):
    square = "[[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]]"
    arena = load_arena(write(tmp_path, "bounds_m: [0, 0, 1, 1]\npolygons_m: [%s]\ncircles_m: []\n" % square))
    inside = arenas.measure_clearance(np.array([[0.5, 0.5], [0.05, 0.5]]), arena)
    assert inside[0] < 0 < inside[1]


def test_no_robot_is_placed_outside_of_a_closed_wall_around_all(tmp_path):
    diamond, island = "[[1, 0], [0, 1], [-1, 0], [0, -1], [1, 0]]", "[[0, 0], [0.4, 0], [0.2, 0.2], [0, 0]]"
    arena = load_arena(write(tmp_path, "bounds_m: [-2, -2, 2, 2]\nwalls_m:\n  - %s\n  - %s\n" % (diamond, island)))
    clearance_m = arenas.measure_clearance(np.array([[0.2, 0.1], [-0.3, 0.0], [0.8, 0.8], [1.5, 0.0]]), arena)
    assert (clearance_m[:2] > 0.0).all() and (clearance_m[2:] < 0.0).all()
    poses = arenas.place_robots(arena, 20, np.random.RandomState(0))
    assert np.abs(poses[:, :2]).sum(axis=1).max() < 1.0
    with pytest.raises(OptionError, match=r"the start at \(0.8, 0.8\) .* or is outside"):
        load_arena(write(tmp_path, "walls_m: [%s]\nstarts_m_deg: [[0.8, 0.8, 0]]\n" % diamond))


def test_an_open_wall_has_no_outside(tmp_path):
    arena = load_arena(write(tmp_path, "walls_m: [[[1, 0], [0, 1], [-1, 0], [0, -1]]]\nbounds_m: [-2, -2, 2, 2]\n"))
    assert arenas.measure_clearance(np.array([[0.8, 0.8], [1.5, 0.0]]), arena).min() > 0.0


def test_starts_are_headed_along_the_rim_counter_clockwise():
    starts = arenas.build_default(4).starts
    assert [pose[:2] for pose in starts] == [(-0.375, -0.375), (0.375, -0.375), (-0.375, 0.375), (0.375, 0.375)]
    degrees = [round(math.degrees(pose.yaw_rad), 6) % 360.0 for pose in starts]
    assert degrees == [0.0, 90.0, 270.0, 180.0]
    (alone,) = arenas.build_default(1).starts
    assert alone == (0.0, 0.0, 0.0)
    rows = arenas.build_rectangle(3.0, 1.0, 3).starts
    assert [pose[:2] for pose in rows] == [(-0.75, -0.25), (0.75, -0.25), (-0.75, 0.25)]


def test_the_default_field_grows_with_the_robots_and_never_shrinks():
    sides_m = [arenas.build_default(robots).bounds_m.tolist() for robots in (1, 9, 16, 17, 100)]
    assert sides_m == [[-half, -half, half, half] for half in (0.75, 0.75, 0.8, 1.0, 2.0)]


def test_a_place_is_free_with_room_for_both_bodies_and_beside_objects():
    arena = load_arena("discs")
    arena = arena._replace(segments_m=np.array([(0.0, -1.0, 0.0, 1.0)]), circles_m=np.array([(2.0, 0.0, 0.3)]))
    thing = arena.objects[0]
    arena = arena._replace(polygons_m=(), rims_m=(), objects=(thing.put(Pose(4.0, 0.0, 0.0)),))
    reach_m = thing.shape.reach_m
    for x_m, radius_m, is_free in (
        (0.051, 0.05, True), (0.049, 0.05, False), (-0.051, 0.05, True),
        (1.649, 0.05, True), (1.651, 0.05, False),
        (4.0 + reach_m + 0.051, 0.05, True), (4.0 + reach_m + 0.049, 0.05, False),
    ):  # fmt: skip
        assert arenas.is_free(Pose(x_m, 0.0, 0.0), [], arena, radius_m) == is_free, x_m
    others = [Pose(9.0, 9.0, 0.0), Pose(1.0, 0.0, 0.0)]
    for x_m, is_free in ((1.111, True), (1.109, False), (0.889, True)):
        assert arenas.is_free(Pose(x_m, 0.0, 0.0), others, arena, 0.05, 0.06) == is_free
        assert arenas.is_free(Pose(1.0, x_m - 1.0, 0.0), others, arena, 0.05, 0.06) == is_free


def test_robots_are_placed_at_random_with_room_between_them():
    arena = arenas.build_rectangle(1.5, 1.2, 2)
    poses = arenas.place_robots(arena, 12, np.random.RandomState(1), 0.06)
    assert [tuple(pose) for pose in poses[:2].tolist()] == list(arena.starts)
    apart_m = np.hypot(*(poses[:, None, :2] - poses[:, :2]).transpose(2, 0, 1)) + 9.0 * np.eye(12)
    assert apart_m[2:].min() >= 2.0 * 0.06 + 0.05
    assert arenas.measure_clearance(poses[2:, :2], arena).min() >= 0.06 + 0.05
    assert np.ptp(poses[2:, 2]) > math.pi and np.abs(poses[:, 2]).max() <= math.pi
    assert (np.ptp(poses[2:, :2], axis=0) > (0.6, 0.4)).all(), "all over the field"


def test_viewers_draw_walls_and_obstacles_with_their_middle_and_size():
    arena = arenas.build_rectangle(2.0, 1.0, 1)._replace(circles_m=np.array([(0.5, 0.2, 0.1)]))
    shapes = scene.draw_arena(arena)
    right = shapes[1]
    assert (right.namespace, right.number, right.kind) == ("walls", 1, scene.CUBE)
    assert right.pose == pytest.approx((1.0, 0.0, math.pi / 2.0))
    assert right.size_m == pytest.approx((1.005, 0.005, 0.05))
    assert right.z_m == pytest.approx(0.025), "it stands on the floor"
    post = shapes[-1]
    assert (post.namespace, post.kind, post.pose) == ("obstacles", scene.CYLINDER, (0.5, 0.2, 0.0))
    assert post.size_m == pytest.approx((0.2, 0.2, 0.05)) and post.z_m == pytest.approx(0.025)


def test_viewers_draw_robots_as_they_are_with_heading_name_and_light():
    errors = draw_errors([np.random.RandomState(0) for _ in range(4)], 0.0)
    errors.radius_m[1] = 0.06
    poses = np.array([(0.5, 0.5, 0.0), (0.1, 0.2, 0.3), (-0.5, 0.5, 0.0), (-0.5, -0.5, 0.0)])
    world = World(arenas.build_default(4), poses, [np.random.RandomState(0)], errors)
    lights = [(0.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 0.5), (1.0, 1.0, 1.0, 0.0)]
    dark, _, _, robot, heading, name, off, *others = scene.draw_robots(world, ["hero_6", "hero_7", "hero_8"], lights)
    assert len(others) == 2, "a robot without a name is of another world"
    assert {shape.number for shape in (robot, heading, name)} == {1} and robot.pose == heading.pose == (0.1, 0.2, 0.3)
    assert robot.size_m == pytest.approx((0.12, 0.12, 0.045)) and robot.z_m == pytest.approx(0.0225)
    assert dark.size_m[0] == pytest.approx(2.0 * BODY_RADIUS_M)
    assert robot.color == (0.0, 1.0, 0.0, 1.0) and name.text == "hero_7"
    assert robot.z_m * 2.0 < heading.z_m < name.z_m, "above each other"
    assert max(dark.color[:3]) < 0.2 and max(off.color[:3]) < 0.2


def test_viewers_draw_objects_by_their_edges_and_rims():
    things = load_arena("discs").objects[:1] + load_arena("box").objects[:1]
    disc, *edges = scene.draw_objects(things)
    assert disc.kind == scene.CYLINDER and disc.pose[:2] == things[0].pose[:2]
    assert disc.size_m[:2] == pytest.approx((2.0 * things[0].shape.radius_m,) * 2)
    assert [shape.number for shape in edges] == list(range(1, len(things[1].corners_m) + 1))
    middle_m = np.mean([edge.pose[:2] for edge in edges], axis=0)
    assert middle_m == pytest.approx(things[1].pose[:2], abs=1e-6)


def test_a_pipe_as_arena_is_refused_at_once(tmp_path):
    os.mkfifo(str(tmp_path / "arena.yaml"))
    with pytest.raises(OptionError, match=r"arena\.yaml: cannot be read: it is a pipe, device or socket"):
        load_arena(str(tmp_path / "arena.yaml"))


@pytest.mark.slow
def test_more_starts_than_robots_can_be_are_refused(tmp_path):
    rows = ["[%d, %d, 0]" % (number % 100, number // 100) for number in range(1001)]
    text = "bounds_m: [-1, -1, 101, 101]\nstarts_m_deg: [%s]\n"
    assert len(load_arena(write(tmp_path, text % ", ".join(rows[:1000]))).starts) == 1000
    with pytest.raises(OptionError, match="starts_m_deg has 1001 starts, more than 1000"):
        load_arena(write(tmp_path, text % ", ".join(rows)))


def test_an_area_covers_its_border_and_nothing_beyond():
    rectangle = arenas.Area("nest", (-0.5, 0.25, 0.5, 1.0), (0.0, 0.0, 0.0))
    x_m, y_m = np.array([(-0.5, 0.25), (0.5, 1.0), (0.0, 0.5), (-0.51, 0.5), (0.51, 0.5), (0.0, 0.24), (0.0, 1.01)]).T
    assert rectangle.covers(x_m, y_m).tolist() == [True] * 3 + [False] * 4
    circle = arenas.Area("source", (1.0, -1.0, 0.25), (0.0, 0.0, 0.0))
    x_m, y_m = np.array([(1.25, -1.0), (1.0, -0.75), (1.2, -0.8)]).T
    assert circle.covers(x_m, y_m).tolist() == [True, True, False]


def test_a_picture_on_the_floor_has_its_upper_row_first():
    gray = np.array([(0.0, 0.25, 0.5), (0.75, 1.0, 0.125)])
    picture = arenas.Area("picture", (0.0, -1.0, 3.0, 1.0), (0.0, 0.0, 0.0), gray)
    x_m, y_m = np.array([(0.5, 0.5), (1.5, 0.5), (2.9, 0.1), (0.5, -0.1), (3.0, -1.0), (0.0, 1.0)]).T
    colors = picture.find_colors(x_m, y_m)
    assert colors.tolist() == [[value] * 3 for value in (0.0, 0.25, 0.5, 0.75, 0.125, 0.0)]


def test_a_picture_is_read_in_gray_up_to_its_largest_size(tmp_path, monkeypatch):
    image = pytest.importorskip("PIL.Image", reason="pictures need python3-pil")
    text = AREA % "rectangle_m: [0, 0, 1, 1], picture: floor.png"
    for levels, expected in (
        (np.array([[0, 51], [255, 102]], dtype=np.uint8), [[0.0, 0.2], [1.0, 0.4]]),
        (np.array([[0, 13107], [65535, 26214]], dtype=np.uint16), [[0.0, 0.2], [1.0, 0.4]]),
    ):
        image.fromarray(levels).save(str(tmp_path / "floor.png"))
        (area,) = load_arena(write(tmp_path, text)).areas
        assert area.gray == pytest.approx(np.array(expected)) and area.color == pytest.approx((0.4,) * 3)
    monkeypatch.setattr(arena_file, "_MAX_PIXELS", 4)
    load_arena(write(tmp_path, text))
    monkeypatch.setattr(arena_file, "_MAX_PIXELS", 3)
    with pytest.raises(
        OptionError, match=r"line 2: picture .*/floor\.png cannot be read: it has 2 x 2 pixels, more than 3"
    ):
        load_arena(write(tmp_path, text))
    for file, reason in (("gone.png", "No such file or directory"), ("arena.yaml", "cannot identify image file")):
        with pytest.raises(
            OptionError, match=f"{file} cannot be read: {reason}.*; give a PNG or PGM, its path relative"
        ):
            load_arena(write(tmp_path, text.replace("floor.png", file)))


def test_viewers_draw_areas_as_plates_and_pictures_in_strips_of_one_gray():
    strips = arenas.Area("strips", (0.0, -1.0, 3.0, 1.0), (0.0,) * 3, np.array([(0.0, 0.0, 1.0), (0.5, 0.5, 0.5)]))
    fine = arenas.Area("fine", (0.0, 0.0, 64.0, 64.0), (0.0,) * 3, np.indices((64, 64)).sum(axis=0) % 2 * 1.0)
    areas = (arenas.Area("disc", (1.0, 2.0, 0.25), (1.0, 0.0, 0.0)), strips, fine)
    disc, *plates = scene.draw_arena(arenas.build_rectangle(2.0, 1.0, 1)._replace(areas=areas))[: 4 + 32]
    assert (disc.kind, disc.pose, disc.size_m[:2]) == (scene.CYLINDER, (1.0, 2.0, 0.0), (0.5, 0.5))
    drawn = [(plate.color[0], plate.pose[:2], plate.size_m[:2]) for plate in plates]
    assert drawn[:3] == [(0.0, (1.0, 0.5), (2.0, 1.0)), (1.0, (2.5, 0.5), (1.0, 1.0)), (0.5, (1.5, -0.5), (3.0, 1.0))]
    assert drawn[3:] == [(0.5, (32.0, 63.0 - 2.0 * row), (64.0, 2.0)) for row in range(32)], "of each 2 x 2 the mean"
    heights_m = [plate.z_m for plate in (disc, *plates)]
    assert disc.z_m < plates[0].z_m == plates[2].z_m < plates[3].z_m and heights_m == sorted(heights_m)
