"""A chain of robots: each follows the one named before it. Drive the first one yourself."""

import rospy

from hero_client import CommonFrame, Program, ProgramError, Swarm, read_parameters
from hero_client.controllers import FollowLaw, Lateness, follow
from hero_client.values import MAX_LINEAR_M_S
from hero_node import STOP
from hero_node.parameters import number, robot_ids


def step(swarm, common, law, lateness):
    """Send every robot but the first its next command; call it ten times per second."""
    lateness.step(swarm.now_s)
    poses = [common.pose_of(robot) for robot in swarm]
    for robot, pose, leader_pose in zip(swarm.robots[1:], poses[1:], poses):
        known = pose is not None and leader_pose is not None
        robot.drive(*(lateness.slow(follow(pose, leader_pose, law), robot.age_s("odom")) if known else STOP))
    warning = lateness.take_warning()
    if warning:
        rospy.logwarn(warning)


def main():
    with Program("follow") as program:
        parameters = read_parameters(
            {
                "robots": robot_ids("0 1"),
                "frame": "world",
                "gap_m": number(FollowLaw().gap_m, 0.10, 2.0, "m"),
                "linear_m_s": number(FollowLaw().max_linear_m_s, 0.01, MAX_LINEAR_M_S, "m/s"),
            }
        )
        ids = parameters["robots"]
        if ids is None or len(ids) < 2:
            raise ProgramError(f"~robots is {ids or 'all'!r}, but must name a leader and at least one follower")
        law = FollowLaw(gap_m=parameters["gap_m"], max_linear_m_s=parameters["linear_m_s"])
        common, lateness = CommonFrame(parameters["frame"]), Lateness()

        # The leader is never driven from here, so leaving the swarm does not stop it.
        with Swarm(ids, proximity=False) as swarm:
            leader, *followers = swarm
            rospy.loginfo("%s leads %s", leader.name, ", ".join(robot.name for robot in followers))
            for _ in program.rate(10):  # Hz
                step(swarm, common, law, lateness)
                swarm.report_missing(common.missing)
