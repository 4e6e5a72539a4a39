"""Runs a program of the package without ROS: python3 -m hero_swarm run e.yaml."""

import sys

from .experiments import report, runner

PROGRAMS = {"run": runner.main, "report": report.main}


def main() -> None:
    """Run the program that the first argument names."""
    name = sys.argv[1] if len(sys.argv) > 1 else ""
    if name not in PROGRAMS:
        sys.exit("python3 -m hero_swarm: the first argument must be one of: %s" % ", ".join(PROGRAMS))
    PROGRAMS[name](sys.argv[2:])


if __name__ == "__main__":
    main()
