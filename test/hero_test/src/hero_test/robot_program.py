"""A program for one robot, as users write it: the same function is given robots over ROS and robots in process."""


def go_around(robot):
    """Drive and look as most programs do, over all that a Robot offers; return its pose, 0.06 m ahead of the start."""
    robot.wait_until_ready()
    robot.set_pose(0.0, 0.0, 0.0)
    robot.led("green")
    robot.forward(0.03)
    robot.turn(0.3)
    motion = robot.start_go_to(0.06, 0.0)
    for _ in robot.rate(10):
        if motion.done():
            break
    motion.result()
    robot.blink("red", 0.4)
    for time_s in robot.rate(10):
        nearest = robot.nearest()
        if time_s > 0.5 or (nearest is not None and nearest.range_m < 0.15):
            break
        front_m, left_m, *_, right_m = robot.proximity
        robot.drive(0.0, 0.5 if left_m >= right_m and front_m > 0.1 else -0.5)
    robot.stop()
    robot.sleep(0.2)
    return robot.pose
