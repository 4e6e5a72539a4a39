"""Drives a swarm into a formation without collisions; lights are yellow on the way and green in place."""

import time

import rospy

from hero_client import CommonFrame, Program, ProgramError, open_swarm, read_parameters, run
from hero_client.controllers.orca import AvoidanceLaw
from hero_client.controllers.swarm_go_to import SwarmGoToController
from hero_client.formations import assign_goals, place_formation
from hero_client.parameters import flag, number, parse_poses, robot_ids, whole_number
from hero_client.robot_constants import MAX_LINEAR_M_S


def form():
    with Program("swarm_go_to") as program:
        parameters = read_parameters(
            {
                "robots": robot_ids("all"),
                "formation": {"shape": "circle"},
                "frame": "world",
                "starts": "",
                "linear_m_s": number(AvoidanceLaw().max_linear_m_s, 0.01, MAX_LINEAR_M_S, "m/s"),
                "tolerance_m": number(0.01, 0.005, 0.1, "m"),
                "timeout_s": number(120.0, 1.0, 3600.0, "s"),
                "assign": flag(True),
                "once": flag(False),
                "seed": whole_number(0, 0, 2**31),
            }
        )
        ids, formation = parameters["robots"], parameters["formation"]
        law = AvoidanceLaw(max_linear_m_s=parameters["linear_m_s"])
        place_formation(formation, len(ids or [0]), law.min_spacing_m)  # fails before robots are waited for
        common = CommonFrame(parameters["frame"], parse_poses("starts", parameters["starts"], ids))
        with open_swarm(program, ids) as swarm:
            poses = common.wait_for_poses(program, swarm)
            goals = place_formation(formation, len(swarm), law.min_spacing_m)
            if parameters["assign"]:
                goals = [goals[index] for index in assign_goals([pose[:2] for pose in poses], goals)]
            controller = SwarmGoToController(goals, law, 0.1, parameters["seed"], parameters["tolerance_m"])
            start_s, done = time.monotonic(), False
            while not (done and parameters["once"]) and program.pace(0.1):
                poses = [common.pose_of(robot) for robot in swarm]
                swarm.report_missing(common.missing)
                commands = controller.step(poses, [robot.fresh_proximity() for robot in swarm])
                for robot, command, arrived in zip(swarm, commands, controller.arrived):
                    robot.drive(*command)
                    robot.led("green" if arrived else "yellow")
                late = [robot.name for robot, arrived in zip(swarm, controller.arrived) if not arrived]
                if not done and not late and None not in poses:
                    done = True
                    rospy.loginfo("formation complete after %.1f s", time.monotonic() - start_s)
                if not done and time.monotonic() - start_s > parameters["timeout_s"]:
                    raise ProgramError("after %g s not in place: %s" % (parameters["timeout_s"], ", ".join(late)))
            return 1 if parameters["once"] and not done else 0


def main():
    run(form)
