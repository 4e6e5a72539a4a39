"""Drives robots with a joystick on /joy while the enable button is held; other buttons choose one, or stop all."""

from hero_client import Program, ProgramError, open_swarm, read_parameters
from hero_client.apps.joystick_teleop import JoystickMapping, JoystickTeleop
from hero_client.values import MAX_ANGULAR_RAD_S, MAX_LINEAR_M_S
from hero_node.parameters import number, robot_ids, whole_number


def main():
    with Program("teleop_joy", anonymous=True) as program:
        parameters = read_parameters(
            {
                "robots": robot_ids("0"),
                "linear_m_s": number(0.15, 0.02, MAX_LINEAR_M_S, "m/s"),
                "angular_rad_s": number(2.0, 0.25, MAX_ANGULAR_RAD_S, "rad/s"),
                "linear_axis": whole_number(1, 0, 63),
                "angular_axis": whole_number(0, 0, 63),
                "enable_button": whole_number(4, 0, 63),
                "stop_button": whole_number(1, 0, 63),
                "next_button": whole_number(5, 0, 63),
            }
        )
        ids = parameters.pop("robots")
        for name in ("enable_button", "next_button"):
            if parameters["stop_button"] == parameters[name]:
                raise ProgramError("~stop_button is %d, the same as ~%s" % (parameters[name], name))
        with open_swarm(program, ids, odom=False, proximity=False) as swarm:
            JoystickTeleop(swarm, JoystickMapping(**parameters)).run(program)
