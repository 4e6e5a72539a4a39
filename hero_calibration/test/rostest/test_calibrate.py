#!/usr/bin/env python3
"""Calibrates simulated robots with known errors by the real program: accuracy, early ends, restoring.

Robots 0 to 2 face a wall, 3 to 6 have room, 7 and 8 are too close to each other. Two programs run in parallel.
"""

import glob
import os
import pty
import shutil
import signal
import subprocess
import tempfile
import unittest
from concurrent.futures import ThreadPoolExecutor

import rospy
import rostest
import yaml
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from hero_sim.srv import InjectFault
from hero_test.waiting import wait_for

CALIBRATE = ["rosrun", "hero_calibration", "calibrate"]
TIMEOUT_S = 250.0
CENTER_BOUND_US = 4
RANGE_BOUND_M = 0.004
VELOCITY_BOUND = 0.22
"""Share of the target speed; a robot with factory settings is off by 30 % (hero_sim)."""

TRUE_CENTERS_US = {3: (1533, 1478), 4: (1510, 1490), 5: (1480, 1520)}
"""Of the left and right servo, as calibrate.test sets them."""


class Watch:
    """True speeds of robots."""

    def __init__(self, robot_ids):
        self.speeds = {robot_id: 0.0 for robot_id in robot_ids}
        for robot_id in robot_ids:
            topic = "/hero_%d/ground_truth" % robot_id
            rospy.Subscriber(topic, Odometry, self.receive, robot_id, queue_size=5)

    def receive(self, message, robot_id):
        twist = message.twist.twist
        self.speeds[robot_id] = abs(twist.linear.x) + 0.0315 * abs(twist.angular.z)


class CalibrateTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)

    def start(self, *arguments, **options):
        process = subprocess.Popen(
            [*CALIBRATE, "--folder", self.folder, *arguments],
            stdin=options.pop("stdin", subprocess.DEVNULL),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            **options,
        )
        self.addCleanup(process.stdout.close)
        self.addCleanup(lambda: process.poll() is None and os.killpg(process.pid, signal.SIGKILL))
        return process

    def finish(self, process):
        output = process.communicate(timeout=TIMEOUT_S)[0].decode()
        self.assertNotIn("Traceback", output)
        return process.returncode, output

    def run_program(self, *arguments):
        return self.finish(self.start(*arguments))

    def load(self, robot_id):
        with open("%s/hero_%d.yaml" % (self.folder, robot_id), encoding="utf-8") as file:
            return yaml.safe_load(file)

    def test_1_errors_are_below_their_bounds_though_one_robot_vanishes(self):
        open_floor = self.start("motors", "velocity", "--robots", "3-8", "--yes")
        wall = self.start("infrared", "--robots", "0-2,42", "--yes")
        watch = Watch(range(9))
        wait_for(lambda: watch.speeds[6] > 0.02, "motion of hero_6", TIMEOUT_S)
        rospy.ServiceProxy("/hero_sim/fault", InjectFault)("vanish:robot=6")
        with ThreadPoolExecutor() as pool:
            outputs = list(pool.map(self.finish, (open_floor, wall)))
        self.check_floor(*outputs[0])
        self.check_wall(*outputs[1])
        wait_for(lambda: max(watch.speeds.values()) < 1e-3, "standstill", TIMEOUT_S)

    def check_floor(self, code, output):
        self.assertEqual(code, 1, output)
        for robot_id in (3, 4, 5):
            self.assertIn("hero_%d: ok" % robot_id, output)
            kept = self.load(robot_id)
            for found_us, true_us in zip(kept["motor_centers_us"], TRUE_CENTERS_US[robot_id]):
                self.assertLessEqual(abs(found_us - true_us), CENTER_BOUND_US, output)
            before, after = kept["velocity_errors"]
            self.assertLess(after, VELOCITY_BOUND, output)
            self.assertLess(after, 0.9 * before, output)
            picture = "%s/hero_%d.png" % (self.folder, robot_id)
            with open(picture, "rb") as file:
                self.assertEqual(file.read(4), b"\x89PNG")
        self.assertIn("hero_6: FAILED: motors", output)
        for robot_id in (7, 8):
            reason = r"hero_%d: FAILED: place: something is about [4-7] cm from it, at sensor front\n"
            self.assertRegex(output, reason % robot_id)
            self.assertFalse(os.path.exists("%s/hero_%d.yaml" % (self.folder, robot_id)))

    def check_wall(self, code, output):
        self.assertEqual(code, 1, output)
        self.assertIn("hero_42: FAILED: is not connected", output)
        for robot_id in range(3):
            self.assertIn("hero_%d: ok" % robot_id, output)
            kept = self.load(robot_id)
            self.assertLess(max(map(abs, kept["range_errors_after_m"])), RANGE_BOUND_M, output)
            self.assertGreater(max(map(abs, kept["range_errors_before_m"])), RANGE_BOUND_M, output)
        # The robot itself measures the distance of the wall, whichever sensor faces it now.
        scan = rospy.wait_for_message("/hero_0/proximity", LaserScan, timeout=TIMEOUT_S)
        self.assertAlmostEqual(min(scan.ranges), 0.1368, delta=0.008)

    def test_5_calibrations_are_restored_and_a_silent_robot_is_reported(self):
        path = self.folder + "/hero_3.yaml"
        content = {
            "robot": "hero_3",
            "motor_centers_us": [1511, 1489],
            "velocity_gains": [700.0, 5000.0, 0.1] * 2,
        }
        with open(path, "w", encoding="utf-8") as file:
            yaml.safe_dump(content, file)
        code, output = self.run_program("restore")
        self.assertEqual(code, 0, output)
        self.assertIn("hero_3: restored motor_centers_us, velocity_gains", output)
        rospy.ServiceProxy("/hero_sim/fault", InjectFault)("slow-service:robot=4,by=60")
        with open(self.folder + "/hero_4.yaml", "w", encoding="utf-8") as file:
            yaml.safe_dump({**content, "robot": "hero_4"}, file)
        code, output = self.run_program("restore")
        self.assertEqual(code, 1, output)
        self.assertIn("hero_3: restored motor_centers_us, velocity_gains", output)
        self.assertRegex(output, r"hero_4: FAILED: restore: /hero_4/motors_parameters: .*not answered")

    def test_2_results_before_an_early_end_replace_a_damaged_file(self):
        path = self.folder + "/hero_5.yaml"
        with open(path, "w", encoding="utf-8") as file:
            file.write("robot: hero_5\nvelocity_gains: 2026-13-45\n")
        process = self.start("motors", "infrared", "--robots", "5", stdin=subprocess.PIPE)
        # The first question is answered, the second is not.
        process.stdin.write(b"\n")
        process.stdin.close()
        process.stdin = None
        code, output = self.finish(process)
        self.assertEqual(code, 1, output)
        self.assertIn("nobody is there to answer", output)
        for found_us, true_us in zip(self.load(5)["motor_centers_us"], TRUE_CENTERS_US[5]):
            self.assertLessEqual(abs(found_us - true_us), CENTER_BOUND_US, output)
        with open(self.folder + "/hero_5.previous.yaml", encoding="utf-8") as file:
            self.assertIn("2026-13-45", file.read())

    def test_3_robots_stop_on_an_interrupt(self):
        watch = Watch([3, 4])
        process = self.start("motors", "--robots", "3,4", "--yes")
        wait_for(lambda: min(watch.speeds.values()) > 0.03, "motion", TIMEOUT_S)
        os.killpg(process.pid, signal.SIGINT)
        code, output = self.finish(process)
        self.assertEqual(code, 130, output)
        self.assertIn("ended early", output)
        wait_for(lambda: max(watch.speeds.values()) < 1e-3, "standstill", TIMEOUT_S)
        self.assertEqual(glob.glob(self.folder + "/*"), [])

    def test_4_q_and_ctrl_c_answer_the_question_before_anything_moves(self):
        watch = Watch([3])
        for answer in (b"q\n", signal.SIGINT):
            leader, follower = pty.openpty()
            process = self.start("motors", "--robots", "3", stdin=follower)
            os.close(follower)
            output = b""
            while b"q to end" not in output:
                output += os.read(process.stdout.fileno(), 1000)
            self.assertIn(b"20 cm of room", output)
            if answer is signal.SIGINT:
                os.killpg(process.pid, answer)
            else:
                os.write(leader, answer)
            code, rest = self.finish(process)
            os.close(leader)
            self.assertEqual(code, 130, rest)
        self.assertEqual(watch.speeds[3], 0.0)


if __name__ == "__main__":
    rospy.init_node("test_calibrate")
    rostest.rosrun("hero_calibration", "test_calibrate", CalibrateTest)
