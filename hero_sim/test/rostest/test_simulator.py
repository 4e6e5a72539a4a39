#!/usr/bin/env python3
"""The simulator as a node behind the driver: it drives, its ground truth is published, and each fault shows at the
driver."""

import json
import math
import signal
import subprocess
import sys
import threading
import time
import unittest
from pathlib import Path

import rospy
import rostest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from std_msgs.msg import ColorRGBA
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from hero_msgs.msg import Robot, RobotArray
from hero_msgs.srv import SetOdom
from hero_sim.srv import InjectFault
from hero_test.waiting import wait_for

LIMIT_S = 60.0


class Newest:
    """The newest message of a topic, and how many there were."""

    def __init__(self, topic, message_type):
        self.message = None
        self.count = 0
        self._lock = threading.Lock()
        self._subscriber = rospy.Subscriber(topic, message_type, self._take, queue_size=50)

    def _take(self, message):
        with self._lock:
            self.message = message
            self.count += 1

    def wait(self, condition=lambda message: True, what="message"):
        wait_for(lambda: self.message is not None and condition(self.message), what)
        return self.message

    def wait_for_more(self, count=5):
        wait_for(lambda seen=self.count: self.count >= seen + count, "%d messages more" % count)


class SimulatorTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("test_simulator")
        cls.fleet = Newest("/hero_driver/robots", RobotArray)
        rospy.wait_for_service("/hero_sim/fault", timeout=LIMIT_S)
        cls.call_fault = staticmethod(rospy.ServiceProxy("/hero_sim/fault", InjectFault))
        wait_for(lambda: all(cls.is_ready(number) for number in range(8)), "eight ready robots")

    @classmethod
    def find(cls, number):
        """Return the driver's entry of a robot that is let in, None if there is none."""
        if cls.fleet.message is None:
            return None
        found = [robot for robot in cls.fleet.message.robots if robot.id == number and robot.state != Robot.REFUSED]
        return found[0] if found else None

    @classmethod
    def is_ready(cls, number):
        robot = cls.find(number)
        return robot is not None and robot.state == Robot.READY

    def inject(self, fault):
        answer = self.call_fault(fault)
        self.assertTrue(answer.success, answer.message)

    def test_ground_truth_and_odometry_agree_about_a_distance(self):
        truth, odom = Newest("/hero_5/ground_truth", Odometry), Newest("/hero_5/odom", Odometry)
        start = truth.wait().pose.pose.position
        before = odom.wait().pose.pose.position
        publisher = rospy.Publisher("/hero_5/velocity_controller/cmd_vel", Twist, queue_size=1)
        twist = Twist()
        twist.linear.x = 0.1

        def driven():
            publisher.publish(twist)
            here = truth.message.pose.pose.position
            return math.hypot(here.x - start.x, here.y - start.y) > 0.1

        wait_for(driven, "distance of 0.1 m")
        publisher.publish(Twist())
        wait_for(lambda: abs(truth.message.twist.twist.linear.x) < 1e-3, "stop")
        stopped = truth.message.header.stamp
        wait_for(lambda: odom.message.header.stamp > stopped, "odometry measured after the stop")
        here, believed = truth.message.pose.pose.position, odom.message.pose.pose.position
        true_m = math.hypot(here.x - start.x, here.y - start.y)
        self.assertAlmostEqual(math.hypot(believed.x - before.x, believed.y - before.y), true_m, delta=0.003)
        self.assertEqual(truth.message.header.frame_id, "world")

    def test_robots_from_elsewhere_and_simulated_ones_share_a_driver(self):
        """A robot that is none of ours stands for a real one: another program, which knows no simulator."""
        program = Path(__file__).resolve().parents[3] / "test" / "bench" / "emulated_swarm.py"
        command = [sys.executable, program, "--port", "21081", "--first-id", "100", "--count", "1"]
        other = subprocess.Popen([*command, "--seconds", "60"], stdout=subprocess.PIPE)
        try:
            odoms = [Newest("/hero_%d/odom" % number, Odometry) for number in (100, 0)]
            for odom in odoms:
                odom.wait()
            wait_for(lambda: self.is_ready(0) and self.is_ready(100), "two ready robots")
            self.assertNotEqual(self.find(0).address.split(":")[0], self.find(100).address.split(":")[0])
            truth = Newest("/hero_0/ground_truth", Odometry)
            start = truth.wait().pose.pose.position
            drives = [
                rospy.Publisher("/hero_%d/velocity_controller/cmd_vel" % number, Twist, queue_size=1)
                for number in (100, 0)
            ]
            twist = Twist()
            twist.linear.x = 0.1

            def driven():
                # The emulated robot notes what it takes for the time of sending.
                twist.linear.y = time.time()
                for drive in drives:
                    drive.publish(twist)
                here = truth.message.pose.pose.position
                return math.hypot(here.x - start.x, here.y - start.y) > 0.03

            wait_for(driven, "motion of the simulated robot")
            drives[1].publish(Twist())
        finally:
            other.send_signal(signal.SIGINT)
            said, _ = other.communicate(timeout=LIMIT_S)
        self.assertGreater(len(json.loads(said.decode())["commands_s"]), 0)
        self.assertTrue(self.is_ready(0))

    def test_odom_frames_lie_in_the_world_and_follow_set_odom(self):
        frames = Newest("/tf_static", TFMessage)

        def find(child):
            for transform in frames.message.transforms if frames.message else ():
                if transform.header.frame_id == "world" and transform.child_frame_id == child:
                    return transform.transform.translation
            return None

        truth = Newest("/hero_4/ground_truth", Odometry).wait().pose.pose
        wait_for(lambda: find("hero_4/odom"), "frame of hero_4")
        self.assertAlmostEqual(find("hero_4/odom").x, truth.position.x, delta=0.01)
        rospy.ServiceProxy("/hero_4/set_odom", SetOdom)(0.0, 0.0, 0.0)
        answer = rospy.ServiceProxy("/hero_4/set_odom", SetOdom)(1.0, 0.0, 0.0)
        self.assertTrue(answer.success)
        heading_rad = 2.0 * math.atan2(truth.orientation.z, truth.orientation.w)
        expected_m = truth.position.x - math.cos(heading_rad)
        wait_for(lambda: abs(find("hero_4/odom").x - expected_m) < 0.01, "moved frame of hero_4")

    def test_markers_show_the_light(self):
        markers = Newest("/hero_sim/markers", MarkerArray)
        publisher = rospy.Publisher("/hero_3/led", ColorRGBA, queue_size=1)

        def is_green(message):
            publisher.publish(ColorRGBA(0.0, 1.0, 0.0, 1.0))
            body = next(marker for marker in message.markers if (marker.ns, marker.id) == ("robots", 3))
            return (body.color.r, body.color.g, body.color.b) == (0.0, 1.0, 0.0)

        markers.wait(is_green, "green robot")
        Newest("/hero_sim/arena", MarkerArray).wait(lambda message: len(message.markers) == 4, "four walls")

    def test_a_wrong_fault_is_refused_in_words(self):
        answer = self.call_fault("explode:robot=1")
        self.assertFalse(answer.success)
        self.assertIn("explode", answer.message)

    def test_a_robot_that_reboots_is_back(self):
        odom = Newest("/hero_0/odom", Odometry)
        odom.wait()
        reconnects = self.find(0).reconnects
        self.inject("reboot:robot=0")
        wait_for(lambda: self.is_ready(0) and self.find(0).reconnects > reconnects, "return of hero_0")
        odom.wait_for_more()

    def test_a_robot_without_power_is_missed_and_welcome_again(self):
        odom = Newest("/hero_1/odom", Odometry)
        odom.wait()
        self.inject("vanish:robot=1,for=20")
        wait_for(lambda: self.find(1) is None or self.find(1).state == Robot.AWAY, "absence of hero_1")
        wait_for(lambda: self.is_ready(1), "return of hero_1")
        odom.wait_for_more()

    def test_a_handshake_without_topics_is_repaired(self):
        odom = Newest("/hero_3/odom", Odometry)
        odom.wait()
        reconnects = self.find(3).reconnects
        self.inject("zero-topics:robot=3")
        wait_for(lambda: self.is_ready(3) and self.find(3).reconnects > reconnects, "return of hero_3")
        odom.wait_for_more()

    def test_wrong_bytes_are_counted_and_harm_no_robot(self):
        odoms = [Newest("/hero_%d/odom" % number, Odometry) for number in (2, 4)]
        for odom in odoms:
            odom.wait()
        before = self.find(4).bad_packets
        for _ in range(3):
            self.inject("garbage:robot=4")
        wait_for(lambda: self.find(4) and self.find(4).bad_packets >= before + 3, "bad packets of hero_4")
        for odom in odoms:
            odom.wait_for_more()

    def test_a_clock_that_jumps_never_shows_in_stamps(self):
        odom = Newest("/hero_4/odom", Odometry)
        odom.wait()
        self.inject("clock-jump:robot=4,by=100")
        odom.wait_for_more(10)
        self.assertLess(abs((rospy.Time.now() - odom.message.header.stamp).to_sec()), 50.0)

    def test_a_robot_that_takes_anothers_id_is_refused_and_the_other_stays(self):
        odom = Newest("/hero_5/odom", Odometry)
        odom.wait()
        self.inject("duplicate:robot=6,of=5")

        def is_refused():
            return [robot for robot in self.fleet.message.robots if robot.state == Robot.REFUSED]

        wait_for(is_refused, "refused newcomer")
        self.assertTrue(self.is_ready(5))
        odom.wait_for_more()

    def test_a_service_that_does_not_answer_ends_in_an_error(self):
        self.inject("slow-service:robot=7,by=30")
        with self.assertRaises(rospy.ServiceException):
            rospy.ServiceProxy("/hero_7/set_odom", SetOdom)(0.0, 0.0, 0.0)

    def test_a_stalled_radio_delivers_everything_afterwards(self):
        odom = Newest("/hero_2/odom", Odometry)
        odom.wait()
        self.inject("stall:robot=2,for=4")
        wait_for(lambda: (rospy.Time.now() - odom.message.header.stamp).to_sec() > 1.0, "silence of hero_2")
        odom.wait_for_more(40)
        self.assertTrue(self.is_ready(2))


if __name__ == "__main__":
    rostest.rosrun("hero_sim", "simulator", SimulatorTest)
