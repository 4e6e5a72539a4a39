"""Drives robots to goals from parameters, from the topics /hero_N/goal and from the actions /hero_N/go_to."""

import rospy

from hero_client import GoToGoalServer, Program, ProgramError, open_swarm, read_parameters
from hero_client.controllers import DEFAULT_TIMEOUT_S, DEFAULT_TOLERANCE_M, Goal
from hero_node.parameters import flag, number, parse_poses, robot_ids


def main():
    with Program("go_to_goal") as program:
        parameters = read_parameters(
            {
                "robots": robot_ids("0"),
                "goals": "",
                "frame": "",
                "tolerance_m": number(DEFAULT_TOLERANCE_M, 0.002, 1.0, "m"),
                "timeout_s": number(DEFAULT_TIMEOUT_S, 1.0, 3600.0, "s"),
                "avoid": flag(False),
                "once": flag(False),
            }
        )
        ids, once = parameters["robots"], parameters["once"]
        goals = parse_poses("goals", parameters["goals"], ids)
        if once and not goals:
            raise ProgramError("~once is true, but ~goals is empty: there is nothing to do")

        with open_swarm(program, ids) as swarm:
            options = [parameters[name] for name in ("tolerance_m", "timeout_s", "avoid")]
            servers = [GoToGoalServer(robot, *options) for robot in swarm]
            for server in servers:
                if server.robot.robot_id in goals:
                    server.put_goal(Goal(*goals[server.robot.robot_id]), parameters["frame"])
            rospy.loginfo("awaiting goals on %s", ", ".join(robot.namespace + "/goal" for robot in swarm))

            while program.sleep(0.1) and not (once and not any(server.busy for server in servers)):
                swarm.report_missing({s.robot.name: s.robot.missing() if s.busy else None for s in servers})
            for server in servers:
                server.give_up()  # all robots stop at the same time
            for server in servers:
                server.close()
            return 1 if once and not all(server.reached for server in servers) else 0
