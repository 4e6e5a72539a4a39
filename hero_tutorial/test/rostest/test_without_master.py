#!/usr/bin/env python3
"""Scripts of the courses, one with a loop and one with callbacks, while no ROS master answers."""

import os
import sys
import unittest
from pathlib import Path

import rostest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tutorial_runner import Terminal

from hero_test.processes import find_free_port, has_traceback
from hero_test.waiting import TIMEOUT_S

WARNING = "Unable to register with master node ...: master may not be running yet. Will keep trying."


class WithoutMasterTest(unittest.TestCase):
    def test_scripts_say_so_and_end_with_ctrl_c_in_silence(self):
        environment = dict(os.environ, ROS_MASTER_URI="http://127.0.0.1:%d" % find_free_port())
        for script in ("printer_node.py", "subscriber_node.py"):
            terminal = Terminal(environment)
            self.addCleanup(terminal.close)
            terminal.type_line("rosrun hero_tutorial " + script)
            self.assertTrue(terminal.wait_for_lines([WARNING], TIMEOUT_S), terminal.output)
            self.assertTrue(terminal.interrupt())
            self.assertTrue(terminal.wait_for_end(TIMEOUT_S), terminal.output)
            self.assertFalse(has_traceback(terminal.output), terminal.output)


if __name__ == "__main__":
    rostest.rosrun("hero_tutorial", "without_master", WithoutMasterTest, sys.argv)
