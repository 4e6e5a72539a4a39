"""Node teleop: keys of a terminal -> commands of one robot, or of all. The robot stops when no key comes."""

import math
import os
import sys
import time
from typing import List, NamedTuple, Optional, Tuple

from hero_client.control_laws import STANDSTILL, Command
from hero_client.keyboard import Keyboard, NoTerminalError
from hero_client.program import Program, ProgramError, check_number, parse_robot_ids, read_parameters, run
from hero_client.robot import Robot, StaleDataError
from hero_client.stop_status import paint
from hero_client.swarm import Swarm
from hero_client.swarm_start import check_stop, open_swarm
from hero_client.teleop_keys import (
    HELP,
    MAX_LINEAR_M_S,
    MAX_TURN_RAD_S,
    MIN_LINEAR_M_S,
    MIN_TURN_RAD_S,
    RELEASE_KEY,
    STOP_ALL_KEYS,
    KeyDrive,
)

PERIOD_S = 0.1
"""Between two commands; the robot takes one each 50 ms at most."""

STOP_REPEAT_S = 0.5
"""Standstill is sent for so long, then teleop is silent: an idle teleop does not disturb other programs."""


class Parameters(NamedTuple):
    """The checked parameters of the node."""

    robot_ids: Optional[List[int]]
    linear_m_s: float
    turn_rad_s: float


def load_parameters() -> Parameters:
    """Return the node's private parameters. Raises: ProgramError."""
    given = read_parameters({"robots": "0", "linear_m_s": 0.10, "turn_rad_s": 1.5})
    return Parameters(
        parse_robot_ids("robots", given["robots"]),
        check_number("linear_m_s", given["linear_m_s"], MIN_LINEAR_M_S, MAX_LINEAR_M_S, "m/s"),
        check_number("turn_rad_s", given["turn_rad_s"], MIN_TURN_RAD_S, MAX_TURN_RAD_S, "rad/s"),
    )


