"""Payloads of the stock robot's topics, with the firmware's quirks: seq of -1, zero covariances, single transforms.

Also texts (std_msgs/String) and their md5, for topics and services that stock robots do not have.
"""

import io
import math
import struct

from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from nav_msgs.msg import Odometry
from rospy import Time
from sensor_msgs.msg import Imu, LaserScan
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from hero_msgs.msg import Encoder

STRING_MD5 = String._md5sum
WRONG_MD5 = "0123456789abcdef0123456789abcdef"
SEQ_OF_FIRMWARE = 0xFFFFFFFF

TICK_M = math.pi * 0.0492 / 288.0
WHEEL_SEPARATION_M = 0.063

FRAMES = (
    ("odom", "base_link"),
    ("base_link", "left_wheel_link"),
    ("base_link", "right_wheel_link"),
    ("base_link", "hat_link"),
    ("base_link", "laser_link"),
)
"""Parents and children, in the order in which the robot sends them."""


def to_bytes(message):
    """Return a ROS message as its wire bytes."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def from_bytes(message_class, payload):
    """Return the ROS message in payload."""
    return message_class().deserialize(payload)


def _quaternion(yaw_rad):
    return Quaternion(0.0, 0.0, math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0))


def make_odom(name, stamp, x_m=0.0, y_m=0.0, yaw_rad=0.0):
    """Return the robot's own odometry (nav_msgs/Odometry)."""
    message = Odometry()
    message.header.seq = SEQ_OF_FIRMWARE
    message.header.stamp = stamp
    message.header.frame_id = name + "/odom"
    message.child_frame_id = name + "/base_link"
    message.pose.pose.position.x = x_m
    message.pose.pose.position.y = y_m
    message.pose.pose.orientation = _quaternion(yaw_rad)
    return to_bytes(message)


def make_encoder(name, stamp, left_ticks, right_ticks):
    """Return a reading of the wheels (hero_common/Encoder)."""
    message = Encoder()
    message.header.seq = SEQ_OF_FIRMWARE
    message.header.stamp = stamp
    message.header.frame_id = name + "/encoder"
    message.left_ticks = left_ticks
    message.right_ticks = right_ticks
    return to_bytes(message)


def make_transform(parent, child, stamp, x_m=0.0, yaw_rad=0.0):
    """Return one transform in a message of its own (tf/tfMessage)."""
    transform = TransformStamped()
    transform.header.stamp = stamp
    transform.header.frame_id = parent
    transform.child_frame_id = child
    transform.transform.translation = Vector3(x_m, 0.0, 0.0)
    transform.transform.rotation = _quaternion(yaw_rad)
    return to_bytes(TFMessage([transform]))


def make_laser(name, stamp, beams_m, seq=1):
    """Return the stock scan of 16 ranges: the 8 beams_m, and between them means of their neighbors."""
    message = LaserScan()
    message.header.seq = seq
    message.header.stamp = stamp
    message.header.frame_id = name + "/laser_link"
    message.angle_min = -math.pi
    message.angle_max = math.pi
    message.angle_increment = 0.395
    message.range_min = 0.0468
    message.range_max = 0.2368
    for index, range_m in enumerate(beams_m):
        message.ranges += [range_m, (range_m + beams_m[(index + 1) % 8]) / 2.0]
    message.intensities = [float(index) for index in range(16)]
    return to_bytes(message)


def make_imu(name, stamp):
    """Return a reading of the IMU hat (sensor_msgs/Imu)."""
    message = Imu()
    message.header.seq = SEQ_OF_FIRMWARE
    message.header.stamp = stamp
    message.header.frame_id = name + "/base_link"
    message.orientation = _quaternion(0.5)
    return to_bytes(message)


def make_text(text):
    """Return the payload of a std_msgs/String."""
    return to_bytes(String(text))


def make_twist(linear_m_s, angular_rad_s):
    """Return the payload of a velocity command."""
    return struct.pack("<6d", linear_m_s, 0.0, 0.0, 0.0, 0.0, angular_rad_s)


def send_burst(robot, left_ticks, right_ticks, stamp=None, x_m=0.0, yaw_rad=0.0):
    """Let a robot send what it sends 29 times a second, in its order: odom, five transforms, encoder."""
    stamp = Time.now() if stamp is None else stamp
    name = robot.name
    robot.send("odom", make_odom(name, stamp, x_m, 0.0, yaw_rad))
    for parent, child in FRAMES:
        robot.send("/tf", make_transform("%s/%s" % (name, parent), "%s/%s" % (name, child), stamp, x_m))
    robot.send("encoder", make_encoder(name, stamp, left_ticks, right_ticks))
