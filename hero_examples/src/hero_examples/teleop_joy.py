"""Node teleop_joy: axes and buttons of a joystick (sensor_msgs/Joy) -> commands of one robot, or of all.

A robot moves only while the dead-man button is held and /joy is alive. Another button stops all robots of all drivers.
"""

import math
import time
from typing import List, NamedTuple, Optional

import rospy
from sensor_msgs.msg import Joy

from hero_client.control_laws import STANDSTILL, Command
from hero_client.drivers import Drivers
from hero_client.program import Program, ProgramError, check_number, parse_robot_ids, read_parameters, run
from hero_client.robot import MAX_LINEAR_M_S
from hero_client.swarm import Swarm
from hero_client.swarm_start import REPORT_PERIOD_S, WaitReport, check_stop, open_swarm

PERIOD_S = 0.1

SILENCE_S = 0.5
"""No message for so long, and the robot stops: joy_node repeats itself with autorepeat_rate, set in the launch file."""

STOP_REPEAT_S = 0.5
"""Standstill is sent for so long, then the node is silent: other programs may drive the robot."""


class Parameters(NamedTuple):
    """The checked parameters of the node."""

    robot_ids: Optional[List[int]]
    linear_m_s: float
    turn_rad_s: float
    linear_axis: int
    turn_axis: int
    enable_button: int
    stop_button: int


def load_parameters() -> Parameters:
    """Return the node's private parameters. Raises: ProgramError."""
    given = read_parameters(
        {
            "robots": "0",
            "linear_m_s": 0.15,
            "turn_rad_s": 2.0,
            "linear_axis": 1,
            "turn_axis": 0,
            "enable_button": 4,
            "stop_button": 1,
        }
    )
    if given["stop_button"] == given["enable_button"]:
        raise ProgramError("~stop_button is %r, the same as ~enable_button" % (given["stop_button"],))
    return Parameters(
        parse_robot_ids("robots", given["robots"]),
        check_number("linear_m_s", given["linear_m_s"], 0.02, MAX_LINEAR_M_S, "m/s"),
        check_number("turn_rad_s", given["turn_rad_s"], 0.25, 8.0, "rad/s"),
        check_index("linear_axis", given["linear_axis"]),
        check_index("turn_axis", given["turn_axis"]),
        check_index("enable_button", given["enable_button"]),
        check_index("stop_button", given["stop_button"]),
    )


def check_index(name: str, value: object) -> int:
    """Return value if it can be the number of an axis or button. Raises: ProgramError."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= 63:
        raise ProgramError("~%s is %r, but must be a whole number from 0 to 63" % (name, value))
    return value


def read_stick(joy: Joy, parameters: Parameters) -> Optional[Command]:
    """Return what the stick says, a standstill without the dead-man button, None if the joystick lacks a part.

    A stick whose numbers are not finite says standstill.
    """
    axes, buttons = joy.axes, joy.buttons
    if max(parameters.linear_axis, parameters.turn_axis) >= len(axes):
        return None
    if max(parameters.enable_button, parameters.stop_button) >= len(buttons):
        return None
    linear, turn = axes[parameters.linear_axis], axes[parameters.turn_axis]
    if not math.isfinite(linear) or not math.isfinite(turn):
        rospy.logwarn_once("the joystick sends numbers that are not finite: the robot stands meanwhile")
        return STANDSTILL
    if not buttons[parameters.enable_button]:
        return STANDSTILL
    return Command(linear * parameters.linear_m_s, turn * parameters.turn_rad_s)


class Stick:
    """The newest message of the joystick."""

    def __init__(self, stop_button: int, drivers: Drivers) -> None:
        """Listen on /joy; a press of stop_button stops all robots of the drivers."""
        self._stop_button = stop_button
        self._drivers = drivers
        self._is_stop_pressed = False
        self.joy: Optional[Joy] = None
        self.arrival_s = 0.0
        self._subscriber = rospy.Subscriber("/joy", Joy, self._receive, queue_size=10, tcp_nodelay=True)

    def _receive(self, joy: Joy) -> None:
        # Here, because a short press is over when the program looks.
        is_pressed = self._stop_button < len(joy.buttons) and bool(joy.buttons[self._stop_button])
        if is_pressed and not self._is_stop_pressed:
            self._drivers.request_stop(True)
        self._is_stop_pressed = is_pressed
        self.joy = joy
        self.arrival_s = time.monotonic()

    @property
    def alive(self) -> bool:
        """Whether the newest message is young enough to act upon."""
        return self.joy is not None and time.monotonic() - self.arrival_s < SILENCE_S


class StopReport:
    """Says once what came of a stop of all robots, and that robots that are told to move cannot."""

    def __init__(self, swarm: Swarm) -> None:
        """Nothing was said yet."""
        self._swarm = swarm
        self._said = ""
        self._has_said_stopped = False

    def update(self, command: Command) -> None:
        """Write lines where needed; command: what the robots are told."""
        drivers = self._swarm.drivers
        status = drivers.stop_status()
        if status is not None and status.text != self._said:
            self._said = status.text
            {"info": rospy.loginfo, "warn": rospy.logwarn, "error": rospy.logerr}[status.level](status.text)
        stopped = [robot.name for robot in self._swarm if drivers.is_robot_stopped(robot.namespace)]
        if stopped and command != STANDSTILL and not self._has_said_stopped:
            rospy.logwarn(
                "all robots are stopped, so %s cannot move; release them: rosrun hero_tools fleet, key r",
                ", ".join(stopped),
            )
        self._has_said_stopped = bool(stopped) and (self._has_said_stopped or command != STANDSTILL)


def drive_by_stick(program: Program, parameters: Parameters) -> None:
    """Drive until the program is to end."""
    with open_swarm(program, parameters.robot_ids, odom=False, proximity=False) as swarm:
        stick = Stick(parameters.stop_button, swarm.drivers)
        report, stop_report = WaitReport(), StopReport(swarm)
        next_word_s = time.monotonic() + 2.0
        last_motion_s = -STOP_REPEAT_S
        rospy.loginfo(
            "hold button %d and move the stick; button %d stops all robots of all drivers",
            parameters.enable_button,
            parameters.stop_button,
        )
        while program.pace(PERIOD_S):
            now_s = time.monotonic()
            command: Optional[Command] = STANDSTILL
            if stick.alive:
                command = read_stick(stick.joy, parameters)
            elif now_s >= next_word_s:
                next_word_s = now_s + REPORT_PERIOD_S
                rospy.logwarn("nothing on /joy: is a joystick plugged in, and does its driver (package joy) run?")
            if command is None:
                raise ProgramError(
                    "the joystick has %d axes and %d buttons: set ~linear_axis, ~turn_axis, ~enable_button and"
                    " ~stop_button to some of them (counted from 0)" % (len(stick.joy.axes), len(stick.joy.buttons))
                )
            if command != STANDSTILL:
                last_motion_s = now_s
            if now_s - last_motion_s < STOP_REPEAT_S:
                for robot in swarm:
                    robot.drive(*command)
            stop_report.update(command)
            report.update({robot.name: robot.missing() for robot in swarm})
        check_stop(swarm.drivers)


def _main() -> None:
    with Program("teleop_joy") as program:
        drive_by_stick(program, load_parameters())


def main() -> None:
    """Run the node."""
    run(_main)
