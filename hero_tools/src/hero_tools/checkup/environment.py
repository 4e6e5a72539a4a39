"""Python, variables, packages, clock and disk of this PC -> findings."""

import importlib
import os
import platform
import shutil
import sys
import time
from pathlib import Path
from typing import List

import rospkg

from .finding import FAIL, OK, WARN, Finding
from .system_command import NOT_THERE, ask_system

SUITE = (
    "hero_bringup",
    "hero_description",
    "hero_driver",
    "hero_examples",
    "hero_msgs",
    "hero_sim",
    "hero_tutorial",
)
NEEDED_MODULES = ("rospy", "numpy", "yaml", "actionlib", "tf2_ros", "diagnostic_updater")
FIRMWARE_MD5 = {
    # as stock firmware v3.8 declares them; the services' as rosservice calls them
    "hero_msgs.msg.Encoder": "b5586cdbae9b740afc6a1f403a2d7dde",
    "hero_msgs.msg.Motor": "44d4249d207ce6a89de3d72080e4d0b5",
    "hero_msgs.srv.SetIRCalibration": "fc55fd34ad2ef676815ba2e14521ac73",
    "hero_msgs.srv.SetMotor": "07e32bced0fc14456815cdd097819b89",
    "hero_msgs.srv.SetOdom": "4ed90569b1afd039b963e42a12637d2b",
    "hero_msgs.srv.SetPID": "69c16eccc66fd6b477afb5e5500b4b47",
}
OLDEST_PYTHON = (3, 8)
SMALL_DISK_BYTES = 1e9
FULL_DISK_BYTES = 50e6
FIRST_PLAUSIBLE_TIME_S = 1.7e9  # November 2023: a clock before it was never set
SOURCE = ["source the workspace in this terminal: source devel/setup.bash"]


def check_python() -> List[Finding]:
    """Look at this interpreter, its modules, and the python3 that programs would find on PATH."""
    point = "python"
    version = platform.python_version()
    if sys.version_info < OLDEST_PYTHON:
        return [Finding(point, FAIL, "Python %s; needed is 3.8 or newer" % version, ["use a newer system"])]
    missing = []
    for name in NEEDED_MODULES:
        try:
            importlib.import_module(name)
        except ImportError:
            missing.append(name)
    if missing:
        remedy = [
            "script/bootstrap installs them on Debian 12; elsewhere: rosdep install --from-paths src --ignore-src -y"
        ]
        return [
            Finding(
                point, FAIL, "Python %s (%s) lacks %s" % (version, sys.executable, ", ".join(missing)), remedy
            )
        ]
    says = "Python %s (%s) has all modules" % (version, sys.executable)
    other = shutil.which("python3")
    if other and os.path.realpath(other) != os.path.realpath(sys.executable):
        if (
            ask_system(
                [other, "-c", "import importlib.util as i, sys; sys.exit(not i.find_spec('rospy'))"]
            ).code
            != 0
        ):
            says += "; the first python3 on PATH, %s, has no rospy" % other
            remedy = [
                "programs started with rosrun and roslaunch are not affected; your own: %s FILE"
                % sys.executable,
                "build with -DPYTHON_EXECUTABLE=%s" % sys.executable,
            ]
            return [Finding(point, WARN, says, remedy)]
    return [Finding(point, OK, says)]


def check_packages() -> List[Finding]:
    """Look for the packages of the suite on ROS_PACKAGE_PATH, and whether they are of one version."""
    point = "packages"
    finder = rospkg.RosPack()
    paths, versions, missing = {}, set(), []
    for name in SUITE:
        try:
            paths[name] = finder.get_path(name)
            versions.add(finder.get_manifest(name).version)
        except rospkg.ResourceNotFound:
            missing.append(name)
    if missing:
        return [Finding(point, FAIL, "not on ROS_PACKAGE_PATH: " + ", ".join(missing), SOURCE)]
    if len(versions) > 1:
        says = "packages of several versions are mixed: " + ", ".join(sorted(versions))
        return [
            Finding(
                point, FAIL, says, ["build all of them again from one clone, and source only that workspace"]
            )
        ]
    where = os.path.commonpath(list(paths.values()))
    return [Finding(point, OK, "all %d packages, version %s, below %s" % (len(SUITE), versions.pop(), where))]


