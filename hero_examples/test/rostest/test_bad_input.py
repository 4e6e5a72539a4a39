#!/usr/bin/env python3
"""Every example names a wrong parameter in one line, and says what it waits for while no robot answers."""

import sys
import unittest

import rospy
import rostest

from hero_test.processes import ExampleProgram

WRONG = {
    # program and argument: what the line must name
    ("random_walk", "_robots:=zero"): r"~robots .*'zero'.*0-3",
    ("random_walk", "_sped:=0.1"): r"sped.*linear_m_s",
    ("random_walk", "_robots:=::"): r"private parameter .* has no value for YAML: quote it",
    ("go_to_goal", "_goals:=1 2 3 4"): r"~goals .*'1 2 3 4'.*x y heading",
    ("go_to_goal", "_once:=true"): r"~once .* ~goals is empty",
    ("swarm_go_to", "_tolerance_m:=3"): r"~tolerance_m .*3.* 0.1 m",
    ("follow", "_robots:=1"): r"~robots .*1.* at least one follower",
    ("measure_delay", "_plot:=/nowhere/delay.png"): r"/nowhere/delay.png: No such file",
}

WAITING = {
    # program: its arguments
    "random_walk": ["_robots:=55"],
    "led_show": ["_robots:=55"],
    "measure_delay": ["_robots:=55"],
    "teleop_joy": ["_robots:=55"],
    "follow": ["_robots:=55 56"],
    "swarm_go_to": ["_robots:=55"],
    "go_to_goal": ["_robots:=55", "_goals:=1 0"],
}


class BadInputTest(unittest.TestCase):
    def start(self, name, *arguments):
        program = ExampleProgram(name, *arguments)
        self.addCleanup(program.close)
        return program

    def test_a_wrong_parameter_gets_one_line_with_name_value_and_remedy(self):
        programs = {case: self.start(*case) for case in WRONG}
        for case, program in programs.items():
            self.assertEqual(1, program.wait_end(), case)
            self.assertRegex(program.text(), r"\A%s: [^\n]*%s[^\n]*\n\Z" % (case[0], WRONG[case]))

    def test_every_program_says_what_it_waits_for_when_no_robot_answers(self):
        programs = [self.start(name, *arguments) for name, arguments in WAITING.items()]
        for program in programs:
            program.wait_for_text("hero_55: waiting: n")
        for program in programs:
            self.assertIn(program.end(), (0, 1))
            self.assertNotIn("Traceback", program.text())


if __name__ == "__main__":
    rospy.init_node("test_bad_input")
    rostest.rosrun("hero_examples", "bad_input", BadInputTest, sys.argv)
