"""Poses, velocities and angles in the plane: those of hero_node, which the driver and the simulator share. Pure."""

from hero_node.geometry import (
    STOP,
    Pose,
    Velocity,
    clamp,
    invert_pose,
    measure_distance,
    transform_pose,
    wrap_angle,
    yaw_of,
)

__all__ = [
    "STOP",
    "Pose",
    "Velocity",
    "clamp",
    "invert_pose",
    "measure_distance",
    "transform_pose",
    "wrap_angle",
    "yaw_of",
]
