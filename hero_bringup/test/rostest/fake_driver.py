#!/usr/bin/env python
"""A driver with one robot and no sockets: takes requests to stop, and reports what came of them.

listening in its reports tells how many requests came.
"""

import math
import threading

import rospy
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, SetBoolResponse

from hero_msgs.msg import Robot, RobotArray

REPORT_PERIOD_S = 1.0


class FakeDriver:
    """The topics of a driver; ~robot is the number of its robot."""

    def __init__(self):
        self.stopped = False
        self.requests = 0
        self.lock = threading.Lock()
        self.robot_id = rospy.get_param("~robot")
        self.publisher = rospy.Publisher("~robots", RobotArray, queue_size=1, latch=True)
        self.service = rospy.Service("~stop", SetBool, lambda _: SetBoolResponse(False, "by topic only"))
        self.subscriber = rospy.Subscriber("~stop_request", Bool, self.receive_request, tcp_nodelay=True)

    def receive_request(self, message):
        with self.lock:
            self.stopped = message.data
            self.requests += 1
        self.report()

    def report(self):
        with self.lock:
            report = RobotArray(stopped=self.stopped, listening="%d requests" % self.requests)
            stop_state = Robot.AT_REST if self.stopped else Robot.NOT_STOPPED
        report.header.stamp = rospy.Time.now()
        # No driver sends such numbers, but nothing of what it sends may break a program.
        robot = Robot(frames_per_s=math.nan, bytes_per_s=math.inf, clock_offset=math.nan)
        robot.id, robot.namespace = self.robot_id, "/hero_%d" % self.robot_id
        robot.state, robot.stop_state = Robot.READY, stop_state
        robot.uptime = rospy.Duration(2**31 - 1)
        report.robots.append(robot)
        self.publisher.publish(report)


if __name__ == "__main__":
    rospy.init_node("fake_driver")
    driver = FakeDriver()
    while not rospy.is_shutdown():
        driver.report()
        rospy.sleep(REPORT_PERIOD_S)
