"""What `pip install .` installs: every module, data files, and programs that need no ROS."""

import shutil
import subprocess
import sys

import pytest
import setuptools
from catkin_pkg.package import parse_package

import sources

PACKAGES = ("hero_node", "hero_driver", "hero_client", "hero_sim", "hero_swarm", "hero_recording")

WITHOUT_ROS = """
import sys
sys.path.insert(0, sys.argv[1])
for name in ("rospy", "rosgraph", "genpy", "roslib", "std_msgs", "geometry_msgs", "hero_msgs"):
    sys.modules[name] = None  # as if it were not installed
import hero_client, hero_driver, hero_node
from hero_sim.stepped.swarm import StepSwarm
from hero_swarm import fit
from hero_swarm.experiments import runner
from hero_recording import export, plot
with StepSwarm(2, arena="maze") as swarm:
    for robot in swarm:
        robot.drive(0.1, 0.0)
    swarm.sleep(1.0)
    print(all(robot.pose.x_m > 0.03 for robot in swarm), sys.modules["hero_sim"].__file__)
"""

pytestmark = pytest.mark.skipif(
    int(setuptools.__version__.split(".")[0]) < 61, reason="setuptools older than 61 does not read pyproject.toml"
)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Return the folder that the package is built into, from a copy of the sources."""
    copy, built = tmp_path_factory.mktemp("sources"), tmp_path_factory.mktemp("built")
    shutil.copy(str(sources.ROOT / "pyproject.toml"), str(copy))
    leave_out = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for package in PACKAGES:
        source = sources.PACKAGES[package] / "src"
        shutil.copytree(str(source), str(copy / source.relative_to(sources.ROOT)), ignore=leave_out)
    command = [sys.executable, "-W", "ignore", "-c", "import setuptools; setuptools.setup()", "-q"]
    subprocess.run([*command, "build_py", "--build-lib", str(built)], cwd=str(copy), check=True)
    return built


def test_every_module_and_data_file_is_in_the_package(built):
    for package in PACKAGES:
        source = sources.PACKAGES[package] / "src" / package
        kept = {
            path.relative_to(source)
            for path in source.rglob("*")
            if path.suffix in (".py", ".yaml", ".typed", ".controller")
        }
        assert kept == {path.relative_to(built / package) for path in (built / package).rglob("*") if path.is_file()}


def test_the_package_works_where_there_is_no_ros(built):
    command = [sys.executable, "-I", "-c", WITHOUT_ROS, str(built)]
    assert subprocess.check_output(command, universal_newlines=True).startswith(f"True {built}")


def test_its_version_is_that_of_the_suite():
    text = (sources.ROOT / "pyproject.toml").read_text()
    assert f'\nversion = "{parse_package(str(sources.ROOT / "hero")).version}"\n' in text
