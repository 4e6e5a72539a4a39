"""Drives robot 0 along a square of 0.2 m with a blinking light."""

import math

from hero_client import BaseRobot, Robot


def drive_a_square(robot: BaseRobot) -> None:
    robot.blink("green", period_s=0.5)
    for _ in range(4):
        robot.forward(0.2)
        robot.turn(math.pi / 2.0)


def main() -> None:
    with Robot(0) as robot:
        drive_a_square(robot)


if __name__ == "__main__":
    main()
