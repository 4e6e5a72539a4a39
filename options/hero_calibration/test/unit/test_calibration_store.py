"""Files of calibrations: saved values are loaded again; a damaged file is refused in one line, and never in the way."""

import os
from contextlib import contextmanager
from unittest import mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hero_calibration import store
from hero_node.files import SETTINGS, CalibrationFileError, KeptCalibration, read_calibration
from hero_test.nonempty import nonempty

WHOLE = KeptCalibration(
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
NEWER = KeptCalibration(3, "later", {"motor_centers_us": [1520, 1480], "dead_zones_us": [1500, 1540, 1460, 1500]})


def save_whole(folder):
    """Return the path of a complete file, and its content."""
    path = store.name_file(str(folder), 3)
    store.save(path, WHOLE)
    with open(path, "rb") as file:
        return path, file.read()


def test_a_file_holds_what_was_saved(tmp_path):
    path, _ = save_whole(tmp_path)
    kept = read_calibration(path)
    assert (kept.robot_id, kept.date) == (3, WHOLE.date)
    for key, values in nonempty(WHOLE.values.items()):
        assert kept.values[key] == pytest.approx(values, nan_ok=True)


def test_values_that_were_not_measured_again_stay_and_the_old_file_is_kept(tmp_path):
    path, content = save_whole(tmp_path)
    store.save(path, NEWER)
    kept = read_calibration(path)
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
        store.save(path, KeptCalibration(3, "meanwhile", {"wheels_m": [0.05, 0.05, 0.065]}))
        with lock_file(locked):
            yield

    monkeypatch.setattr(store, "lock_file", lock_after_another)
    store.save(path, NEWER)
    kept = read_calibration(path)
    assert kept.date == "later" and kept.values["wheels_m"] == [0.05, 0.05, 0.065]
    assert {key: kept.values[key] for key in NEWER.values} == NEWER.values
    assert read_calibration(str(tmp_path / "hero_3.previous.yaml")).date == "meanwhile"


def test_comments_stay_when_a_robot_is_calibrated_again(tmp_path):
    path = store.name_file(str(tmp_path), 3)
    store.save(path, KeptCalibration(3, "2026-11-01", {"motor_centers_us": [1500.0, 1510.0]}))
    with open(path, encoding="utf-8") as file:
        text = "# new servos\n" + file.read().replace("robot: hero_3", "robot: hero_3  # Ada")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    store.save(path, KeptCalibration(3, "2026-11-02", {"motor_centers_us": [1505.0, 1510.0]}))
    with open(path, encoding="utf-8") as file:
        assert file.read() == text.replace("[1500.0", "[1505.0").replace("11-01", "11-02")


def test_results_of_another_model_are_not_kept_but_ticks_by_hand_are(tmp_path):
    path = tmp_path / "hero_3.yaml"
    path.write_text("robot: hero_3\nwheels_m: [0.05, 0.05, 0.065]\nticks_per_turn: 100\n")
    for model, wheels_m in (("hero_plus", [0.05, 0.05, 0.065]), ("hero_plus", [0.05, 0.05, 0.065]), ("hero", None)):
        store.save(str(path), KeptCalibration(3, "today", {"motor_centers_us": [1500, 1500]}, {"model": model}))
        kept = read_calibration(str(path))
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
    assert read_calibration(str(path)) == NEWER
    assert (tmp_path / "hero_3.previous.yaml").read_bytes() == content


def test_a_full_disk_leaves_the_old_file_as_it_was(tmp_path, monkeypatch):
    path, content = save_whole(tmp_path)

    def fail(fd):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="No space left on device"):
        store.save(path, NEWER)
    assert [(name, (tmp_path / name).read_bytes()) for name in os.listdir(str(tmp_path))] == [("hero_3.yaml", content)]


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
        found = read_calibration(path)
    except CalibrationFileError as error:
        assert str(error).startswith(path) and str(error).isprintable()
    else:
        for key, numbers in SETTINGS.items():
            values = found.values.get(key, [numbers.low] * numbers.length)
            assert len(values) == numbers.length
            assert all(numbers.low <= value <= numbers.high for value in values)
    store.save(path, NEWER)
    assert read_calibration(path).values["motor_centers_us"] == NEWER.values["motor_centers_us"]
