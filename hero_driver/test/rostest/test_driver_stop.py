#!/usr/bin/env python3
"""Stops that the robot's wheels confirm: robots that tune themselves, that stall, that return, and new drivers."""

import math
import os
import signal
import subprocess
from pathlib import Path

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Twist
from std_msgs.msg import Bool, ColorRGBA
from std_srvs.srv import SetBool, Trigger

from hero_driver.commands.velocity_shaper import STOPPED_MOTORS
from hero_msgs.msg import Motor, Robot
from hero_test.driver_case import (
    DriverProcess,
    OwnDriverCase,
    Recorder,
    make_command,
    make_publisher,
    receives_topic,
)
from hero_test.fake_robot import READ_CYCLE_S, SUB
from hero_test.nonempty import nonempty
from hero_test.processes import suspended
from hero_test.waiting import wait_for

VELOCITY = "velocity_controller"
POSITION = "position_controller"


def is_error(diagnostics, name):
    """Return whether a status whose name ends so is an error."""
    return any(
        status.name.endswith(": " + name) and status.level == DiagnosticStatus.ERROR for status in diagnostics.status
    )


ROSTOPIC_MOTION = ("geometry_msgs/Twist", "[0.1, 0.0, 0.0]", "[0.0, 0.0, 0.0]")