class Teleop:
    """The keys, and the robots that they drive."""

    def __init__(self, swarm: Swarm, parameters: Parameters) -> None:
        """Begin with the first robot chosen, and at standstill."""
        self._swarm = swarm
        self._chosen: List[Robot] = swarm.robots[:1]
        self._drive = KeyDrive(parameters.linear_m_s, parameters.turn_rad_s)
        self._last_motion_s = -math.inf
        self._next_send_s = 0.0
        self._sent = STANDSTILL
        self._has_told_stopped = False

    def press(self, key: str, now_s: float) -> None:
        """Do what the key says."""
        if key == "?":
            show_text(HELP)
        elif key in STOP_ALL_KEYS:
            self._swarm.drivers.request_stop(True)
            self._drive.stop()
        elif key == RELEASE_KEY:
            self._swarm.drivers.request_stop(False)
        elif key == "\t":
            position = self._swarm.robots.index(self._chosen[0]) if len(self._chosen) == 1 else -1
            self._choose([self._swarm.robots[(position + 1) % len(self._swarm)]])
        elif key == "g":
            self._choose(self._swarm.robots)
        elif key.isdecimal():
            chosen = [robot for robot in self._swarm if str(robot.robot_id) == key]
            if chosen:
                self._choose(chosen)
            else:
                names = ", ".join(robot.name for robot in self._swarm)
                show_text("hero_%s is not among the robots of this teleop: %s\n" % (key, names))
        else:
            self._drive.press(key, now_s)

    def _choose(self, robots: List[Robot]) -> None:
        """Drive these robots from now on; those that were driven stop."""
        self._drive.stop()
        self.send(STANDSTILL)
        self._chosen = list(robots)

    def step(self, now_s: float) -> None:
        """Send what is due: a change at once, else every PERIOD_S."""
        command = self._drive.command(now_s)
        if command != STANDSTILL:
            self._last_motion_s = now_s
        if command == self._sent and now_s < self._next_send_s:
            return
        self._next_send_s = now_s + PERIOD_S
        if now_s - self._last_motion_s < STOP_REPEAT_S:
            self.send(command)

    def send(self, command: Command) -> None:
        """Tell the chosen robots."""
        for robot in self._chosen:
            robot.drive(*command)
        self._sent = command
        if not self._find_stopped():
            self._has_told_stopped = False
        elif command != STANDSTILL and not self._has_told_stopped:
            self._has_told_stopped = True
            show_text("%s\n" % self._find_stopped())

    def _find_stopped(self) -> str:
        """Return which of the chosen robots cannot move because all robots are stopped, in words; empty if none."""
        drivers = self._swarm.drivers
        stopped = [robot.name for robot in self._chosen if drivers.is_robot_stopped(robot.namespace)]
        return "all robots are stopped, so %s cannot move: r releases them" % ", ".join(stopped) if stopped else ""

    def _describe_stop(self) -> Tuple[str, str]:
        """Return level and text of what there is to say about a stop of all robots; no text if nothing."""
        status, stopped = self._swarm.drivers.stop_status(), self._find_stopped()
        if status is None or (status.is_final and status.level != "error" and not stopped):
            return "warn", stopped
        return status.level, status.text + (": r releases them" if status.is_final and stopped else "")

    def describe(self) -> Tuple[str, str]:
        """Return level and text of the live line: who, how fast, where, and what is near, or what a stop came to."""
        who = "all %d robots" % len(self._swarm) if len(self._chosen) > 1 else self._chosen[0].name
        speeds = "%+.2f m/s %+.2f rad/s (keys: %.2f, %.2f)" % (
            *self._sent,
            self._drive.linear_m_s,
            self._drive.turn_rad_s,
        )
        level, stop = self._describe_stop()
        if stop:
            return level, "%s | %s" % (who, stop)
        robot = self._chosen[0]
        missing = robot.missing()
        if missing is not None:
            return "info", "%s | waiting: %s" % (who, missing)
        try:
            pose, nearest = robot.pose, robot.nearest()
        except StaleDataError as error:
            return "info", "%s | waiting: %s" % (who, error)
        near = "free"
        if nearest is not None:
            near = "%.2f m at %+.0f deg" % (nearest.range_m, math.degrees(nearest.bearing_rad))
        where = "x %.2f y %.2f m %.0f deg" % (pose.x_m, pose.y_m, math.degrees(pose.yaw_rad))
        return "info", "%s | %s | %s | near: %s" % (who, speeds, where, near)


def show_text(text: str) -> None:
    """Write whole lines, over the live line."""
    sys.stdout.write("\r\x1b[K" + text)
    sys.stdout.flush()


def show_live_line(level: str, text: str) -> None:
    """Write text over the last one, cut to the terminal: a line that wraps could not be written over."""
    if not sys.stdout.isatty():
        return
    width = os.get_terminal_size(sys.stdout.fileno()).columns or 80
    sys.stdout.write("\r\x1b[K" + paint(level, text[: width - 1]))
    sys.stdout.flush()


def drive_by_keys(program: Program, keyboard: Keyboard, teleop: Teleop) -> None:
    """Drive until the program is to end, or the terminal is gone."""
    next_line_s = 0.0
    while program.running:
        if program.wait_readable([keyboard.fileno()], PERIOD_S / 2.0):
            keys = keyboard.read_keys()
            if keys is None or "\x04" in keys:  # Ctrl-D
                return
            for key in keys:
                teleop.press(key, time.monotonic())
        now_s = time.monotonic()
        teleop.step(now_s)
        if now_s >= next_line_s:
            show_live_line(*teleop.describe())
            next_line_s = now_s + 2.0 * PERIOD_S


def _main() -> None:
    with Program("teleop") as program:
        parameters = load_parameters()
        try:
            keyboard = Keyboard()
        except NoTerminalError as error:
            raise ProgramError(str(error)) from None
        with keyboard, open_swarm(program, parameters.robot_ids) as swarm:
            show_text(HELP)
            drive_by_keys(program, keyboard, Teleop(swarm, parameters))
            show_text("")
            check_stop(swarm.drivers)


def main() -> None:
    """Run the node."""
    run(_main)
