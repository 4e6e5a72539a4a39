"""Program record: records topics of all robots into bags, until Ctrl-C or until the disk is nearly full.

rosbag's own recorder writes; this program tells it the topics, watches the disk, and makes sure that every file is
closed at the end.
"""

import argparse
import glob
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from typing import Dict, List, Optional, Sequence, Set

import roslib.packages

from hero_node import command_line, end_process
from hero_node.files import read_fleet_file
from hero_node.parameters import robot_ids_option, within
from hero_node.ros import check_master

from .bags.bag_set import ACTIVE_SUFFIX
from .bags.repair import ORIGINAL_SUFFIX, repair_bag
from .bags.topics import declare_topics, make_patterns
from .disk_guard import MB, find_reason_to_stop, prepare_folder
from .errors import RecordingError

CHECK_PERIOD_S = 0.5
"""Time between two checks of the disk; fifty robots fill 3 MB in that time, uncompressed."""

SILENCE_S = 15.0
"""An empty recording is reported this long after the start."""

CLOSING_S = 10.0
"""The recorder has to close its files within this; roslaunch waits 15 s before it sends SIGTERM."""

REMAPPING = re.compile(r"(__|[^_-]).*:=")
"""An argument for ROS, such as __name:=my_record; private parameters are refused: the options take their place."""

EMPTY_BAG_BYTES = 10000
"""A bag without messages is a header of 4 kB and at most the names of topics."""


class Recording:
    """One recording: its files, its end, and its messages to the user."""

    def __init__(self, options: argparse.Namespace, recorder_arguments: Sequence[str]) -> None:
        """Prepare; recorder_arguments are ROS's own, such as __name:=. Raises: RecordingError."""
        self._options = options
        self._free_mb = prepare_folder(options.folder, options.min_free_mb)
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
            if path.endswith(ORIGINAL_SUFFIX):
                continue
            # Gone since glob saw it: the recorder renames what it has closed, and disks are pulled out.
            with suppress(OSError):
                status = os.stat(path)
                found.append((status.st_ctime_ns, path, status.st_size))
        return {path: size for _, path, size in sorted(found)}

    def run(self) -> None:
        """Record until something ends it. Raises: RecordingError if that was not the user, or files were left open."""
        for path in sorted(self._old_files):
            if path.endswith(ACTIVE_SUFFIX):
                say(f"{path} was cut off, or is being recorded; to repair it: record --repair {path}")
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._receive_signal)
        seconds, files = self._options.seconds, os.path.join(self._options.folder, self._options.name + "_*.bag")
        until = "until Ctrl-C" if seconds is None else "for %g s, or until Ctrl-C" % seconds
        free, limit = format_size(self._free_mb * MB), format_size(self._options.min_free_mb * MB)
        say(f"recording to {files} {until}; {free} are free, stops by itself below {limit}")
        start_s = time.monotonic()
        # It names every topic that it subscribes to, on stdout and on /rosout; warnings and errors remain.
        with tempfile.NamedTemporaryFile(suffix=".config") as logging:
            logging.write(b"log4j.logger.ros=WARN\n")
            logging.flush()
            self._record(start_s, {**os.environ, "ROSCONSOLE_CONFIG_FILE": logging.name})

    def _record(self, start_s: float, environment: Dict[str, str]) -> None:
        """Run the recorder from start to end. Raises: RecordingError."""
        null = subprocess.DEVNULL
        recorder = subprocess.Popen(self._command, stdin=null, stdout=null, env=environment)
        reason = None
        try:
            reason = self._watch(recorder, start_s)
        finally:
            code = end_process(recorder, CLOSING_S)
            leftovers = [path for path in self._find_files() if path.endswith(ACTIVE_SUFFIX)]
            repair_all(leftovers)
        self._summarize(time.monotonic() - start_s)
        if reason is not None:
            raise RecordingError("stopped: " + reason)
        if leftovers or code not in (0, -signal.SIGINT, -signal.SIGTERM):
            raise RecordingError(f"rosbag's recorder failed (exit code {code}); its last lines tell why")

    def _watch(self, recorder: "subprocess.Popen[bytes]", start_s: float) -> Optional[str]:
        """Wait for the end; return the reason if the disk forced it."""
        is_checked = False
        while self._end_signal is None:
            time.sleep(CHECK_PERIOD_S)
            if recorder.poll() is not None:
                return None
            reason = find_reason_to_stop(self._options.folder, self._options.min_free_mb)
            if reason is not None:
                return reason
            now_s = time.monotonic()
            if self._options.seconds is not None and now_s - start_s >= self._options.seconds:
                return None
            if not is_checked and now_s - start_s >= SILENCE_S:
                is_checked = True
                if sum(self._find_files().values()) <= EMPTY_BAG_BYTES:
                    say(f"nothing received in {SILENCE_S:.0f} s: is the driver running, has a robot joined?")
        return None

    def _summarize(self, elapsed_s: float) -> None:
        files = self._find_files()
        if sum(files.values()) <= EMPTY_BAG_BYTES:
            say("nothing was recorded: no robot and no driver published anything")
        for path, size in files.items():
            say(f"{path}  {format_size(size)}")
        say(f"{format_size(sum(files.values()))} in {elapsed_s:.0f} s")


