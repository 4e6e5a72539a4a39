"""Single key presses of a terminal, whose settings are restored at the end. Knows no robot and no ROS.

Sources: termios(3); ECMA-48 for the arrow keys.
"""

import os
import re
import sys
import termios
import tty
from typing import IO, Any, List, Optional, Tuple

from hero_node import ProgramError

ESCAPE = "\x1b"

KEY = re.compile(ESCAPE + r"(?:[\[O]([0-9;]*.?))?|.", re.DOTALL)
"""A character, or a sequence that terminals send for other keys, in normal ([) or in application mode (O)."""

ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left"}
"""Ends of the sequences of the arrow keys."""

STOP_ALL_KEYS = ("\r", "\n")
RELEASE_KEY = "r"
"""The keys that stop and release all robots, the same in every program."""


class NoTerminalError(ProgramError):
    """There is no terminal to read keys from."""


class Keyboard:
    """The keys of a terminal, one by one, without waiting for return and without showing them.

    Ctrl-C still sends its signal. As a context manager it restores the terminal's settings at the end, also after an
    error or a signal that Program handles; after kill -9 the shell command `reset` does so.
    """

    def __init__(self) -> None:
        """Find the terminal. Raises: NoTerminalError."""
        self.file = open_terminal()
        self._settings: List[Any] = []
        self._unfinished = ""

    def __enter__(self) -> "Keyboard":
        self._settings = termios.tcgetattr(self.file)
        tty.setcbreak(self.fileno(), termios.TCSANOW)
        settings = termios.tcgetattr(self.file)
        # Ctrl-Z would leave a program that neither reads keys nor stops the robot, so it is a key like any other.
        settings[6][termios.VSUSP] = b"\0"
        termios.tcsetattr(self.file, termios.TCSANOW, settings)
        return self

    def __exit__(self, *error: object) -> None:
        try:
            # FLUSH: keys that are still held down are not for the shell.
            termios.tcsetattr(self.file, termios.TCSAFLUSH, self._settings)
        except termios.error:
            return  # the terminal is closed: nothing is left to restore
        finally:
            self.file.close()

    def fileno(self) -> int:
        """Return what to wait on."""
        return self.file.fileno()

    def read_keys(self) -> Optional[List[str]]:
        """Return the keys that were pressed since the last call; None if the terminal is closed.

        A key is its character, or "up", "down", "left", "right" for an arrow. Never waits.
        """
        try:
            data = os.read(self.file.fileno(), 1024)
        except BlockingIOError:
            return []
        except OSError:
            return None
        if not data:
            return None
        text, self._unfinished = self._unfinished + data.decode("utf-8", "replace"), ""
        keys, self._unfinished = split_keys(text)
        return keys


def split_keys(text: str) -> Tuple[List[str], str]:
    """Return the keys in text, and the rest of it if that may be the start of an arrow key.

    A lone escape, and a sequence that means nothing here, are dropped.
    """
    whole = text[:-2] if text.endswith((ESCAPE + "[", ESCAPE + "O")) else text
    found = [ARROWS.get(match[1], match[0]) for match in KEY.finditer(whole)]
    return [key for key in found if key[0] != ESCAPE], text[len(whole) :]


def open_terminal() -> IO[bytes]:
    """Return the terminal for reading and setting, unbuffered.

    Standard input, if it is one. A node under roslaunch is in its own session, where /dev/tty does not open,
    but it has roslaunch's standard streams. Raises: NoTerminalError with what to do.
    """
    for stream in (sys.__stdin__, sys.__stdout__, sys.__stderr__):
        if stream is not None and not stream.closed and os.isatty(stream.fileno()):
            return _open_terminal_device(os.ttyname(stream.fileno()))
    try:
        return _open_terminal_device("/dev/tty")
    except OSError:
        text = "no terminal to read keys from: start it in a plain terminal, with neither input nor output redirected"
        raise NoTerminalError(text) from None


def _open_terminal_device(path: str) -> IO[bytes]:
    # NOCTTY: opening a terminal must not make it this session's own. NONBLOCK: a terminal that could be read may be
    # empty a moment later, because Ctrl-C discards what was typed, and a read that waits would do so for ever.
    return os.fdopen(os.open(path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK), "rb", buffering=0)
