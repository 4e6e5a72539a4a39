"""Program record: topics of all robots -> bags, split by size, until Ctrl-C or until the disk is nearly full.

rosbag's own recorder writes; this program gives it the right topics, watches the disk, and sees to it that every
file is closed when it ends.
"""

import argparse
import glob
import math
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from typing import Dict, List, Optional, Sequence, Set

import rosgraph
import roslib.packages

from hero_client import command_line
from hero_client.program import ProgramError, parse_robot_ids
from hero_client.ros_node import NodeError, check_master

from .disk_guard import MB, DiskGuard
from .errors import RecordingError
from .mending import ACTIVE_SUFFIX, mend_bag
from .progress import Progress
from .topics import make_patterns

CHECK_PERIOD_S = 0.5
"""Between two looks at the disk; fifty robots fill 3 MB in that time, uncompressed."""

REPORT_PERIOD_S = 60.0
SILENCE_S = 15.0
"""So long after the start an empty recording is worth a line."""

CLOSING_S = 10.0
"""The recorder has to close its files within this; roslaunch itself waits 15 s before it gets rough."""

EMPTY_BAG_BYTES = 10000
"""A bag without messages is a header of 4 kB and no more than the names of topics."""


class Recorder:
    """rosbag's recorder as a child process, which is told to end and then waited for."""

    def __init__(self, command: Sequence[str]) -> None:
        """Start it."""
        # Its stdout names every topic that it subscribes to; warnings and errors go to stderr.
        self._process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)

    def wait(self, timeout_s: float) -> Optional[int]:
        """Return its exit code, None if it still runs after timeout_s."""
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None

    def close(self) -> int:
        """End it: gently, then less so; return its exit code. Safe twice."""
        for ending in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            if self._process.poll() is None:
                self._process.send_signal(ending)
            code = self.wait(CLOSING_S if ending is signal.SIGINT else 2.0)
            if code is not None:
                return code
        return -signal.SIGKILL


class Recording:
    """One recording: its files, its end, what is said about it."""

    def __init__(self, options: argparse.Namespace, recorder_arguments: Sequence[str]) -> None:
        """Prepare; recorder_arguments are ROS's own, such as __name:=. Raises: RecordingError."""
        self._options = options
        self._guard = DiskGuard(options.folder, options.min_free_mb)
        self._free_mb = self._guard.prepare()
        self._pattern = os.path.join(glob.escape(options.folder), options.name + "_[0-9]*.bag*")
        self._old_files: Set[str] = set(glob.glob(self._pattern))
        self._command = make_command(options, recorder_arguments)
        self._end_signal: Optional[int] = None

    def _receive_signal(self, number: int, frame: object) -> None:
        self._end_signal = number

    def _find_files(self) -> Dict[str, int]:
        """Return the files of this recording with their sizes, oldest first."""
        found = []
        for path in set(glob.glob(self._pattern)) - self._old_files:
            # Gone since glob saw it: the recorder renames what it has closed, and disks are pulled out.
            with suppress(OSError):
                status = os.stat(path)
                found.append((status.st_ctime_ns, path, status.st_size))
        return {path: size for _, path, size in sorted(found)}

    def run(self) -> int:
        """Record until something ends it; return the exit code."""
        for path in sorted(self._old_files):
            if path.endswith(ACTIVE_SUFFIX):
                say(
                    "%s was cut off, or another recording writes it; to mend it: record --mend %s"
                    % (path, path)
                )
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._receive_signal)
        say(
            "recording to %s, %s are free there, ends by itself when less than %s are; Ctrl-C ends it"
            % (
                os.path.join(self._options.folder, self._options.name + "_*.bag"),
                format_size(self._free_mb * MB),
                format_size(self._options.min_free_mb * MB),
            )
        )
        start_s = time.monotonic()
        recorder = Recorder(self._command)
        reason, code = None, None
        try:
            reason = self._watch(recorder, start_s)
        finally:
            code = recorder.close()
            mended = self._mend_leftovers()
        self._summarise(time.monotonic() - start_s)
        if reason is not None:
            command_line.complain("ended: " + reason)
            return 1
        if mended or code not in (0, -signal.SIGINT, -signal.SIGTERM):
            command_line.complain("rosbag's recorder ended badly (exit code %s); its last lines say why" % code)
            return 1
        return 0

    def _watch(self, recorder: Recorder, start_s: float) -> Optional[str]:
        """Wait for the end; return its reason if it is not one that was wished for."""
        next_report_s = start_s + SILENCE_S
        while self._end_signal is None:
            if recorder.wait(CHECK_PERIOD_S) is not None:
                return None
            reason = self._guard.find_reason_to_end()
            if reason is not None:
                return reason
            now_s = time.monotonic()
            if self._options.seconds is not None and now_s - start_s >= self._options.seconds:
                return None
            if now_s >= next_report_s:
                next_report_s = now_s + REPORT_PERIOD_S
                self._report(now_s - start_s)
        return None

    def _report(self, elapsed_s: float) -> None:
        files = self._find_files()
        sizes = sum(files.values())
        if sizes <= EMPTY_BAG_BYTES:
            say("nothing came in %.0f s: does the driver run, has a robot joined?" % elapsed_s)
            return
        text = "%s in %d file%s after %s" % (
            format_size(sizes),
            len(files),
            "" if len(files) == 1 else "s",
            format_time(elapsed_s),
        )
        free_mb = self._guard.read_free_above_limit_mb()
        if not self._options.max_files and free_mb is not None:
            text += ", space for about %s more" % format_time(free_mb * MB / (sizes / elapsed_s))
        say(text)

    def _mend_leftovers(self) -> bool:
        """Mend what the recorder could not close; return whether there was anything."""
        leftovers = [path for path in self._find_files() if path.endswith(ACTIVE_SUFFIX)]
        for path in leftovers:
            try:
                say("mended %s" % mend_bag(path, Progress()))
            except RecordingError as error:
                command_line.complain(str(error))
        return bool(leftovers)

    def _summarise(self, elapsed_s: float) -> None:
        files = self._find_files()
        if sum(files.values()) <= EMPTY_BAG_BYTES:
            say("nothing was recorded: no robot, no driver was heard")
        for path, size in files.items():
            say("%s  %s" % (path, format_size(size)))
        say("%s in %s" % (format_size(sum(files.values())), format_time(elapsed_s)))


