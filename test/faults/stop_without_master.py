"""stop_without_master.py PID: drives a robot, kills the ROS master PID, and asks for a stop; prints JSON.

A program of its own, because its ROS master is one of its own.
"""

import json
import os
import signal
import sys

import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import Bool

from hero_test.driver_case import DriverProcess, make_publisher
from hero_test.fake_robot import READ_CYCLE_S, FakeRobot
from hero_test.waiting import wait_for

rospy.init_node("stop_without_master", disable_signals=True)
with DriverProcess() as driver:
    robot = FakeRobot(1, read_cycle_s=READ_CYCLE_S, has_motors=True).connect(driver.address)
    driver.fleet.wait_ready("/hero_1")
    requests = make_publisher(driver.node + "/stop_request", Bool)
    twist = Twist()
    twist.linear.x = 0.1
    make_publisher("/hero_1/velocity_controller/cmd_vel", Twist).publish(twist)
    wait_for(lambda: robot.motors.is_turning, "the wheels to turn")
    os.kill(int(sys.argv[1]), signal.SIGKILL)
    requests.publish(Bool(True))
    wait_for(lambda: not robot.motors.is_turning, "the wheels to rest")
    wait_for(lambda: driver.fleet.newest.stopped, "the driver's report")
    robot.close()
print(json.dumps({"at_rest": True}), flush=True)
