#!/usr/bin/env python3
"""Launch files that are started twice: the second one ends with a clear line, and the first one's robots drive on."""

import unittest

import rosgraph
import rospy
import rostest
from geometry_msgs.msg import Twist

from hero_msgs.msg import Robot, RobotArray
from hero_test.processes import Program, find_free_port, find_pid, has_traceback
from hero_test.waiting import wait_for
from hero_test.watches.swarm_watch import SwarmWatch

IDS = [0, 1]
DRIVER_REFUSED = "a driver already runs as /hero_driver: end it, or start this one with another name:= and port:="
SIMULATOR_REFUSED = "simulated robots already run as /hero_sim: end them"


def make_launch(port, *arguments):
    """Return a command that starts a fleet."""
    return ("roslaunch", "hero_bringup", "hero_bringup.launch", "port:=%d" % port, *arguments)


class SecondLaunchTest(unittest.TestCase):
    """A first fleet of two robots, which goes on through all tests."""

    @classmethod
    def setUpClass(cls):
        cls.port = find_free_port()
        cls.first = Program(*make_launch(cls.port, "count:=2"))
        cls.addClassCleanup(cls.first.end)
        for number in IDS:
            cls.first.wait_for_text("hero_%d arrived" % number)
        cls.pids = find_pid("/hero_driver"), find_pid("/hero_sim")

    def setUp(self):
        self.reports = {}
        self.watch_driver("/hero_driver")

    def tearDown(self):
        """The first fleet has lost nothing."""
        self.reports.clear()
        self.wait_ready("/hero_driver", *IDS)
        self.assertEqual((find_pid("/hero_driver"), find_pid("/hero_sim")), self.pids)
        self.assertIsNone(self.first.process.poll())

    def start(self, *command, environment=None):
        """Start a program, which ends after the test."""
        program = Program(*command, environment=environment)
        self.addCleanup(program.end)
        return program

    def launch_fleet(self, *arguments, port=None, **options):
        return self.start(*make_launch(port or self.port, *arguments), **options)

    def watch_driver(self, name):
        """Keep the newest report of a driver."""

        def receive(report):
            self.reports[name] = report

        subscriber = rospy.Subscriber(name + "/robots", RobotArray, receive)
        self.addCleanup(subscriber.unregister)

    def find_reconnects(self, name):
        """Return how often each robot that is ready came back to its driver."""
        report = self.reports.get(name, RobotArray())
        return {robot.id: robot.reconnects for robot in report.robots if robot.state == Robot.READY}

    def wait_ready(self, name, *ids):
        """Wait until exactly these robots are ready, and none was ever lost."""
        wait_for(
            lambda: self.find_reconnects(name) == dict.fromkeys(ids, 0),
            lambda: "robots %s of %s, last: %s" % (ids, name, self.reports.get(name)),
        )

    def assert_fleet_refused(self, program):
        program.wait_end()
        self.assertEqual(len(program.find_lines(DRIVER_REFUSED)), 1, program.lines)
        # The driver's end ends the launch, perhaps before the simulator says why it cannot start.
        self.assertLessEqual(len(program.find_lines(SIMULATOR_REFUSED)), 1, program.lines)
        self.assertFalse(has_traceback(program.text()), program.lines)

    def test_a_fleet_drives_on_when_its_launch_file_is_started_again(self):
        publishers = [rospy.Publisher("/hero_%d/cmd_vel" % number, Twist, queue_size=1) for number in IDS]
        command = Twist()
        command.linear.x = 0.05
        self.assert_fleet_refused(self.launch_fleet("count:=2"))
        self.reports.clear()
        self.wait_ready("/hero_driver", *IDS)
        watch = SwarmWatch(IDS)
        self.addCleanup(watch.close)

        def all_drive():
            for publisher in publishers:
                publisher.publish(command)
            return len(watch.rows) == 2 and all(rows and rows[-1][4] > 0.02 for rows in watch.rows.values())

        wait_for(all_drive, "motion of both robots")

    def test_the_master_that_the_first_launch_started_goes_on(self):
        uri = "http://localhost:%d" % find_free_port()
        master = rosgraph.Master("/test", master_uri=uri)
        port, environment = find_free_port(), {"ROS_MASTER_URI": uri}
        first = self.launch_fleet("count:=1", port=port, environment=environment)
        first.wait_for_text("hero_0 arrived")
        pid = master.getPid()
        self.assert_fleet_refused(self.launch_fleet("count:=1", port=port, environment=environment))
        self.assertEqual(master.getPid(), pid)
        self.assertEqual(first.find_lines("hero_0 left|killing on exit|has died"), [])

    def test_robots_of_a_launch_whose_port_is_taken_join_no_other_swarm(self):
        environment = {"ROS_MASTER_URI": "http://localhost:%d" % find_free_port()}
        second = self.launch_fleet("count:=1", "first_id:=10", environment=environment)
        second.wait_for_text("is in use: end the other program")
        second.wait_end()
        self.assertEqual(self.first.find_lines("hero_10"), [])

    def test_a_fleet_of_another_name_and_port_runs_beside_the_first(self):
        self.watch_driver("/hero_driver_b")
        self.launch_fleet("name:=hero_driver_b", "count:=2", "first_id:=10", port=find_free_port())
        self.wait_ready("/hero_driver_b", 10, 11)

    def test_a_tutorial_with_its_own_robots_leaves_a_fleet_alone(self):
        tutorial = ("roslaunch", "hero_tutorial", "random_walk.launch", "sim:=true", "port:=%d" % find_free_port())
        self.assert_fleet_refused(self.start(*tutorial))

    def test_a_second_monitor_ends_and_the_first_one_goes_on(self):
        monitor = ("roslaunch", "hero_bringup", "monitor.launch", "port:=0")
        first = self.start(*monitor)
        first.wait_for_text("fleet monitor: http://")
        pid = find_pid("/hero_monitor")
        second = self.start(*monitor)
        second.wait_end()
        self.assertEqual(len(second.find_lines("/hero_monitor already runs: end it")), 1, second.lines)
        self.assertEqual(find_pid("/hero_monitor"), pid)
        self.assertIsNone(first.process.poll())


if __name__ == "__main__":
    rospy.init_node("test_second_launch")
    rostest.rosrun("hero_bringup", "second_launch", SecondLaunchTest)
