#!/usr/bin/env python3
"""Services of robots as ROS services: all of them, one call at a time, and what becomes of calls that go wrong."""

import struct
import threading

import genpy
import rospy
import rostest
from std_msgs.msg import ColorRGBA
from std_srvs.srv import Trigger

from hero_msgs.msg import Robot
from hero_msgs.srv import SetIRCalibration, SetMotor, SetOdom, SetPID
from hero_test import stock_messages
from hero_test.driver_case import DriverCase, make_publisher, wait_payloads
from hero_test.fake_robot import encode_answer
from hero_test.waiting import wait_for

GAINS = (100.0, 2.0, 0.5, 101.0, 2.5, 0.25)

STOCK_CALLS = {
    "ir_calibration": (SetIRCalibration, (0.4, 0.41, 0.42, 0.43, 0.44, 0.45, 0.46, 0.47), "<8d"),
    "set_odom": (SetOdom, (1.0, -2.0, 0.5), "<3d"),
    "motors_parameters": (SetMotor, (1510, 1490), "<2h"),
    "position_controller/pid_parameters": (SetPID, GAINS, "<6f"),
    "position_controller/pid_calibration": (Trigger, (), "<"),
    "velocity_controller/pid_parameters": (SetPID, GAINS, "<6f"),
    "velocity_controller/pid_calibration": (Trigger, (), "<"),
}


class Call:
    """One call of a service on its own thread."""

    def __init__(self, service, *arguments):
        self.answer = None
        self.error = ""
        self._thread = threading.Thread(target=self._run, args=(service, arguments), daemon=True)
        self._thread.start()

    @property
    def is_over(self):
        """Whether an answer or an error came."""
        return not self._thread.is_alive()

    def wait(self):
        """Wait for the end of the call and return itself."""
        wait_for(lambda: self.is_over, "the end of the call")
        return self

    def _run(self, service, arguments):
        try:
            self.answer = service(*arguments)
        except rospy.ServiceException as error:
            self.error = str(error)


def make_service(robot, name, service_class):
    """Return a service of a robot once it is there."""
    full_name = "%s/%s" % (robot.namespace, name)
    rospy.wait_for_service(full_name, 60.0)
    return rospy.ServiceProxy(full_name, service_class)


class TestDriverServices(DriverCase):
    def test_every_stock_service_passes_its_request_and_its_answer(self):
        robot = self.join(1)
        for name, (service_class, arguments, layout) in STOCK_CALLS.items():
            answer = make_service(robot, name, service_class)(*arguments)
            self.assertEqual((answer.success, answer.message), (True, name))
            self.assertEqual(robot.payloads_on(name), [struct.pack(layout, *arguments)])

    def test_an_answer_without_success_is_an_answer(self):
        robot = self.join(2)
        robot.answers["velocity_controller/pid_calibration"] = lambda _: encode_answer(False, "PID Autotuning!")
        answer = make_service(robot, "velocity_controller/pid_calibration", Trigger)()
        self.assertEqual((answer.success, answer.message), (False, "PID Autotuning!"))

    def test_a_call_fails_at_once_when_the_robot_leaves(self):
        robot = self.join(8)
        robot.answers["motors_parameters"] = lambda _: None
        call = Call(make_service(robot, "motors_parameters", SetMotor), 1500, 1500)
        wait_payloads(robot, "motors_parameters")
        robot.close()
        self.assertIn("/hero_8/motors_parameters was not answered: closed by the robot", call.wait().error)

    def test_a_call_while_the_robot_is_away_fails_at_once(self):
        robot = self.join(10)
        service = make_service(robot, "set_odom", SetOdom)
        robot.close()
        self.fleet.wait("/hero_10", Robot.AWAY)
        self.assertIn("the robot is not connected", Call(service, 0.0, 0.0, 0.0).wait().error)

    def test_a_request_that_would_harm_the_robot_is_refused_with_the_reason(self):
        robot = self.join(14)
        for name, service_class, arguments, reason in (
            ("set_odom", SetOdom, (float("nan"), 0.0, 0.0), "finite"),
            ("velocity_controller/pid_parameters", SetPID, (float("inf"), *GAINS[1:]), "finite"),
            ("velocity_controller/pid_parameters", SetPID, (1e30, *GAINS[1:]), "from 0 to 1e6"),
            ("velocity_controller/pid_parameters", SetPID, (-1.0, *GAINS[1:]), "negative"),
            ("motors_parameters", SetMotor, (30000, 1500), "1000..2000"),
            ("ir_calibration", SetIRCalibration, (0.0,) * 8, "above 0"),
        ):
            self.assertIn(reason, Call(make_service(robot, name, service_class), *arguments).wait().error)
            self.assertEqual(robot.payloads_on(name), [])

    def test_a_garbled_answer_is_an_error_of_this_call_alone(self):
        robot = self.join(15)
        robot.answers["set_odom"] = lambda _: b"\x01"
        service = make_service(robot, "set_odom", SetOdom)
        with self.assertRaises((rospy.ServiceException, genpy.DeserializationError)):
            service(0.0, 0.0, 0.0)
        del robot.answers["set_odom"]
        self.assertTrue(make_service(robot, "set_odom", SetOdom)(0.0, 0.0, 0.0).success)

    def test_a_slow_service_does_not_delay_commands_or_other_robots(self):
        slow, other = self.join(17), self.join(18)
        slow.answers["set_odom"] = lambda _: None
        call = Call(make_service(slow, "set_odom", SetOdom), 0.0, 0.0, 0.0)
        wait_payloads(slow, "set_odom")
        make_publisher("/hero_17/led", ColorRGBA).publish(ColorRGBA(1.0, 1.0, 1.0, 1.0))
        self.assertEqual(wait_payloads(slow, "led"), [stock_messages.to_bytes(ColorRGBA(1.0, 1.0, 1.0, 1.0))])
        self.assertTrue(make_service(other, "set_odom", SetOdom)(0.0, 0.0, 0.0).success)
        slow.answer("set_odom", encode_answer(True, "slow"))
        self.assertEqual(call.wait().answer.message, "slow")

    def test_services_work_with_the_firmwares_read_cycle(self):
        robot = self.join(19, read_cycle_s=0.051)
        service = make_service(robot, "motors_parameters", SetMotor)
        for index in range(5):
            self.assertTrue(service(1500 + index, 1500).success)
        self.assertEqual(len(robot.payloads_on("motors_parameters")), 5)


if __name__ == "__main__":
    rospy.init_node("test_driver_services")
    rostest.rosrun("hero_driver", "driver_services", TestDriverServices)
