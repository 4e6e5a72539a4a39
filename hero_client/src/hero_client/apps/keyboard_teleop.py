"""Drives robots with the keys of a terminal: hold a key to drive, release it to stop.

A terminal sends a key when it is pressed and then repeatedly while it is held; it never reports the release. So a
motion ends when its key has not come for a moment: longer after the first press, because terminals wait 0.25..0.66 s
before they repeat, and short once the key repeats (every 30..50 ms).
"""

import math
import os
import sys
import time
from typing import Dict, List, Optional, Tuple

from hero_node import STOP, Velocity
from hero_node.robot_constants import MAX_LINEAR_M_S
from hero_node.ros import Program

from ..robot import Robot
from ..ros.stop_status import paint
from ..swarm import Swarm
from ..values.errors import NotCalibratedError, StaleDataError
from ..values.robot_states import describe_stop_origin
from .keyboard import RELEASE_KEY, STOP_ALL_KEYS, Keyboard
from .teleop_output import PauseDetector, TeleopOutput

PERIOD_S = 0.1
"""Time between two commands; the robot takes one every 50 ms at most."""

FIRST_TIMEOUT_S = 0.75
"""A single press drives for this time: a little more than the longest usual wait for the first repeat."""

REPEAT_TIMEOUT_S = 0.3
"""A held key that is silent for this time was released: several repeats, so that a hiccup of ssh does not stop."""

MIN_LINEAR_M_S, LINEAR_STEP_M_S = 0.02, 0.02
MIN_KEY_ANGULAR_RAD_S, MAX_KEY_ANGULAR_RAD_S, ANGULAR_STEP_RAD_S = 0.25, 4.0, 0.25

MOTIONS: Dict[str, Tuple[int, int]] = {
    "w": (1, 0),
    "x": (-1, 0),
    "a": (0, 1),
    "d": (0, -1),
    "q": (1, 1),
    "e": (1, -1),
    "z": (-1, -1),
    "c": (-1, 1),
    "up": (1, 0),
    "down": (-1, 0),
    "left": (0, 1),
    "right": (0, -1),
}
"""Key -> (forward, left). A curve backwards to the left (z) swings the rear to the left: the turn is to the right."""

STOP_KEYS = ("s", " ", "\x1a")
"""s, space, and Ctrl-Z, whose user wants the program to pause."""

END_KEY = "\x04"  # Ctrl-D

HELP = """\
Hold a key to drive; release it to stop.

      q   w   e        w x    forward, backward      + -   drive faster, slower
      a   s   d        a d    turn left, right       > <   turn faster, slower
      z   x   c        q e    forward in a curve     0..9  this robot    Tab  next robot
                       z c    backward in a curve    g     all robots
  s or space: stop     arrows work too               ?     this text     Ctrl-C  end

  Enter: STOP ALL ROBOTS of all drivers     r: release them
"""


