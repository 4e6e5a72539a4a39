"""Programs send a stop once: nothing is lost by it, whatever the program does next. These robots have no watchdogs."""

import contextlib

import pytest
from geometry_msgs.msg import Twist
from rig import start_python

from hero_test.driver_case import make_command, make_publisher
from hero_test.fake_robot import READ_CYCLE_S, FakeRobot
from hero_test.waiting import wait_for

PARTS = ("group", "teleop", "monitor", "calibration")
REGULAR_COMMANDS = 12


@contextlib.contextmanager
def joined_robots(driver, first):
    """Give a robot for each part of the suite, by its name."""
    numbers = enumerate(PARTS, first)
    robots = {part: FakeRobot(number, read_cycle_s=READ_CYCLE_S, has_motors=True) for number, part in numbers}
    for robot in robots.values():
        robot.connect(driver.address)
    for robot in robots.values():
        driver.fleet.wait_ready(robot.namespace)
    yield robots
    for robot in robots.values():
        robot.close()


def list_moving(robots):
    """Return the parts of the suite whose robots move."""
    return [part for part, robot in robots.items() if robot.motors.is_turning]


@pytest.mark.parametrize("end", ["KILL", "STOP"])
def test_a_single_stop_of_a_program_that_dies_or_hangs_then_is_enough(start_driver, record, end):
    with joined_robots(start_driver(), 40) as robots, contextlib.ExitStack() as stack:
        programs = [
            stack.enter_context(start_python("single_stop.py", part, robot.name, end)) for part, robot in robots.items()
        ]
        for part, robot in robots.items():
            wait_for(lambda robot=robot: len(robot.velocities) > REGULAR_COMMANDS, part + " to drive its robot")
        wait_for(lambda: list_moving(robots) == list(PARTS), "all robots to move")
        for program in programs:
            program.process.stdin.write("\n")
            program.process.stdin.flush()
        wait_for(lambda: not list_moving(robots), lambda: f"rest of the robots of {list_moving(robots)}")
    record(f"a program that gets SIG{end} after it published a stop once", len(PARTS), len(PARTS))


def test_a_single_stop_on_a_new_connection_arrives(start_driver, record):
    """A calibration drives no robot before the driver is connected to all its topics."""
    with joined_robots(start_driver(), 50) as robots, contextlib.ExitStack() as stack:
        del robots["calibration"]
        for robot in robots.values():
            make_publisher(robot.namespace + "/velocity_controller/cmd_vel", Twist).publish(make_command(0.05))
        wait_for(lambda: list_moving(robots) == list(robots), "all robots to move")
        for part, robot in robots.items():
            stack.enter_context(start_python("single_stop.py", part, robot.name, "CONT", "first"))
        wait_for(lambda: not list_moving(robots), lambda: f"rest of the robots of {list_moving(robots)}")
    record("a stop that is the first that a program publishes", 3, 3)
