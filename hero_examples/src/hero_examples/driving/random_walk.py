"""Robots walk at random and avoid obstacles; their lights show green: walking, yellow: bending away, red: turning."""

import random

import rospy

from hero_client import Program, open_swarm, read_parameters
from hero_client.controllers import WanderLaw, WanderMemory, shorten_for_body, wander
from hero_client.values import MAX_LINEAR_M_S, is_blind
from hero_node import STOP
from hero_node.parameters import number, robot_ids, whole_number


class Walker:
    """One robot on its walk; call step() ten times per second."""

    def __init__(self, robot, law, seed=None):
        """seed: of the random numbers; None draws one."""
        self.robot, self.law = robot, law
        self.random = random.Random(seed)
        self.memory = WanderMemory()

    def step(self):
        """Send the next command; return why the robot cannot walk, or None."""
        ranges, missing = self.robot.fresh_proximity(), self.robot.missing_ranges() or self.robot.missing()
        if is_blind(ranges):
            command, self.memory, color = STOP, WanderMemory(), "blue"
        else:
            ranges = shorten_for_body(ranges, self.robot.model.body_radius_m)
            command, self.memory = wander(ranges, self.memory, self.random.random(), self.law)
            color = "green" if command.linear_m_s >= self.law.cruise_m_s else "yellow"
            color = "red" if self.memory.escape_sign else color
        self.robot.drive(*command)
        self.robot.led(color)
        return missing


def main():
    with Program("random_walk") as program:
        parameters = read_parameters(
            {
                "robots": robot_ids("0"),
                "linear_m_s": number(0.10, 0.0, MAX_LINEAR_M_S, "m/s"),
                "angular_rad_s": number(1.5, 0.1, 4.0, "rad/s"),
                "seed": whole_number(-1, -1, 2**31),
            }
        )
        law = WanderLaw(parameters["linear_m_s"], parameters["angular_rad_s"])
        seed = parameters["seed"]

        with open_swarm(program, parameters["robots"], odom=False) as swarm:
            rospy.loginfo("random walk of %s", ", ".join(robot.name for robot in swarm))
            walkers = [Walker(robot, law, None if seed < 0 else seed + robot.robot_id) for robot in swarm]
            for _ in program.rate(10):  # Hz
                missing = {walker.robot.name: walker.step() for walker in walkers}
                swarm.report_missing(missing)
            swarm.led("off")
    rospy.loginfo("random walk ended, robots stopped")
