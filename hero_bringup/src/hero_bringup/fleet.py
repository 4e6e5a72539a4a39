"""Topics of the driver and of its robots -> the fleet as a live table, as lines, or as JSON.

    rosrun hero_bringup fleet                  a table like top, redrawn in place
    rosrun hero_bringup fleet --once --json    the fleet as one line of JSON, for scripts

Shows the robots of all drivers. Only listens, but for the keys s and d: they call the services stop and disconnect of
the drivers. Messages of robots are kept as bytes and read when the table is drawn, so that fifty robots cost little.
"""

import argparse
import select
import shutil
import signal
import sys
import threading
import time
from types import FrameType
from typing import Dict, List, Optional, Sequence

import rosgraph
import rospy

from hero_examples.drivers import Drivers
from hero_examples.keyboard import Keyboard, NoTerminalError
from hero_msgs.msg import Robot
from hero_msgs.srv import Disconnect

from .fleet_state import RobotRow, RobotTrack, find_missing, sort_rows
from .fleet_table import format_json, format_table, format_title
from .robot_listener import STATES, RobotListener

ORDERS = ("id", "state", "nearest")
DRIVER_TIMEOUT_S = 10.0  # how long --once waits for a driver that is just starting
DRAW_PERIOD_S = 0.5
ENTER_SCREEN = (
    "\x1b[?1049h\x1b[?25l"  # xterm: the alternate screen, so that what was there comes back; no cursor
)
LEAVE_SCREEN = "\x1b[?25h\x1b[?1049l"
HOME = "\x1b[H"
CLEAR_LINE_END = "\x1b[K"
CLEAR_SCREEN_END = "\x1b[J"
KEYS_HELP = "q ends   s stops all robots, or lets them go   o order   up, down choose   d disconnects the chosen robot"


class FleetListener:
    """The drivers' lists of robots, and a listener for each robot."""

    def __init__(self) -> None:
        self.heard = False
        self.listening = ""
        self.stopped = False
        self._drivers = Drivers()
        self._listeners: Dict[str, RobotListener] = {}

    def wait_for_driver(self, timeout_s: float) -> bool:
        """Return as soon as every driver was heard, and whether one was heard in that time."""
        end_s = time.monotonic() + timeout_s
        while not (self._drivers.read() and self._drivers.is_settled) and time.monotonic() < end_s:
            time.sleep(0.02)
        return self._drivers.read() is not None

    def read_rows(self, now_s: float) -> List[RobotRow]:
        """Return the fleet as it is; listens from now on to robots that are new."""
        report = self._drivers.read()
        if report is None:
            return []
        self.heard, self.listening, self.stopped = True, report.listening, report.stopped
        robots = report.robots
        present = {robot.namespace for robot in robots if robot.namespace}
        for namespace in present - set(self._listeners):
            self._listeners[namespace] = RobotListener(namespace)
        for namespace in set(self._listeners) - present:
            self._listeners.pop(namespace).close()
        return [self._make_row(robot, now_s) for robot in robots]

    def _make_row(self, robot: Robot, now_s: float) -> RobotRow:
        listener = self._listeners.get(robot.namespace)
        if listener is not None:
            listener.read_newest()
        track = listener.track if listener is not None else RobotTrack()
        return RobotRow(
            id=robot.id,
            namespace=robot.namespace,
            address=robot.address,
            state=STATES.get(robot.state, str(robot.state)),
            odom_hz=track.odometry.rate_hz(now_s),
            frames_per_s=robot.frames_per_s,
            bytes_per_s=robot.bytes_per_s,
            pose=track.pose,
            way_m=track.way_m,
            turned_rad=track.turned_rad,
            proximity_seen=track.proximity_seen,
            nearest=track.nearest,
            reconnects=robot.reconnects,
            clock_offset_s=robot.clock_offset,
            firmware=robot.firmware,
            last_error=robot.last_error,
        )

    def toggle_stop(self) -> None:
        """Ask the drivers to stop all robots, or to let them go again, without waiting for their answers."""
        self._drivers.stop(not self.stopped, log_failure)

    def disconnect(self, robot: str, news: List[str]) -> None:
        """Ask the robot's driver to close its connection; what came of it is added to the news later."""
        driver = self._drivers.find("/" + robot)
        threading.Thread(target=call_disconnect, args=(driver, robot, news), daemon=True).start()


def log_failure(driver: str, failure: Optional[str]) -> None:
    """Say why a driver did not do what it was asked for."""
    if failure is not None:
        rospy.logerr(failure)


