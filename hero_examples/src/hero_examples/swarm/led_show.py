"""Shows a pattern of colors that runs over the swarm."""

import colorsys

import rospy

from hero_client import Program, open_swarm, read_parameters
from hero_node.parameters import choice, number, robot_ids


def rainbow(phase, share, lit):
    return colorsys.hsv_to_rgb((phase + share) % 1.0, 1.0, 1.0)


def chase(phase, share, lit):
    return (1.0, 1.0, 1.0) if lit else (0.0, 0.0, 0.0)


def blink(phase, share, lit):
    return (1.0, 0.0, 0.0) if phase < 0.5 else (0.0, 0.0, 1.0)


PATTERNS = {"rainbow": rainbow, "chase": chase, "blink": blink}


def step(swarm, pattern, phase, brightness=1.0):
    """Show every robot its color at a phase 0..1 of the pattern."""
    for place, robot in enumerate(swarm):
        color = pattern(phase, place / len(swarm), int(phase * len(swarm)) == place)
        robot.led([part * brightness for part in color])


def main():
    with Program("led_show") as program:
        parameters = read_parameters(
            {
                "robots": robot_ids("all"),
                "pattern": choice("rainbow", list(PATTERNS)),
                "period_s": number(4.0, 0.5, 60.0, "s"),
                "brightness": number(1.0, 0.0, 1.0),
            }
        )
        pattern = PATTERNS[parameters["pattern"]]
        with open_swarm(program, parameters["robots"], odom=False, proximity=False) as swarm:
            rospy.loginfo("%s on %s", parameters["pattern"], ", ".join(robot.name for robot in swarm))
            for time_s in program.rate(5):  # Hz
                step(swarm, pattern, time_s / parameters["period_s"] % 1.0, parameters["brightness"])
                swarm.report_missing()
            swarm.led("off")
