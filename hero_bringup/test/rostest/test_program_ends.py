#!/usr/bin/env python3
"""How programs end where nothing works: one line and the right exit status, whatever their environment and output."""

import os
import signal
import subprocess
import tempfile
import unittest
from pathlib import Path

import rostest

from hero_test.nonempty import nonempty
from hero_test.processes import find_program

TIMEOUT_S = 600.0
BAD_URI = "localhost"  # others: test_master.py of hero_node, test_sim_master_watch.py
NODES = (["record"], ["calibrate", "--yes", "motors"], ["fleet", "--once"], ["hero_sim"])
PRINTING = (["fleet", "--help"], ["export", "--help"], ["hero_sim", "--print-errors"])
"""With ROS, without, and what is no help; all programs end by the same lines of hero_node."""

PACKAGES = {
    "calibrate": "hero_calibration",
    "export": "hero_recording",
    "fleet": "hero_tools",
    "hero_sim": "hero_sim",
    "record": "hero_recording",
}


def start(command, stdout=subprocess.PIPE, **environment):
    """Return the process of a program of the suite."""
    return subprocess.Popen(
        [find_program(PACKAGES[command[0]], command[0]), *command[1:]],
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=subprocess.PIPE,
        env={**os.environ, **environment},
        text=True,
    )


class ProgramEndsTest(unittest.TestCase):
    def end(self, process):
        """Return exit status and lines on stderr."""
        _, errors = process.communicate(timeout=TIMEOUT_S)
        return process.returncode, errors.splitlines()

    def test_ctrl_c_while_modules_load_prints_nothing(self):
        with tempfile.TemporaryDirectory() as folder:
            for module in "rospy", "numpy":
                slow = "import time; print('loading', flush=True); time.sleep(%g)\n" % TIMEOUT_S
                Path(folder, module + ".py").write_text(slow)
            environment = {**os.environ, "PYTHONPATH": "%s:%s" % (folder, os.environ["PYTHONPATH"])}
            for package, program in (("hero_driver", "hero_driver"), ("hero_tools", "fleet"), ("hero_sim", "hero_sim")):
                with subprocess.Popen(
                    [find_program(package, program)],
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    env=environment,
                    text=True,
                ) as process:
                    self.assertEqual(process.stdout.readline(), "loading\n", program)
                    process.send_signal(signal.SIGINT)
                    self.assertEqual(self.end(process), (-signal.SIGINT, []), program)

    def test_a_master_uri_that_is_none_is_named_in_one_line(self):
        for node, process in [(node, start(node, ROS_MASTER_URI=BAD_URI)) for node in NODES]:
            status, lines = self.end(process)
            self.assertEqual((status, len(lines)), (1, 1), (node, lines))
            self.assertTrue(lines[0].startswith(node[0] + ": "), lines)
            self.assertIn(repr(BAD_URI), lines[0])

    def test_a_negative_number_of_simulated_robots_is_refused_by_the_simulator(self):
        for count, expected in (("-1", True), ("0", False)):
            command = ["roslaunch", "--nodes", "hero_bringup", "hero_bringup.launch", "count:=" + count]
            result = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, timeout=TIMEOUT_S)
            self.assertEqual("/hero_sim" in result.stdout.split(), expected, result.stdout)
        status, lines = self.end(start(["hero_sim", "--count", "-1"]))
        self.assertEqual((status, lines), (2, ["hero_sim: --count -1: must be 1..1000"]))

    def test_a_log_directory_that_is_a_file_is_named_in_one_line(self):
        started = [(node, start(node, ROS_LOG_DIR=__file__)) for node in NODES if node[0] != "record"]
        for node, process in nonempty(started):
            status, lines = self.end(process)
            self.assertEqual((status, len(lines)), (1, 1), (node, lines))
            self.assertIn(__file__, lines[0])
            self.assertIn("ROS_LOG_DIR", lines[0])

    def test_a_pipe_without_a_reader_ends_a_program_silently(self):
        """One stands for all: test_command_line.py of hero_node tests this and a full disk for what they share."""
        read_end, write_end = os.pipe()
        os.close(read_end)
        with os.fdopen(write_end, "wb") as pipe:
            self.assertEqual(self.end(start(PRINTING[0], pipe)), (141, []))

    def test_an_output_that_is_full_is_told_in_one_line(self):
        with open("/dev/full", "wb") as full:
            started = [(command, start(command, full)) for command in PRINTING]
        for command, process in started:
            line = command[0] + ": the output cannot be written: No space left on device"
            self.assertEqual(self.end(process), (1, [line]), command)


if __name__ == "__main__":
    rostest.rosrun("hero_bringup", "test_program_ends", ProgramEndsTest)
