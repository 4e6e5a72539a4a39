"""A camera device, and what drivers and the nodes of hero_localization report of themselves."""

import glob
import os
from typing import Dict, Mapping, Sequence

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from hero_node.ros import ask_master

from .points import LINES_MAX, REPORT_TIMEOUT_S, Finding, ok, wait_until, warn

DIAGNOSTICS_TOPIC = "/diagnostics"


def check_camera(pattern: str = "/dev/video*") -> Finding:
    """List the camera devices of this PC, and whether this user may open them."""
    devices = sorted(glob.glob(pattern))
    if not devices:
        return ok(f"no {pattern}: images must come on a topic; without tags no camera is needed")
    closed = [device for device in devices if not os.access(device, os.R_OK | os.W_OK)]
    if closed:
        text = f"this user may not open {', '.join(closed)}"
        return warn(text, "sudo usermod -aG video $USER, and log in again")
    return ok(", ".join(devices))


def check_nodes() -> Finding:
    """Print how many of the robots and other subjects that nodes report on have no problem, and name those that do."""
    nodes = dict(ask_master("getSystemState")[0]).get(DIAGNOSTICS_TOPIC, [])
    if not nodes:
        return ok("no node reports diagnostics")
    heard: Dict[str, Dict[str, DiagnosticStatus]] = {node: {} for node in nodes}

    def keep(report: DiagnosticArray) -> None:
        own = heard.setdefault(report._connection_header["callerid"], {})
        own.update({status.name: status for status in report.status})

    subscriber = rospy.Subscriber(DIAGNOSTICS_TOPIC, DiagnosticArray, keep)
    wait_until(lambda: all(heard.values()), REPORT_TIMEOUT_S)
    subscriber.unregister()
    return describe_nodes({node.lstrip("/"): list(statuses.values()) for node, statuses in sorted(heard.items())})


def describe_nodes(reports: Mapping[str, Sequence[DiagnosticStatus]]) -> Finding:
    """Return one line on all nodes, by name, and a line for each problem that they report."""
    texts, remedies = [], []
    for name, statuses in reports.items():
        bad = [status for status in statuses if status.level != DiagnosticStatus.OK]
        texts.append(f"{name}: {len(statuses) - len(bad)} of {len(statuses)} without a problem")
        if not statuses:
            remedies.append(f"{name} sends no diagnostics: rosnode ping {name} tells whether it hangs")
        remedies += [f"{status.name}: {status.message}" for status in bad]
    return warn("; ".join(texts), *remedies[:LINES_MAX]) if remedies else ok("; ".join(texts))
