"""Programs of the stock package hero_examples that have another name here: says which."""

import os
import sys

from hero_node import ProgramError

NEW_NAMES = {
    "blink.py": "rosrun hero_examples led_show",
    "blink_controller.py": "rosrun hero_examples led_show",
    "blink_demo.py": "rosrun hero_examples led_show",
    "delay_measure.py": "rosrun hero_examples measure_delay",
    "hero_demo.py": "rosrun hero_examples swarm_go_to",
    "hero_ir_calib.py": "rosrun hero_calibration calibrate infrared",
    "hero_motor_calib.py": "rosrun hero_calibration calibrate motors",
    "hero_pos_demo.py": "rosrun hero_examples go_to_goal",
    "laser_disabler.py": "rostopic pub -1 /hero_0/laser_enable std_msgs/Bool false",
    "led_demo.py": "rosrun hero_examples led_show",
    "local_planner.py": "rosrun hero_examples go_to_goal _avoid:=true",
    "motor_teleop.py": "rosrun hero_examples teleop",
    "potential_field.py": "roslaunch hero_swarm behavior.launch",
    "random_walk2.py": "rosrun hero_examples random_walk",
    "rgbscreen.py": "rosrun hero_examples led_show",
    "tag2pose.py": "roslaunch hero_localization localization.launch",
}
"""Commands that do the same; random_walk.py is started by its old name, too."""


def main() -> None:
    name = os.path.basename(sys.argv[0])
    raise ProgramError(f"is a program of the stock packages; here it is: {NEW_NAMES[name]} (docs/migration.md)")