def format_size(size: float) -> str:
    """Return a size in words."""
    return "%.1f GB" % (size / 1e9) if size >= 1e9 else "%.1f MB" % (size / 1e6)


def format_time(duration_s: float) -> str:
    """Return a duration in words."""
    if duration_s < 120.0:
        return "%.0f s" % duration_s
    if duration_s < 7200.0:
        return "%.0f min" % (duration_s / 60.0)
    return "%.0f h" % (duration_s / 3600.0)


def say(text: str) -> None:
    """Write a line for people; the recording goes on where nobody reads it."""
    command_line.say("record: " + text)


def make_command(options: argparse.Namespace, recorder_arguments: Sequence[str]) -> List[str]:
    """Return the command line of rosbag's recorder. Raises: RecordingError if it is not installed."""
    found = roslib.packages.find_node("rosbag", "record")
    if not found:
        raise RecordingError(
            "rosbag's recorder is missing; install it: apt install python3-rosbag, or ros-noetic-rosbag"
        )
    command = [found[0], "--quiet", "--regex", "--repeat-latched", "--buffsize", "256", "--tcpnodelay"]
    command += ["-o", os.path.join(options.folder, options.name), "--split", "--size", str(options.split_mb)]
    # The recorder's own guard only stops writing and goes on; it is the second line, should this program be killed.
    command += ["--min-space", "%dk" % max(1, options.min_free_mb * MB / 1024 / 10)]
    if options.max_files:
        command += ["--max-splits", str(options.max_files)]
    if options.compression != "none":
        command.append("--" + options.compression)
    return [*command, *make_patterns(options.robots, options.raw, options.topics), *recorder_arguments]


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="record", description="Record all robots into bags, split by size.")
    parser.add_argument("--folder", default=".", help="where the bags go (here); it is made if need be")
    parser.add_argument("--name", default="hero", help="begin of the files' names, NAME_DATE_0.bag (hero)")
    parser.add_argument(
        "--robots", default="all", help="ids, e.g. '0 1 2' or 0-3 (all, also those that join later)"
    )
    parser.add_argument(
        "--topics", default="", help="more topics to record, regular expressions with spaces between"
    )
    parser.add_argument("--raw", action="store_true", help="record odom_raw, laser and laser_enable too")
    parser.add_argument(
        "--split-mb", type=int, default=256, metavar="MB", help="begin a new file at this size (256)"
    )
    parser.add_argument(
        "--max-files", type=int, default=0, metavar="N", help="keep the newest N files only (0: keep all)"
    )
    parser.add_argument(
        "--min-free-mb", type=float, default=1000.0, metavar="MB", help="end when less is free (1000)"
    )
    parser.add_argument(
        "--compression", choices=("lz4", "bz2", "none"), default="lz4", help="of the bags (lz4)"
    )
    parser.add_argument("--seconds", type=float, metavar="S", help="end by itself after S seconds")
    parser.add_argument(
        "--mend", nargs="+", metavar="FILE", help="record nothing, but mend recordings that were cut off"
    )
    options = parser.parse_args(arguments)
    for name, lowest, highest in (
        ("split_mb", 1, 100000),
        ("max_files", 0, 10000),
        ("min_free_mb", 0.0, 1e9),
    ):
        value = getattr(options, name)
        if not lowest <= value <= highest:
            parser.error("--%s %s: must be %g..%g" % (name.replace("_", "-"), value, lowest, highest))
    if options.seconds is not None and not 0.0 < options.seconds < math.inf:
        parser.error("--seconds %g: must be more than 0, and finite" % options.seconds)
    if not re.fullmatch(r"[\w][\w.-]*", options.name):
        parser.error("--name %r: must be letters, digits, _ . and -" % options.name)
    try:
        options.robots = parse_robot_ids("robots", options.robots)
    except ProgramError as error:
        parser.error(str(error).replace("~", "--"))
    options.topics = options.topics.split()
    for pattern in options.topics:
        try:
            re.compile(pattern)
        except re.error as error:
            parser.error("--topics %r: not a regular expression: %s" % (pattern, error))
    options.folder = os.path.abspath(os.path.expanduser(options.folder))
    return options


def run(arguments: Sequence[str]) -> int:
    """Do what the command line says; return the exit code. Raises: RecordingError, NodeError."""
    ros_arguments = [word for word in arguments if rosgraph.names.REMAP in word]
    options = parse_options([word for word in arguments if rosgraph.names.REMAP not in word])
    if options.mend:
        for path in options.mend:
            say("mended %s" % mend_bag(path, Progress()))
        return 0
    check_master()
    return Recording(options, ros_arguments).run()


def main() -> None:
    """Run the program record."""
    command_line.run(lambda: run(sys.argv[1:]), RecordingError, NodeError)
