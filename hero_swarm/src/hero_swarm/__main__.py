"""Runs a program of the package without ROS: python3 -m hero_swarm run e.yaml."""

import sys
from importlib import import_module

from hero_node.command_line import run

PROGRAMS = {"fit": "fit", "run": "run", "report": "experiments.report", "show": "show"}


def main() -> None:
    """Run the program that the first argument names."""
    name = sys.argv[1] if len(sys.argv) > 1 else ""
    if name not in PROGRAMS:
        sys.exit("python3 -m hero_swarm: the first argument must be one of: %s" % ", ".join(PROGRAMS))
    try:
        program = import_module("hero_swarm." + PROGRAMS[name])
    except ModuleNotFoundError as error:
        sys.exit("python3 -m hero_swarm %s: %s is missing; install python3-%s" % (name, error.name, error.name))
    run(lambda: program.main(sys.argv[2:]))


if __name__ == "__main__":
    main()