class TestDriverStop(OwnDriverCase):
    """Each test has robots of its own numbers, also where it has a driver of its own: topics outlast a connection."""

    def tearDown(self):
        for driver in self._shared.values():
            self.call_stop(driver, False)

    def dial_stock(self, driver, number):
        """Return a robot with wheels that takes commands as the firmware does."""
        return self.dial(driver, number, read_cycle_s=READ_CYCLE_S, has_motors=True)

    def call_stop(self, driver, stopped):
        """Call ~stop; return its answer."""
        rospy.wait_for_service(driver.node + "/stop", 60.0)
        answer = rospy.ServiceProxy(driver.node + "/stop", SetBool)(stopped)
        self.assertTrue(answer.success, answer.message)
        return answer.message

    def drive(self, robot, controller=VELOCITY):
        """Let a robot move; return the publisher of its commands."""
        publisher = make_publisher("%s/%s/cmd_vel" % (robot.namespace, controller), Twist)
        before = len(robot.velocities)
        publisher.publish(make_command(0.1))
        # Wheels may turn by an earlier command: wait for this one.
        wait_for(lambda: any(v.linear_m_s == 0.1 for v in robot.velocities[before:]), "the command to arrive")
        wait_for(lambda: robot.motors.is_turning, "the wheels to turn")
        return publisher

    def wait_at_rest(self, driver, robot):
        """Wait until the driver says that a robot is at rest, which must be true."""
        driver.fleet.wait(robot.namespace, Robot.READY, "at rest", lambda entry: entry.stop_state == Robot.AT_REST)
        self.assertFalse(robot.motors.is_turning)

    def start_tuning(self, driver, robot, controller):
        """Call pid_calibration of a controller."""
        name = "%s/%s/pid_calibration" % (robot.namespace, controller)
        rospy.wait_for_service(name, 60.0)
        self.assertEqual(rospy.ServiceProxy(name, Trigger)().message, "PID Autotuning!")
        self.assertTrue(robot.motors.is_tuning)

    # What moves a robot.

    def test_a_stop_ends_whatever_moves_the_robot(self):
        driver = self.share()
        moved = [self.dial_stock(driver, number) for number in (1, 2, 3)]
        self.drive(moved[0])
        self.drive(moved[1], POSITION)
        make_publisher("/hero_3/cmd_motor", Motor).publish(Motor(1400, 1600))
        wait_for(lambda: moved[2].motors.is_turning, "the wheels to turn")
        self.call_stop(driver, True)
        for robot in moved:
            self.wait_at_rest(driver, robot)

    def test_a_new_driver_stops_what_an_earlier_one_set_in_motion(self):
        driver = self.share()
        robot = self.dial_stock(driver, 50)
        robot.motors.take_velocity("/hero_50/position_controller/cmd_vel", False)
        self.call_stop(driver, True)
        self.wait_at_rest(driver, robot)

    def test_pid_calibration_is_refused_unless_it_is_allowed(self):
        driver = self.share()
        robot = self.dial_stock(driver, 51)
        for controller in (VELOCITY, POSITION):
            name = "/hero_51/%s/pid_calibration" % controller
            rospy.wait_for_service(name, 60.0)
            with self.assertRaisesRegex(rospy.ServiceException, "allow_self_tuning"):
                rospy.ServiceProxy(name, Trigger)()
            self.assertEqual(robot.payloads_on(controller + "/pid_calibration"), [])

    def test_pid_calibration_is_refused_while_robots_are_stopped(self):
        driver = self.share(allow_self_tuning=True)
        robot = self.dial_stock(driver, 52)
        self.call_stop(driver, True)
        rospy.wait_for_service("/hero_52/velocity_controller/pid_calibration", 60.0)
        with self.assertRaisesRegex(rospy.ServiceException, "all robots are stopped"):
            rospy.ServiceProxy("/hero_52/velocity_controller/pid_calibration", Trigger)()
        self.assertEqual(robot.payloads_on(VELOCITY + "/pid_calibration"), [])

    def test_a_stop_ends_the_self_tuning_of_either_controller(self):
        driver = self.share(allow_self_tuning=True)
        for number, controller in ((71, VELOCITY), (72, POSITION)):
            robot = self.dial_stock(driver, number)
            self.start_tuning(driver, robot, controller)
            self.call_stop(driver, True)
            self.wait_at_rest(driver, robot)
            self.call_stop(driver, False)

    def test_an_unannounced_self_tuning_is_recognized_by_the_wheels(self):
        driver = self.share()
        robot = self.dial_stock(driver, 53)
        robot.is_silent = True
        robot.motors.start_tuning(VELOCITY)
        robot.is_silent = False
        self.call_stop(driver, True)
        self.wait_at_rest(driver, robot)

    def test_a_suspended_driver_accuses_no_robot_of_a_tuning_that_is_over(self):
        driver = self.start()
        robot = self.dial_stock(driver, 54)
        with suspended(driver.process.pid):
            threads = Path("/proc/%d/task" % driver.process.pid)
            wait_for(
                lambda: all(" T " in path.read_text() for path in nonempty(threads.glob("*/stat"))),
                "all threads to rest",
            )
            for _ in range(45):
                robot.log("Tunning Motor Set: [0.000000,0.000000], [0.050000,0.050000]->[-50,210]")
            for _ in range(45):  # what comes last, behind more than one read, is young again
                robot.log("[%s] %s" % (robot.namespace, "-" * 90))
            wait_for(lambda: robot.count_unacknowledged() == 0, "all of it to be in the driver's socket")
        robot.log("this is read in time")
        driver.wait_line("this is read in time")
        self.assertEqual(driver.find_lines("tunes itself, without a request"), [])
        robot.start_tuning()
        driver.wait_line("hero_54 tunes itself, without a request from this driver: stopped")
        wait_for(lambda: not robot.motors.is_tuning, "the tuning to end")

    def test_the_end_of_the_driver_names_a_robot_whose_wheels_turn(self):
        driver = self.start()
        robots = [self.dial_stock(driver, number) for number in (75, 76)]
        robots[0].motors.is_pushed = True
        driver.process.send_signal(signal.SIGINT)
        self.assertEqual(driver.wait_end(), 0, driver.lines)
        self.assertRegex(driver.lines[-1], r"not known to be at rest: hero_75 \(MOVING\)")

    # What is known of it.

    def test_a_robot_that_is_pushed_is_reported_and_at_rest_afterwards(self):
        driver = self.start()
        robot = self.dial_stock(driver, 55)
        self.call_stop(driver, True)
        self.wait_at_rest(driver, robot)
        diagnostics = Recorder("/diagnostics", DiagnosticArray)
        robot.motors.is_pushed = True
        driver.fleet.wait("/hero_55", Robot.READY, "moving", lambda entry: entry.stop_state == Robot.MOVING)
        driver.wait_line("hero_55: its wheels turn although it was stopped")
        for name in ("driver", "hero_55"):
            diagnostics.wait_message(lambda array, name=name: is_error(array, name), "an error of " + name)
        self.assertIn("1 MOVING", self.call_stop(driver, True))
        robot.motors.is_pushed = False
        self.wait_at_rest(driver, robot)
        self.assertIn("1 AT_REST", self.call_stop(driver, True))

    def test_a_robot_without_readings_is_stopped_and_not_confirmed(self):
        driver = self.share()
        robot = self.dial(driver, 56, read_cycle_s=READ_CYCLE_S)
        self.call_stop(driver, True)
        driver.fleet.wait("/hero_56", Robot.READY, "unconfirmed", lambda entry: entry.stop_state == Robot.UNCONFIRMED)
        self.assertTrue(all(velocity.is_zero for velocity in robot.velocities))
        self.assertGreaterEqual(len(robot.velocities), 2)

    def test_a_robot_that_is_away_is_stopped_when_it_returns(self):
        driver = self.share()
        robot = self.dial_stock(driver, 57)
        robot.close()
        driver.fleet.wait("/hero_57", Robot.AWAY)
        self.call_stop(driver, True)
        driver.fleet.wait("/hero_57", Robot.AWAY, "stopping", lambda entry: entry.stop_state == Robot.STOPPING)
        robot.motors.take_velocity("/hero_57/position_controller/cmd_vel", False)
        robot.connect(driver.address)
        self.wait_at_rest(driver, robot)

    def test_a_refused_robot_is_stopped_and_counted(self):
        driver = self.share()
        first = self.dial_stock(driver, 80)
        second = self.dial(
            driver, 80, ready=False, read_cycle_s=READ_CYCLE_S, has_motors=True, source_host="127.0.0.80"
        )
        driver.fleet.wait("/hero_80", Robot.REFUSED)
        for robot in (first, second):
            robot.motors.take_velocity("/hero_80/velocity_controller/cmd_vel", False)
        self.call_stop(driver, True)
        for state in (Robot.READY, Robot.REFUSED):
            driver.fleet.wait("/hero_80", state, "at rest", lambda entry: entry.stop_state == Robot.AT_REST)
        self.assertFalse(first.motors.is_turning or second.motors.is_turning)
        self.assertTrue(all(velocity.is_zero for velocity in nonempty(second.velocities)))
        self.assertIn("2 AT_REST", self.call_stop(driver, True))

    # Who asks for it.

    def test_a_request_on_the_topic_stops_and_releases(self):
        driver = self.share()
        robot = self.dial_stock(driver, 59)
        requests = make_publisher(driver.node + "/stop_request", Bool)
        self.drive(robot)
        requests.publish(Bool(True))
        self.wait_at_rest(driver, robot)
        wait_for(lambda: driver.fleet.newest.stopped, "the report")
        self.assertEqual(driver.fleet.newest.stopped_by, rospy.get_name())
        self.assertLess(driver.fleet.newest.stopped_since, rospy.Time.now())
        requests.publish(Bool(False))
        wait_for(lambda: not driver.fleet.newest.stopped, "the report")
        self.drive(robot)

    def test_a_driver_that_is_started_again_stays_stopped(self):
        first = self.start()
        self.call_stop(first, True)
        first.process.send_signal(signal.SIGINT)
        first.wait_end()
        rospy.delete_param(first.node)  # as with a new ROS master
        second = DriverProcess(name=first.node[1:])
        self.addCleanup(second.__exit__)
        second.wait_line("all robots are stopped since 20.*rosservice call %s/stop false" % second.node)
        stopped = Recorder(second.node + "/stopped", Bool)
        wait_for(lambda: stopped.messages and stopped.messages[-1].data, "the second driver to begin stopped")
        wait_for(lambda: second.fleet.newest and second.fleet.newest.stopped_since, "the time of the stop")
        self.assertEqual(second.fleet.newest.stopped_by, "", "it was before this driver's start")
        robot = self.dial_stock(second, 78)
        publisher = make_publisher("/hero_78/velocity_controller/cmd_vel", Twist)
        publisher.publish(make_command(0.1))
        self.wait_at_rest(second, robot)
        self.assertTrue(all(velocity.is_zero for velocity in nonempty(robot.velocities)))
        self.call_stop(second, False)
        self.drive(robot)

    def test_a_stop_that_was_answered_survives_the_drivers_sudden_death(self):
        first = self.start()
        self.call_stop(first, True)
        first.process.kill()
        first.wait_end()
        second = DriverProcess(name=first.node[1:])
        self.addCleanup(second.__exit__)
        second.wait_line("all robots are stopped since 20")

    def test_the_answer_to_a_stop_says_if_it_cannot_be_kept(self):
        # rospy does not start without a folder for its log.
        log_folder = os.environ.get("ROS_LOG_DIR", os.environ["ROS_HOME"])
        driver = DriverProcess(environment={"ROS_HOME": __file__, "ROS_LOG_DIR": log_folder})
        self.addCleanup(driver.__exit__)
        for _ in range(2):
            self.assertIn("the stop will not survive a restart of the driver", self.call_stop(driver, True))
        driver.wait_line("the stop will not survive a restart of the driver.*set ROS_HOME")
        wait_for(lambda: driver.fleet.newest is not None and driver.fleet.newest.stopped, "the report")

    def test_start_stopped_says_otherwise(self):
        driver = self.start(start_stopped="always")
        self.wait_at_rest(driver, self.dial_stock(driver, 77))
        driver.process.send_signal(signal.SIGINT)
        driver.wait_end()
        again = DriverProcess({"start_stopped": "never"}, name=driver.node[1:])
        self.addCleanup(again.__exit__)
        self.drive(self.dial_stock(again, 60))

    # Programs that go, or go wrong.

    def test_a_robot_stops_when_its_commander_hangs(self):
        driver = self.share()
        robot = self.dial_stock(driver, 82)
        commander = subprocess.Popen(["rostopic", "pub", "-r", "20", "/hero_82/cmd_vel", *ROSTOPIC_MOTION])
        self.addCleanup(commander.wait)
        self.addCleanup(commander.kill)
        wait_for(lambda: len(robot.velocities) > 10, "regular commands")
        commander.send_signal(signal.SIGSTOP)
        wait_for(lambda: not robot.motors.is_turning, "the wheels to rest")
        driver.wait_line("hero_82 is stopped: /rostopic_.* has been silent")

    def test_latched_motion_and_releases_of_before_are_not_acted_on(self):
        publisher = rospy.Publisher("/hero_83/cmd_vel", Twist, queue_size=1, latch=True)
        publisher.publish(make_command(0.1))
        releases = rospy.Publisher("/latch_driver/stop_request", Bool, queue_size=1, latch=True)
        releases.publish(Bool(False))
        driver = DriverProcess({"start_stopped": "always"}, name="latch_driver")
        self.addCleanup(driver.__exit__)
        driver.wait_line("a release on ~stop_request was refused")
        wait_for(lambda: driver.fleet.newest is not None, "the report")
        self.assertTrue(driver.fleet.newest.stopped)
        self.call_stop(driver, False)
        robot = self.dial_stock(driver, 83)
        driver.wait_line("hero_83: a command on /hero_83/cmd_vel was refused")
        self.assertFalse(any(not velocity.is_zero for velocity in robot.velocities))
        # A publisher that comes later latches, too: so does rostopic.
        command = ["rostopic", "pub", "-1", "/hero_83/cmd_vel", *ROSTOPIC_MOTION]
        self.addCleanup(subprocess.Popen(command).wait)
        wait_for(lambda: robot.motors.is_turning, "the wheels to turn")
        releases.publish(Bool(True))
        self.wait_at_rest(driver, robot)
        releases.publish(Bool(False))
        wait_for(lambda: not driver.fleet.newest.stopped, "the release")

    def test_the_end_of_a_program_that_moves_nothing_stops_no_robot(self):
        driver = self.share(orphan_stop_s=0.0)
        robot = self.dial_stock(driver, 41)
        idle = make_publisher("/hero_41/velocity_controller/cmd_vel", Twist)
        idle.publish(make_command(0.0))
        wait_for(lambda: robot.velocities, "the zero")
        self.drive(robot, POSITION)
        idle.unregister()
        # Both are handled in order: a stop would be there before what comes now.
        wait_for(lambda: not receives_topic(driver.node, "/hero_41/velocity_controller/cmd_vel"), "its end")
        make_publisher("/hero_41/led", ColorRGBA).publish(ColorRGBA())
        wait_for(lambda: robot.payloads_on("led"), "the next command")
        self.assertTrue(robot.motors.is_turning)

    def test_a_robot_that_was_orphaned_may_be_driven_again_at_once(self):
        driver = self.share(orphan_stop_s=0.0)
        robot = self.dial_stock(driver, 42)
        self.drive(robot).unregister()
        wait_for(lambda: not robot.motors.is_turning, "the wheels to rest")
        self.drive(robot)
        driver.fleet.wait("/hero_42", Robot.READY, "free", lambda entry: entry.stop_state == Robot.NOT_STOPPED)
        self.assertTrue(robot.motors.is_turning)

    def test_a_velocity_that_is_not_finite_stops_a_robot_that_moves(self):
        driver = self.share()
        robot = self.dial_stock(driver, 62)
        self.drive(robot).publish(make_command(math.nan))
        wait_for(lambda: not robot.motors.is_turning, "the wheels to rest")
        driver.wait_line("hero_62: a command on .* is not finite")

    def test_servo_pulses_do_not_pile_up_in_front_of_a_stop(self):
        driver = self.share()
        robot = self.dial_stock(driver, 63)
        motors = make_publisher("/hero_63/cmd_motor", Motor)
        motors.publish(Motor(1400, 1600))
        wait_for(lambda: robot.motors.is_turning, "the wheels to turn")
        robot.is_stalled = robot.is_silent = True
        rate = rospy.Rate(50)
        for pulse_us in range(1300, 1400):
            motors.publish(Motor(pulse_us, 1600))
            rate.sleep()
        self.call_stop(driver, True)
        before = len(robot.received)
        robot.is_stalled = robot.is_silent = False
        self.wait_at_rest(driver, robot)
        late = [
            packet.payload
            for packet in robot.received[before:]
            if packet.topic_id == robot.find_id("cmd_motor", (SUB,)) and packet.payload != STOPPED_MOTORS
        ]
        # What was sent before the driver noticed, by its own clock: one in 0.06 s of half a second.
        self.assertLess(len(late), 15)


if __name__ == "__main__":
    rospy.init_node("test_driver_stop")
    rostest.rosrun("hero_driver", "driver_stop", TestDriverStop)
