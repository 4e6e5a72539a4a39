#!/usr/bin/env python3
"""The wiring of the calibration: topics, services, files, questions, signals. How well it measures: test/unit.

Robot 0 faces a wall, 1 has room, 2 and 3 are too close to each other, 4 vanishes.
"""

import json
import os
import pty
import shutil
import signal
import subprocess
import tempfile
import unittest
from pathlib import Path

import rospy
import rostest
import yaml
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from hero_calibration.errors import CalibrationError
from hero_calibration.models.infrared_model import FRONT
from hero_calibration.robots.ros_probe import RosProbe
from hero_sim.srv import InjectFault
from hero_test.processes import Program, find_program
from hero_test.waiting import wait_for

CALIBRATE = find_program("hero_calibration", "calibrate")
ARENA = str(Path(__file__).resolve().with_name("calibration_arena.yaml"))
CENTERS_US = [1511, 1489]
GAINS = [700.0, 5000.0, 0.5, 800.0, 6000.0, 0.25]
COUNTS_M2 = [0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0, 1.125]


def keep(folder, robot_id, **content):
    """Write the file of a robot; return its path."""
    path = "%s/hero_%d.yaml" % (folder, robot_id)
    with open(path, "w", encoding="utf-8") as file:
        yaml.safe_dump({"robot": "hero_%d" % robot_id, **content}, file)
    return path


class CalibrateTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        cls.simulator = Program(
            find_program("hero_sim", "hero_sim"),
            *("--count", "5", "--port", "21298", "--arena", ARENA, "--flash-dir", cls.folder + "/flash", "--quiet"),
            *("--motors", "factory", "--ir", "factory", "--servo-timing", "drawn"),
            *("--seed", os.environ.get("HERO_SEED", "0")),
        )
        cls.wheel_m_s = dict.fromkeys(range(5), 0.0)
        for robot_id in cls.wheel_m_s:
            rospy.Subscriber("/hero_%d/ground_truth" % robot_id, Odometry, cls.receive_motion, robot_id)
        cls.probes = [RosProbe(robot_id, "hero") for robot_id in range(5)]
        cls.start_to_restore()
        for probe in cls.probes:
            wait_for(lambda probe=probe: probe.find_silence(rospy.get_time()) is None, "all topics of " + probe.name)
        rospy.ServiceProxy("/hero_sim/fault", InjectFault)("vanish:robot=4")

    @classmethod
    def start_to_restore(cls):
        """Robot 42 is waited for 10 s: meanwhile the other tests run."""
        folder = tempfile.mkdtemp(dir=cls.folder)
        for robot_id in (2, 42):
            keep(folder, robot_id, motor_centers_us=CENTERS_US, velocity_gains=GAINS, infrared_counts_m2=COUNTS_M2)
        cls.restoring = Program(CALIBRATE, "restore", "--folder", folder)

    @classmethod
    def tearDownClass(cls):
        cls.restoring.close()
        cls.simulator.end()
        shutil.rmtree(cls.folder)

    @classmethod
    def receive_motion(cls, message, robot_id):
        twist = message.twist.twist
        cls.wheel_m_s[robot_id] = abs(twist.linear.x) + 0.0315 * abs(twist.angular.z)

    def setUp(self):
        self.files = tempfile.mkdtemp(dir=self.folder)

    def start(self, *arguments, stdin=subprocess.DEVNULL):
        program = Program(CALIBRATE, "--folder", self.files, *arguments, stdin=stdin)
        self.addCleanup(program.close)
        return program

    def finish(self, program, expected_code):
        """Return what a program prints until its end."""
        code = program.wait_end()
        self.assertEqual(code, expected_code, program.text())
        self.assertNotIn("Traceback", program.text())
        return program.text()

    def read_flash(self, robot_id):
        with open("%s/flash/hero_%d.json" % (self.folder, robot_id), encoding="utf-8") as file:
            return json.load(file)

    def wait_for_rest(self, robot_id):
        wait_for(lambda: self.wheel_m_s[robot_id] < 1e-3, "hero_%d to stop" % robot_id)

    def turn_wheels(self, command):
        """Send a command to robot 1 and stop it as soon as both wheels turn; return by how many ticks they did."""
        probe = self.probes[1]
        before = probe.read_wheels()
        command(probe)

        def read_ticks():
            now = probe.read_wheels()
            ticks = now.left_ticks[-1] - before.left_ticks[-1], now.right_ticks[-1] - before.right_ticks[-1]
            return min(map(abs, ticks)) > 10 and ticks

        ticks = wait_for(read_ticks, "wheels to turn")
        probe.stop()
        self.wait_for_rest(1)
        return ticks

    def test_each_kind_of_command_turns_the_robot_and_its_readings_show_that(self):
        for command in (lambda probe: probe.drive(2.0), lambda probe: probe.turn(0.8)):
            yaw_rad = self.probes[1].pose.yaw_rad
            left, right = self.turn_wheels(command)
            self.assertLess(left, 0)
            self.assertGreater(right, 0)
            self.assertNotEqual(self.probes[1].pose.yaw_rad, yaw_rad)
        # The servos are mounted as mirror images.
        left, right = self.turn_wheels(lambda probe: probe.set_pulses(1400, 1400))
        self.assertGreater(left, 0)
        self.assertLess(right, 0)
        self.assertAlmostEqual(self.probes[1].read_wheels().step_s, 0.034, delta=0.01)

    def test_a_stop_goes_to_both_controllers(self):
        stops = {"velocity": [], "position": []}
        for name, received in stops.items():
            rospy.Subscriber("/hero_1/%s_controller/cmd_vel" % name, Twist, received.append)
        for publisher in (self.probes[1]._velocity, self.probes[1]._position):
            wait_for(lambda publisher=publisher: publisher.get_num_connections() == 2, "the driver and this test")
        self.probes[1].stop()
        wait_for(lambda: all(stops.values()), "two stops")
        self.assertEqual([received[0] for received in stops.values()], [Twist()] * 2)

    def test_scans_hold_counts_and_ranges_of_eight_sensors(self):
        self.probes[0].forget_scans()
        wait_for(lambda: self.probes[0].count_scans() >= 5, "scans")
        counts, ranges_m = self.probes[0].read_scans()
        self.assertEqual((int(counts.argmax()), int(ranges_m.argmin())), (FRONT, FRONT))
        self.assertAlmostEqual(counts[FRONT], 42.0, delta=8.0)
        self.assertAlmostEqual(ranges_m[FRONT], 0.147, delta=0.015)

    def test_calibrations_are_restored_and_a_robot_that_is_away_is_named(self):
        output = self.finish(self.restoring, 1)
        self.assertIn("hero_2: restored motor_centers_us, velocity_gains, infrared_counts_m2", output)
        self.assertIn("hero_42: FAILED: is not connected to the driver: is it on?; restored nothing", output)
        flash = self.read_flash(2)
        self.assertEqual(flash["motor_centers_us"], CENTERS_US)
        self.assertEqual(flash["velocity_pid"], GAINS)
        self.assertEqual(flash["ir_calibration_counts_m2"], COUNTS_M2)

    def test_robots_at_a_wrong_place_are_named_in_the_table(self):
        floor, wall = self.start("motors", "--robots", "2,3", "--yes"), self.start("infrared", "--robots", "1", "--yes")
        output = self.finish(floor, 1)
        for robot_id in (2, 3):
            reason = "hero_%d: FAILED: place: something is about [4-7] cm from it, at sensor front\n" % robot_id
            self.assertRegex(output, reason)
        output = self.finish(wall, 1)
        self.assertRegex(output, "hero_1: FAILED: place: its front sensor reads [0-4] counts; 42 are typical")

    def test_robots_stop_on_an_interrupt_and_nothing_is_saved(self):
        program = self.start("motors", "--robots", "1", "--yes")
        wait_for(lambda: self.wheel_m_s[1] > 0.02, "hero_1 to move")
        program.process.send_signal(signal.SIGINT)
        self.assertIn("ended early", self.finish(program, 130))
        self.wait_for_rest(1)
        self.assertEqual(os.listdir(self.files), [])

    def test_q_and_ctrl_c_answer_the_question(self):
        leader, follower = pty.openpty()
        self.addCleanup(os.close, leader)
        quitted, interrupted = (self.start("motors", "--robots", "1", stdin=follower) for _ in range(2))
        os.close(follower)
        for program in (quitted, interrupted):
            program.wait_for_text("20 cm of room")
        interrupted.process.send_signal(signal.SIGINT)
        self.finish(interrupted, 130)
        os.write(leader, b"q\n")
        self.finish(quitted, 130)

    def test_without_an_answer_or_with_bad_files_it_ends_with_the_reason(self):
        file = keep(self.files, 1, motor_centers_us=[1511, 9000])
        cases = [
            (self.start("motors", "--robots", "1"), "no terminal to answer"),
            (self.start("restore"), "hero_1.yaml, line 3: motor_centers_us is 9000, but"),
            (self.start("motors", "--folder", file), "hero_1.yaml: File exists"),
        ]
        for program, reason in cases:
            self.assertIn(reason, self.finish(program, 1))

    def test_silence_and_failed_writing_show_that_a_robot_has_vanished(self):
        probe = self.probes[4]
        silence = wait_for(lambda: probe.find_silence(rospy.get_time()), "silence of hero_4")
        self.assertRegex(silence, "^nothing received on /hero_4/[a-z]+: is the robot on and in reach[?]$")
        with self.assertRaisesRegex(CalibrationError, "^/hero_4/motors_parameters: "):
            probe.write("motor_centers_us", CENTERS_US)


if __name__ == "__main__":
    rospy.init_node("test_calibrate")
    rostest.rosrun("hero_calibration", "test_calibrate", CalibrateTest)