def repair_all(paths: Sequence[str]) -> bool:
    """Repair recordings; return whether all could be: one that cannot be keeps no other from it."""
    failed = []
    for path in paths:
        try:
            say(repair_bag(path))
        except RecordingError as error:
            command_line.print_error(str(error))
            failed.append(path)
    return not failed


def format_size(size: float) -> str:
    """Return a number of bytes as text."""
    return f"{size / 1000000000.0:.1f} GB" if size >= 1e9 else f"{size / 1000000.0:.1f} MB"


def say(text: str) -> None:
    """Write a line; the recording continues if its output is closed."""
    command_line.say("record: " + text)


def make_command(options: argparse.Namespace, recorder_arguments: Sequence[str]) -> List[str]:
    """Return the command line of rosbag's recorder. Raises: RecordingError if it is not installed."""
    found = roslib.packages.find_node("rosbag", "record")
    if not found:
        raise RecordingError("rosbag's recorder is missing: apt install python3-rosbag, or ros-noetic-rosbag")
    if not shutil.which("setpriv"):
        raise RecordingError("setpriv, which stops the recorder at the end, is missing: apt install util-linux")
    # If this program is killed, the recorder closes its files and ends (setpriv(1) of util-linux).
    command = ["setpriv", "--pdeathsig", "INT", found[0]]
    command += ["--quiet", "--regex", "--repeat-latched", "--buffsize", "256", "--tcpnodelay"]
    command += ["-o", os.path.join(options.folder, options.name), "--split", "--size", str(options.split_mb)]
    # The recorder's own guard only stops writing; it is the second line, should this program be killed.
    command += ["--min-space", "%dk" % max(1, options.min_free_mb * MB / 1024 / 10)]
    if options.max_files:
        command += ["--max-splits", str(options.max_files)]
    if options.compression != "none":
        command.append("--" + options.compression)
    return [*command, *make_patterns(options.robots, options.topics), *recorder_arguments]


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="record", description="Record all robots into bags.", allow_abbrev=False)
    add = parser.add_argument
    add("--folder", default=".", help="folder of the bags (here); created if missing")
    add("--name", default="hero", help="prefix of the file names, NAME_DATE_0.bag (hero)")
    add("--robots", type=robot_ids_option, default="all", help="ids, e.g. '0 1 2' or 0-3 (all)")
    add("--topics", default="", help="more topics: regular expressions separated by spaces")
    add("--split-mb", type=within(1, 100_000, int), default=256, metavar="MB", help="size of a file (256)")
    add("--max-files", type=within(0, 10_000, int), default=0, metavar="N", help="keep only the newest N (0: all)")
    add("--min-free-mb", type=within(0.0, 1e9), default=1000.0, metavar="MB", help="stop below this (1000)")
    add("--compression", choices=("lz4", "bz2", "none"), default="lz4", help="bag compression (lz4)")
    add("--seconds", type=float, metavar="S", help="stop after S seconds")
    add("--repair", nargs="+", metavar="FILE", help="repair recordings that were cut off, and exit")
    options = parser.parse_args(arguments)
    if options.seconds is not None and not 0.0 < options.seconds < math.inf:
        parser.error(f"--seconds {options.seconds:g}: must be more than 0, and finite")
    if not re.fullmatch(r"[\w][\w.-]*", options.name):
        parser.error(f"--name {options.name!r}: must be letters, digits, _ . and -")
    options.topics = options.topics.split()
    for pattern in options.topics:
        try:
            re.compile(pattern)
        except re.error as error:
            parser.error(f"--topics {pattern!r}: not a regular expression: {error}")
    options.folder = os.path.abspath(os.path.expanduser(options.folder))
    return options


def main() -> int:
    """Record, or repair recordings; return the exit status. Raises: RecordingError, NodeError."""
    ros_arguments = [word for word in sys.argv[1:] if REMAPPING.match(word)]
    options = parse_options([word for word in sys.argv[1:] if not REMAPPING.match(word)])
    declare_topics(read_fleet_file().topics)
    if options.repair:
        return 0 if repair_all(options.repair) else 1
    check_master()
    Recording(options, ros_arguments).run()
    return 0
