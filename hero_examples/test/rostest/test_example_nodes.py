#!/usr/bin/env python3
"""follow, led_show, measure_delay, teleop_joy, joy_driver and go_to_goal as programs, judged by the ground truth."""

import math
import os
import re
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np
import rospy
import rostest
from sensor_msgs.msg import Joy

from hero_client import Robot
from hero_sim.robot_constants import BODY_RADIUS_M
from hero_sim.world.arena import measure_clearance
from hero_sim.world.arena_file import load_arena
from hero_test.example_program import ExampleProgram
from hero_test.light_watch import LightWatch
from hero_test.swarm_watch import SwarmWatch
from hero_test.waiting import wait_for

ROBOTS = 6
WHITE, DARK, RED = (1.0, 1.0, 1.0), (0.15, 0.15, 0.15), (1.0, 0.0, 0.0)

WRONG = {
    # program and argument: what the line must name
    ("random_walk", "_robots:=zero"): r"~robots .*'zero'.*0-3",
    ("random_walk", "_seed:=0.5"): r"~seed .*0.5.* whole number",
    ("random_walk", "_sped:=0.1"): r"sped.*linear_m_s",
    ("go_to_goal", "_goals:=1 2 3 4"): r"~goals .*'1 2 3 4'.*x y heading",
    ("go_to_goal", "_once:=true"): r"~once .* ~goals is empty",
    ("swarm_go_to", "_formation:={shape: star}"): r"formation: shape is 'star'.* circle",
    ("swarm_go_to", "_tolerance_m:=3"): r"~tolerance_m .*3.* 0.1 m",
    ("follow", "_robots:=1"): r"~robots .*1.* at least one follower",
    ("led_show", "_pattern:=disco"): r"~pattern .*'disco'.* rainbow",
    ("measure_delay", "_plot:=/nowhere/delay.png"): r"/nowhere/delay.png: No such file",
    ("teleop", "_linear_m_s:=5"): r"~linear_m_s .*5.* 0.2 m/s",
    ("teleop_joy", "_enable_button:=-1"): r"~enable_button .*-1.* 63",
}

WAITING = ("random_walk", "led_show", "measure_delay", "teleop_joy", "follow", "swarm_go_to", "go_to_goal")


class ExampleNodesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.watch = SwarmWatch(range(ROBOTS))
        cls.watch.wait_until_complete(60.0)
        cls.lights = LightWatch()
        for robot_id in range(ROBOTS):
            Robot(robot_id).wait_until_ready(timeout_s=30.0)

    def start(self, name, *arguments, environment=None):
        program = ExampleProgram(name, *arguments, environment=environment)
        self.addCleanup(program.close)
        return program

    def speed(self, robot_id):
        return self.watch.rows[robot_id][-1][4]

    def count_rows(self):
        return {robot_id: len(rows) for robot_id, rows in self.watch.rows.items()}

    def test_1_a_chain_follows_its_leader_around_a_curve_and_keeps_its_gaps(self):
        program = self.start("follow", "_robots:=0 1 2", "_gap_m:=0.15")
        program.wait_for_text("hero_0 leads")
        first = self.count_rows()
        with Robot(0) as leader:
            leader.wait_until_ready(timeout_s=10.0)
            leader.drive(0.08, 0.25, duration_s=10.0)
            wait_for(
                lambda: self.speed(1) < 0.005 and self.speed(2) < 0.005, "followers that have caught up"
            )
        for robot_id in (1, 2):
            ahead = self.watch.path(robot_id - 1)
            rows = self.watch.path(robot_id)[first[robot_id] :]
            way_m = float(np.sum(np.hypot(*np.diff(rows[:, 1:3], axis=0).T)))
            self.assertGreater(way_m, 0.5)
            at_leader = np.column_stack([np.interp(rows[:, 0], ahead[:, 0], ahead[:, column]) for column in (1, 2)])
            gaps_m = np.hypot(*(rows[:, 1:3] - at_leader).T)
            self.assertGreater(gaps_m.min(), 2.0 * BODY_RADIUS_M + 0.01)
            self.assertLess(abs(gaps_m[-1] - 0.15), 0.06)
        self.assertEqual(0, program.end())
        self.watch.wait_until_stopped(0, 1, 2)

    def test_2_a_light_runs_over_the_swarm_and_is_put_out_at_the_end(self):
        program = self.start("led_show", "_robots:=0-3", "_pattern:=chase", "_period_s:=2")
        lit = set()

        def all_were_lit_alone():
            whites = [robot_id for robot_id in range(4) if self.lights.is_lit(robot_id, WHITE)]
            if len(whites) == 1:
                lit.update(whites)
            return lit == set(range(4))

        wait_for(all_were_lit_alone, "each of four robots lit alone")
        self.assertEqual(0, program.end())
        wait_for(lambda: all(self.lights.is_lit(robot_id, DARK) for robot_id in range(4)), "darkness", 2.0)

    def test_3_delays_are_measured_printed_and_plotted(self):
        with tempfile.TemporaryDirectory() as folder:
            plot = Path(folder) / "delay.png"
            program = self.start("measure_delay", "_robots:=4 5", "_turns:=2", "_plot:=%s" % plot)
            self.assertEqual(0, program.wait_end(40.0), program.text())
            self.assertEqual(b"\x89PNG", plot.read_bytes()[:4])
        for name in ("hero_4", "hero_5"):
            motion_ms = float(re.search(name + r" command to motion: p50 ([\d.]+) ms.*\(2\)", program.text())[1])
            self.assertTrue(10.0 < motion_ms < 1000.0, motion_ms)
            self.assertIn(name + " message delay: p50", program.text())
        self.watch.wait_until_stopped(4, 5)

    def test_4_a_joystick_drives_only_while_its_button_is_held_and_it_is_alive(self):
        stick = rospy.Publisher("/joy", Joy, queue_size=1)
        program = self.start("teleop_joy", "_robots:=0 1")
        program.wait_for_text("hold button 4")
        program.wait_for_text("nothing on /joy")
        wait_for(lambda: stick.get_num_connections() == 1, "teleop_joy on /joy")

        def push(button):
            stick.publish(Joy(axes=[0.0, -0.4], buttons=[0, 0, 0, 0, button]))

        first = self.count_rows()

        def drives(button):
            push(button)
            return all(self.speed(robot_id) < -0.02 for robot_id in (0, 1))

        wait_for(lambda: drives(1), "both robots going back")
        self.watch.wait_until_stopped_despite(lambda: push(0), 0, 1)
        self.assertGreater(min(row[4] for row in self.watch.rows[0][first[0] :]), -0.12)
        wait_for(lambda: drives(1), "both robots going back again")
        wait_for(lambda: self.watch.at_rest(0, 1), "rest after the joystick fell silent", 1.8)
        stick.publish(Joy(axes=[0.0], buttons=[0]))
        self.assertEqual(1, program.wait_end())
        self.assertRegex(program.text(), r"teleop_joy: the joystick has 1 axes and 1 buttons: set ~linear_axis")
        stick.unregister()

    def test_5_joy_driver_runs_the_joystick_driver_or_says_how_to_get_it(self):
        with tempfile.TemporaryDirectory() as folder:
            environment = dict(os.environ, ROS_PACKAGE_PATH=folder, CMAKE_PREFIX_PATH=folder)
            absent = ExampleProgram("joy_driver", environment=environment)
            self.addCleanup(absent.close)
            self.assertEqual(1, absent.wait_end())
            self.assertRegex(absent.text(), r"\Ajoy_driver: no joystick driver: .*joy_driver:=false\n\Z")
            package = Path(folder) / "joy"
            package.mkdir()
            (package / "package.xml").write_text("<package><name>joy</name></package>")
            node = package / "joy_node"
            node.write_text('#!/bin/sh\necho "joy_node got $*"\n')
            node.chmod(0o755)
            present = self.start("joy_driver", "_dev:=/dev/input/js7", environment=environment)
            self.assertEqual(0, present.wait_end(), present.text())
            self.assertIn("_dev:=/dev/input/js7", present.text())

    def test_6_go_to_goal_goes_around_a_post_and_another_robot(self):
        first = self.count_rows()
        program = self.start(
            "go_to_goal", "_robots:=3", "_goals:=0.1 -0.92", "_frame:=world", "_avoid:=true", "_once:=true"
        )
        self.assertEqual(0, program.wait_end(80.0), program.text())
        self.assertIn("hero_3 is at its goal", program.text())
        rows = self.watch.path(3)[first[3] :]
        self.assertLess(math.dist(rows[-1, 1:3], (0.1, -0.92)), 0.1)
        arena = load_arena(str(Path(__file__).resolve().parents[3] / "hero_test" / "arenas" / "examples_arena.yaml"))
        self.assertGreater(measure_clearance(rows[:, 1:3], arena).min(), BODY_RADIUS_M + 0.005)
        to_other_m = np.hypot(*(rows[:, 1:3] - self.watch.pose(5)[:2]).T)
        self.assertGreater(to_other_m.min(), 2.0 * BODY_RADIUS_M + 0.005)

    def test_7_a_goal_that_cannot_be_reached_ends_with_the_reason(self):
        program = self.start("go_to_goal", "_robots:=2", "_goals:=50 0", "_timeout_s:=1", "_once:=true")
        self.assertEqual(1, program.wait_end())
        self.assertRegex(program.text(), r"hero_2 did not reach \(50, 0\): not there after 1 s, 4\d\.\d+ m are left")
        self.watch.wait_until_stopped(2)

    def test_8_a_wrong_parameter_gets_one_line_with_name_value_and_remedy(self):
        programs = {case: self.start(*case) for case in WRONG}
        for case, program in programs.items():
            self.assertEqual(1, program.wait_end(60.0), case)
            self.assertRegex(program.text(), r"\A%s: [^\n]*%s[^\n]*\n\Z" % (case[0], WRONG[case]))

    def test_9_every_program_says_what_it_waits_for_when_no_robot_answers(self):
        more = {
            "follow": ["_robots:=55 56"],
            "go_to_goal": ["_robots:=55", "_goals:=1 0"],
            "swarm_go_to": ["_robots:=55"],
        }
        programs = [self.start(name, *more.get(name, ["_robots:=55"])) for name in WAITING]
        for program in programs:
            program.wait_for_text("hero_55: waiting: n")
        for program in programs:
            self.assertIn(program.end(), (0, 1))
            self.assertNotIn("Traceback", program.text())


if __name__ == "__main__":
    rospy.init_node("test_example_nodes")
    rostest.rosrun("hero_examples", "example_nodes", ExampleNodesTest, sys.argv)
