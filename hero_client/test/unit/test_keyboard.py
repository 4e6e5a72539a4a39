"""A terminal's keys, in a real pseudo-terminal."""

import os
import pty
import signal
import sys

import pytest

from hero_client.apps.keyboard import Keyboard


@pytest.fixture
def terminal(monkeypatch):
    """The other end of the terminal that is this process's standard input."""
    leader, follower = pty.openpty()
    with os.fdopen(follower) as standard_input:
        monkeypatch.setattr(sys, "__stdin__", standard_input)
        yield leader
    os.close(leader)


def test_reading_keys_that_ctrl_c_has_discarded_does_not_wait(terminal):
    signal.signal(signal.SIGALRM, lambda number, frame: pytest.fail("the read waits"))
    signal.alarm(10)
    with Keyboard() as keyboard:
        assert keyboard.read_keys() == []
        os.write(terminal, b"w")
        assert keyboard.read_keys() == ["w"]
    signal.alarm(0)