def check_messages() -> List[Finding]:
    """Compare the built messages with those of the firmware."""
    point = "messages"
    wrong = []
    for name, md5 in FIRMWARE_MD5.items():
        module, _, kind = name.rpartition(".")
        try:
            built = getattr(importlib.import_module(module), kind)._md5sum
        except (ImportError, AttributeError) as error:
            return [
                Finding(
                    point,
                    FAIL,
                    "%s is not built: %s" % (name, error),
                    ["build the workspace: catkin build", *SOURCE],
                )
            ]
        if built != md5:
            wrong.append("%s has md5 %s, the firmware %s" % (name, built, md5))
    if wrong:
        return [
            Finding(
                point,
                FAIL,
                "; ".join(wrong),
                ["build hero_msgs again; another package of that name may hide it: rospack find hero_msgs"],
            )
        ]
    return [Finding(point, OK, "%d types are equal to those of firmware v3.8" % len(FIRMWARE_MD5))]


def check_clock() -> List[Finding]:
    """Look whether something keeps the clock right; between PCs stamps are compared."""
    point = "clock"
    if time.time() < FIRST_PLAUSIBLE_TIME_S:
        return [
            Finding(
                point,
                FAIL,
                "the clock says %s" % time.strftime("%Y-%m-%d"),
                ["sudo date --set '2030-01-31 12:00'"],
            )
        ]
    several = "matters as soon as two PCs share a ROS master; one PC with its robots needs nothing"
    chrony = ask_system(["chronyc", "-n", "tracking"])
    if chrony.code == 0:
        leap = [
            line.split(":")[1].strip()
            for line in chrony.output.splitlines()
            if line.startswith("Leap status")
        ]
        if leap == ["Normal"]:
            return [Finding(point, OK, "kept right by chrony")]
        return [
            Finding(
                point, WARN, "chrony runs but is not synchronised", ["chronyc sources shows why", several]
            )
        ]
    systemd = ask_system(["timedatectl", "show", "--property=NTP", "--property=NTPSynchronized"])
    if "NTPSynchronized=yes" in systemd.output:
        return [Finding(point, OK, "synchronised, says timedatectl")]
    if systemd.code == 0:
        return [
            Finding(
                point,
                WARN,
                "not synchronised, says timedatectl",
                ["sudo timedatectl set-ntp true, and a network with a time server", several],
            )
        ]
    asked = (
        "neither chronyc nor timedatectl"
        if {chrony.code, systemd.code} == {NOT_THERE}
        else "what keeps the clock right"
    )
    return [
        Finding(
            point,
            WARN,
            "%s answers here: whether the clock is right is not known" % asked
            if "neither" in asked
            else "%s is not known" % asked,
            ["sudo apt install chrony", several],
        )
    ]


def check_disk() -> List[Finding]:
    """Look at the space where ROS writes its logs."""
    point = "disk"
    directory = Path(rospkg.get_log_dir())
    existing = directory
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        reason = "cannot be written" if existing.is_dir() else "cannot be made: %s is a file" % existing
        return [
            Finding(
                point,
                FAIL,
                "log folder %s %s" % (directory, reason),
                ["export ROS_LOG_DIR=/a/folder/of/yours"],
            )
        ]
    free_bytes = shutil.disk_usage(existing).free
    says = "%.1f GB free for logs in %s" % (free_bytes / 1e9, directory)
    remedy = ["rosclean purge deletes old logs; export ROS_LOG_DIR=/another/disk moves them"]
    if free_bytes < FULL_DISK_BYTES:
        return [Finding(point, FAIL, says, remedy)]
    return [Finding(point, WARN, says, remedy) if free_bytes < SMALL_DISK_BYTES else Finding(point, OK, says)]


def check_versions() -> List[Finding]:
    """Say what runs here, for a report."""
    release = Path("/etc/os-release")
    names = [
        line.partition("=")[2].strip('"')
        for line in (release.read_text().splitlines() if release.is_file() else [])
        if line.startswith("PRETTY_NAME=")
    ]
    try:
        ros = "rospy " + rospkg.RosPack().get_manifest("rospy").version
    except rospkg.ResourceNotFound:
        ros = "rospy not found"
    distribution = os.environ.get("ROS_DISTRO") or "Debian's packages"
    says = "ROS: %s (%s); %s; Linux %s" % (
        distribution,
        ros,
        (names or [platform.system()])[0],
        platform.release(),
    )
    return [Finding("versions", OK, says)]
