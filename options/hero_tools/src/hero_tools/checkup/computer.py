"""Python, packages, disk and clock of this PC."""

import importlib.util
import os
import platform
import shutil
import sys
from pathlib import Path
from typing import Dict, List

import rospkg
from catkin_pkg.package import parse_package
from catkin_pkg.packages import find_package_paths

from .points import Finding, ask_system, fail, ok, warn

CORE = (
    "hero_bringup", "hero_client", "hero_driver", "hero_examples", "hero_msgs", "hero_node", "hero_sim",
    "hero_tutorial",
)  # fmt: skip
OPTIONS = (
    "hero_calibration", "hero_common", "hero_description", "hero_localization", "hero_monitor", "hero_recording",
    "hero_swarm", "hero_tools",
)  # fmt: skip
MODULES = {
    "python3-catkin-pkg": "catkin_pkg",
    "python3-opencv": "cv2",
    "python3-pil": "PIL",
    **{name: name for name in ("rospy", "actionlib", "tf2_ros", "diagnostic_updater")},
}
"""Modules of dependencies that are not called python3- and the module's name."""

AUTHOR = "HeRo suite maintainers"
LOW_DISK_GB, FULL_DISK_GB = 2.0, 0.2
INSTALL = "elsewhere: rosdep install --from-paths src --ignore-src -y"
SOURCE = "source the workspace in this terminal: source devel/setup.bash"


def check_python() -> Finding:
    """Check this interpreter, its modules, and the python3 that is first on PATH."""
    version = platform.python_version()
    lacking = find_lacking_dependencies()
    if lacking:
        listed = ", ".join(f"{key} (for {', '.join(packages)})" for key, packages in lacking.items())
        tell = fail if set(CORE).intersection(*lacking.values()) else warn
        debian = [key if key.startswith("python3-") else "python3-" + key.replace("_", "-") for key in lacking]
        remedy = f"Debian: sudo apt install {' '.join(debian)}"
        return tell(f"Python {version} ({sys.executable}) lacks {listed}", remedy, INSTALL)
    text = f"Python {version} ({sys.executable}) has all modules"
    other = shutil.which("python3")
    if other and os.path.realpath(other) != os.path.realpath(sys.executable):
        look = "import importlib.util as i, sys; sys.exit(not i.find_spec('rospy'))"
        if ask_system([other, "-c", look]) is None:
            return warn(
                f"{text}; the first python3 on PATH, {other}, has no rospy",
                f"rosrun and roslaunch are not affected; your own scripts: {sys.executable} FILE",
                f"build with -DPYTHON_EXECUTABLE={sys.executable}; Debian 13: -DPython_EXECUTABLE",
            )
    return ok(text)


def find_lacking_dependencies() -> Dict[str, List[str]]:
    """Return dependencies whose Python modules cannot be imported, with the packages of the suite that declare them."""
    finder, lacking = rospkg.RosPack(), {}  # type: rospkg.RosPack, Dict[str, List[str]]
    for name in CORE + OPTIONS:
        try:
            needed = parse_package(finder.get_path(name)).exec_depends
        except rospkg.ResourceNotFound:
            continue
        for key in {dependency.name for dependency in needed}:
            module = MODULES.get(key, key[len("python3-") :] if key.startswith("python3-") else "")
            if module and not importlib.util.find_spec(module):
                lacking.setdefault(key, []).append(name)
    return lacking


def check_packages() -> Finding:
    """Check that the core is on ROS_PACKAGE_PATH, and all that is there of the suite in one version."""
    finder = rospkg.RosPack()
    paths, versions, missing = [], set(), []
    for name in CORE + OPTIONS:
        try:
            manifest = finder.get_manifest(name)
            if AUTHOR not in manifest.author:
                return fail(
                    f"{finder.get_path(name)} is another package of the name {name}, which hides the suite's",
                    f"rename it; or, to leave out the suite's: touch HERO/{name}/CATKIN_IGNORE, and build again",
                )
            paths.append(finder.get_path(name))
            versions.add(manifest.version)
        except rospkg.ResourceNotFound:
            missing.append(name)
    missing_core = [name for name in missing if name in CORE]
    if missing_core:
        return fail("not on ROS_PACKAGE_PATH: " + ", ".join(missing_core), SOURCE)
    if len(versions) > 1:
        return fail(
            "packages of several versions are mixed: " + ", ".join(sorted(versions)),
            "rebuild all of them from one clone, and source only that workspace",
        )
    text = f"all of version {versions.pop()}, below {os.path.commonpath(paths)}"
    return ok(text + (", without " + ", ".join(missing) if missing else ""))


def check_workspace() -> Finding:
    """Look for packages of one name in the workspace of this folder: catkin then builds none of it."""
    for folder in (Path.cwd(), *Path.cwd().parents):
        if not (folder / "src").is_dir() or not ((folder / "build").is_dir() or (folder / ".catkin_tools").is_dir()):
            continue
        found: Dict[str, List[str]] = {}
        for path in find_package_paths(str(folder / "src")):
            name = parse_package(str(folder / "src" / path)).name
            found.setdefault(name, []).append(str(folder / "src" / path))
        for name, paths in found.items():
            if len(paths) > 1:
                return fail(
                    f"two packages are called {name}, so that catkin builds none: {', '.join(sorted(paths))}",
                    "rename one, or leave one out: touch ITS_FOLDER/CATKIN_IGNORE",
                )
        return ok(f"{len(found)} packages in {folder}, each of another name")
    return ok("this folder is in no catkin workspace")


def check_disk() -> Finding:
    """Check the space for logs, recordings and what the driver keeps."""
    home = os.environ.get("ROS_HOME") or os.path.expanduser("~/.ros")
    folder = next(path for path in (Path(home), *Path(home).parents) if path.is_dir())
    free_gb = shutil.disk_usage(str(folder)).free / 1e9
    text = f"{free_gb:.1f} GB free for {home}"
    remedy = "rosclean check shows what logs take, rosclean purge removes them; recordings are in ~/hero_recordings"
    if free_gb < FULL_DISK_GB:
        return fail(text, remedy)
    return warn(text, remedy) if free_gb < LOW_DISK_GB else ok(text)


def check_clock() -> Finding:
    """Check that the clock is synchronized, which several PCs and cameras need."""
    answer = ask_system(["timedatectl", "show", "-p", "NTPSynchronized", "--value"])
    if answer is None:
        return ok("unknown whether the clock is synchronized: the command timedatectl gives no answer")
    if answer.strip() == "yes":
        return ok("the clock is synchronized")
    return warn("the clock is not synchronized: several PCs disagree", "sudo timedatectl set-ntp true; or chrony")
