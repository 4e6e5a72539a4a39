"""Drives robots with a joystick (sensor_msgs/Joy): only while the enable button is held and /joy is alive.

Other buttons choose which ones, drive them as a formation, and stop all robots of all drivers.
"""

import math
from collections import deque
from typing import Deque, Dict, NamedTuple, Optional, Sequence

import rospy
from sensor_msgs.msg import Joy

from hero_node import STOP, ProgramError, Velocity
from hero_node.ros import Program

from ..controllers.formation_drive import FormationDrive
from ..controllers.lateness import Lateness
from ..robots.common_frame import CommonFrame
from ..robots.swarm_base import REPORT_PERIOD_S
from ..swarm import Swarm
from .robot_choice import ChoiceButtons, RobotChoice
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


class JoystickMapping(NamedTuple):
    """Indices of axes and buttons, and the velocities at full stick."""

    linear_m_s: float
    angular_rad_s: float
    linear_axis: int
    angular_axis: int
    enable_button: int
    stop_button: int

    def is_enabled(self, buttons: Sequence[int]) -> bool:
        """Return whether the enable button is held."""
        return self.enable_button < len(buttons) and bool(buttons[self.enable_button])

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
        if not self.is_enabled(joy.buttons):
            return STOP
        return Velocity(linear * self.linear_m_s, angular * self.angular_rad_s)


class JoystickTeleop:
    """Sends the joystick's commands to all robots of a swarm, or those that its buttons choose."""

    def __init__(
        self, swarm: Swarm, mapping: JoystickMapping, choice: Optional[ChoiceButtons] = None, frame: str = "map"
    ) -> None:
        """Start stopped; frame: in which the poses of a formation are known."""
        self._formation: Optional[FormationDrive] = None
        self._lateness = Lateness()
        self._frame = CommonFrame(frame)
        self._choice = RobotChoice(list(swarm), ChoiceButtons() if choice is None else choice)
        self._presses: Deque[Sequence[int]] = deque(maxlen=PRESSES_MAX)
        self._swarm = swarm
        self._mapping = mapping
        self._newest: Optional[Joy] = None
        self._arrival_s = -math.inf
        self._is_stop_pressed = False
        self._output = TeleopOutput()
        self._pauses = PauseDetector(swarm.now_s)
        self._fresh_s = -math.inf  # from when on messages are no longer those of before a pause
        self._next_warning_s = swarm.now_s + FIRST_WARNING_S
        self._reported_status = ""

    def receive(self, joy: Joy) -> None:
        """Take a message of the joystick; a press of the stop button stops all robots of the drivers."""
        # Here, because a short press may be over at the program's next step.
        button = self._mapping.stop_button
        is_pressed = button < len(joy.buttons) and bool(joy.buttons[button])
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
        rospy.loginfo(
            "hold button %d and move the stick; button %d stops all robots of all drivers",
            self._mapping.enable_button,
            self._mapping.stop_button,
        )
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
            rospy.logwarn(
                "nothing on %s: is a joystick plugged in, and does its driver (package joy) run?",
                rospy.resolve_name("/joy"),
            )
        while self._presses:
            buttons = self._presses.popleft()
            self._output.note_hold(self._mapping.is_enabled(buttons))
            was_formation = self._choice.is_formation
            for robot in self._choice.read(buttons):
                robot.drive(*STOP)
            if self._choice.is_formation != was_formation:
                self._formation = None
                for robot in self._choice.robots:
                    robot.drive(*STOP)
                    robot._link.subscribe("odom")  # by each alone none is read
        command = self._output.limit(command, self._swarm)
        warning = self._output.take_warning()
        if warning:
            rospy.logwarn(warning)
        missing = self._drive(command) if self._output.passes(command) else None
        self._report_stop()
        self._swarm.report_missing(missing)

    def _drive(self, command: Velocity) -> Optional[Dict[str, Optional[str]]]:
        """Send a command to the chosen robots, or to the body that they form; return why it stands, if it does."""
        missing: Optional[Dict[str, Optional[str]]] = None
        robots = self._choice.robots
        commands = [command] * len(robots)
        if self._choice.is_formation and command != STOP:
            poses = [self._frame.pose_of(robot) for robot in robots]
            known = [pose for pose in poses if pose is not None]
            if len(known) == len(robots):
                self._formation = self._formation or FormationDrive(known)
                commands = self._formation.step(known, command, 1.0 / STEP_HZ)
                self._lateness.step(self._swarm.now_s)
                commands = [self._lateness.slow(each, robot.age_s("odom")) for robot, each in zip(robots, commands)]
                warning = self._lateness.take_warning()
                if warning:
                    rospy.logwarn(warning)
            else:
                commands, missing = [STOP] * len(robots), self._frame.missing
        for robot, each in zip(robots, commands):
            robot.drive(*each)
        return missing

    def _report_stop(self) -> None:
        """Log once what came of a stop of all robots."""
        status = self._swarm.drivers.stop_status()
        if status is not None and status.text != self._reported_status:
            self._reported_status = status.text
            {"info": rospy.loginfo, "warn": rospy.logwarn, "error": rospy.logerr}[status.level](status.text)
