"""A camera device, and what drivers and the nodes of hero_localization report of themselves."""

import glob
import os
from typing import Dict, List, Sequence

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from hero_node.ros import ask_master

from .points import Finding, ok, wait_until, warn

DIAGNOSTICS_TOPIC = "/diagnostics"
TRACKER, LOCALIZER = "track", "localization"
"""Nodes of hero_localization; track_2 is that of a second camera. Their statuses are called NODE: SUBJECT."""

REPORT_TIMEOUT_S = 3.0
"""They report once a second; a busy PC takes its time to connect."""

LINES_MAX = 10


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
    """Print what drivers, tracker and filter report, such as the rate of images and robots with a problem."""
    published = dict(ask_master("getSystemState")[0])
    names = sorted(name.lstrip("/") for name in published.get(DIAGNOSTICS_TOPIC, []))
    running = [name for name in names if f"/{name}" in published.get(f"/{name}/robots", ())]
    running += [name for name in names if name.partition("_")[0] == TRACKER]
    running += [name for name in names if name == LOCALIZER]
    if not running:
        return ok("no driver, tracker or localization runs")
    statuses: Dict[str, DiagnosticStatus] = {}

    def keep(report: DiagnosticArray) -> None:
        statuses.update({status.name: status for status in report.status})

    subscriber = rospy.Subscriber(DIAGNOSTICS_TOPIC, DiagnosticArray, keep)
    wait_until(lambda: all(list_statuses(name, list(statuses.values())) for name in running), REPORT_TIMEOUT_S)
    subscriber.unregister()
    return describe_nodes(running, list(statuses.values()))


def list_statuses(name: str, statuses: Sequence[DiagnosticStatus]) -> List[DiagnosticStatus]:
    """Return the statuses of a node."""
    return [status for status in statuses if status.name.startswith(name + ": ")]


def describe_nodes(running: Sequence[str], statuses: Sequence[DiagnosticStatus]) -> Finding:
    """Return one line on all of them, and a line for each problem that they report."""
    texts, remedies = [], []
    for name in running:
        own = list_statuses(name, statuses)
        good = [status for status in own if status.level == DiagnosticStatus.OK]
        if name.partition("_")[0] == TRACKER:
            camera = [status for status in own if status.name == name + ": camera"]
            is_usable = camera and camera[0].level < DiagnosticStatus.ERROR
            texts.append(f"{name}: {camera[0].message if is_usable else 'no usable images'}")
        else:
            robots = [status for status in own if status.name.startswith(f"{name}: hero_")]
            well = [robot for robot in robots if robot in good]
            texts.append(f"{name}: {len(well)} of {len(robots)} robots without a problem")
        if not own:
            remedies.append(f"{name} sends no diagnostics: rosnode ping {name} tells whether it hangs")
        remedies += [f"{status.name}: {status.message}" for status in own if status not in good]
    return warn("; ".join(texts), *remedies[:LINES_MAX]) if remedies else ok("; ".join(texts))
