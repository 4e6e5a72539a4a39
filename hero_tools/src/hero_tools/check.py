"""This PC -> what would keep robots from being driven from it, each with its remedy.

    rosrun hero_tools check            a line per point: OK, WARN or FAIL, and what to do
    rosrun hero_tools check --json     the same as one line of JSON

Changes nothing. Ends within about 3 s whatever hangs; the exit code is 1 if a point failed.
"""

import argparse
import json
import os
import threading
from typing import Dict, List, Optional, Sequence

import rospy

from hero_client import command_line
from hero_client.command_line import make_printable

from .checkup import environment, graph, network
from .checkup.finding import FAIL, OK, WARN, Finding, Point, run_points
from .checkup.firewall import check_firewall

FIRST_TIMEOUT_S = 1.2  # what needs no ROS master: names, files, commands of the system
SECOND_TIMEOUT_S = 1.2  # what needs one
LEAVE_TIMEOUT_S = 0.3
ORDER = (
    "python",
    "packages",
    "messages",
    "versions",
    "ros_environment",
    "own_name",
    "master",
    "way_back",
    "nodes",
    "port",
    "addresses",
    "firewall",
    "clock",
    "disk",
    "robots",
)
SKIPPED = ("way_back", "nodes", "robots")


def run_check(port: int, interface: Optional[str]) -> List[Finding]:
    """Look at every point and return the findings in the order of ORDER."""
    addresses = network.read_addresses()
    own = addresses or []
    robots_on = network.find_robot_interface(own, interface)
    others = sorted({found.interface for found in own} - {robots_on})
    findings = run_points(
        {
            "python": environment.check_python,
            "packages": environment.check_packages,
            "messages": environment.check_messages,
            "versions": environment.check_versions,
            "ros_environment": lambda: graph.check_variables(addresses),
            "own_name": lambda: graph.check_own_name(own),
            "master": lambda: graph.check_master(own),
            "port": lambda: network.check_port(port),
            "addresses": lambda: network.check_addresses(
                addresses, interface, port, list(network.find_listeners(port))
            ),
            "firewall": lambda: check_firewall(robots_on, others, port),
            "clock": environment.check_clock,
            "disk": environment.check_disk,
        },
        FIRST_TIMEOUT_S,
    )
    if any(finding.point == "master" and finding.state == OK for finding in findings):
        node = graph.OwnNode()
        running: Dict[str, Point] = {
            "way_back": node.check_way_back,
            "nodes": graph.check_nodes,
            "robots": node.check_robots,
        }
        findings += run_points(running, SECOND_TIMEOUT_S)
    else:
        findings += [Finding(point, WARN, "not looked at: there is no ROS master") for point in SKIPPED]
    return sorted(findings, key=lambda finding: ORDER.index(finding.point))


def format_findings(findings: Sequence[Finding]) -> List[str]:
    """Return a line per finding, and one per remedy below it."""
    width = max(len(finding.point) for finding in findings)
    lines = []
    for finding in findings:
        lines.append("%-4s  %-*s  %s" % (finding.state, width, finding.point, make_printable(finding.says)))
        lines += ["%*s  -> %s" % (width + 6, "", make_printable(remedy)) for remedy in finding.remedy]
    count = {state: sum(finding.state == state for finding in findings) for state in (OK, WARN, FAIL)}
    return [*lines, "%d OK, %d WARN, %d FAIL" % (count[OK], count[WARN], count[FAIL])]


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="check", description="What would keep robots from being driven from this PC, and the remedy."
    )
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.add_argument(
        "--port", type=int, default=11411, metavar="PORT", help="TCP port that robots dial (11411)"
    )
    parser.add_argument(
        "--interface",
        metavar="NAME",
        help="interface to the robots' network, e.g. wlan0 (found by itself where only one will do)",
    )
    options = parser.parse_args(arguments)
    if not 1 <= options.port <= 65535:
        parser.error("--port %d: must be 1..65535" % options.port)
    return options


def run(options: argparse.Namespace) -> int:
    """Look, print what was found, and return the exit status."""
    findings = run_check(options.port, options.interface)
    failed = any(finding.state == FAIL for finding in findings)
    if options.json:
        print(json.dumps({"ok": not failed, "points": [finding._asdict() for finding in findings]}))
    else:
        print("\n".join(format_findings(findings)))
    return int(failed)


def main() -> None:
    """Run the program check."""
    status = command_line.call(lambda: run(parse_options(rospy.myargv()[1:])))
    # Taking leave of a master that hangs would take for ever, as would threads that wait for a name server.
    leaving = threading.Thread(target=rospy.signal_shutdown, args=("done",), daemon=True)
    leaving.start()
    leaving.join(LEAVE_TIMEOUT_S)
    os._exit(status)
