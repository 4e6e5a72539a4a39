"""Drives robot 0 forward for two seconds, then turns it to the left."""

from hero_client import BaseRobot, Robot


def move(robot: BaseRobot) -> None:
    robot.wait_until_ready()
    robot.drive(0.1, 0.0, duration_s=2.0)  # m/s forward, rad/s to the left
    robot.drive(0.0, 1.5, duration_s=1.0)


def main() -> None:
    with Robot(0) as robot:  # at the end, also after an error, the robot is stopped
        move(robot)


if __name__ == "__main__":
    main()
