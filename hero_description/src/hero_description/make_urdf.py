"""Writes the robot's URDF to a file, or to standard output: rosrun hero_description make_urdf [FILE]."""

import sys

from .urdf import make_urdf


def main() -> None:
    """Run the program make_urdf."""
    if len(sys.argv) > 2 or sys.argv[1:2] in (["-h"], ["--help"]):
        print("usage: make_urdf [FILE]", file=sys.stderr)
        sys.exit(0 if len(sys.argv) == 2 else 2)
    if len(sys.argv) == 1:
        sys.stdout.write(make_urdf())
        return
    try:
        with open(sys.argv[1], "w", encoding="utf-8") as file:
            file.write(make_urdf())
    except OSError as error:
        sys.exit("make_urdf: cannot write %s: %s" % (sys.argv[1], error.strerror))
