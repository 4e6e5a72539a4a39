"""Threads that cannot start, or run out of memory, are noticed."""

import threading
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from hero_driver.ros import thread_watch
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


def test_a_lack_of_threads_that_keeps_programs_out_for_2_s_is_a_failure(started, monkeypatch):
    watch, now_s = ThreadWatch(), [10.0]
    monkeypatch.setattr(thread_watch, "time", SimpleNamespace(monotonic=lambda: now_s[0]))

    def connect(at_s, is_refused):
        now_s[0] = at_s
        started.extend([NO_THREAD] * is_refused)
        with pytest.raises(RuntimeError) if is_refused else nullcontext():
            threading.Thread(name=HANDSHAKE).start()
        return watch.failure

    assert [connect(at_s, True) for at_s in (10.0, 10.0, 11.9)] == [""] * 3
    assert connect(11.9, False) == connect(12.5, True) == connect(14.4, True) == ""
    assert "no thread can be started: free memory" in connect(14.5, True)


def test_a_thread_that_ends_for_lack_of_memory_is_noticed(started):
    watch = ThreadWatch()
    for error in (MemoryError(), NO_THREAD):
        threading.excepthook(threading.ExceptHookArgs((type(error), error, None, None)))
    assert watch.failure.startswith("there is no memory")
