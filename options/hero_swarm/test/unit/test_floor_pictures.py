"""Pictures on the floor: gray levels in their places, as viewers see them, in packed experiments, and bad files."""

import os
import struct
import zlib

import numpy as np
import pytest

from hero_sim import scene
from hero_sim.errors import OptionError
from hero_sim.world import load_arena
from hero_swarm.behavior import Behavior, Floor, Random, sense
from hero_swarm.experiments import runner
from hero_swarm.experiments.pack import collect

Image = pytest.importorskip("PIL.Image", reason="pictures need python3-pil")

ARENA = """\
bounds_m: [-1, -1, 1, 1]
areas:
  - {name: ramp, rectangle_m: [-0.9, -0.5, 0.9, 0.5], picture: ramp.png}
  - {name: spot, circle_m: [0, 0, 0.1], color: [1, 0, 0]}
"""
EXPERIMENT = """\
behavior: dispersion
robots: 2
arena: arena.yaml
time_s: 1
seeds: {count: 1}
metrics: [dispersion]
"""
LEVELS = np.array([[0, 51, 102], [153, 204, 255]], dtype=np.uint8)
PLACES = [(-0.6, 0.25), (0.0, 0.25), (0.6, 0.25), (-0.6, -0.25), (0.0, -0.25), (0.9, -0.5), (0.91, 0.0)]


@pytest.fixture(name="write_arena")
def fixture_write_arena(tmp_path):
    def write(levels=LEVELS, text=ARENA, name="ramp.png"):
        Image.fromarray(levels).save(str(tmp_path / name))
        (tmp_path / "arena.yaml").write_text(text)
        return str(tmp_path / "arena.yaml")

    return write


def sense_floor(arena):
    behavior = Behavior()
    behavior.floor = Floor()
    poses = np.array([[(*place, 0.0) for place in PLACES]])
    return sense(behavior, 0.0, poses, Random([0], len(PLACES)), arena=arena).floor


def test_a_picture_lies_in_its_rectangle_with_its_upper_row_up(write_arena):
    ground = sense_floor(load_arena(write_arena()))
    assert ground.gray.tolist() == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 0.5])
    assert ground.area.tolist() == [0, 0, 0, 0, 0, 0, -1]
    assert ground.color == pytest.approx(np.repeat(ground.gray[:, None], 3, axis=1))


@pytest.mark.parametrize("name, levels", [("ramp.pgm", LEVELS), ("ramp.png", LEVELS.astype(np.uint16) * 257)])
def test_pgm_and_16_bits_give_the_same_floor(write_arena, name, levels):
    ground = sense_floor(load_arena(write_arena(levels, ARENA.replace("ramp.png", name), name)))
    assert ground.gray.tolist() == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 0.5])


def test_viewers_see_a_picture_as_rectangles_of_gray_below_what_follows(write_arena):
    levels = np.kron(np.array([[0, 255], [255, 255]], dtype=np.uint8), np.ones((100, 100), dtype=np.uint8))
    *plates, spot = [shape for shape in scene.draw_arena(load_arena(write_arena(levels))) if shape.namespace == "areas"]
    assert len(plates) == 16 * 2 + 16, "each row of the coarser picture is as few rectangles as it has grays"
    assert len({shape.number for shape in [*plates, spot]}) == len(plates) + 1
    assert {shape.kind for shape in plates} == {scene.CUBE} and {shape.z_m < spot.z_m for shape in plates} == {True}
    black = [shape for shape in plates if shape.color[:3] == (0.0, 0.0, 0.0)]
    assert len(black) == 16 and all(shape.pose.x_m == pytest.approx(-0.45) for shape in black)
    assert min(shape.pose.y_m - shape.size_m[1] / 2.0 for shape in black) == pytest.approx(0.0)
    assert sum(shape.size_m[0] * shape.size_m[1] for shape in plates) == pytest.approx(1.8)
    assert spot.color == (1.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    "old, new, words",
    [
        (
            "ramp.png",
            "none.png",
            r"line 3: picture .*none\.png cannot be read: No such file or directory; give a PNG or P",
        ),
        ("ramp.png", "arena.yaml", r"line 3: picture .*arena\.yaml cannot be read: cannot identify image file"),
        ("picture: ramp.png", "color: 1, picture: ramp.png", "line 3: .* but must be .* name, and color or picture"),
        (
            "color: [1, 0, 0]",
            "picture: ramp.png",
            "line 4: .* but must be left out, or have a rectangle_m that it fills",
        ),
    ],
)
def test_a_bad_picture_is_refused_with_file_line_and_remedy(write_arena, old, new, words):
    with pytest.raises(OptionError, match=r"arena\.yaml, " + words):
        load_arena(write_arena(text=ARENA.replace(old, new)))


def test_a_large_picture_is_refused_by_its_header(write_arena, tmp_path):
    path = write_arena()
    header = b"IHDR" + struct.pack(">2I5B", 13000, 13000, 8, 0, 0, 0, 0)
    chunks = struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header))
    # Decoding it would say that the file is cut off.
    (tmp_path / "ramp.png").write_bytes(b"\x89PNG\r\n\x1a\n" + chunks + struct.pack(">I", 100) + b"IDAT")
    with pytest.raises(OptionError, match="it has 13000 x 13000 pixels, more than 4000000"):
        load_arena(path)


def test_a_pipe_as_picture_is_refused(write_arena, tmp_path):
    path = write_arena()
    (tmp_path / "ramp.png").unlink()
    os.mkfifo(str(tmp_path / "ramp.png"))
    with pytest.raises(OptionError, match="ramp.png cannot be read: it is a pipe, device or socket"):
        load_arena(path)


@pytest.mark.slow
def test_the_pack_of_an_experiment_holds_its_picture(write_arena, tmp_path):
    write_arena()
    (tmp_path / "e.yaml").write_text(EXPERIMENT)
    runner.run_experiment(runner.parse_options([str(tmp_path / "e.yaml"), "--jobs", "1"]))
    assert collect(str(tmp_path / "e"))["files/ramp.png"] == (tmp_path / "ramp.png").read_bytes()
