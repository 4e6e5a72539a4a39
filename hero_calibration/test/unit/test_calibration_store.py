"""Files of calibrations: what was saved comes back; a damaged one is refused in one line, and costs no measurement."""

import math
import os
import re

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hero_calibration import store
from hero_calibration.errors import CalibrationError

WHOLE = store.Calibration(
    3,
    "2026-11-21 10:00:00",
    [1511, 1489],
    [700.0, 5000.0, 0.1] * 2,
    [0.42] * 8,
    {"error": 0.1, "zones": [[1, 2], [3, 4]], "before_m": [float("nan"), 0.1]},
)
NEWER = store.Calibration(3, "later", [1520, 1480], results={"b": 2.0})


def save_whole(folder):
    """Return the path of a file that holds all there is, and its content."""
    path = store.name_file(str(folder), 3)
    store.save(path, WHOLE)
    with open(path, "rb") as file:
        return path, file.read()


def test_a_file_holds_what_was_saved(tmp_path):
    path, _ = save_whole(tmp_path)
    kept = store.load(path)
    assert kept._replace(results=None) == WHOLE._replace(results=None)
    assert kept.results["zones"] == [[1, 2], [3, 4]]
    assert math.isnan(kept.results["before_m"][0])


def test_parts_that_were_not_measured_stay_and_the_old_file_is_kept(tmp_path):
    path, content = save_whole(tmp_path)
    assert store.save(path, NEWER) is None
    kept = store.load(path)
    assert (kept.date, kept.motor_centres_us) == ("later", [1520, 1480])
    assert (kept.velocity_gains, kept.infrared_counts_m2) == (WHOLE.velocity_gains, WHOLE.infrared_counts_m2)
    assert kept.results["b"] == 2.0 and kept.results["error"] == 0.1
    assert (tmp_path / "hero_3.previous.yaml").read_bytes() == content
    assert len(os.listdir(str(tmp_path))) == 2


@pytest.mark.parametrize(
    "content",
    [b"", b"\xff\x00\x01", b"[" * 20000, b"robot: hero_3\nvelocity_gains: 2020-13-45\n", b"robot: hero_4"],
)
def test_a_damaged_old_file_is_kept_and_costs_no_measurement(tmp_path, content):
    path = tmp_path / "hero_3.yaml"
    path.write_bytes(content)
    damaged = store.save(str(path), NEWER)
    assert store.load(str(path)) == NEWER
    assert re.fullmatch(r"hero_3\.damaged-[0-9-]+\.yaml", os.path.basename(damaged))
    with open(damaged, "rb") as file:
        assert file.read() == content


def test_a_directory_in_place_of_a_file_costs_no_measurement(tmp_path):
    (tmp_path / "hero_3.yaml").mkdir()
    damaged = store.save(str(tmp_path / "hero_3.yaml"), NEWER)
    assert store.load(str(tmp_path / "hero_3.yaml")) == NEWER
    assert os.path.isdir(damaged)


def test_a_new_file_is_on_the_disk_before_it_takes_the_name(tmp_path, monkeypatch):
    path, _ = save_whole(tmp_path)
    steps = []
    monkeypatch.setattr(store.os, "fsync", lambda fd: steps.append("fsync " + os.readlink("/proc/self/fd/%d" % fd)))
    replace = os.replace
    monkeypatch.setattr(store.os, "replace", lambda old, new: (steps.append("name " + new), replace(old, new)))
    store.save(path, NEWER)
    written = "%s.%d.new" % (path, os.getpid())
    assert steps[-3:] == ["fsync " + written, "name " + path, "fsync " + str(tmp_path)]