def call_disconnect(driver: str, robot: str, news: List[str]) -> None:
    """Call a driver's disconnect service, and add what came of it to the news."""
    try:
        news.append(rospy.ServiceProxy(driver + "/disconnect", Disconnect)(robot).message)
    except rospy.ServiceException as error:
        news.append("%s is not disconnected: %s" % (robot, error))


class Screen:
    """A terminal: the table in place, and keys."""

    def __init__(self, keyboard: Keyboard) -> None:
        self._keyboard = keyboard

    def __enter__(self) -> "Screen":
        self._keyboard.__enter__()
        sys.stdout.write(ENTER_SCREEN)
        return self

    def __exit__(self, kind, error, traceback) -> None:  # type: ignore[no-untyped-def]
        sys.stdout.write(LEAVE_SCREEN)
        sys.stdout.flush()
        self._keyboard.__exit__(kind, error, traceback)

    def draw(self, lines: Sequence[str]) -> None:
        """Draw the lines over what was there, without a flicker."""
        text = "".join(line + CLEAR_LINE_END + "\r\n" for line in lines[:-1]) + lines[-1] + CLEAR_LINE_END
        sys.stdout.write(HOME + text + CLEAR_SCREEN_END)
        sys.stdout.flush()

    def wait_for_keys(self, timeout_s: float) -> Optional[List[str]]:
        """Return the keys pressed within the time; None if the terminal is gone."""
        if select.select([self._keyboard], [], [], max(0.0, timeout_s))[0]:
            return self._keyboard.read_keys()
        return []


