"""A driver without connections: takes stop requests, and reports of its robots what a test tells it to.

~ids lists the robots, ~gone those that have not returned, as JSON; ~twin_of is an id that a second robot wants. ~behave
(std_msgs/String) takes JSON: which robots move though stopped, and whether the others come to rest at all.
The port on which it says that it listens is the number of stop requests so far.
"""

import json
import threading
from functools import partial

import rospy
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse

from hero_msgs.msg import Robot, RobotArray

REST_AFTER_S = 0.3
REPORT_PERIOD_S = 1.0


class ScriptedDriver:
    def __init__(self):
        self.ids = json.loads(rospy.get_param("~ids"))
        self.twin_of = rospy.get_param("~twin_of", None)
        self.requests = 0
        self.gone = json.loads(rospy.get_param("~gone", "[]"))
        self.lock = threading.Lock()
        self.behavior = {"moving": [], "rest": True}
        self.stop_time_s, self.stopped_by = None, ""
        self.publisher = rospy.Publisher("~robots", RobotArray, queue_size=5, latch=True)
        rospy.Service("~stop", SetBool, self.serve_stop)
        rospy.Service("~dismiss_gone", Trigger, self.dismiss_gone)
        rospy.Subscriber("~stop_request", Bool, self.receive_stop, queue_size=10, tcp_nodelay=True)
        rospy.Subscriber("~behave", String, self.receive_behavior, queue_size=10)
        rospy.Timer(rospy.Duration(REPORT_PERIOD_S), lambda event: self.report())
        self.report()

    def receive_stop(self, message):
        with self.lock:
            self.requests += 1
            if message.data != (self.stop_time_s is not None):
                self.stop_time_s = rospy.get_time() if message.data else None
                self.stopped_by = message._connection_header["callerid"] if message.data else ""
        self.report()
        rospy.Timer(rospy.Duration(REST_AFTER_S), lambda event: self.report(), oneshot=True)

    def dismiss_gone(self, request):
        self.gone = []
        self.report()
        return TriggerResponse(True, "")

    def serve_stop(self, request):
        self.receive_stop(request)
        return SetBoolResponse(True, "")

    def receive_behavior(self, message):
        self.behavior = json.loads(message.data)
        self.report()

    def find_stop_state(self, robot_id):
        if self.stop_time_s is None:
            return Robot.NOT_STOPPED
        if rospy.get_time() < self.stop_time_s + REST_AFTER_S or not self.behavior["rest"]:
            return Robot.STOPPING
        return Robot.MOVING if robot_id in self.behavior["moving"] else Robot.AT_REST

    def report(self):
        with self.lock:
            make = partial(Robot, since=rospy.Time.now(), firmware="v3.8", packets_per_s=88.0, bytes_per_s=88.0)
            report = RobotArray(listening="127.0.0.1:%d" % self.requests, stopped=self.stop_time_s is not None)
            report.header.stamp = rospy.Time.now()
            report.stopped_by = self.stopped_by
            report.stopped_since = rospy.Time.from_sec(self.stop_time_s or 0.0)
            report.gone = [Robot(id=number, since=report.header.stamp) for number in self.gone]
            for robot_id in self.ids:
                row = make(id=robot_id, namespace="/hero_%d" % robot_id, state=Robot.READY)
                row.address, row.stop_state = "127.0.1.%d:40000" % robot_id, self.find_stop_state(robot_id)
                report.robots.append(row)
            if self.twin_of is not None:
                reason = "hero_%d is here and stays, 127.0.9.9:5 is refused" % self.twin_of
                report.robots.append(
                    Robot(
                        id=self.twin_of,
                        namespace="/hero_%d" % self.twin_of,
                        address="127.0.9.9:5",
                        state=Robot.REFUSED,
                        last_error=reason,
                    )
                )
            self.publisher.publish(report)


def main():
    rospy.init_node("scripted_driver")
    driver = ScriptedDriver()  # noqa: F841 - its subscribers live as long as it does
    rospy.spin()
