"""Node follow: a chain of robots, each of which keeps behind the one before it; the first is led by anyone."""

from typing import Dict, List, NamedTuple, Optional

import rospy

from hero_client.common_frame import DEFAULT_FRAME, CommonFrame, parse_starts
from hero_client.control_laws import STANDSTILL, FollowLaw, Pose, follow
from hero_client.program import Program, ProgramError, check_number, parse_robot_ids, read_parameters, run
from hero_client.robot import MAX_LINEAR_M_S
from hero_client.swarm import Swarm
from hero_client.swarm_start import WaitReport

RATE_HZ = 10.0


class Parameters(NamedTuple):
    """The checked parameters of the node."""

    robot_ids: List[int]
    frame: str
    starts: Optional[Dict[int, Pose]]
    law: FollowLaw


def load_parameters() -> Parameters:
    """Return the node's private parameters. Raises: ProgramError."""
    law = FollowLaw()
    given = read_parameters(
        {
            "robots": "0 1",
            "frame": DEFAULT_FRAME,
            "starts": "",
            "gap_m": law.gap_m,
            "linear_m_s": law.max_linear_m_s,
        }
    )
    robot_ids = parse_robot_ids("robots", given["robots"])
    if robot_ids is None or len(robot_ids) < 2:
        raise ProgramError("~robots is %r, but must name a leader and at least one follower" % (given["robots"],))
    law = law._replace(
        gap_m=check_number("gap_m", given["gap_m"], 0.10, 2.0, "m"),
        max_linear_m_s=check_number("linear_m_s", given["linear_m_s"], 0.01, MAX_LINEAR_M_S, "m/s"),
    )
    return Parameters(robot_ids, str(given["frame"]), parse_starts(given["starts"], robot_ids), law)


def follow_leader(program: Program, parameters: Parameters, swarm: Swarm) -> None:
    """Let each robot but the first follow the one before it, until the program is to end."""
    common = CommonFrame(parameters.frame, parameters.starts)
    report = WaitReport()
    rospy.loginfo("%s leads, and %s follow", swarm.robots[0].name, ", ".join(r.name for r in swarm.robots[1:]))
    while program.pace(1.0 / RATE_HZ):
        poses = [common.pose_of(robot) for robot in swarm]
        for robot, pose, leader in zip(swarm.robots[1:], poses[1:], poses):
            known = pose is not None and leader is not None
            robot.drive(*(follow(pose, leader, parameters.law) if known else STANDSTILL))
        report.update(common.missing)
    common.close()


def _main() -> None:
    with Program("follow") as program:
        parameters = load_parameters()
        # The leader is never driven from here, so the swarm's end does not stop it: whoever leads it may go on.
        with Swarm(parameters.robot_ids, proximity=False) as swarm:
            follow_leader(program, parameters, swarm)


def main() -> None:
    """Run the node."""
    run(_main)
