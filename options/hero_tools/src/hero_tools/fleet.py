"""Shows the robots of all drivers as a live table, as lines, or as JSON.

    rosrun hero_tools fleet                  a table like top, redrawn in place
    rosrun hero_tools fleet --once --json    the fleet as one line of JSON, for scripts

Messages of robots are decoded only when the table is drawn. Only worker threads wait for the ROS master.
"""

import argparse
import contextlib
import math
import shutil
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Dict, Iterator, List, Optional, Sequence, Set

import rospy

from hero_client.apps.keyboard import RELEASE_KEY, STOP_ALL_KEYS, Keyboard, NoTerminalError
from hero_client.ros import Drivers, RobotListener, RobotTrack, StopStatus, follow, load_fleet_file, paint
from hero_msgs.msg import Robot, RobotArray
from hero_node.files import RobotNotes, read_calibrations
from hero_node.parameters import within
from hero_node.ros import Program

from .fleet_rows import RobotRow, find_missing, sort_rows
from .fleet_table import format_json, format_table, format_title
from .inventory import format_inventory, list_inventory, list_warnings

DRIVER_TIMEOUT_S = 10.0  # how long --once waits for a driver that is just starting
LISTEN_S = 1.5  # how long --once counts messages
LISTEN_MAX_S = 5.0  # also for robots that are ready but silent: a busy PC takes its time to subscribe
DRAW_PERIOD_S = 0.5
ASKING_DRAW_PERIOD_S = 0.1  # while users wait for a stop
ENTER_SCREEN = "\x1b[?1049h\x1b[?25l"  # xterm: the alternate screen, no cursor
LEAVE_SCREEN = "\x1b[?25h\x1b[?1049l"
HOME = "\x1b[H"
CLEAR_LINE_END = "\x1b[K"
CLEAR_SCREEN_END = "\x1b[J"
PRINT_PERIOD_S = 5.0  # without a terminal
STOP_KEYS = (*STOP_ALL_KEYS, "s")
"""Those of teleop; s, which there stops the robots that it drives, is not advertised here."""

KEYS_HELP = "q quit   Enter STOP ALL ROBOTS   r release them"
MAX_OPTION = 1e6


@contextlib.contextmanager
def take_screen(keyboard: Keyboard) -> Iterator[None]:
    """Read keys, and draw on the terminal's other screen, until the context ends."""
    with keyboard:
        sys.stdout.write(ENTER_SCREEN)
        try:
            yield
        finally:
            with contextlib.suppress(OSError):  # the terminal may be closed
                sys.stdout.write(LEAVE_SCREEN)
                sys.stdout.flush()


def draw(lines: Sequence[str]) -> None:
    """Draw the lines over what was there, without a flicker."""
    text = "".join(line + CLEAR_LINE_END + "\r\n" for line in lines[:-1]) + lines[-1] + CLEAR_LINE_END
    sys.stdout.write(HOME + text + CLEAR_SCREEN_END)
    sys.stdout.flush()


