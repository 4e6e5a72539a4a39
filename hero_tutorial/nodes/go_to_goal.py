#!/usr/bin/env python3
"""Drives a robot to a goal in its odometry frame with a unicycle controller, then logs "arrived" and exits."""

import math

import rospy
from angles import normalize_angle
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from tf.transformations import euler_from_quaternion

PERIOD_S = 0.2  # 5 Hz
LINEAR_GAIN = 0.5  # m/s per m of distance
ANGULAR_GAIN = 1.0  # rad/s per rad of heading error
MAX_LINEAR_M_S = 0.1
MAX_ANGULAR_RAD_S = 1.0
TOLERANCE_M = 0.01
MAX_AGE_S = 1.0


class GoToGoal:
    def __init__(self, robot, goal_x_m, goal_y_m):
        self.goal_x_m, self.goal_y_m = goal_x_m, goal_y_m
        self.odometry = None
        self.publisher = rospy.Publisher(robot + "/velocity_controller/cmd_vel", Twist, queue_size=1)
        self.subscriber = rospy.Subscriber(robot + "/odom", Odometry, self.receive, queue_size=1)
        self.timer = rospy.Timer(rospy.Duration(PERIOD_S), self.step)
        rospy.on_shutdown(self.stop)

    def receive(self, message):
        self.odometry = message

    def step(self, event):
        if self.odometry is None or (rospy.Time.now() - self.odometry.header.stamp).to_sec() > MAX_AGE_S:
            rospy.logwarn_throttle(5.0, "waiting for odometry on %s" % self.subscriber.name)
            self.publisher.publish(Twist())
            return
        pose = self.odometry.pose.pose
        q = pose.orientation
        _, _, yaw_rad = euler_from_quaternion([q.x, q.y, q.z, q.w])
        dx_m, dy_m = self.goal_x_m - pose.position.x, self.goal_y_m - pose.position.y
        distance_m = math.hypot(dx_m, dy_m)
        if distance_m < TOLERANCE_M:
            self.timer.shutdown()
            rospy.loginfo("arrived")
            rospy.signal_shutdown("arrived")
            return
        error_rad = normalize_angle(math.atan2(dy_m, dx_m) - yaw_rad)
        command = Twist()
        command.linear.x = clamp(LINEAR_GAIN * distance_m * math.cos(error_rad), MAX_LINEAR_M_S)
        command.angular.z = clamp(ANGULAR_GAIN * error_rad, MAX_ANGULAR_RAD_S)
        self.publisher.publish(command)

    def stop(self):
        self.timer.shutdown()
        self.publisher.publish(Twist())
        rospy.sleep(0.2)


def clamp(value, limit):
    return max(-limit, min(limit, value))


def main():
    rospy.init_node("go_to_goal")
    robot = "hero_" + str(rospy.get_param("~robot", 3)).replace("hero_", "")  # 3 or hero_3
    GoToGoal(robot, rospy.get_param("~goal_x_m", 0.15), rospy.get_param("~goal_y_m", 0.0))
    rospy.spin()


if __name__ == "__main__":
    main()
