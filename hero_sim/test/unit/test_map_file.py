"""Arenas from maps of map_server: what is solid, where robots start, wrong files."""

import os
import struct
import zlib

import numpy as np
import pytest

from hero_sim.errors import OptionError
from hero_sim.world.arena import measure_clearance, place_robots
from hero_sim.world.arena_file import load_arena

Image = pytest.importorskip("PIL.Image", reason="images of maps need python3-pil")

MAP = (
    "image: room.png\nresolution: 0.01\norigin: [-0.6, -0.5, 0.0]\n"
    "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
)


def draw_room():
    """A room of 1 m by 0.8 m around the origin in unknown cells, with a solid block of which only the rim was seen."""
    pixels = np.full((100, 120), 205, dtype=np.uint8)
    pixels[10:90, 10:110] = 254
    pixels[40:60, 80:100] = 205
    pixels[40:60, [80, 99]] = 0
    pixels[[40, 59], 80:100] = 0
    pixels[10, 10:110] = pixels[89, 10:110] = 0
    return pixels


@pytest.fixture
def write_map(tmp_path):
    def write(text=MAP, pixels=None):
        Image.fromarray(draw_room() if pixels is None else pixels).save(tmp_path / "room.png")
        path = tmp_path / "room.yaml"
        path.write_text(text)
        return str(path)

    return write


def test_the_free_cells_of_a_map_are_a_room(write_map):
    arena = load_arena(write_map())
    points_m = np.array([(0.0, 0.0), (0.3, 0.0), (-0.45, 0.0), (0.0, 0.38), (0.0, -0.38), (0.55, 0.0)])
    clearance_m = measure_clearance(points_m, arena)
    np.testing.assert_allclose(clearance_m[[0, 2, 3, 4]], (0.2, 0.05, 0.01, 0.01), atol=1e-9)
    assert clearance_m[1] < 0.0 and clearance_m[5] < 0.0
    np.testing.assert_allclose(arena.bounds_m, (-0.5, -0.39, 0.5, 0.39), atol=1e-9)


def test_straight_walls_are_one_segment_each(write_map):
    assert len(load_arena(write_map()).segments_m) == 8


def test_robots_start_only_where_it_is_free(write_map):
    arena = load_arena(write_map())
    poses = place_robots(arena, 12, np.random.RandomState(0))
    assert (measure_clearance(poses[:, :2], arena) > 0.04).all()


def test_the_upper_row_of_the_picture_is_up_in_the_arena(write_map):
    pixels = np.full((10, 10), 254, dtype=np.uint8)
    pixels[0] = 0
    arena = load_arena(write_map("image: room.png\nresolution: 0.1\norigin: [0, 0, 0]\n", pixels))
    np.testing.assert_allclose(arena.bounds_m, (0.0, 0.0, 1.0, 0.9), atol=1e-9)


def test_a_negated_map_is_free_where_it_is_black(write_map):
    arena = load_arena(write_map(MAP.replace("negate: 0", "negate: 1"), 255 - draw_room()))
    np.testing.assert_allclose(arena.bounds_m, (-0.5, -0.39, 0.5, 0.39), atol=1e-9)


@pytest.mark.parametrize(
    "text, reason",
    [
        (MAP.replace("0.01", "none"), "line 2: resolution is 'none', but must be a number"),
        (MAP.replace("0.01", "50"), "resolution is .*50.* must be a number from 0.001 to 1 m"),
        (MAP.replace("0.0]", "0.5]"), "a yaw of 0"),
        (MAP.replace("-0.6", "1e300"), "origin is '1e300', but must be a number from -1000 to 1000"),
        (MAP.replace("0.196", "25"), "free_thresh is '25', but must be a number .* to 1 .0.25 is 25 %"),
        (MAP.replace("0.196", "0"), "free_thresh is '0', but must be a number"),
        (MAP.replace("negate: 0", "negate: true"), "negate is 'true', but must be one of: 0, 1"),
        (MAP.replace("[-0.6, -0.5, 0.0]", "here"), "origin is 'here', but must be a list of x m, y m and yaw"),
        (MAP.replace("room.png", "none.png"), "none.png cannot be read"),
        (MAP.replace("room.png", "room.yaml"), "room.yaml cannot be read"),
    ],
)
def test_a_wrong_map_is_refused_with_the_reason(write_map, text, reason):
    with pytest.raises(OptionError, match=reason):
        load_arena(write_map(text))


def test_a_large_picture_is_refused_by_its_header(write_map, tmp_path):
    path = write_map()
    header = b"IHDR" + struct.pack(">2I5B", 13000, 13000, 8, 0, 0, 0, 0)
    chunks = struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header))
    # Decoding it would say that the file is cut off.
    (tmp_path / "room.png").write_bytes(b"\x89PNG\r\n\x1a\n" + chunks + struct.pack(">I", 100) + b"IDAT")
    with pytest.raises(OptionError, match="the picture has 13000 x 13000 pixels, more than 4000000"):
        load_arena(path)


def test_a_pipe_as_picture_is_refused(write_map, tmp_path):
    path = write_map()
    (tmp_path / "room.png").unlink()
    os.mkfifo(tmp_path / "room.png")
    with pytest.raises(OptionError, match="room.png cannot be read: it is a pipe, device or socket"):
        load_arena(path)


def test_a_map_without_free_cells_is_refused(write_map):
    with pytest.raises(OptionError, match="no free cell"):
        load_arena(write_map(MAP, np.zeros((10, 10), dtype=np.uint8)))
