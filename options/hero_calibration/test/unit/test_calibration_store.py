"""Files of calibrations: saved values are loaded again; a damaged file is refused in one line, and never in the way."""

import os
from contextlib import contextmanager
from unittest import mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hero_calibration import store
from hero_calibration.errors import CalibrationError

WHOLE = store.KeptCalibration(
    3,
    "2026-11-21 10:00:00",
    {
        "motor_centers_us": [1511, 1489],
        "velocity_gains": [700.0, 5000.0, 0.1] * 2,
        "velocity_errors": [0.3, 0.1],
        "infrared_counts_m2": [0.42] * 8,
        "range_errors_before_m": [float("nan"), *[0.1] * 7],
    },
)
NEWER = store.KeptCalibration(3, "later", {"motor_centers_us": [1520, 1480], "dead_zones_us": [1500, 1540, 1460, 1500]})


def save_whole(folder):
    """Return the path of a complete file, and its content."""
    path = store.name_file(str(folder), 3)
    store.save(path, WHOLE)
    with open(path, "rb") as file:
        return path, file.read()


def test_a_file_holds_what_was_saved(tmp_path):
    path, _ = save_whole(tmp_path)
    kept = store.load(path)
    assert (kept.robot_id, kept.date) == (3, WHOLE.date)
    for key, values in WHOLE.values.items():
        assert kept.values[key] == pytest.approx(values, nan_ok=True)


def test_values_that_were_not_measured_again_stay_and_the_old_file_is_kept(tmp_path):
    path, content = save_whole(tmp_path)
    store.save(path, NEWER)
    kept = store.load(path)
    assert kept.date == "later"
    assert {key: kept.values[key] for key in NEWER.values} == NEWER.values
    assert set(kept.values) == {*WHOLE.values, *NEWER.values}
    assert (tmp_path / "hero_3.previous.yaml").read_bytes() == content
    assert len(os.listdir(str(tmp_path))) == 2


def test_what_another_program_saves_before_the_lock_is_taken_stays(tmp_path, monkeypatch):
    path, _ = save_whole(tmp_path)
    lock_file = store.lock_file

    @contextmanager
    def lock_after_another(locked):
        monkeypatch.setattr(store, "lock_file", lock_file)
        store.save(path, store.KeptCalibration(3, "meanwhile", {"wheels_m": [0.05, 0.05, 0.065]}))
        with lock_file(locked):
            yield

    monkeypatch.setattr(store, "lock_file", lock_after_another)
    store.save(path, NEWER)
    kept = store.load(path)
    assert kept.date == "later" and kept.values["wheels_m"] == [0.05, 0.05, 0.065]
    assert {key: kept.values[key] for key in NEWER.values} == NEWER.values
    assert store.load(str(tmp_path / "hero_3.previous.yaml")).date == "meanwhile"


def test_comments_stay_when_a_robot_is_calibrated_again(tmp_path):
    path = store.name_file(str(tmp_path), 3)
    store.save(path, store.KeptCalibration(3, "2026-11-01", {"motor_centers_us": [1500.0, 1510.0]}))
    with open(path, encoding="utf-8") as file:
        text = "# new servos\n" + file.read().replace("1510.0]", "1510.0]  # by hand")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    store.save(path, store.KeptCalibration(3, "2026-11-02", {"motor_centers_us": [1505.0, 1510.0]}))
    with open(path, encoding="utf-8") as file:
        assert file.read() == text.replace("[1500.0", "[1505.0").replace("11-01", "11-02")


def test_results_of_another_model_are_not_kept_but_ticks_by_hand_are(tmp_path):
    path = tmp_path / "hero_3.yaml"
    path.write_text("robot: hero_3\nwheels_m: [0.05, 0.05, 0.065]\nticks_per_turn: 100\n")
    for model, wheels_m in (("hero_plus", [0.05, 0.05, 0.065]), ("hero_plus", [0.05, 0.05, 0.065]), ("hero", None)):
        store.save(str(path), store.KeptCalibration(3, "today", {"motor_centers_us": [1500, 1500]}, {"model": model}))
        kept = store.load(str(path))
        assert kept.values.get("wheels_m") == wheels_m
        assert kept.others == {"model": model, **({"ticks_per_turn": 100} if wheels_m else {})}


