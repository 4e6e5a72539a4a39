"""Threads that cannot start, or run out of memory, are noticed."""

import threading

import pytest

from hero_driver.ros.thread_watch import HANDSHAKE, ThreadWatch

NO_THREAD = RuntimeError("can't start new thread")


@pytest.fixture(name="started")
def make_started(monkeypatch):
    """Give what starting a thread raises, if there is any; what ThreadWatch changes is changed back."""
    errors = []

    def start(thread):
        if errors:
            raise errors.pop()

    monkeypatch.setattr(threading.Thread, "start", start)
    monkeypatch.setattr(threading, "excepthook", lambda arguments: None)
    return errors


def test_a_thread_that_cannot_start_is_noticed_and_its_starter_told(started):
    watch = ThreadWatch()
    threading.Thread().start()
    assert watch.failure == ""
    started.append(NO_THREAD)
    with pytest.raises(RuntimeError):
        threading.Thread().start()
    assert "no thread can be started: free memory" in watch.failure


@pytest.mark.parametrize(
    ("name", "error"),
    [(HANDSHAKE, NO_THREAD), ("other", RuntimeError("threads can only be started once"))],
)
def test_what_costs_no_program_its_robots_is_no_failure(started, name, error):
    watch = ThreadWatch()
    started.append(error)
    with pytest.raises(RuntimeError):
        threading.Thread(name=name).start()
    assert watch.failure == ""


def test_a_thread_that_ends_for_lack_of_memory_is_noticed(started):
    watch = ThreadWatch()
    for error in (MemoryError(), NO_THREAD):
        threading.excepthook(threading.ExceptHookArgs((type(error), error, None, None)))
    assert watch.failure.startswith("there is no memory")
