#!/usr/bin/env python3
"""An experiment on robots: trials that count, a trial that is stopped, and the operator's answers."""

import csv
import glob
import os
import shutil
import subprocess
import tempfile
import unittest

import rosbag
import rospy
import rostest

from hero_client import Drivers
from hero_test.processes import Program, find_program, has_traceback
from hero_test.waiting import wait_for
from hero_test.watches.fleet_report import wait_until_ready
from hero_test.watches.swarm_watch import SwarmWatch

IDS = range(5, 8)
EXPERIMENT = """\
behavior: rendezvous
robots: 3
time_s: %g
seeds: {count: %d}
start: {kind: file, file: %s}
metrics: [consensus_error]
"""
TRIAL_S = 2.0
ENDLESS_S = 3600.0
MOVED_M = 0.01


class RobotRunsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("test_robot_runs")
        wait_until_ready(*IDS)
        cls.watch = SwarmWatch(IDS)
        cls.watch.wait_until_complete()

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)

    def start(self, time_s, trials):
        """Start an experiment of so many trials, whose start places are where the robots are now."""
        places = [self.watch.pose(robot_id) for robot_id in IDS]
        starts = os.path.join(self.folder, "starts.csv")
        with open(starts, "w") as file:
            csv.writer(file).writerows(places)
        path = os.path.join(self.folder, "e.yaml")
        with open(path, "w") as file:
            file.write(EXPERIMENT % (time_s, trials, starts))
        command = (find_program("hero_swarm", "run"), path, "--robots", "5-7", "--frame", "world")
        program = Program(*command, stdin=subprocess.PIPE)
        self.addCleanup(program.close)
        self.addCleanup(program.process.stdin.close)
        return program

    def answer(self, program, text):
        program.process.stdin.write(text + "\n")
        program.process.stdin.flush()

    def finish(self, program):
        """Wait for the end; return what it printed and the rows of the table of runs, by seed."""
        self.assertEqual(program.wait_end(), 0, program.text())
        self.assertFalse(has_traceback(program.text()), program.text())
        with open(os.path.join(self.folder, "e", "runs.csv")) as file:
            return program.text(), {int(row["seed"]): row for row in csv.DictReader(file)}

    def test_a_trial_that_ends_by_itself_counts_and_is_recorded(self):
        program = self.start(TRIAL_S, 1)
        self.answer(program, "x\nd\n")  # a stray key, then drive there again
        text, rows = self.finish(program)
        self.assertIn("seed 1: done", text)
        self.assertIn("1 of 1 missing trials done", text)
        self.assertEqual(text.count("seed 1: driving to the start"), 2, text)
        self.assertEqual((rows[1]["kind"], rows[1]["remark"]), ("real", ""))
        self.assertGreater(float(rows[1]["consensus_error"]), 0.0)
        (name,) = glob.glob(os.path.join(self.folder, "e", "bags", "*.bag"))
        with rosbag.Bag(name) as bag:
            self.assertLess({"/hero_%d/odom" % robot for robot in IDS}, set(bag.get_type_and_topic_info()[1]))
        self.assertTrue(self.watch.at_rest(*IDS))

    def test_a_stopped_trial_does_not_count_and_none_starts_before_release(self):
        drivers = Drivers()
        self.addCleanup(drivers.close)
        self.addCleanup(drivers.request_stop, False)
        program = self.start(ENDLESS_S, 2)
        self.answer(program, "")
        before = {robot: self.watch.pose(robot) for robot in IDS}
        wait_for(lambda: self.has_moved(before), "a robot that moves")
        drivers.request_stop(True)
        program.wait_line("seed 1: does not count: stopped at")
        self.watch.wait_until_stopped(*IDS)
        self.answer(program, "")
        program.wait_line("seed 2: cannot start: ")
        drivers.request_stop(False)
        self.answer(program, "q")
        text, rows = self.finish(program)
        self.assertIn("0 of 2 missing trials done; start it again for the others", text)
        self.assertEqual(list(rows), [1])
        self.assertRegex(rows[1]["remark"], "^stopped at ")

    def has_moved(self, before):
        poses = [(self.watch.pose(robot), before[robot]) for robot in IDS]
        return any(abs(now[0] - then[0]) + abs(now[1] - then[1]) > MOVED_M for now, then in poses)


if __name__ == "__main__":
    rostest.rosrun("hero_swarm", "test_robot_runs", RobotRunsTest)
