"""Drives robot 0 to 0.15 m from the nearest obstacle, and keeps that distance, until Ctrl-C."""

import math

from hero_client import BaseRobot, Robot, rate


def step(robot: BaseRobot) -> None:
    if robot.stop_if_blind():  # its sensors are not calibrated
        return
    nearest = robot.nearest()
    if nearest is None:
        robot.drive(0.05, 0.0)  # the sensors see 0.24 m far
    else:
        robot.drive(0.8 * (nearest.range_m - 0.15) * math.cos(nearest.bearing_rad), 1.5 * nearest.bearing_rad)


def main() -> None:
    with Robot(0) as robot:
        robot.wait_until_ready()
        for _ in rate(10):  # Hz
            step(robot)


if __name__ == "__main__":
    main()
