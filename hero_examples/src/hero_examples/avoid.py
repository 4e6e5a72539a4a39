"""Drives robot 0 forward and turns it away from what it sees, until Ctrl-C."""

import time

from hero_client import Robot


def main() -> None:
    with Robot(0) as robot:
        robot.wait_until_ready()
        while True:
            front, left, *_, right = robot.proximity  # m from the robot's centre; inf: nothing in range
            if min(front, left, right) > 0.15:
                robot.drive(0.08, 0.0)
            else:
                robot.drive(0.0, 1.5 if left > right else -1.5)
            time.sleep(0.1)


if __name__ == "__main__":
    main()