@pytest.mark.parametrize(
    "content",
    [b"", b"\xff\x00\x01", b"[" * 600, b"robot: hero_3\nvelocity_gains: 2020-13-45\n", b"robot: hero_4"],
)
def test_a_damaged_previous_file_is_kept_beside_the_new_one(tmp_path, content):
    path = tmp_path / "hero_3.yaml"
    path.write_bytes(content)
    store.save(str(path), NEWER)
    assert store.load(str(path)) == NEWER
    assert (tmp_path / "hero_3.previous.yaml").read_bytes() == content


def test_a_full_disk_leaves_the_old_file_as_it_was(tmp_path, monkeypatch):
    path, content = save_whole(tmp_path)

    def fail(fd):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(CalibrationError, match=r"hero_3\.yaml cannot be written: No space left on device"):
        store.save(path, NEWER)
    assert [(name, (tmp_path / name).read_bytes()) for name in os.listdir(str(tmp_path))] == [("hero_3.yaml", content)]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("motor_centers_us: [1511, 9000]", r"motor_centers_us must be 2 numbers from 1200 to 1800 .*, not 9000;"),
        ("motor_centers_us: [1511]", r"motor_centers_us must be 2 numbers .*, not \[1511\]"),
        ("motor_centers_us: 2026-11-21", "motor_centers_us must be 2 numbers"),
        ("motor_centers_us: [2026-11-21, 1500]", r"not datetime.date\(2026"),
        ("motor_centers_us: [1%s, 1500]" % ("0" * 400), "not 1000"),
        ("motor_centers_us: [1%s, 1500]" % ("0" * 5000), "is no calibration|not 1000"),
        ("motor_centers_us: [true, 1500]", "not True"),
        ("velocity_gains: [1.0e+9, 1, 1, 1, 1, 1]", r"velocity_gains must be 6 numbers .* not 1000000000\.0"),
        ("velocity_gains: [.nan, 1, 1, 1, 1, 1]", "not nan"),
        ("velocity_gains: [nan, 1, 1, 1, 1, 1]", "not 'nan'"),
        ("velocity_gains: [-.inf, 1, 1, 1, 1, 1]", "not -inf"),
        ("velocity_gains: [[1], 1, 1, 1, 1, 1]", r"not \[1\]"),
        ("infrared_counts_m2: {a: 1}", "infrared_counts_m2 must be 8 numbers .* not {.a.: 1}"),
        ("velocity_errors: &a [*a, *a]", r"not \[\[\[...\], \[...\]\], "),
        ("velocity_errors: [0.1, .inf]", "not inf"),
        ("color: red", "unknown key 'color'"),
        ("? [a]\n: 1", "is no calibration: .* line 2"),
        ("\x00", "is no calibration"),
        ("date: [", "is no calibration: .* line 3"),
    ],
)
def test_a_wrong_file_is_refused_with_file_key_and_value(change, words, tmp_path):
    path = tmp_path / "hero_3.yaml"
    path.write_text("robot: hero_3\n" + change + "\n")
    with pytest.raises(CalibrationError, match=words) as caught:
        store.load(str(path))
    assert str(caught.value).startswith(str(path)) and str(caught.value).isprintable()


