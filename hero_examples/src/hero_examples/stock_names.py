"""Programs of the stock package hero_examples that have another name here: says which."""

import os
import sys

from hero_node import ProgramError

COMMANDS = {
    "rosrun hero_examples led_show": "blink blink_controller blink_demo led_demo rgbscreen",
    "rosrun hero_examples measure_delay": "delay_measure",
    "rosrun hero_examples swarm_go_to": "hero_demo",
    "rosrun hero_calibration calibrate infrared": "hero_ir_calib",
    "rosrun hero_calibration calibrate motors": "hero_motor_calib",
    "rosrun hero_examples go_to_goal": "hero_pos_demo",
    "rostopic pub -1 /hero_0/laser_enable std_msgs/Bool false": "laser_disabler",
    "rosrun hero_examples go_to_goal _avoid:=true": "local_planner",
    "rosrun hero_examples teleop": "motor_teleop",
    "roslaunch hero_swarm behavior.launch": "potential_field",
    "rosrun hero_examples random_walk": "random_walk2",
    "roslaunch hero_localization localization.launch": "tag2pose",
}
NEW_NAMES = {name + ".py": command for command, names in COMMANDS.items() for name in names.split()}
"""Commands that do the same; random_walk.py is started by its old name, too."""


def main() -> None:
    name = os.path.basename(sys.argv[0])
    raise ProgramError(f"is a program of the stock packages; here it is: {NEW_NAMES[name]} (docs/migration.md)")