class KeyDrive:
    """Turns keys into a command that expires. Pure."""

    def __init__(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Start stopped; linear_m_s, angular_rad_s: the speeds that keys give."""
        self.linear_m_s = linear_m_s
        self.angular_rad_s = angular_rad_s
        self._last_key = ""
        self._last_press_s = -math.inf
        self.stop()

    def press(self, key: str, now_s: float) -> None:
        """Handle a key; one that has no meaning here changes nothing."""
        lower = key.lower()  # caps lock must not take the controls away
        if key in STOP_KEYS:
            self.stop()
        elif lower in MOTIONS:
            self._move(lower, now_s)
        elif key in "+=-_":
            step_m_s = LINEAR_STEP_M_S if key in "+=" else -LINEAR_STEP_M_S
            self.linear_m_s = min(MAX_LINEAR_M_S, max(MIN_LINEAR_M_S, self.linear_m_s + step_m_s))
        elif key in ">.<,":
            step_rad_s = ANGULAR_STEP_RAD_S if key in ">." else -ANGULAR_STEP_RAD_S
            self.angular_rad_s = min(MAX_KEY_ANGULAR_RAD_S, max(MIN_KEY_ANGULAR_RAD_S, self.angular_rad_s + step_rad_s))

    def _move(self, key: str, now_s: float) -> None:
        """Set the parts of the motion that the key gives; the other part expires on its own."""
        held = key == self._last_key and now_s - self._last_press_s < REPEAT_TIMEOUT_S
        end_s = now_s + (REPEAT_TIMEOUT_S if held else FIRST_TIMEOUT_S)
        for part, sign in enumerate(MOTIONS[key]):
            if sign:
                self._parts[part] = sign, end_s
        self._last_key, self._last_press_s = key, now_s

    def stop(self) -> None:
        """Forget every motion."""
        self._parts = [(0, -math.inf)] * 2  # forward and left: the sign, and when it expires
        self._last_key = ""

    def command(self, now_s: float) -> Velocity:
        """Return the command for now."""
        forward, left = (sign if now_s < end_s else 0 for sign, end_s in self._parts)
        return Velocity(forward * self.linear_m_s, left * self.angular_rad_s)


class KeyboardTeleop:
    """The keys, and the robots that they drive."""

    def __init__(self, swarm: Swarm, linear_m_s: float, angular_rad_s: float) -> None:
        """Start with the first robot chosen, and stopped; the speeds are those that keys give at first."""
        self._swarm = swarm
        self._chosen: List[Robot] = swarm.robots[:1]
        self._drive = KeyDrive(linear_m_s, angular_rad_s)
        self._output = TeleopOutput(lambda text: show_text(f"{text}\n"))
        self._next_send_s = 0.0
        self._sent = STOP
        self._has_reported_stopped = False

    def run(self, program: Program, keyboard: Keyboard) -> None:
        """Show the keys and drive until the program is to end, the user presses Ctrl-D or the terminal is closed.

        Raises: ProgramError if robots or drivers did not obey the last stop or release of all robots.
        """
        show_text(HELP)
        next_line_s = 0.0
        pauses = PauseDetector(program.now_s)
        while program.running:
            if program.wait_readable([keyboard.fileno()], PERIOD_S / 2.0):
                keys = read_stops(keyboard) if pauses.is_paused(program.now_s) else keyboard.read_keys()
                if keys is None or END_KEY in keys:
                    break
                for key in keys:
                    self.press(key, program.now_s)
            now_s = program.now_s
            pauses.step(now_s)
            self.step(now_s)
            if now_s >= next_line_s:
                show_live_line(*self.describe())
                next_line_s = now_s + 2.0 * PERIOD_S
        show_text("")
        self._swarm.drivers.check_stop()

    def press(self, key: str, now_s: float) -> None:
        """Handle a key."""
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
            try:
                self._choose([self._swarm[int(key)]])
            except KeyError as error:
                show_text(f"{error.args[0]}\n")
        else:
            self._drive.press(key, now_s)
            if key in STOP_KEYS:
                self._output.demand_stop()  # also where another program drives the robot
                self._next_send_s = now_s

    def _choose(self, robots: List[Robot]) -> None:
        """Drive these robots from now on; those that were driven stop."""
        self._drive.stop()
        self.send(STOP)
        self._chosen = list(robots)

    def step(self, now_s: float) -> None:
        """Send what is due: a change at once, else every PERIOD_S."""
        command = self._drive.command(now_s)
        self._output.note_hold(command != STOP)
        command = self._output.limit(command, self._swarm)
        if command == self._sent and now_s < self._next_send_s:
            return
        self._next_send_s = now_s + PERIOD_S
        if self._output.passes(command):
            self.send(command)

    def send(self, command: Velocity) -> None:
        """Send a command to the chosen robots."""
        for robot in self._chosen:
            if not robot.is_stopped:  # that is shown here, once, and not logged over the live line
                robot.drive(*command)
        self._sent = command
        if not self._find_stopped():
            self._has_reported_stopped = False
        elif command != STOP and not self._has_reported_stopped:
            self._has_reported_stopped = True
            show_text(f"{self._find_stopped()}\n")

    def _find_stopped(self) -> str:
        """Return a line with the chosen robots that cannot move because all robots are stopped; empty if none."""
        stopped = [robot.name for robot in self._chosen if robot.is_stopped]
        if not stopped:
            return ""
        report = self._swarm.drivers.read()
        origin = describe_stop_origin(report, time.time()) if report else ""
        return f"all robots are stopped {origin}".strip() + f", so {', '.join(stopped)} cannot move: r releases them"

    def _describe_stop(self) -> Tuple[str, str]:
        """Return level and text about a stop of all robots; no text if there is nothing to say."""
        status, stopped = self._swarm.drivers.stop_status(), self._find_stopped()
        if status is None or (status.is_final and status.level != "error" and not stopped):
            return "warn", stopped
        return status.level, status.text + (": r releases them" if status.is_final and stopped else "")

    def describe(self) -> Tuple[str, str]:
        """Return level and text of the live line: robot, command, pose, nearest obstacle, or the outcome of a stop."""
        robots = f"all {len(self._swarm)} robots" if len(self._chosen) > 1 else self._chosen[0].name
        by_keys = self._drive.linear_m_s, self._drive.angular_rad_s
        speeds = "%+.2f m/s %+.2f rad/s (keys: %.2f, %.2f)" % (*self._sent, *by_keys)
        level, stop = self._describe_stop()
        if stop:
            return level, f"{robots} | {stop}"
        robot = self._chosen[0]
        missing = robot.missing()
        if missing is not None:
            return "info", f"{robots} | waiting: {missing}"
        near = "free"
        try:
            pose, nearest = robot.pose, robot.nearest()
            if nearest is not None:
                near = f"{nearest.range_m:.2f} m at {math.degrees(nearest.bearing_rad):+.0f} deg"
        except NotCalibratedError:
            near = "not calibrated"
        except StaleDataError as error:
            return "info", f"{robots} | waiting: {error}"
        where = f"x {pose.x_m:.2f} y {pose.y_m:.2f} m {math.degrees(pose.yaw_rad):.0f} deg"
        return "info", f"{robots} | {speeds} | {where} | near: {near}"


def read_stops(keyboard: Keyboard) -> Optional[List[str]]:
    """Return the keys that stop or end among all that wait; None if the terminal is closed.

    After a pause of the program: what was typed meanwhile must drive no robot.
    """
    stops: List[str] = []
    keys = keyboard.read_keys()
    while keys:
        stops += [key for key in keys if key in (*STOP_KEYS, *STOP_ALL_KEYS, END_KEY)]
        keys = keyboard.read_keys()
    return None if keys is None else stops


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
