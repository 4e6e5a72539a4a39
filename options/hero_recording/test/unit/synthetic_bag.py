"""Bags of robots that drive circles with known paths, delays and errors, for tests."""

import math

import rosbag
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion, TransformStamped, Twist
from nav_msgs.msg import Odometry
from rospy import Time
from sensor_msgs.msg import LaserScan
from std_msgs.msg import ColorRGBA
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from hero_msgs.msg import Encoder, Robot, RobotArray

START_S = 1700000000.0
RADIUS_M = 0.2
ANGULAR_RAD_S = 0.5
PERIOD_S = 0.034
ERROR_M = 0.01
"""Offset of the ground truth in x."""

DELAY_S = 0.02
"""Of all messages."""

ORIGIN_X_M = 1.0
"""Of hero_N's odom frame in the world, times N."""

START_DELAY_S = 1.0
"""The robots get their first command this long after the start."""

MOTION_DELAY_S = 0.1


def make_quaternion(yaw_rad):
    return Quaternion(0.0, 0.0, math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0))


def place(message, frame, stamp_s, x_m, y_m, yaw_rad):
    message.header.frame_id, message.header.stamp = frame, Time.from_sec(stamp_s)
    message.pose.pose.position.x, message.pose.pose.position.y = x_m, y_m
    message.pose.pose.orientation = make_quaternion(yaw_rad)
    return message


def make_localized(stamp_s, x_m, y_m, yaw_rad):
    message = place(PoseWithCovarianceStamped(), "map", stamp_s, x_m, y_m, yaw_rad)
    message.pose.covariance = [4e-6 if index in (0, 7) else 0.0 for index in range(36)]
    return message


def make_pose(frame, stamp_s, x_m, y_m, yaw_rad, speed_m_s=0.0):
    message = place(Odometry(), frame, stamp_s, x_m, y_m, yaw_rad)
    message.twist.twist.linear.x = speed_m_s
    message.twist.twist.angular.z = speed_m_s / RADIUS_M
    return message


def make_arena():
    wall = Marker(type=Marker.CUBE)
    wall.pose.orientation.w = 1.0
    wall.scale.x = 2.0
    post = Marker(type=Marker.CYLINDER)
    post.pose.position.x = 0.5
    post.scale.x = 0.2
    return MarkerArray([wall, post])


def make_origins(robot_ids):
    transforms = [TransformStamped(child_frame_id="camera_optical")]  # of another program
    for robot_id in robot_ids:
        transform = TransformStamped(child_frame_id="hero_%d/odom" % robot_id)
        transform.header.frame_id = "world"
        transform.transform.translation.x = ORIGIN_X_M * robot_id
        transform.transform.rotation.w = 1.0
        transforms.append(transform)
    return TFMessage(transforms)


def make_fleet(robot_ids, state):
    return RobotArray(robots=[Robot(id=number, namespace="/hero_%d" % number, state=state) for number in robot_ids])


def write_bag(path, robot_ids=(0,), seconds=5.0, start_s=START_S, pause=None, compression="none"):
    """Write a bag; pause (start s, end s): the robots send nothing, and the driver reports them away."""
    with rosbag.Bag(str(path), "w", compression, chunk_threshold=20000) as bag:

        def write(topic, message, time_s):
            bag.write(topic, message, Time.from_sec(start_s + time_s))

        write("/tf_static", make_origins(robot_ids), 0.0)
        write("/hero_sim/arena", make_arena(), 0.0)
        write("/chatter", ColorRGBA(), 0.0)
        write("/hero_0/led", Twist(), 0.0)  # a type that does not fit the name
        for step in range(int(seconds / PERIOD_S)):
            time_s = step * PERIOD_S
            away = pause is not None and pause[0] <= time_s < pause[1]
            if step % 15 == 0:
                write("/hero_driver/robots", make_fleet(robot_ids, Robot.AWAY if away else Robot.READY), time_s)
            if away:
                continue
            driven_s = max(0.0, time_s - START_DELAY_S - MOTION_DELAY_S)
            yaw_rad = ANGULAR_RAD_S * driven_s
            speed_m_s = RADIUS_M * ANGULAR_RAD_S if driven_s else 0.0
            x_m, y_m = RADIUS_M * math.sin(yaw_rad), RADIUS_M * (1.0 - math.cos(yaw_rad))
            for robot_id in robot_ids:
                name = "/hero_%d/" % robot_id
                stamp_s = start_s + time_s
                write(name + "odom", make_pose(name + "odom", stamp_s, x_m, y_m, yaw_rad, speed_m_s), time_s + DELAY_S)
                true_x_m = x_m + ORIGIN_X_M * robot_id + ERROR_M
                write(name + "ground_truth", make_pose("world", stamp_s, true_x_m, y_m, yaw_rad), time_s)
                encoder = Encoder(left_ticks=round(driven_s * 200.0), right_ticks=round(driven_s * 200.0))
                encoder.header.stamp = Time.from_sec(stamp_s)
                write(name + "encoder", encoder, time_s)
                if time_s >= START_DELAY_S and step % 3 == 0:
                    command = Twist()
                    command.linear.x = RADIUS_M * ANGULAR_RAD_S
                    command.angular.z = ANGULAR_RAD_S
                    write(name + "velocity_controller/cmd_vel", command, time_s)
                if step % 6 == 0:
                    scan = LaserScan(ranges=[0.1, math.inf, -math.inf, math.nan, 0.2, 0.2, 0.2, 0.2])
                    scan.header.stamp = Time.from_sec(stamp_s)
                    write(name + "proximity", scan, time_s)
