"""Any file: it is read, or refused in one line with file and reason; nothing else is ever raised."""

import json
import math
import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hero_sim.errors import OptionError
from hero_sim.robot.flash import Flash
from hero_sim.world.arena import Arena
from hero_sim.world.arena_file import load_arena

ARENA = """\
name: mine
walls_m:
  - [[0, 0], [1, 0], [1, 1]]
circles_m: [[0.5, 0.5, 0.1]]
polygons_m:
  - &corners [[0, 0], [0.2, 0], [0, 0.2]]
starts_m_deg: [[0.7, 0.7, 90]]
bounds_m: [0, 0, 1, 1]
"""

WORDS = (
    *("name", "walls_m", "circles_m", "polygons_m", "starts_m_deg", "bounds_m", "left_gain", "all", "hero_0"),
    *(": ", "- ", "\n", "\n  ", "[", "]", "{", "}", ", ", "? ", "| ", "> ", "# ", "'", '"', "&a ", "*a", "<<", "!!"),
    *("!!int ", "!!python/name:os.system", "---\n", "...\n", "%YAML 9\n", "\t", "\x00", "\x1b", "\ufeff", "\u2028"),
    *("1", "0.5", "-3", "1e999", ".nan", "nan", "inf", "1_0", "0x10", "null", "~", "true", "9" * 400, "\u0663"),
)

numbers = st.one_of(st.integers(-2, 2), st.floats(), st.integers())
leaves = st.one_of(numbers, st.none(), st.booleans(), st.text(max_size=4))
structures = st.recursive(leaves, lambda inner: st.lists(inner, max_size=4), max_leaves=20)
points = st.lists(st.lists(numbers, min_size=1, max_size=3), max_size=5)
keys = st.sampled_from(("name", "walls_m", "circles_m", "polygons_m", "starts_m_deg", "bounds_m", "left_gain"))
mappings = st.dictionaries(
    st.one_of(keys, keys, keys, st.text(max_size=5)),
    st.one_of(structures, points, st.lists(points, max_size=3), st.dictionaries(keys, leaves, max_size=2)),
    max_size=6,
)
changes = st.lists(
    st.tuples(st.integers(0, len(ARENA)), st.integers(0, 6), st.sampled_from(WORDS)), min_size=1, max_size=4
)


def change(script):
    """Return the good file with pieces of it replaced."""
    text = ARENA
    for place, length, word in script:
        text = text[:place] + word + text[place + length :]
    return text


contents = st.one_of(
    st.binary(max_size=100),
    st.lists(st.sampled_from(WORDS), max_size=30).map("".join).map(str.encode),
    changes.map(change).map(str.encode),
    mappings.map(json.dumps).map(str.encode),
)
# Not a test of how fast the machine is.
often = settings(max_examples=200)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz") / "fuzz.yaml"


@often
@given(content=contents)
@example(content=b": \xef\xbb\xbf")
def test_any_arena_file_is_read_or_refused_with_file_and_reason(path, content):
    path.write_bytes(content)
    try:
        arena = load_arena(str(path))
    except OptionError as error:
        text = str(error)
        assert text.isprintable(), ascii(text)
        assert len(text) < len(str(path)) + 1200, text
        assert re.match(r"arena %s(, line \d+)?: ." % re.escape(str(path)), text), text
        return
    assert type(arena) is Arena and arena.name.isprintable()
    for part in (arena.segments_m, arena.circles_m, *arena.polygons_m, *arena.starts, arena.bounds_m):
        assert np.isfinite(np.asarray(part, dtype=float)).all()


FLASH = json.dumps(
    {
        "ir_calibration_counts_m2": [0.5] * 8,
        "motor_centers_us": [1500, 1500],
        "velocity_pid": [-1.0] * 6,
        "position_pid": [-1.0] * 6,
    }
).encode()
pieces = st.one_of(
    st.binary(max_size=4),
    st.sampled_from((b"NaN", b"Infinity", b"1e999", b"9" * 400, b"9" * 5000, b"[" * 9999, b"true")),
)


@often
@given(st.lists(st.tuples(st.integers(0, len(FLASH)), st.integers(0, 4), pieces), min_size=1, max_size=4))
def test_any_flash_file_is_read_or_refused_with_file_and_remedy(path, script):
    content = FLASH
    for place, length, piece in script:
        content = content[:place] + piece + content[place + length :]
    path.write_bytes(content)
    flash = Flash([0.5] * 8)
    try:
        flash.keep_in(str(path))
    except OptionError as error:
        assert re.fullmatch(r"flash file %s.*; delete it to start over.*" % re.escape(str(path)), str(error))
    kept = (*flash.motor_centers_us, *flash.velocity_pid, *flash.position_pid)
    assert all(map(math.isfinite, kept)) and not any(map(math.isinf, flash.ir_calibration_counts_m2))


@pytest.mark.parametrize(
    "text, words",
    [
        ("bounds_m: [0, 0, 1, 1]\nname: \x00\n", "special characters are not allowed"),
        ("name: x\n? [a]\n: 1\n", "a name must be a text"),
        ("name: x\nbounds_m: [0, 0, 1, [1]]\n", "bounds_m is a list, but must be a number"),
        ("bounds_m: &a [0, 0, 1, *a]\n", "anchors cannot be used"),
        ("name: [a]\nbounds_m: [0, 0, 1, 1]\n", "name is a list, but must be a text"),
        ('name: "\\e[2J"\nbounds_m: [0, 0, 1, 1]\n', "name is .*but must be one line of text"),
        pytest.param("[" * 2000, "more than 20 levels", id="2,000 brackets"),
    ],
)
def test_what_fuzzing_found_is_refused_with_file_and_reason(path, text, words):
    path.write_text(text, encoding="utf-8")
    with pytest.raises(OptionError) as caught:
        load_arena(str(path))
    assert str(caught.value).startswith("arena %s" % path)
    assert re.search(words, str(caught.value))
