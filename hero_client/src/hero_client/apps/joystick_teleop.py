"""Drives robots with a joystick (sensor_msgs/Joy): only while the enable button is held and /joy is alive.

Other buttons choose one of several, and stop all robots of all drivers.
"""

import math
from collections import deque
from typing import Deque, NamedTuple, Optional, Sequence

import rospy
from sensor_msgs.msg import Joy

from hero_node import STOP, ProgramError, Velocity
from hero_node.ros import Program

from ..robots.swarm_base import REPORT_PERIOD_S
from ..swarm import Swarm
from .teleop_output import PauseDetector, TeleopOutput

STEP_HZ = 10.0

SILENCE_S = 0.5
"""Without a message for this time the robot stops: joy_node repeats held axes by autorepeat_rate of the launch file."""

DRAIN_S = 0.3
"""Time after a pause of the program in which messages on /joy may be old ones that waited."""

PRESSES_MAX = 100
"""Messages between two steps whose buttons count."""

FIRST_WARNING_S = 2.0
"""joy_node may start later."""

CHOSEN_COLOR = "white"


class JoystickMapping(NamedTuple):
    """Indices of axes and buttons, and the velocities at full stick."""

    linear_m_s: float
    angular_rad_s: float
    linear_axis: int
    angular_axis: int
    enable_button: int
    stop_button: int
    next_button: int = 5
    """Chooses the first robot, then the next one, after the last one all again."""

    def read(self, joy: Joy) -> Velocity:
        """Return the command of a message; STOP while the enable button is released or an axis is not finite.

        Raises: ProgramError if the joystick lacks one of the axes or buttons.
        """
        has_axes = max(self.linear_axis, self.angular_axis) < len(joy.axes)
        if not has_axes or max(self.enable_button, self.stop_button) >= len(joy.buttons):
            raise ProgramError(
                "the joystick has %d axes and %d buttons: set ~linear_axis, ~angular_axis, ~enable_button and"
                " ~stop_button to some of them (counted from 0)" % (len(joy.axes), len(joy.buttons))
            )
        linear, angular = joy.axes[self.linear_axis], joy.axes[self.angular_axis]
        if not math.isfinite(linear) or not math.isfinite(angular):
            rospy.logwarn_once("the joystick sends numbers that are not finite: the robot is stopped meanwhile")
            return STOP
        if not is_held(joy.buttons, self.enable_button):
            return STOP
        return Velocity(linear * self.linear_m_s, angular * self.angular_rad_s)


def is_held(buttons: Sequence[int], button: int) -> bool:
    """Return whether a button is held; one that the joystick lacks never is."""
    return button < len(buttons) and bool(buttons[button])


class JoystickTeleop:
    """Sends the joystick's commands to all robots of a swarm, or to one that a button chooses, whose light is white."""

    def __init__(self, swarm: Swarm, mapping: JoystickMapping) -> None:
        """Drive swarm by the axes and buttons of mapping; start stopped."""
        self._chosen = list(swarm)
        self._is_next_held = False
        self._presses: Deque[Sequence[int]] = deque(maxlen=PRESSES_MAX)
        self._swarm = swarm
        self._mapping = mapping
        self._newest: Optional[Joy] = None
        self._arrival_s = -math.inf
        self._is_stop_pressed = False
        self._output = TeleopOutput(rospy.logwarn)
        self._pauses = PauseDetector(swarm.now_s)
        self._fresh_s = -math.inf  # from when on messages are no longer those of before a pause
        self._next_warning_s = swarm.now_s + FIRST_WARNING_S
        self._reported_status = ""

    def receive(self, joy: Joy) -> None:
        """Take a message of the joystick; a press of the stop button stops all robots of the drivers."""
        # Here, because a short press may be over at the program's next step.
        is_pressed = is_held(joy.buttons, self._mapping.stop_button)
        if is_pressed and not self._is_stop_pressed:
            self._swarm.drivers.request_stop(True)
        self._is_stop_pressed = is_pressed
        self._presses.append(joy.buttons)
        now_s = self._swarm.now_s
        if now_s >= self._fresh_s and not self._pauses.is_paused(now_s):
            self._newest, self._arrival_s = joy, now_s

    def run(self, program: Program) -> None:
        """Subscribe to /joy, and drive until the program is to end.

        Raises: ProgramError if the joystick lacks an axis or button, or a stop of all robots was not obeyed.
        """
        text = "hold button %d and move the stick; button %d stops all robots of all drivers"
        rospy.loginfo(text, self._mapping.enable_button, self._mapping.stop_button)
        rospy.Subscriber("/joy", Joy, self.receive, queue_size=10, tcp_nodelay=True)
        for _ in program.rate(STEP_HZ):
            self.step(self._swarm.now_s)
        self._swarm.drivers.check_stop()

    def step(self, now_s: float) -> None:
        """Send the next command, and log what users must know; now_s: the robots' time.

        Raises: ProgramError; see JoystickMapping.read().
        """
        command = STOP
        if self._pauses.step(now_s):
            self._newest, self._fresh_s = None, now_s + DRAIN_S
        if self._newest is not None and now_s - self._arrival_s < SILENCE_S:
            command = self._mapping.read(self._newest)
        elif now_s >= self._next_warning_s:
            self._next_warning_s = now_s + REPORT_PERIOD_S
            text = "nothing on %s: is a joystick plugged in, and does its driver (package joy) run?"
            rospy.logwarn(text, rospy.resolve_name("/joy"))
        while self._presses:
            buttons = self._presses.popleft()
            self._output.note_hold(is_held(buttons, self._mapping.enable_button))
            was_next_held, self._is_next_held = self._is_next_held, is_held(buttons, self._mapping.next_button)
            if self._is_next_held and not was_next_held:
                self._choose_next()
        command = self._output.limit(command, self._swarm)
        if self._output.passes(command):
            for robot in self._chosen:
                robot.drive(*command)
        self._report_stop()
        self._swarm.report_missing()

    def _choose_next(self) -> None:
        """Drive the next robot from now on; those that were driven stop."""
        robots, before = self._swarm.robots, self._chosen
        start = robots.index(before[0]) + 1 if len(before) == 1 else 0
        self._chosen = robots[start : start + 1] or list(robots)
        for robot in robots:
            robot.led(CHOSEN_COLOR if len(self._chosen) < len(robots) and robot in self._chosen else "off")
            if robot in before and robot not in self._chosen:
                robot.drive(*STOP)

    def _report_stop(self) -> None:
        """Log once what came of a stop of all robots."""
        status = self._swarm.drivers.stop_status()
        if status is not None and status.text != self._reported_status:
            self._reported_status = status.text
            {"info": rospy.loginfo, "warn": rospy.logwarn, "error": rospy.logerr}[status.level](status.text)
