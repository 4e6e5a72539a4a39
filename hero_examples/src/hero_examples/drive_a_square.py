"""Drives robot 0 along a square of 0.2 m, by its odometry."""

import math

from hero_client import Robot

SIDE_M = 0.2


def main() -> None:
    with Robot(0) as robot:
        robot.wait_until_ready()
        start = robot.pose
        for corner in range(1, 5):
            angle_rad, here = start.yaw_rad + corner * math.pi / 2.0, robot.pose
            robot.go_to(here.x_m + SIDE_M * math.cos(angle_rad), here.y_m + SIDE_M * math.sin(angle_rad))


if __name__ == "__main__":
    main()
