"""Drives a swarm into a formation without collisions; lights are yellow on the way and green in place."""

import rospy

from hero_client import CommonFrame, Program, ProgramError, open_swarm, read_parameters
from hero_client.apps.formations import assign_goals, place_formation
from hero_client.controllers import AvoidanceLaw, SwarmGoToController
from hero_client.values import MAX_LINEAR_M_S
from hero_node.parameters import flag, number, robot_ids

STEP_HZ = 10.0


class Formation:
    """A swarm on its way to one goal for each robot; call step() at STEP_HZ.

    Attributes:
        done: whether all robots have been in place at once.
    """

    def __init__(self, swarm, common, goals, law, tolerance_m=0.01, timeout_s=120.0):
        self.swarm, self.common, self.timeout_s = swarm, common, timeout_s
        self.controller = SwarmGoToController(goals, law, 1.0 / STEP_HZ, tolerance_m)
        self.done = False

    def step(self, elapsed_s):
        """Send every robot its next command; elapsed_s: since the start. Raises: ProgramError after timeout_s."""
        self.swarm.step_to_goals(self.controller, self.common)
        for robot, arrived in zip(self.swarm, self.controller.arrived):
            robot.led("green" if arrived else "yellow")
        late = [robot.name for robot, arrived in zip(self.swarm, self.controller.arrived) if not arrived]
        if not self.done and not late:
            self.done = True
            rospy.loginfo("formation complete after %.1f s", elapsed_s)
        if not self.done and elapsed_s > self.timeout_s:
            raise ProgramError(f"after {self.timeout_s:g} s not in place: {', '.join(late)}")


def main():
    with Program("swarm_go_to") as program:
        parameters = read_parameters(
            {
                "robots": robot_ids("all"),
                "formation": {"shape": "circle"},
                "frame": "world",
                "linear_m_s": number(AvoidanceLaw().max_linear_m_s, 0.01, MAX_LINEAR_M_S, "m/s"),
                "tolerance_m": number(0.01, 0.005, 0.1, "m"),
                "timeout_s": number(120.0, 1.0, 3600.0, "s"),
                "assign": flag(True),
                "once": flag(False),
            }
        )
        ids, wanted = parameters["robots"], parameters["formation"]
        law = AvoidanceLaw(max_linear_m_s=parameters["linear_m_s"])
        place_formation(wanted, len(ids or [0]), law.min_spacing_m)  # fails before robots are waited for
        common = CommonFrame(parameters["frame"])
        with open_swarm(program, ids) as swarm:
            poses = swarm.wait_for_poses(common, program)
            law = law._replace(body_m=swarm.max_body_radius_m)
            goals = place_formation(wanted, len(swarm), law.min_spacing_m)
            if parameters["assign"]:
                goals = [goals[index] for index in assign_goals([pose[:2] for pose in poses], goals)]
            formation = Formation(swarm, common, goals, law, parameters["tolerance_m"], parameters["timeout_s"])
            for time_s in program.rate(STEP_HZ):
                formation.step(time_s)
                if formation.done and parameters["once"]:
                    break
            return 1 if parameters["once"] and not formation.done else 0