def test_numbers_at_their_limits_are_taken_and_beyond_them_refused(tmp_path):
    path = tmp_path / "hero_3.yaml"
    limits = {
        "motor_centers_us": (2, 1200, 1800),
        "velocity_gains": (6, 0, 100000),
        "infrared_counts_m2": (8, 0.001, 100),
        "wheels_m": (3, 0.01, 1),
        "dead_zones_us": (4, 0, 3000),
        "velocity_errors": (2, 0, 100),
        "range_errors_before_m": (8, -10, 10),
        "range_errors_after_m": (8, -10, 10),
    }
    assert set(limits) == {*store.SETTINGS, *store.RESULTS}
    for key, (count, low, high) in limits.items():
        for number, allowed in ((low, True), (high, True), (low - 1e-6, False), (high + 1e-6, False)):
            path.write_text("robot: hero_3\n%s: %s\n" % (key, [number] * count))
            if allowed:
                assert store.load(str(path)).values[key] == [number] * count
            else:
                with pytest.raises(CalibrationError, match=key + " must be"):
                    store.load(str(path))


def test_files_of_robots_are_listed_and_a_folder_that_cannot_be_is_named(tmp_path):
    for name in ("hero_1.yaml", "hero_0.yaml", "hero_0.previous.yaml", "notes.txt"):
        (tmp_path / name).write_text("")
    assert [os.path.basename(path) for path in store.list_files(str(tmp_path))] == ["hero_0.yaml", "hero_1.yaml"]
    assert store.list_files(str(tmp_path / "nothing")) == []
    store.make_folder(str(tmp_path))
    with pytest.raises(CalibrationError, match="notes.txt/hero cannot be created: Not a directory"):
        store.make_folder(str(tmp_path / "notes.txt" / "hero"))


def test_a_date_cannot_draw_on_the_terminal(tmp_path):
    (tmp_path / "hero_3.yaml").write_text('robot: hero_3\ndate: "\\e[2J"\n')
    assert store.load(str(tmp_path / "hero_3.yaml")).date.isprintable()


@pytest.mark.parametrize("robot", ["wall_e", "hero_", "hero_-1", "hero_" + "9" * 5000, "[hero_3]", "hero_\u0663"])
def test_a_file_of_no_robot_is_refused(robot, tmp_path):
    (tmp_path / "x.yaml").write_text("robot: %s\n" % robot, encoding="utf-8")
    with pytest.raises(CalibrationError, match=r"x\.yaml: robot must be hero_N"):
        store.load(str(tmp_path / "x.yaml"))


def test_a_file_that_is_no_calibration_is_refused(tmp_path):
    for content in ("- 1\n", "", "a\n"):
        (tmp_path / "x.yaml").write_text(content)
        with pytest.raises(CalibrationError, match=r"x\.yaml: is no calibration"):
            store.load(str(tmp_path / "x.yaml"))
    with pytest.raises(CalibrationError, match="No such file"):
        store.load(str(tmp_path / "y.yaml"))
    with pytest.raises(CalibrationError, match="Is a directory"):
        store.load(str(tmp_path))


PIECES = st.one_of(
    st.binary(max_size=3),
    st.sampled_from((b"2026-13-45", b".nan", b"-.inf", b"9" * 400, b"9" * 5000, b"[" * 600, b"{", b"!!int ")),
    st.sampled_from((b"*a", b"&a ", b": ", b"\n")),
)


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    # A busy disk takes its time for each fsync; other tests prove that files are synced.
    with mock.patch.object(store.os, "fsync"):
        yield tmp_path_factory.mktemp("any_file")


@settings(max_examples=100)
@given(script=st.lists(st.tuples(st.integers(0, 330), st.integers(0, 6), PIECES), min_size=1, max_size=4))
def test_any_file_is_read_or_refused_in_one_line_and_can_be_replaced(directory, script):
    path, content = save_whole(directory)
    for place, length, piece in script:
        content = content[:place] + piece + content[place + length :]
    with open(path, "wb") as file:
        file.write(content)
    try:
        found = store.load(path)
    except CalibrationError as error:
        assert str(error).startswith(path) and str(error).isprintable()
    else:
        for key, (count, low, high, _) in store.SETTINGS.items():
            values = found.values.get(key, [low] * count)
            assert len(values) == count and all(low <= value <= high for value in values)
    store.save(path, NEWER)
    assert store.load(path).values["motor_centers_us"] == NEWER.values["motor_centers_us"]
