"""Messages of the stock robot as bytes, field by field by the ROS definitions, without the code under test."""

import math
import struct

MS = 10**6
NS_PER_S = 10**9
NOW_NS = 1795240942 * NS_PER_S
NO_SEQ = 4294967295
"""What the firmware has in the sequence numbers that it never sets."""


def build_text(text):
    """Return a string as it lies in a message."""
    data = text if isinstance(text, bytes) else text.encode()
    return struct.pack("<I", len(data)) + data


def build_header(stamp_ns, frame_id, seq=NO_SEQ):
    """Return a std_msgs/Header."""
    return struct.pack("<III", seq, stamp_ns // NS_PER_S, stamp_ns % NS_PER_S) + build_text(frame_id)


def build_encoder(stamp_ns, left_ticks, right_ticks, robot="hero_0"):
    """Return a hero_common/Encoder; what is behind the ticks does not matter here."""
    fields = (left_ticks, right_ticks, 1.0, 2.0, 0.5, 0.6, 34.0, 0.1, 0.2, 0.3, 0.4)
    return build_header(stamp_ns, robot + "/encoder") + struct.pack("<11d", *fields)


def build_odometry(stamp_ns, x_m=0.0, y_m=0.0, yaw_rad=0.0, linear_m_s=0.0, angular_rad_s=0.0, robot="hero_0"):
    """Return a nav_msgs/Odometry with covariances of zero."""
    return b"".join(
        (
            build_header(stamp_ns, robot + "/odom"),
            build_text(robot + "/base_link"),
            struct.pack("<7d", x_m, y_m, 0.0, 0.0, 0.0, math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0)),
            bytes(36 * 8),
            struct.pack("<6d", linear_m_s, 0.0, 0.0, 0.0, 0.0, angular_rad_s),
            bytes(36 * 8),
        )
    )


def build_transform(stamp_ns, parent, child, numbers=(1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0)):
    """Return a geometry_msgs/TransformStamped: translation x, y, z and rotation x, y, z, w."""
    return build_header(stamp_ns, parent, 0) + build_text(child) + struct.pack("<7d", *numbers)


def build_transform_message(*transforms):
    """Return a tf2_msgs/TFMessage."""
    return struct.pack("<I", len(transforms)) + b"".join(transforms)


def build_laser(stamp_ns, ranges_m, intensities, robot="hero_0"):
    """Return a sensor_msgs/LaserScan with the odd angles of the firmware."""
    return b"".join(
        (
            build_header(stamp_ns, robot + "/laser_link", 1),
            struct.pack("<7f", -math.pi, math.pi, 0.395, 0.0, 0.0, 0.0368, 0.2368),
            struct.pack("<I", len(ranges_m)),
            struct.pack("<%df" % len(ranges_m), *ranges_m),
            struct.pack("<I", len(intensities)),
            struct.pack("<%df" % len(intensities), *intensities),
        )
    )


def build_imu(stamp_ns, robot="hero_0"):
    """Return a sensor_msgs/Imu."""
    return build_header(stamp_ns, robot + "/imu") + struct.pack("<37d", *range(37))


def build_burst(stamp_ns, ticks=(0.0, 0.0), robot="hero_0", encoder_stamp_ns=None):
    """Return what the robot sends 29 times a second, as (name, type, payload), in its order."""
    pairs = [
        ("odom", "base_link"),
        ("base_link", "left_wheel_link"),
        ("base_link", "right_wheel_link"),
        ("base_link", "hat_link"),
        ("base_link", "laser_link"),
    ]
    transforms = [
        build_transform_message(build_transform(stamp_ns, robot + "/" + parent, robot + "/" + child))
        for parent, child in pairs
    ]
    encoder_stamp_ns = stamp_ns if encoder_stamp_ns is None else encoder_stamp_ns
    return [
        ("/%s/odom" % robot, "nav_msgs/Odometry", build_odometry(stamp_ns, robot=robot)),
        *(("/tf", "tf2_msgs/TFMessage", transform) for transform in transforms),
        ("/%s/encoder" % robot, "hero_msgs/Encoder", build_encoder(encoder_stamp_ns, *ticks, robot=robot)),
    ]


# Reading what comes out.


def read_stamp_ns(payload, offset=4):
    """Return the stamp of a message that begins with a header."""
    secs, nsecs = struct.unpack_from("<II", payload, offset)
    return secs * NS_PER_S + nsecs


def read_seq(payload):
    """Return the sequence number of a message that begins with a header."""
    return struct.unpack_from("<I", payload)[0]


def read_texts(payload, offset, count):
    """Return count strings at offset and where they end."""
    texts = []
    for _ in range(count):
        length = struct.unpack_from("<I", payload, offset)[0]
        texts.append(payload[offset + 4 : offset + 4 + length].decode("latin-1"))
        offset += 4 + length
    return texts, offset


def read_odometry(payload):
    """Return (frame_id, child_frame_id, x, y, yaw, linear, turn, pose covariance, twist covariance)."""
    (frame_id, child_frame_id), offset = read_texts(payload, 12, 2)
    numbers = struct.unpack_from("<85d", payload, offset)
    assert offset + 85 * 8 == len(payload)
    yaw_rad = 2.0 * math.atan2(numbers[5], numbers[6])
    pose_covariance, twist, twist_covariance = numbers[7:43], numbers[43:49], numbers[49:]
    return (frame_id, child_frame_id, *numbers[:2], yaw_rad, twist[0], twist[5], pose_covariance, twist_covariance)


def read_transform(transform):
    """Return (stamp, parent, child, x, y, yaw) of a geometry_msgs/TransformStamped."""
    (parent, child), offset = read_texts(transform, 12, 2)
    numbers = struct.unpack_from("<7d", transform, offset)
    assert offset + 56 == len(transform)
    return read_stamp_ns(transform), parent, child, numbers[0], numbers[1], 2.0 * math.atan2(numbers[5], numbers[6])


def read_scan(payload):
    """Return (frame_id, seven numbers, ranges, intensities) of a sensor_msgs/LaserScan."""
    (frame_id,), offset = read_texts(payload, 12, 1)
    numbers = struct.unpack_from("<7f", payload, offset)
    count = struct.unpack_from("<I", payload, offset + 28)[0]
    ranges_m = struct.unpack_from("<%df" % count, payload, offset + 32)
    offset += 32 + 4 * count
    intensity_count = struct.unpack_from("<I", payload, offset)[0]
    intensities = struct.unpack_from("<%df" % intensity_count, payload, offset + 4)
    assert offset + 4 + 4 * intensity_count == len(payload)
    return frame_id, numbers, ranges_m, intensities
