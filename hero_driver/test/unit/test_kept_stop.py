"""The stop that a driver keeps for the next one of its name."""

import os

import pytest
import rospkg

from hero_driver.kept_stop import KeptStop


@pytest.fixture(name="home")
def make_home(monkeypatch, tmp_path):
    monkeypatch.setattr(rospkg, "get_ros_home", lambda: str(tmp_path / "ros home"))
    return tmp_path / "ros home"


def test_a_stop_is_kept_by_the_name_of_the_driver_until_it_is_released(home):
    kept = KeptStop("/lab/hero_driver")
    assert kept.read_since() == ""
    kept.write(True)
    assert KeptStop("/lab/hero_driver").read_since()[:2] == "20"
    assert KeptStop("/hero_driver").read_since() == ""
    kept.write(False)
    kept.write(False)
    assert kept.read_since() == ""
    assert os.listdir(home / "hero_driver") == []


def test_a_stop_that_is_kept_already_keeps_its_time(home):
    kept = KeptStop("/hero_driver")
    kept.write(True)
    with open(kept.path, "w", encoding="utf-8") as file:
        file.write("2001-02-03 04:05:06\n")
    kept.write(True)
    assert kept.read_since() == "2001-02-03 04:05:06"


def test_drivers_of_several_names_keep_their_stops_side_by_side(home):
    drivers = [KeptStop("/lab/hero_driver"), KeptStop("/hero_driver")]
    for kept in drivers:
        kept.write(True)
    drivers[0].write(False)
    assert [bool(kept.read_since()) for kept in drivers] == [False, True]


@pytest.mark.parametrize("content", [b"", b"\xff\xfe"])
def test_a_file_that_cannot_be_read_still_is_a_stop(home, content):
    kept = KeptStop("/hero_driver")
    kept.write(True)
    with open(kept.path, "wb") as file:
        file.write(content)
    assert kept.read_since() == "an unknown time"


def test_a_stop_that_cannot_be_written_is_an_error_and_leaves_no_file(home, monkeypatch):
    def fail(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    kept = KeptStop("/hero_driver")
    with pytest.raises(OSError, match="No space"):
        kept.write(True)
    assert os.listdir(home / "hero_driver") == []
