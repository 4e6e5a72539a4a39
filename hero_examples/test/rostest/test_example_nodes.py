#!/usr/bin/env python3
"""The examples as programs, all at once, each with robots of its own: they move them, and stop them at their end.

What they do is tested in virtual time: see test/unit.
"""

import math
import os
import re
import struct
import sys
import tempfile
import unittest
from pathlib import Path

import rospy
import rostest
from sensor_msgs.msg import Joy

from hero_client import Robot
from hero_test.processes import ExampleProgram
from hero_test.waiting import wait_for
from hero_test.watches.command_watch import CommandWatch
from hero_test.watches.light_watch import LightWatch
from hero_test.watches.swarm_watch import SwarmWatch

ROBOTS = range(12)
WHITE, DARK, GREEN = (1.0, 1.0, 1.0), (0.15, 0.15, 0.15), (0.0, 1.0, 0.0)
"""Dark is how the simulator draws a robot whose light is off."""

PLACES = {7: (-1.6, -0.5), 8: (-1.6, -0.9)}
"""Of the formation, in world."""

NEAR_M = 0.1
"""Half of the way to a goal. A robot of a starved machine overshoots; its accuracy is tried in virtual time."""


class ExampleNodesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.watch, cls.commands, cls.lights = SwarmWatch(ROBOTS), CommandWatch(ROBOTS), LightWatch()
        cls.watch.wait_until_complete(60.0)
        cls.starts = {robot_id: cls.watch.pose(robot_id) for robot_id in ROBOTS}
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.plot = Path(folder.name) / "delay.png"
        places = "{shape: points, points: [%s]}" % ", ".join("[%g, %g]" % place for place in PLACES.values())
        cls.programs = {
            name: ExampleProgram(name.partition(" ")[0], *arguments)
            for name, arguments in {
                "follow": ("_robots:=0 1 2", "_gap_m:=0.15"),
                "go_to_goal": ("_robots:=3", "_goals:=-1.8 0.8", "_frame:=world", "_avoid:=true", "_once:=true"),
                "go_to_goal in vain": ("_robots:=4", "_goals:=50 0", "_timeout_s:=1", "_once:=true"),
                "random_walk": ("_robots:=5-6", "_seed:=1"),
                "swarm_go_to": ("_robots:=7 8", "_formation:=" + places, "_assign:=false", "_once:=true"),
                "led_show": ("_robots:=9 10", "_pattern:=chase", "_period_s:=1"),
                "measure_delay": ("_robots:=9", "_turns:=1", "_plot:=%s" % cls.plot),
                "teleop_joy": ("_robots:=11",),
            }.items()
        }
        for program in cls.programs.values():
            cls.addClassCleanup(program.close)

    def distance_m(self, robot_id):
        """Return how far a robot is from its start."""
        return math.dist(self.starts[robot_id][:2], self.watch.pose(robot_id)[:2])

    def end(self, name):
        """End a program by Ctrl-C."""
        self.assertEqual(0, self.programs[name].end(), self.programs[name].text())

    def wait_until_stopped(self, *robot_ids):
        """Wait until the programs have stopped their robots, themselves, and these are at rest."""
        self.commands.wait_for_stops(*robot_ids)
        self.watch.wait_until_stopped(*robot_ids)

    def test_followers_drive_behind_their_leader_and_stop(self):
        self.programs["follow"].wait_for_text("hero_0 leads")
        with Robot(0, proximity=False) as leader:
            leader.wait_until_ready(timeout_s=60.0)

            def followers_have_moved():
                leader.drive(0.06, 0.0)
                return min(self.distance_m(1), self.distance_m(2)) > 0.05

            wait_for(followers_have_moved, "followers on their way")
        self.end("follow")
        self.wait_until_stopped(1, 2)

    def test_a_goal_is_reached_and_the_program_ends(self):
        program = self.programs["go_to_goal"]
        self.assertEqual(0, program.wait_end(), program.text())
        self.assertIn("hero_3 is at its goal", program.text())
        wait_for(lambda: math.dist(self.watch.pose(3)[:2], (-1.8, 0.8)) < NEAR_M, "hero_3 at its goal")
        self.wait_until_stopped(3)

    def test_a_goal_that_cannot_be_reached_ends_with_the_reason(self):
        program = self.programs["go_to_goal in vain"]
        self.assertEqual(1, program.wait_end(), program.text())
        # On a busy machine the second is over before its odometry has come.
        self.assertRegex(program.text(), r"hero_4 (did not reach \(50, 0\): not there|is not ready) after 1 s[,:] .+")
        self.watch.wait_until_stopped(4)

    def test_walkers_walk_until_ctrl_c_and_their_lights_go_out(self):
        wait_for(lambda: min(self.distance_m(5), self.distance_m(6)) > 0.1, "walkers on their way")
        wait_for(lambda: all(self.lights.is_lit(robot_id, GREEN) for robot_id in (5, 6)), "green lights")
        self.end("random_walk")
        self.assertIn("random walk ended, robots stopped", self.programs["random_walk"].text())
        self.wait_until_stopped(5, 6)
        wait_for(lambda: all(self.lights.is_lit(robot_id, DARK) for robot_id in (5, 6)), "darkness")

    def test_robots_form_up_and_the_program_ends(self):
        program = self.programs["swarm_go_to"]
        self.assertEqual(0, program.wait_end(), program.text())
        self.assertIn("formation complete", program.text())
        for robot_id, place in PLACES.items():
            wait_for(
                lambda robot_id=robot_id, place=place: math.dist(self.watch.pose(robot_id)[:2], place) < NEAR_M,
                "hero_%d at its place" % robot_id,
            )
        self.wait_until_stopped(*PLACES)

    def test_a_light_runs_over_the_swarm_and_is_put_out_at_the_end(self):
        lit = set()

        def all_were_lit_alone():
            whites = [robot_id for robot_id in (9, 10) if self.lights.is_lit(robot_id, WHITE)]
            if len(whites) == 1:
                lit.update(whites)
            return lit == {9, 10}

        wait_for(all_were_lit_alone, "each of two robots lit alone")
        self.end("led_show")
        wait_for(lambda: all(self.lights.is_lit(robot_id, DARK) for robot_id in (9, 10)), "darkness")

    def test_delays_are_measured_printed_and_plotted(self):
        program = self.programs["measure_delay"]
        self.assertEqual(0, program.wait_end(), program.text())
        self.assertEqual(b"\x89PNG", self.plot.read_bytes()[:4])
        self.assertGreater(float(re.search(r"hero_9 command to motion: p50 ([\d.]+) ms", program.text())[1]), 10.0)
        self.assertIn("hero_9 message delay: p50", program.text())
        self.wait_until_stopped(9)

    def test_a_joystick_drives_only_while_its_button_is_held_and_it_is_alive(self):
        stick, program = rospy.Publisher("/joy", Joy, queue_size=1), self.programs["teleop_joy"]
        program.wait_for_text("hold button 4")
        wait_for(lambda: stick.get_num_connections() == 1, "teleop_joy on /joy")

        def drives(button):
            stick.publish(Joy(axes=[0.0, -0.4], buttons=[0, 0, 0, 0, button]))
            return self.watch.rows[11][-1][4] < -0.02

        wait_for(lambda: drives(1), "the robot going back")
        self.assertAlmostEqual(-0.4 * 0.15, min(self.commands.commands[11])[0])
        wait_for(lambda: not drives(0) and self.commands.commands[11][-1] == (0.0, 0.0), "a stop after the button")
        wait_for(lambda: drives(1), "the robot going back again")
        self.wait_until_stopped(11)  # the joystick is silent now
        stick.publish(Joy(axes=[0.0], buttons=[0]))
        self.assertEqual(1, program.wait_end())
        self.assertRegex(program.text(), r"teleop_joy: the joystick has 1 axes and 1 buttons: set ~linear_axis")

    def test_joy_driver_runs_joy_node_or_reads_the_device_itself(self):
        with tempfile.TemporaryDirectory() as folder:
            environment = dict(os.environ, ROS_PACKAGE_PATH=folder, CMAKE_PREFIX_PATH=folder)
            absent = ExampleProgram("joy_driver", "_dev:=" + folder + "/js9", environment=environment)
            self.addCleanup(absent.close)
            self.assertEqual(1, absent.wait_end())
            self.assertRegex(absent.text(), r"joy_driver: no joystick .*/js9 .*: plug it in")
            device = folder + "/js0"
            os.mkfifo(device)
            kernel = os.open(device, os.O_RDWR)
            self.addCleanup(os.close, kernel)
            sticks = []
            rospy.Subscriber("joy", Joy, sticks.append)
            plugged = ExampleProgram("joy_driver", "_dev:=" + device, environment=environment)
            self.addCleanup(plugged.close)
            os.write(kernel, struct.pack("=IhBB", 1, -32767, 2, 1))
            wait_for(lambda: sticks and list(sticks[-1].axes) == [0.0, 1.0], "the stick")
            plugged.close()
            package = Path(folder) / "joy"
            package.mkdir()
            (package / "package.xml").write_text("<package><name>joy</name></package>")
            node = package / "joy_node"
            node.write_text('#!/bin/sh\necho "joy_node got $*"\n')
            node.chmod(0o755)
            present = ExampleProgram("joy_driver", "_dev:=/dev/input/js7", environment=environment)
            self.addCleanup(present.close)
            self.assertEqual(0, present.wait_end(), present.text())
            self.assertIn("_dev:=/dev/input/js7", present.text())


if __name__ == "__main__":
    rospy.init_node("test_example_nodes")
    rostest.rosrun("hero_examples", "example_nodes", ExampleNodesTest, sys.argv)
