"""Turns robot 0 slowly on the spot for ten seconds and prints what its sensors see."""

from hero_client import BaseRobot, Robot, rate


def step(robot: BaseRobot) -> None:
    robot.drive(0.0, 0.6)  # the robot obeys one command for about 2 s
    print("pose: x %.2f m, y %.2f m, yaw %.2f rad" % robot.pose)
    print("ranges from the front, counter-clockwise, m:", [f"{range_m:.2f}" for range_m in robot.proximity])
    print("nearest:", robot.nearest())


def main() -> None:
    with Robot(0) as robot:
        robot.wait_until_ready()
        for time_s in rate(2):  # Hz
            if time_s >= 10.0:
                break
            step(robot)


if __name__ == "__main__":
    main()
