"""Python, packages and messages of this PC."""

import importlib
import os
import platform
import shutil
import sys

import rospkg

from .points import Finding, ask_system, fail, ok, warn

CORE = (
    "hero_bringup",
    "hero_client",
    "hero_driver",
    "hero_examples",
    "hero_msgs",
    "hero_node",
    "hero_sim",
    "hero_tutorial",
)
OPTIONS = (
    "hero_calibration",
    "hero_description",
    "hero_localization",
    "hero_monitor",
    "hero_recording",
    "hero_swarm",
    "hero_tools",
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
SOURCE = "source the workspace in this terminal: source devel/setup.bash"


def check_python() -> Finding:
    """Check this interpreter, its modules, and the python3 that is first on PATH."""
    version = platform.python_version()
    if sys.version_info < OLDEST_PYTHON:
        return fail(f"Python {version}; 3.8 or newer is needed", "use a newer system")
    missing = []
    for name in NEEDED_MODULES:
        try:
            importlib.import_module(name)
        except ImportError:
            missing.append(name)
    if missing:
        return fail(
            f"Python {version} ({sys.executable}) lacks {', '.join(missing)}",
            "Debian: script/bootstrap; elsewhere: rosdep install --from-paths src --ignore-src -y",
        )
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


def check_packages() -> Finding:
    """Check that the core is on ROS_PACKAGE_PATH, and all that is there of the suite in one version."""
    finder = rospkg.RosPack()
    paths, versions, missing = [], set(), []
    for name in CORE + OPTIONS:
        try:
            paths.append(finder.get_path(name))
            versions.add(finder.get_manifest(name).version)
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


def check_messages() -> Finding:
    """Compare the built messages with those of the firmware."""
    wrong = []
    for name, md5 in FIRMWARE_MD5.items():
        module, _, kind = name.rpartition(".")
        try:
            built = getattr(importlib.import_module(module), kind)._md5sum
        except (ImportError, AttributeError) as error:
            return fail(f"{name} is not built: {error}", "build the workspace: catkin build", SOURCE)
        if built != md5:
            wrong.append(f"{name} has md5 {built}, the firmware {md5}")
    if wrong:
        return fail(
            "; ".join(wrong), "rebuild hero_msgs; another package of that name may hide it: rospack find hero_msgs"
        )
    return ok(f"{len(FIRMWARE_MD5)} types match those of firmware v3.8")
