"""Sanitises and parses log lines of robots: versions at boot, uptime once a second, self-tuning.

The texts are the firmware's (ROSHandle.ino:92, 116). Log texts are untrusted: what could forge a line, move
a cursor or color a terminal is taken out. Pure.
"""

import re
from typing import NamedTuple, Optional

MAX_TEXT_LENGTH = 400

_ANSI = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\x1b.")
# Control characters, line separators and marks that are invisible or turn the direction of writing.
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff]+")
_NAME = re.compile(r"^\[/?(hero_\d+|HERO)\]\s*")
_BOOT = re.compile(
    r"Firmware:\s*(?P<firmware>\S+)\s*\|\s*Hardware:\s*(?P<hardware>\S+)\s*\|"
    r"(?:\s*Config:\s*(?P<config>\S+)\s*\|)?"
)
_WORLD = re.compile(r"\| World: (\w{1,16})")  # simulated robots only
_PID_RESET = "Reseting PID..."  # VelocityControl.ino, with each zero velocity: ten times a second while one is sent
_TUNES = re.compile(r"^(Starting Motors Auto Tuning|Tunning Motor Set)")  # VelocityControl.ino:230, 118
_TUNING_ENDED = re.compile(r"Tuning Failure|Best PID params")  # VelocityControl.ino:261-276
_NO_IMU = "IMU is not working"  # IMUSensor.ino:99, at each start without the hat, which stock robots do not have
_HEARTBEAT = re.compile(r"^Conn?ected at time (?P<millis>\d{1,10})$")


class BootLine(NamedTuple):
    """Versions that a robot logs at its start; config is empty with firmware before v3.8."""

    firmware: str
    hardware: str
    config: str


class LogLine(NamedTuple):
    """One log line, read."""

    text: str  # without name, colors and control characters, of bounded length
    boot: Optional[BootLine]
    world: str  # in which a simulated robot boots; empty: a real robot, or no boot line
    uptime_s: Optional[float]  # in the status that a robot logs once a second
    tunes: Optional[bool]  # True: a controller tunes itself; False: it has ended that; None: nothing of that
    is_routine: bool  # said so often, and so independently of what happens, that it is no news


def clean_text(text: str) -> str:
    """Return untrusted text as one line without control characters, at most MAX_TEXT_LENGTH long."""
    clean = _CONTROL.sub(" ", _ANSI.sub("", text)).strip()
    return clean if len(clean) <= MAX_TEXT_LENGTH else clean[: MAX_TEXT_LENGTH - 3] + "..."


def read_log_line(text: str) -> LogLine:
    """Return what a log text of a robot says."""
    body = _NAME.sub("", clean_text(text))
    boot = uptime_s = None
    world = ""
    match = _BOOT.search(body)
    if match is not None:
        boot = BootLine(*(part[:32] for part in (match["firmware"], match["hardware"], match["config"] or "")))
        named = _WORLD.search(body, match.end())
        world = "" if named is None else named[1]
    else:
        match = _HEARTBEAT.match(body)
        if match is not None:
            uptime_s = int(match["millis"]) / 1000.0
    tunes: Optional[bool] = None
    if _TUNES.match(body) is not None:
        tunes = True
    elif _TUNING_ENDED.search(body) is not None:
        tunes = False
    if body.startswith(_NO_IMU):
        body = "no IMU hat, so nothing on imu"
    return LogLine(body, boot, world, uptime_s, tunes, uptime_s is not None or body == _PID_RESET)
