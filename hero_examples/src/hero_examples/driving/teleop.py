"""Drives robots with the keys of a terminal; the robot stops when no key comes."""

from hero_client import Program, open_swarm, read_parameters
from hero_client.apps.keyboard import Keyboard
from hero_client.apps.keyboard_teleop import (
    MAX_KEY_ANGULAR_RAD_S,
    MIN_KEY_ANGULAR_RAD_S,
    MIN_LINEAR_M_S,
    KeyboardTeleop,
)
from hero_client.values import MAX_LINEAR_M_S
from hero_node.parameters import number, robot_ids


def main():
    with Program("teleop", anonymous=True) as program:
        parameters = read_parameters(
            {
                "robots": robot_ids("0"),
                "linear_m_s": number(0.10, MIN_LINEAR_M_S, MAX_LINEAR_M_S, "m/s"),
                "angular_rad_s": number(1.5, MIN_KEY_ANGULAR_RAD_S, MAX_KEY_ANGULAR_RAD_S, "rad/s"),
            }
        )
        with Keyboard() as keyboard, open_swarm(program, parameters["robots"]) as swarm:
            KeyboardTeleop(swarm, parameters["linear_m_s"], parameters["angular_rad_s"]).run(program, keyboard)
