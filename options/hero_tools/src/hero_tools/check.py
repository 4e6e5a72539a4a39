"""Checks whether this PC can drive robots, and names the remedy for each problem.

    rosrun hero_tools check            a line per point: OK, WARN or FAIL, and what to do
    rosrun hero_tools check --json     the same as one line of JSON

Changes nothing. Ends within about 5 s whatever hangs; the exit status is 1 if a point failed.
"""

import argparse
import json
import os
from typing import Dict, List, Sequence

import rospy

from hero_node import command_line, make_printable
from hero_node.parameters import within
from hero_node.ros import end_ros_node

from .checkup import computer, graph, localization, network
from .checkup.points import FAIL, OK, WARN, Finding, Point, run_points, warn
from .hotspot import DRIVER_PORT

TIMEOUT_S = 4.0  # of the points that run at once: those that need no ROS master, the node, those that need it
LEAVE_TIMEOUT_S = 0.3


def run_check(port: int) -> Dict[str, Finding]:
    """Return the findings by point."""
    addresses = network.read_addresses()
    own = addresses or []
    listeners = network.find_listeners(port)
    points: Dict[str, Point] = {
        "python": computer.check_python,
        "packages": computer.check_packages,
        "workspace": computer.check_workspace,
        "disk": computer.check_disk,
        "clock": computer.check_clock,
        "camera": localization.check_camera,
        "ros_environment": lambda: graph.check_variables(addresses),
        "own_name": lambda: graph.check_own_name(own),
        "port": lambda: network.check_port(port, listeners),
        "addresses": lambda: network.check_addresses(addresses, port, list(listeners or ())),
        "master": lambda: graph.check_master(own),
    }
    node = graph.OwnNode()
    later: Dict[str, Point] = {
        "return_path": node.check_return_path,
        "robots": node.check_robots,
        "commands": graph.check_commands,
        "diagnostics": localization.check_nodes,
    }
    findings = run_points(points, TIMEOUT_S)
    for needed, more in (("master", {"node": node.start}), ("node", later)):
        if findings[needed].state == OK:
            findings.update(run_points(more, TIMEOUT_S))
        else:
            findings.update(dict.fromkeys(more, warn("skipped: needs the point " + needed)))
    return findings


def format_findings(findings: Dict[str, Finding]) -> List[str]:
    """Return a line per finding, and one per remedy below it."""
    width = max(map(len, findings))
    lines = []
    for point, finding in findings.items():
        lines.append("%-4s  %-*s  %s" % (finding.state, width, point, make_printable(finding.text)))
        lines += ["%*s  -> %s" % (width + 6, "", make_printable(remedy)) for remedy in finding.remedy]
    states = [finding.state for finding in findings.values()]
    return [*lines, ", ".join("%d %s" % (states.count(state), state) for state in (OK, WARN, FAIL))]


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="check", description="Checks whether this PC can drive robots.")
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    text = "TCP port that robots connect to (%(default)s)"
    parser.add_argument("--port", type=within(1, 65535, int), default=DRIVER_PORT, metavar="PORT", help=text)
    return parser.parse_args(arguments)


def run(options: argparse.Namespace) -> int:
    """Print the findings and return the exit status."""
    findings = run_check(options.port)
    failed = any(finding.state == FAIL for finding in findings.values())
    if options.json:
        points = [{"point": point, **finding._asdict()} for point, finding in findings.items()]
        print(json.dumps({"ok": not failed, "points": points}))
    else:
        print("\n".join(format_findings(findings)))
    return int(failed)


def main() -> None:
    """Run the program check."""
    status = command_line.call(lambda: run(parse_options(rospy.myargv()[1:])))
    end_ros_node("done", LEAVE_TIMEOUT_S)
    os._exit(status)  # although threads may still wait for a name server