class FleetProgram:
    """The program: listens, shows, and checks at the end whether the expected robots joined and moved."""

    def __init__(self, program: Program, options: argparse.Namespace) -> None:
        self._program = program
        self._options = options
        self._file = load_fleet_file()
        self._drivers = Drivers()
        self._report: Optional[RobotArray] = None
        self._listeners: Dict[str, RobotListener] = {}
        self._asked: Set[str] = set()
        self._worker = ThreadPoolExecutor(1, "subscriptions")
        self._end_s = math.inf if options.seconds is None else time.monotonic() + options.seconds
        self._rows: List[RobotRow] = []

    def _seconds_left(self) -> float:
        return self._end_s - time.monotonic()

    def _going(self) -> bool:
        return self._seconds_left() > 0.0 and self._program.running

    def _wait_for_driver(self) -> bool:
        """Return as soon as every driver has reported, and whether one has within DRIVER_TIMEOUT_S."""
        end_s = time.monotonic() + DRIVER_TIMEOUT_S
        while not (self._drivers.read() and self._drivers.is_settled) and time.monotonic() < end_s:
            if not self._program.sleep(0.02):
                break
        return self._drivers.read() is not None

    def _read(self) -> None:
        """Read the robots, and subscribe to topics of those that are new."""
        report = self._report = self._drivers.read() or self._report
        if report is None:
            return
        present = {robot.namespace for robot in report.robots if robot.namespace and robot.state != Robot.REFUSED}
        if present != self._asked:
            self._asked = present
            self._worker.submit(follow, self._listeners, present, RobotListener)
        self._rows = sort_rows([self._make_row(robot, report.stopped) for robot in report.robots])

    def _make_row(self, robot: Robot, stopped: bool) -> RobotRow:
        # Topics under the name of a robot that was refused are those of another robot.
        listener = None if robot.state == Robot.REFUSED else self._listeners.get(robot.namespace)
        if listener is not None:
            listener.read_newest()
        track = RobotTrack() if listener is None else listener.track
        notes, values = self._file.robots.get(robot.id, RobotNotes()), {} if listener is None else listener.values
        return RobotRow(robot, track, track.odometry.rate_hz(time.monotonic()), stopped, notes, values)

    def _make_lines(self, width: int, height: int) -> List[str]:
        if self._report is None:
            text = "no driver yet: nothing on /hero_driver/robots (roslaunch hero_bringup hero_bringup.launch)"
            return [text[:width]]
        silent = self._drivers.find_silent()
        title = format_title(self._report, time.time(), silent)
        return [
            *(line[:width] for line in title),
            *format_table(self._rows, width, max(2, height - len(title)), self._file.topics),
        ]

    def _press(self, key: str) -> None:
        """Execute the command of a key."""
        if key in STOP_KEYS or key == RELEASE_KEY:
            self._drivers.request_stop(key in STOP_KEYS)
        elif key == "d":
            self._worker.submit(self._drivers.dismiss_gone)

    def print_fleet(self) -> None:
        """Print the fleet once, as lines or as JSON; or the inventory."""
        if self._options.inventory is not None:
            file = self._file
            inventory = list_inventory(self._rows, file, read_calibrations(self._options.calibrations).found)
            warnings = list_warnings(inventory, file.run_time_h)
            style = "json" if self._options.json else self._options.inventory
            print(format_inventory(inventory, style, warnings), flush=True)
            return
        if self._options.json:
            print(format_json(self._rows, self._report or RobotArray()), flush=True)
        else:
            print("\n".join(self._make_lines(200, 10000)), flush=True)

    def run_once(self) -> int:
        """Wait for the driver, listen for a moment, print."""
        if not self._wait_for_driver():
            if self._program.running:
                text = "fleet: no driver: nothing on /hero_driver/robots after %.0f s"
                print(text % DRIVER_TIMEOUT_S, file=sys.stderr)
            return 1
        start_s = time.monotonic()
        while self._program.sleep(0.1):
            self._read()
            heard = all(row.is_heard for row in self._rows if row.robot.state == Robot.READY)
            if time.monotonic() - start_s > (LISTEN_S if heard else LISTEN_MAX_S):
                break
        self.print_fleet()
        return 0

    def run_lines(self) -> int:
        """Print the fleet every few seconds until the time is over, and once more then."""
        next_print_s = time.monotonic() + PRINT_PERIOD_S
        while self._going():
            self._program.sleep(max(0.0, min(DRAW_PERIOD_S, self._seconds_left())))
            self._read()
            if time.monotonic() >= next_print_s and self._seconds_left() > DRAW_PERIOD_S:
                next_print_s += PRINT_PERIOD_S
                self.print_fleet()
        self.print_fleet()
        return self.check_expected()

    def run_screen(self, keyboard: Keyboard) -> int:
        """Show the table in place until the time is over or a key ends it."""
        with take_screen(keyboard):
            while self._going():
                self._read()
                status = self._drivers.stop_status()
                draw(self._make_screen(status))
                period_s = DRAW_PERIOD_S if status is None or status.is_final else ASKING_DRAW_PERIOD_S
                keys: Optional[List[str]] = []
                if self._program.wait_readable([keyboard.fileno()], min(period_s, self._seconds_left())):
                    keys = keyboard.read_keys()  # None: the terminal is closed
                for key in keys or ():
                    self._press(key)
                if keys is None or "q" in keys:
                    break
        if self._program.end_signal is None:
            self.print_fleet()
        self._drivers.check_stop()
        return self.check_expected()

    def _make_screen(self, status: Optional[StopStatus]) -> List[str]:
        """Return all lines: the table, the state of a stop, and the keys."""
        size = shutil.get_terminal_size()
        left_s = self._seconds_left()
        ending = "" if left_s == math.inf else f"   ends in {left_s:.0f} s"
        stop = "" if status is None else paint(status.level, status.text[: size.columns])
        return [*self._make_lines(size.columns, size.lines - 2), stop, (KEYS_HELP + ending)[: size.columns]]

    def check_expected(self) -> int:
        """Print which of the expected robots did not join or move, and return the exit status."""
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
    parser.add_argument("--once", action="store_true", help="print the fleet once and quit")
    parser.add_argument("--json", action="store_true", help="print JSON, one line each time, instead of a table")
    parser.add_argument("--seconds", type=within(0.0, MAX_OPTION), metavar="S", help="quit after S seconds")
    text = "at the end list each of hero_0 to hero_(N-1) that did not join or move, and exit with 1"
    parser.add_argument("--expect", type=within(0, MAX_OPTION, int), metavar="N", help=text)
    text = "print every robot once with versions, run time, calibration and notes of fleet.yaml: table or csv"
    parser.add_argument("--inventory", nargs="?", choices=("table", "csv"), const="table", help=text)
    text = "folder of calibrations (%(default)s)"
    parser.add_argument("--calibrations", default="~/hero_calibration", metavar="FOLDER", help=text)
    options = parser.parse_args(arguments)
    options.once = options.once or options.inventory is not None
    return options


def main() -> int:
    """Show the fleet until the end and return the exit code."""
    options = parse_options(rospy.myargv()[1:])
    with Program("fleet", anonymous=True) as program:
        fleet = FleetProgram(program, options)
        try:
            keyboard = None if options.once or options.json or not sys.stdout.isatty() else Keyboard()
        except NoTerminalError:
            keyboard = None
        if options.once:
            exit_code = fleet.run_once()
        elif keyboard is None:
            exit_code = fleet.run_lines()
        else:
            exit_code = fleet.run_screen(keyboard)
        return exit_code if program.end_signal is None else 128 + program.end_signal
