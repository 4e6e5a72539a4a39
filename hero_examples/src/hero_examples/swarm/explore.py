"""Robots drive to frontiers of the map, and walk at random there: see map_arena in hero_localization."""

import math
import random

import rospy
from geometry_msgs.msg import PoseArray

from hero_client import CommonFrame, Program, open_swarm, read_parameters
from hero_client.controllers import Goal, GoToGoalController, Lateness, State, WanderMemory, shorten_for_body, wander
from hero_client.values import is_blind
from hero_node import STOP
from hero_node.parameters import flag, number, robot_ids, whole_number

NEAR_M = 0.35
"""So near to a frontier a robot walks at random: its eight beams leave gaps, which only motion fills."""

APART_M = 0.3
"""Goals of two robots are further apart than this."""

TIMEOUT_S = 30.0


class Explorer:
    """One robot; call step() ten times per second."""

    def __init__(self, robot, common, seed=None):
        """common: frame of the map; seed: of the random walk."""
        self.robot, self.common = robot, common
        self.random = random.Random(seed)
        self.memory = WanderMemory()
        self.lateness = Lateness()
        self.controller = None
        self.failed = []

    @property
    def goal(self):
        """The place that the robot drives to; None on a random walk."""
        return self.controller.goal[:2] if self.controller else None

    def step(self, frontiers, taken, now_s):
        """Send the next command. frontiers: places on the frontier of the map; taken: goals of the other robots."""
        pose, ranges = self.common.pose_of(self.robot), self.robot.fresh_proximity()
        command = STOP
        self.lateness.step(now_s)
        if is_blind(ranges):
            self.common.missing[self.robot.name] = self.robot.missing_ranges()
        elif pose is not None:
            self.choose(pose, frontiers, taken, now_s)
            ranges = shorten_for_body(ranges, self.robot.model.body_radius_m)
            age_s = self.robot.age_s("odom")
            if self.controller:
                command = self.controller.step(pose, ranges, now_s, pose_age_s=age_s)
            else:
                command, self.memory = wander(ranges, self.memory, self.random.random())
                command = self.lateness.slow(command, age_s)
        self.robot.drive(*command)
        self.robot.led("green" if self.controller else "yellow")

    def choose(self, pose, frontiers, taken, now_s):
        """Keep the goal while it is a frontier, or take the nearest that no other robot has."""
        if self.controller and self.controller.state is State.FAILED:
            self.failed = [*self.failed[-4:], self.goal]
        elif self.controller and is_near(self.goal, frontiers, APART_M / 2.0):
            if not is_near(self.goal, [pose[:2]], NEAR_M):
                return
        self.controller = None
        if not is_near(pose[:2], frontiers, NEAR_M):
            free = [place for place in frontiers if not is_near(place, [*taken, *self.failed], APART_M)]
            nearest = min(free, key=lambda place: math.dist(place, pose[:2]), default=None)
            self.controller = nearest and GoToGoalController(Goal(*nearest), now_s, timeout_s=TIMEOUT_S, avoid=True)


def is_near(place, others, distance_m):
    return any(math.dist(place, other) < distance_m for other in others)


def explore_together(explorers, frontiers, now_s):
    """Step all explorers; log if they are late."""
    for explorer in explorers:
        taken = [other.goal for other in explorers if other is not explorer and other.goal]
        explorer.step(frontiers, taken, now_s)
    for warning in {(explorer.controller or explorer).lateness.take_warning() for explorer in explorers} - {""}:
        rospy.logwarn(warning)


def main():
    with Program("explore") as program:
        parameters = read_parameters(
            {
                "robots": robot_ids("all"),
                "frame": "map",
                "frontiers_topic": "/map_arena/frontiers",
                "once": flag(False),
                "idle_s": number(10.0, 1.0, 3600.0, "s"),
                "seed": whole_number(-1, -1, 2**31),
            }
        )
        common, seed, newest = CommonFrame(parameters["frame"]), parameters["seed"], []
        rospy.Subscriber(parameters["frontiers_topic"], PoseArray, lambda message: newest.append(message), queue_size=1)
        with open_swarm(program, parameters["robots"]) as swarm:
            swarm.wait_for_poses(common, program)
            rospy.loginfo("%s explore", ", ".join(robot.name for robot in swarm))
            explorers = [Explorer(robot, common, None if seed < 0 else seed + robot.robot_id) for robot in swarm]
            busy_s = program.now_s
            for _ in program.rate(10):  # Hz
                del newest[:-1]
                frontiers = [(pose.position.x, pose.position.y) for message in newest for pose in message.poses]
                explore_together(explorers, frontiers, program.now_s)
                swarm.report_missing(common.missing)
                busy_s = program.now_s if frontiers or not newest else busy_s
                if parameters["once"] and program.now_s > busy_s + parameters["idle_s"]:
                    break
            swarm.led("off")
