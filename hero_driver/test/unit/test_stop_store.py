"""The stop that a driver keeps for the next one of its name and master."""

import errno
import os

import pytest
import rospkg

from hero_driver.stops.store import UNKNOWN_TIME_S, StopStore

MASTER = "http://localhost:11311"
TIME_S = 1700000000


@pytest.fixture(name="home")
def make_home(monkeypatch, tmp_path):
    monkeypatch.setattr(rospkg, "get_ros_home", lambda: str(tmp_path / "ros home"))
    return tmp_path / "ros home"


@pytest.fixture(name="store")
def make_store(home):
    store = StopStore("/hero_driver", MASTER)
    store.write(False)
    return store


@pytest.fixture(name="full_disk")
def make_full_disk(monkeypatch, store):
    """No file can be made any more."""

    def fail(path, *_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path)

    monkeypatch.setattr("builtins.open", fail)


def test_a_stop_is_kept_by_the_name_of_the_driver_until_it_is_released(home):
    store = StopStore("/lab/hero_driver", MASTER)
    assert store.read_since() is None
    store.write(True)
    assert StopStore("/lab/hero_driver", MASTER).read_since() > 1e9
    assert StopStore("/hero_driver", MASTER).read_since() is None
    store.write(False)
    store.write(False)
    assert store.read_since() is None
    assert len(os.listdir(home / "hero_driver")) == 1


def test_a_stop_that_is_kept_already_keeps_its_time(store):
    store.write(True)
    os.utime(store.path, (TIME_S, TIME_S))
    since = store.read_since()
    assert since == TIME_S
    store.write(True)
    assert store.read_since() == since


def test_a_later_stop_has_a_time_of_its_own(store):
    store.write(True)
    os.utime(store.path, (TIME_S, TIME_S))
    store.write(False)
    store.write(True)
    assert store.read_since() > 1.7e9


@pytest.mark.parametrize(
    "other",
    [
        ("/lab/hero_driver", MASTER),
        ("/hero_driver", "http://localhost:11312"),
        ("/hero_driver", "http://lab-pc:11311"),
    ],
)
def test_drivers_of_other_names_or_masters_keep_their_own_stops(store, other):
    other_store = StopStore(*other)
    store.write(True)
    assert other_store.read_since() is None
    other_store.write(True)
    store.write(False)
    assert store.read_since() is None and other_store.read_since() > 1e9


@pytest.mark.parametrize("host", ["LOCALHOST", "127.0.0.1", "127.0.1.1", "[::1]", "this-pc", "This-PC"])
def test_a_master_on_this_pc_is_the_same_however_it_is_addressed(store, monkeypatch, host):
    monkeypatch.setattr("platform.node", lambda: "This-PC")
    assert StopStore("/hero_driver", "http://%s:11311/" % host).path == store.path


def test_a_disk_that_is_full_since_the_start_loses_no_stop(store, full_disk):
    store.write(True)
    assert store.read_since() is not None
    store.write(False)
    assert store.read_since() is None


def test_a_folder_that_was_deleted_is_made_again(home, store):
    os.remove(home / "hero_driver" / "hero_driver.localhost_11311.released")
    os.rmdir(home / "hero_driver")
    store.write(True)
    assert store.read_since() is not None


def test_a_stop_that_cannot_be_kept_is_an_error(home):
    home.write_text("a file in place of the folder")
    store = StopStore("/hero_driver", MASTER)
    with pytest.raises(OSError, match="ros home"):
        store.write(True)
    assert store.read_since() is None


def test_a_stop_counts_as_written_only_when_it_is_on_the_disk(store, monkeypatch):
    def fail(descriptor):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="Input/output"):
        store.write(True)


def test_a_stop_whose_file_cannot_be_looked_at_is_assumed(store, monkeypatch):
    def fail(path):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path)

    with monkeypatch.context() as patch:  # pytest looks at files to show a failure
        patch.setattr(os, "stat", fail)
        since = store.read_since()
    assert since == UNKNOWN_TIME_S
