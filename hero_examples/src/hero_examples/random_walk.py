"""Robots walk at random and avoid obstacles; their lights show green: walking, yellow: bending away, red: turning."""

import math
import random

import rospy

from hero_client import Program, open_swarm, read_parameters, run
from hero_client.controllers import avoidance
from hero_client.parameters import number, robot_ids, whole_number
from hero_client.robot_constants import MAX_LINEAR_M_S


def walk():
    with Program("random_walk") as program:
        parameters = read_parameters(
            {
                "robots": robot_ids("0"),
                "linear_m_s": number(0.10, 0.0, MAX_LINEAR_M_S, "m/s"),
                "angular_rad_s": number(1.5, 0.1, 4.0, "rad/s"),
                "seed": whole_number(-1, -1, 2**31),
            }
        )
        cruise_m_s, seed = parameters["linear_m_s"], parameters["seed"]
        law = avoidance.WanderLaw(cruise_m_s, parameters["angular_rad_s"])

        with open_swarm(program, parameters["robots"], odom=False) as swarm:
            rospy.loginfo("random walk of %s", ", ".join(robot.name for robot in swarm))
            dice = {robot: random.Random(None if seed < 0 else seed + robot.robot_id) for robot in swarm}
            memories = {robot: avoidance.WanderMemory() for robot in swarm}
            missing = {}
            while program.pace(0.1):
                for robot in swarm:
                    ranges = robot.fresh_proximity()
                    missing[robot.name] = robot.missing()
                    if all(map(math.isnan, ranges)):
                        missing[robot.name] = missing[robot.name] or "no usable ranges: infrared calibration?"
                        command, memories[robot], color = (0.0, 0.0), avoidance.WanderMemory(), "blue"
                    else:
                        command, memories[robot] = avoidance.wander(ranges, memories[robot], dice[robot].random(), law)
                        color = "green" if command.linear_m_s >= cruise_m_s else "yellow"
                        color = "red" if memories[robot].escape_sign else color
                    robot.drive(*command)
                    robot.led(color)
                swarm.report_missing(missing)
            swarm.led("off")
    rospy.loginfo("random walk ended, robots stopped")


def main():
    run(walk)