def test_a_disk_that_is_full_leaves_the_old_file_as_it_was(tmp_path, monkeypatch):
    path, content = save_whole(tmp_path)

    def fail(fd):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(store.os, "fsync", fail)
    with pytest.raises(CalibrationError, match=r"hero_3\.yaml cannot be written: No space left on device"):
        store.save(path, NEWER)
    assert [(name, (tmp_path / name).read_bytes()) for name in os.listdir(str(tmp_path))] == [("hero_3.yaml", content)]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("motor_centres_us: [1511, 9000]", "motor_centres_us holds '9000', but must be 2 numbers from 1200 to 1800"),
        ("motor_centres_us: [1511]", "motor_centres_us must be 2 numbers"),
        ("motor_centres_us: 2026-11-21", "motor_centres_us must be 2 numbers"),
        ("motor_centres_us: [2026-11-21, 1500]", "holds '2026-11-21'"),
        ("motor_centres_us: [1%s, 1500]" % ("0" * 400), "holds '1000"),
        ("motor_centres_us: [1%s, 1500]" % ("0" * 5000), "holds '1000"),
        ("motor_centres_us: [true, 1500]", "holds 'true'"),
        ("motor_centres_us: [1500, 1500]\nmotor_centres_us: [1501, 1500]", "is there twice"),
        ("velocity_gains: [1e9, 1, 1, 1, 1, 1]", "velocity_gains holds '1e9'"),
        ("velocity_gains: [.nan, 1, 1, 1, 1, 1]", r"velocity_gains holds '\.nan'"),
        ("velocity_gains: [nan, 1, 1, 1, 1, 1]", "velocity_gains holds 'nan'"),
        ("velocity_gains: [-.inf, 1, 1, 1, 1, 1]", r"velocity_gains holds '-\.inf'"),
        ("velocity_gains: [[1], 1, 1, 1, 1, 1]", "velocity_gains holds a sequence"),
        ("infrared_counts_m2: {a: 1}", "infrared_counts_m2 must be 8 numbers"),
        ("date: [2026]", "date must be one line of text"),
        ('date: "\\e[2J"', "date must be one line of text"),
        ("results: 3", "results must be"),
        ("results: {a: .inf}", "results must be"),
        ("results: &a [*a]", "results must be"),
        ("results: {a: &a [*a, *a]}", "results must be"),
        ("colour: red", "unknown key 'colour'"),
        ("? [a]\n: 1", "a key must be a word"),
        ("\x00", r"U\+0000 may not stand"),
        ("date: [", "expected"),
    ],
)
def test_a_wrong_file_is_refused_with_file_line_and_what_is_allowed(change, words, tmp_path):
    path = tmp_path / "hero_3.yaml"
    path.write_text("robot: hero_3\n" + change + "\n")
    with pytest.raises(CalibrationError, match=words) as caught:
        store.load(str(path))
    assert re.match(re.escape(str(path)) + r":[2-4]: ", str(caught.value))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("robot", ["wall_e", "hero_", "hero_-1", "hero_" + "9" * 5000, "[hero_3]", "hero_\u0663"])
def test_a_file_of_no_robot_is_refused(robot, tmp_path):
    (tmp_path / "x.yaml").write_text("robot: %s\n" % robot, encoding="utf-8")
    with pytest.raises(CalibrationError, match=r"x\.yaml:1: robot must be hero_N"):
        store.load(str(tmp_path / "x.yaml"))


def test_what_is_no_calibration_is_named(tmp_path):
    for content in ("- 1\n", "", "a\n"):
        (tmp_path / "x.yaml").write_text(content)
        with pytest.raises(CalibrationError, match=r"x\.yaml:1: is no calibration"):
            store.load(str(tmp_path / "x.yaml"))
    with pytest.raises(CalibrationError, match="No such file"):
        store.load(str(tmp_path / "y.yaml"))
    with pytest.raises(CalibrationError, match="Is a directory"):
        store.load(str(tmp_path))


PIECES = st.one_of(
    st.binary(max_size=3),
    st.sampled_from((b"2026-13-45", b".nan", b"-.inf", b"9" * 400, b"9" * 5000, b"[" * 5000, b"{", b"!!int ")),
    st.sampled_from((b"*a", b"&a ", b": ", b"\n")),
)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(script=st.lists(st.tuples(st.integers(0, 330), st.integers(0, 6), PIECES), min_size=1, max_size=4))
def test_any_file_is_read_or_refused_in_one_line_and_never_in_the_way(tmp_path, script):
    path, content = save_whole(tmp_path)
    for place, length, piece in script:
        content = content[:place] + piece + content[place + length :]
    with open(path, "wb") as file:
        file.write(content)
    try:
        found = store.load(path)
    except CalibrationError as error:
        assert str(error).startswith(path) and str(error).isprintable()
    else:
        for values, (_, low, high, _) in zip(found[2:5], store._RANGES.values()):
            assert values is None or all(low <= value <= high for value in values)
    store.save(path, NEWER)
    assert store.load(path).motor_centres_us == NEWER.motor_centres_us
