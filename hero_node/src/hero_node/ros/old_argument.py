"""Ends a launch file with one line: an argument of the stock packages that is not read here, and what to give instead.

<node pkg="hero_node" type="old_argument" name="..." args="ARGUMENT is not read: REMEDY" required="true"/>
"""

import argparse

import rospy

from ..errors import ProgramError


def main() -> None:
    """Raise what the arguments say."""
    parser = argparse.ArgumentParser(prog="old_argument", description="End with one line, from a launch file.")
    parser.add_argument("word", nargs="+", help="of the line")
    raise ProgramError(" ".join(parser.parse_args(rospy.myargv()[1:]).word))
