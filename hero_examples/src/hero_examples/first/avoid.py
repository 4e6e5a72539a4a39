"""Drives robot 0 forward and turns it away from what it sees, until Ctrl-C."""

from hero_client import BaseRobot, Robot, rate


def step(robot: BaseRobot) -> None:
    if robot.stop_if_blind():  # its sensors are not calibrated
        return
    front, front_left, *_, front_right = robot.proximity  # m, at 0, 45 and -45 degrees; inf: nothing, nan: not known
    is_blocked = not (front >= 0.15 and front_left >= 0.15 and front_right >= 0.15)  # nan is no free path
    angular_rad_s = 1.5 if front_left > front_right else -1.5
    robot.drive(0.0 if is_blocked else 0.08, angular_rad_s if is_blocked else 0.0)


def main() -> None:
    with Robot(0) as robot:
        robot.wait_until_ready()
        for _ in rate(10):  # Hz
            step(robot)


if __name__ == "__main__":
    main()
