"""Node measure_delay: commands and odometry of robots -> how late messages come and how soon robots move; a plot.

Message delay: arrival of odometry minus its stamp, which is the robot's synchronised clock. Command to motion: from
sending a turn on the spot until odometry shows the first motion, which holds the way there, the robot's command
cycle (51 ms), its motors, one odometry period (34 ms) and the way back.
"""

import os
import time
from typing import Any, Dict, List, NamedTuple, Optional

import numpy as np
import rospy
from nav_msgs.msg import Odometry

from hero_client.control_laws import STANDSTILL, wrap_angle
from hero_client.program import Program, ProgramError, check_number, parse_robot_ids, read_parameters, run
from hero_client.readings import yaw_of
from hero_client.robot import Robot
from hero_client.swarm_start import WaitReport, open_swarm

TURN_RAD_S = 2.0

MOVED_RAD = 0.03
"""Heading that counts as motion: two ticks of both wheels (0.017 rad each), so that a single tick does not count."""

REST_S = 1.0
"""Standstill before each turn."""

LONGEST_DELAY_S = 2.0
"""A robot that has not moved by then did not get the command."""

POLL_S = 0.002


class Parameters(NamedTuple):
    """The checked parameters of the node."""

    robot_ids: Optional[List[int]]
    turns: int
    plot: str


class Delays(NamedTuple):
    """What was measured of one robot, in seconds."""

    message_s: List[float]
    motion_s: List[float]
    lost: int
    """Turns that the robot did not make."""


def load_parameters() -> Parameters:
    """Return the node's private parameters. Raises: ProgramError."""
    given = read_parameters({"robots": "all", "turns": 10, "plot": "measure_delay.png"})
    turns = check_number("turns", given["turns"], 1, 1000)
    plot = os.path.abspath(os.path.expanduser(str(given["plot"])))
    if not plot.endswith(".png") or not os.access(os.path.dirname(plot), os.W_OK):
        raise ProgramError("~plot is %r, but must be the path of a .png file in a folder that can be written" % plot)
    return Parameters(parse_robot_ids("robots", given["robots"]), int(turns), plot)


class OdomTimes:
    """Arrivals, stamps and headings of one robot's odometry."""

    def __init__(self, robot: Robot) -> None:
        """Begin to listen."""
        self.message_s: List[float] = []
        self.arrival_s = 0.0
        self.yaw_rad = 0.0
        self._subscriber = rospy.Subscriber(
            robot.namespace + "/odom", Odometry, self._receive, queue_size=10, tcp_nodelay=True
        )

    def _receive(self, message: Odometry) -> None:
        self.message_s.append(rospy.get_time() - message.header.stamp.to_sec())
        self.yaw_rad = yaw_of(message.pose.pose.orientation)
        self.arrival_s = time.monotonic()

    def close(self) -> None:
        """Listen no more."""
        self._subscriber.unregister()


def measure_turn(program: Program, robot: Robot, odom: OdomTimes, turn_rad_s: float) -> Optional[float]:
    """Return the seconds from a command to motion; None if there is none, or the program is to end."""
    program.sleep(REST_S)
    yaw_rad = odom.yaw_rad
    start_s = time.monotonic()
    robot.drive(0.0, turn_rad_s)
    while time.monotonic() - start_s < LONGEST_DELAY_S and program.sleep(POLL_S):
        if abs(wrap_angle(odom.yaw_rad - yaw_rad)) > MOVED_RAD:
            return odom.arrival_s - start_s
    return None


def measure(program: Program, robot: Robot, turns: int) -> Delays:
    """Turn the robot to and fro and return what was measured."""
    odom = OdomTimes(robot)
    motion_s: List[float] = []
    lost = 0
    for index in range(turns):
        delay_s = measure_turn(program, robot, odom, TURN_RAD_S if index % 2 == 0 else -TURN_RAD_S)
        robot.drive(*STANDSTILL)
        if not program.running:
            break
        if delay_s is None:
            lost += 1
        else:
            motion_s.append(delay_s)
    robot.stop()
    odom.close()
    return Delays(list(odom.message_s), motion_s, lost)


def describe(values_s: List[float]) -> str:
    """Return median and 99th percentile in ms, for people."""
    if not values_s:
        return "nothing measured"
    p50, p99 = np.percentile(np.array(values_s) * 1000.0, [50, 99])
    return "p50 %.1f ms, p99 %.1f ms (%d)" % (p50, p99, len(values_s))


def save_plot(path: str, delays: Dict[str, Delays]) -> None:
    """Draw both delays of every robot into a PNG file. Raises: ProgramError where matplotlib is missing."""
    try:
        import matplotlib

        matplotlib.use("Agg")  # no display is needed for a file
        from matplotlib import pyplot
    except ImportError:
        raise ProgramError("no plot, because matplotlib is missing: sudo apt install python3-matplotlib") from None
    figure, axes = pyplot.subplots(1, 2, figsize=(10, 4), constrained_layout=True)
    draw_delays(axes[0], "odometry: arrival minus stamp", {name: item.message_s for name, item in delays.items()})
    draw_delays(axes[1], "command to motion", {name: item.motion_s for name, item in delays.items()})
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def draw_delays(axes: Any, title: str, values_s: Dict[str, List[float]]) -> None:
    """Draw a box for each robot: quartiles, whiskers to the 1st and 99th percentile."""
    names = [name for name, values in values_s.items() if values]
    if names:
        axes.boxplot([np.array(values_s[name]) * 1000.0 for name in names], whis=(1, 99), showfliers=False)
        axes.set_xticks(range(1, len(names) + 1))
        axes.set_xticklabels(names, rotation=45 if len(names) > 4 else 0)
    axes.set_title(title)
    axes.set_ylabel("ms")
    axes.grid(axis="y", alpha=0.3)


def wait_until_ready(program: Program, robot: Robot, report: WaitReport) -> None:
    """Wait for the robot, saying so."""
    while robot.missing() is not None and program.sleep(0.1):
        report.update({robot.name: robot.missing()})


def _main() -> None:
    with Program("measure_delay") as program:
        parameters = load_parameters()
        delays: Dict[str, Delays] = {}
        with open_swarm(program, parameters.robot_ids, proximity=False) as swarm:
            report = WaitReport()
            for robot in swarm:
                wait_until_ready(program, robot, report)
                if not program.running:
                    return
                rospy.loginfo("%s turns %d times to and fro", robot.name, parameters.turns)
                item = delays[robot.name] = measure(program, robot, parameters.turns)
                rospy.loginfo("%s message delay: %s", robot.name, describe(item.message_s))
                rospy.loginfo("%s command to motion: %s, lost %d", robot.name, describe(item.motion_s), item.lost)
        save_plot(parameters.plot, delays)
        rospy.loginfo("plot: %s", parameters.plot)


def main() -> None:
    """Run the node."""
    run(_main)
