"""Runs a program of the package without ROS: python3 -m hero_recording export FILE.bag."""

import sys
from importlib import import_module

from hero_node.command_line import run

PROGRAMS = ("export", "plot")


def main() -> None:
    """Run the program that the first argument names."""
    if len(sys.argv) < 2 or sys.argv[1] not in PROGRAMS:
        sys.exit("python3 -m hero_recording: the first argument must be one of: %s" % ", ".join(PROGRAMS))
    name = sys.argv.pop(1)
    run(import_module("hero_recording." + name).main)


if __name__ == "__main__":
    main()