class FleetProgram:
    """The program: listens, shows, and says at the end whether the robots that were expected came and moved."""

    def __init__(self, options: argparse.Namespace) -> None:
        self._options = options
        self._fleet = FleetListener()
        self._order = options.sort
        self._chosen: Optional[str] = None
        self._asks_disconnect = False
        self._news: List[str] = []
        self._start_s = time.monotonic()
        self._rows: List[RobotRow] = []

    def _seconds_left(self) -> float:
        if self._options.seconds is None:
            return float("inf")
        return float(self._start_s + self._options.seconds - time.monotonic())

    def _going(self) -> bool:
        return self._seconds_left() > 0.0 and not rospy.is_shutdown()

    def _read(self) -> None:
        self._rows = sort_rows(self._fleet.read_rows(time.monotonic()), self._order)

    def _make_lines(self, width: int, height: int) -> List[str]:
        if not self._fleet.heard:
            return [
                "no driver yet: nothing on /hero_driver/robots (roslaunch hero_bringup hero_bringup.launch)"[
                    :width
                ]
            ]
        title = format_title(self._rows, self._fleet.listening, self._fleet.stopped)
        return [title[:width], *format_table(self._rows, width, max(2, height - 1), self._find_chosen())]

    def _find_chosen(self) -> Optional[int]:
        """Return the number of the chosen robot's row."""
        names = [row.name for row in self._rows]
        return names.index(self._chosen) if self._chosen in names else None

    def _choose(self, step: int) -> None:
        """Choose the next robot, or the one before."""
        chosen = self._find_chosen()
        if self._rows:
            number = (0 if step > 0 else -1) if chosen is None else (chosen + step) % len(self._rows)
            self._chosen = self._rows[number].name

    def _disconnect(self) -> None:
        """Disconnect the chosen robot at the second key in a row."""
        if self._find_chosen() is None:
            self._news = ["choose a robot first: up, down"]
        elif not self._asks_disconnect:
            self._asks_disconnect = True
            self._news = ["d again disconnects %s" % self._chosen]
            return
        else:
            self._news = ["disconnecting %s" % self._chosen]
            self._fleet.disconnect(str(self._chosen), self._news)
        self._asks_disconnect = False

    def _press(self, key: str) -> None:
        """Do what a key says."""
        self._asks_disconnect = self._asks_disconnect and key == "d"
        if key == "o":
            self._order = ORDERS[(ORDERS.index(self._order) + 1) % len(ORDERS)]
            self._news = ["order: %s" % self._order]
        elif key == "s":
            self._fleet.toggle_stop()
        elif key in ("up", "down"):
            self._choose(1 if key == "down" else -1)
        elif key == "d":
            self._disconnect()

    def print_fleet(self) -> None:
        """Print the fleet once, as lines or as JSON."""
        self._chosen = None
        if self._options.json:
            print(format_json(self._rows, self._fleet.listening, self._fleet.stopped), flush=True)
        else:
            print("\n".join(self._make_lines(200, 10000)), flush=True)

    def run_once(self) -> int:
        """Wait for the driver, listen for a moment, print."""
        if not self._fleet.wait_for_driver(DRIVER_TIMEOUT_S):
            print(
                "fleet: no driver: nothing on /hero_driver/robots after %.0f s" % DRIVER_TIMEOUT_S,
                file=sys.stderr,
            )
            return 1
        end_s = (
            time.monotonic() + 1.5
        )  # laser scans come 5 times a second, new subscriptions take a few 0.1 s
        while time.monotonic() < end_s:
            self._read()
            time.sleep(0.1)
        self._read()
        self.print_fleet()
        return 0

    def run_lines(self) -> None:
        """Print the fleet every few seconds until the time is over, and once more then."""
        next_print_s = time.monotonic() + self._options.period
        while self._going():
            time.sleep(max(0.0, min(DRAW_PERIOD_S, self._seconds_left())))
            self._read()
            if time.monotonic() >= next_print_s and self._seconds_left() > DRAW_PERIOD_S:
                next_print_s += self._options.period
                self.print_fleet()
        self.print_fleet()

    def run_screen(self, keyboard: Keyboard) -> None:
        """Show the table in place until the time is over or a key ends it."""
        with Screen(keyboard) as screen:
            while self._going():
                self._read()
                size = shutil.get_terminal_size()
                left_s = self._seconds_left()
                ending = "" if left_s == float("inf") else "   ends in %.0f s" % left_s
                table = self._make_lines(size.columns, size.lines - 2)
                last = "".join(self._news[-1:]) or KEYS_HELP + ending
                screen.draw([*table, "", last[: size.columns]])
                keys = screen.wait_for_keys(min(DRAW_PERIOD_S, left_s))
                if keys is None or "q" in keys:
                    return
                if keys:
                    self._news = []
                for key in keys:
                    self._press(key)

    def check_expected(self) -> int:
        """Say which of the expected robots did not join or move, and return the exit code."""
        if self._options.expect is None:
            return 0
        missing = find_missing(self._rows, range(self._options.expect))
        for robot_id, reason in missing.items():
            print("fleet: hero_%d %s" % (robot_id, reason), file=sys.stderr)
        if not missing:
            print("all %d robots joined and moved" % self._options.expect)
        return 1 if missing else 0


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="fleet", description="The robots of all drivers, as a live table.")
    parser.add_argument("--once", action="store_true", help="print the fleet once and end")
    parser.add_argument(
        "--json", action="store_true", help="print JSON, one line each time, instead of a table"
    )
    parser.add_argument("--seconds", type=float, metavar="S", help="end by itself after S seconds")
    parser.add_argument(
        "--period",
        type=float,
        default=5.0,
        metavar="S",
        help="seconds between two prints where the output is not a terminal (5)",
    )
    parser.add_argument("--sort", choices=ORDERS, default="id", help="order of the robots (id)")
    parser.add_argument(
        "--expect",
        type=int,
        metavar="N",
        help="at the end name every robot of hero_0 to hero_(N-1) that did not join or move, and exit with 1",
    )
    options = parser.parse_args(arguments)
    for name, lowest in (("seconds", 0.0), ("period", 0.1), ("expect", 0)):
        value = getattr(options, name)
        if value is not None and not value >= lowest:
            parser.error("--%s %s: must be at least %s" % (name, value, lowest))
    return options


def raise_interrupt(number: int, frame: Optional[FrameType]) -> None:
    """End on SIGTERM as on Ctrl-C, so that the terminal is given back."""
    raise KeyboardInterrupt


def run(options: argparse.Namespace) -> int:
    """Run until the end and return the exit code."""
    if not rosgraph.is_master_online():
        uri = rosgraph.get_master_uri()
        print("fleet: no ROS master at %s: start one with roslaunch or roscore" % uri, file=sys.stderr)
        return 1
    rospy.init_node("fleet", anonymous=True, disable_signals=True)
    program = FleetProgram(options)
    if options.once:
        return program.run_once()
    try:
        keyboard = None if options.json or not sys.stdout.isatty() else Keyboard()
    except NoTerminalError:
        keyboard = None
    if keyboard is None:
        program.run_lines()
    else:
        program.run_screen(keyboard)
        program.print_fleet()
    return program.check_expected()


def main() -> None:
    """Run the program fleet."""
    options = parse_options(rospy.myargv()[1:])
    signal.signal(signal.SIGTERM, raise_interrupt)
    try:
        exit_code = run(options)
    except KeyboardInterrupt:
        exit_code = 130
    rospy.signal_shutdown("done")
    sys.exit(exit_code)
