"""Node swarm_go_to: a formation -> every robot in a place of it, without collisions."""

import sys
import time
from typing import Any, Dict, List, NamedTuple, Optional

import rospy
import yaml

from hero_client.assignment import assign_goals
from hero_client.common_frame import DEFAULT_FRAME, CommonFrame, parse_starts
from hero_client.control_laws import STANDSTILL, Pose
from hero_client.formations import FormationError, Point, place_formation
from hero_client.program import (
    Program,
    ProgramError,
    check_flag,
    check_number,
    parse_robot_ids,
    read_parameters,
    run,
)
from hero_client.reciprocal import AvoidanceLaw
from hero_client.robot import MAX_LINEAR_M_S
from hero_client.swarm import Swarm
from hero_client.swarm_start import WaitReport, open_swarm
from hero_client.swarm_steering import SwarmSteering

RATE_HZ = 10.0

LED_PERIOD_S = 2.0


class Parameters(NamedTuple):
    """The checked parameters of the node."""

    robot_ids: Optional[List[int]]
    formation: Dict[str, Any]
    frame: str
    starts: Optional[Dict[int, Pose]]
    law: AvoidanceLaw
    tolerance_m: float
    timeout_s: float
    assign: bool
    once: bool
    seed: int


def load_parameters() -> Parameters:
    """Return the node's private parameters. Raises: ProgramError."""
    law = AvoidanceLaw()
    given = read_parameters(
        {
            "robots": "all",
            "formation": {"shape": "circle"},
            "frame": DEFAULT_FRAME,
            "starts": "",
            "linear_m_s": law.max_linear_m_s,
            "tolerance_m": 0.01,
            "timeout_s": 120.0,
            "assign": True,
            "once": False,
            "seed": 0,
        }
    )
    robot_ids = parse_robot_ids("robots", given["robots"])
    seed = given["seed"]
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ProgramError("~seed is %r, but must be a whole number, 0 or more" % (seed,))
    law = law._replace(
        max_linear_m_s=check_number("linear_m_s", given["linear_m_s"], 0.01, MAX_LINEAR_M_S, "m/s")
    )
    formation = read_formation(given["formation"])
    if robot_ids is not None:
        place_robots(formation, len(robot_ids), law)  # what cannot work is told before robots are waited for
    return Parameters(
        robot_ids,
        formation,
        str(given["frame"]),
        parse_starts(given["starts"], robot_ids),
        law,
        check_number("tolerance_m", given["tolerance_m"], 0.005, 0.1, "m"),
        check_number("timeout_s", given["timeout_s"], 1.0, 3600.0, "s"),
        check_flag("assign", given["assign"]),
        check_flag("once", given["once"]),
        seed,
    )


def read_formation(value: Any) -> Dict[str, Any]:
    """Return the formation as a table; text is read as YAML, for the command line.

    Raises: ProgramError if it is none.
    """
    if isinstance(value, str):
        try:
            value = yaml.safe_load(value)
        except yaml.YAMLError as error:
            raise ProgramError("~formation is not YAML: %s" % " ".join(str(error).split())) from None
    if not isinstance(value, dict):
        raise ProgramError("~formation is %r, but must be a table such as {shape: circle, spacing_m: 0.3}" % (value,))
    return value


def wait_for_poses(program: Program, common: CommonFrame, swarm: Swarm) -> List[Pose]:
    """Return the poses of all robots as soon as all are known, saying which are waited for.

    Raises: ProgramError if the program is to end before.
    """
    report = WaitReport()
    while program.pace(1.0 / RATE_HZ):
        poses = [common.pose_of(robot) for robot in swarm]
        known = [pose for pose in poses if pose is not None]
        report.update(common.missing)
        if len(known) == len(poses):
            return known
    raise ProgramError("ended before all robots were there")


def place_robots(formation: Dict[str, Any], count: int, law: AvoidanceLaw) -> List[Point]:
    """Return a place for each of count robots. Raises: ProgramError."""
    try:
        return place_formation(formation, count, 2.0 * law.radius_m + 0.02)
    except FormationError as error:
        raise ProgramError("~%s" % error) from None


def choose_goals(parameters: Parameters, poses: List[Pose]) -> List[Point]:
    """Return a goal for each robot. Raises: ProgramError."""
    places = place_robots(parameters.formation, len(poses), parameters.law)
    if not parameters.assign:
        return places[: len(poses)]
    order = assign_goals([(pose.x_m, pose.y_m) for pose in poses], places)
    return [places[index] for index in order]


def form(program: Program, parameters: Parameters, swarm: Swarm) -> bool:
    """Bring the swarm into its formation; return whether all are there."""
    common = CommonFrame(parameters.frame, parameters.starts)
    poses = wait_for_poses(program, common, swarm)
    goals = choose_goals(parameters, poses)
    for robot, goal in zip(swarm, goals):
        rospy.loginfo("%s goes to (%.3f, %.3f) in %s", robot.name, goal[0], goal[1], parameters.frame)
    steering = SwarmSteering(goals, parameters.law, 1.0 / RATE_HZ, parameters.seed, parameters.tolerance_m)
    report = WaitReport()
    start_s = time.monotonic()
    next_led_s = start_s
    done = False
    while program.pace(1.0 / RATE_HZ):
        now_s = time.monotonic()
        known = [common.pose_of(robot) for robot in swarm]
        report.update(common.missing)
        # A robot that is silent may be anywhere: then all stand until it is back.
        complete = all(pose is not None for pose in known)
        poses = [new if new is not None else old for new, old in zip(known, poses)]
        ranges = [robot.fresh_proximity() for robot in swarm]
        commands = steering.step(poses, ranges) if complete else [STANDSTILL] * len(poses)
        for robot, command in zip(swarm, commands):
            robot.drive(*command)
        if now_s >= next_led_s:
            next_led_s = now_s + LED_PERIOD_S
            for robot, arrived in zip(swarm, steering.arrived):
                robot.led("green" if arrived else "yellow")
        if all(steering.arrived) and complete and not done:
            done = True
            rospy.loginfo("formation complete after %.1f s", now_s - start_s)
            if parameters.once:
                return True
        if not done and now_s - start_s > parameters.timeout_s:
            late = [robot.name for robot, arrived in zip(swarm, steering.arrived) if not arrived]
            raise ProgramError("after %g s not at their places: %s" % (parameters.timeout_s, ", ".join(late)))
    return done


def _main() -> None:
    with Program("swarm_go_to") as program:
        parameters = load_parameters()
        with open_swarm(program, parameters.robot_ids) as swarm:
            reached = form(program, parameters, swarm)
        if parameters.once and not reached:
            sys.exit(1)


def main() -> None:
    """Run the node."""
    run(_main)
