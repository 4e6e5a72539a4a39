"""A terminal's keys, in a real pseudo-terminal."""

import os
import pty
import signal
import sys
import termios
from unittest import mock

import pytest

from hero_client.apps.keyboard import Keyboard, NoTerminalError, split_keys


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


def test_the_terminal_has_its_settings_back_also_after_an_error(terminal):
    before = termios.tcgetattr(sys.__stdin__)
    with pytest.raises(ZeroDivisionError), Keyboard() as keyboard:
        inside = termios.tcgetattr(sys.__stdin__)
        assert not inside[3] & (termios.ICANON | termios.ECHO) and inside[3] & termios.ISIG, "Ctrl-C is a signal still"
        assert inside[6][termios.VSUSP] == b"\0", "Ctrl-Z is a key"
        raise ZeroDivisionError
    assert termios.tcgetattr(sys.__stdin__) == before and keyboard.file.closed


@pytest.mark.parametrize(("raised", "told"), [(OSError, NoTerminalError), (ValueError, ValueError)])
def test_only_a_terminal_that_does_not_open_counts_as_none(monkeypatch, raised, told):
    for name in ("__stdin__", "__stdout__", "__stderr__"):
        monkeypatch.setattr(sys, name, None)
    monkeypatch.setattr(os, "open", mock.create_autospec(os.open, side_effect=raised))
    with pytest.raises(told):
        Keyboard()


def test_a_terminal_that_is_gone_gives_no_keys_and_is_closed(terminal, monkeypatch):
    with Keyboard() as keyboard:
        for given, keys in ((b"", None), (OSError, None), (BlockingIOError, []), ([b"w"], ["w"])):
            with monkeypatch.context() as patched:
                patched.setattr(os, "read", mock.Mock(side_effect=given or [b""]))
                assert keyboard.read_keys() == keys
        monkeypatch.setattr(termios, "tcsetattr", mock.Mock(side_effect=termios.error))
    assert keyboard.file.closed


def test_an_arrow_that_comes_in_two_pieces_is_one_key(terminal):
    with Keyboard() as keyboard:
        for sent, keys in ((b"w\x1b[", ["w"]), (b"Ad", ["up", "d"]), (b"\x1bO", []), (b"D", ["left"])):
            os.write(terminal, sent)
            assert keyboard.read_keys() == keys


@pytest.mark.parametrize(
    ("text", "keys", "rest"),
    [
        ("", [], ""),
        ("wxW ", ["w", "x", "W", " "], ""),
        ("\x1b[A\x1b[B\x1b[C\x1b[D\x1bOA", ["up", "down", "right", "left", "up"], ""),
        ("ab\x1b[", ["a", "b"], "\x1b["),
        ("b\x1bO", ["b"], "\x1bO"),
        ("\x1b", [], ""),
        ("a\x1bb", ["a", "b"], ""),
        ("\x1b[3~q", ["q"], ""),
        ("\x1b[1;5Cq", ["q"], ""),
        ("\r\n\t\x04", ["\r", "\n", "\t", "\x04"], ""),
    ],
)
def test_sequences_of_terminals_are_keys_or_nothing(text, keys, rest):
    assert split_keys(text) == (keys, rest)
