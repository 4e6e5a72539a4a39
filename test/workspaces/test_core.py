"""The core alone builds, starts and passes its unit tests with rospy, numpy and PyYAML, without any other package.

It is built by catkin build, package by package, where that is installed. Optional modules are refused as if they were
not. One of the options is added last.
"""

import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import sources
from hero_test.processes import find_free_port

ROOT = Path(__file__).resolve().parents[2]
WORKSPACE = ROOT / ".work" / "workspaces" / "core"
CORE = "hero_msgs hero_node hero_driver hero_client hero_sim hero_examples hero_tutorial hero_bringup".split()
OPTIONAL_MODULES = ("apriltag", "cv2", "matplotlib", "PIL", "ruamel", "scipy", "selenium", "tornado", "tqdm")
BUILD_TIMEOUT_S = 1800.0
TIMEOUT_S = 900.0
UNIT_TESTS = [name for name in CORE if (ROOT / name / "test" / "unit").is_dir()]
# Debian 13's catkin takes only the second name.
CMAKE_ARGUMENTS = f"-DPYTHON_EXECUTABLE={sys.executable} -DPython_EXECUTABLE={sys.executable}"
CATKIN_BUILD = f"catkin config --init --cmake-args {CMAKE_ARGUMENTS} && catkin build --no-status --summarize"
HAS_CATKIN_TOOLS = shutil.which("catkin") is not None
REFUSE = f"""
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {OPTIONAL_MODULES!r}:
            raise ModuleNotFoundError("No module named %r" % name, name=name)

sys.meta_path.insert(0, Refuse())
"""
REQUIRE_REFUSAL = """
import importlib, sys
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        continue
    sys.exit(name + " was imported")
"""


def run(script, timeout_s=TIMEOUT_S, **variables):
    """Run a bash script in the workspace and return its output."""
    overlay = ("CMAKE_PREFIX_PATH", "ROS_PACKAGE_PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "PKG_CONFIG_PATH")
    environment = {name: value for name, value in os.environ.items() if name not in overlay}
    environment.update(variables, ROS_LANG_DISABLE="gencpp:geneus:genlisp:gennodejs")
    ended = subprocess.run(
        ["bash", "-eo", "pipefail", "-c", script], cwd=str(WORKSPACE), env=environment, timeout=timeout_s,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
    )  # fmt: skip
    output = ended.stdout.decode(errors="replace")
    assert ended.returncode == 0, f"{script}\n{output[-6000:]}"
    return output


def copy_package(name):
    ignored = shutil.ignore_patterns("__pycache__", "*.pyc", ".*_cache", ".hypothesis")
    folder = sources.PACKAGES[name]
    shutil.copytree(str(folder), str(WORKSPACE / "src" / "hero" / folder.relative_to(ROOT)), ignore=ignored)


@pytest.fixture(scope="module")
def run_in_core():
    """Runs scripts where the core is built and optional modules are refused."""
    shutil.rmtree(str(WORKSPACE), ignore_errors=True)
    for name in (*CORE, "hero_test"):  # no part of the suite: helpers of its tests
        copy_package(name)
    for name in ("conftest.py", "test/sources.py"):
        shutil.copy(str(ROOT / name), str(WORKSPACE / "src" / "hero" / name))
    # Tests compare what packages document with the pages of the repository.
    shutil.copytree(str(ROOT / "docs"), str(WORKSPACE / "src" / "hero" / "docs"))
    (WORKSPACE / "refuse").mkdir()
    (WORKSPACE / "refuse" / "sitecustomize.py").write_text(REFUSE)
    refuse = f"export PYTHONPATH={WORKSPACE}/refuse:$PYTHONPATH\n"
    run(refuse + (CATKIN_BUILD if HAS_CATKIN_TOOLS else f"catkin_make {CMAKE_ARGUMENTS}"), BUILD_TIMEOUT_S)
    return lambda script, **variables: run(f". devel/setup.bash\n{refuse}{script}", **variables)


def test_optional_modules_are_refused_here(run_in_core):
    run_in_core(f"{sys.executable} - {' '.join(OPTIONAL_MODULES)} <<'END'\n{REQUIRE_REFUSAL}\nEND")


def test_the_core_needs_no_other_package_to_be_imported(run_in_core):
    modules = []
    for package in CORE:
        source = ROOT / package / "src"
        names = (".".join(path.relative_to(source).with_suffix("").parts) for path in sorted(source.rglob("*.py")))
        modules += [name.replace(".__init__", "") for name in names if not name.endswith("__main__")]
    run_in_core(f"{sys.executable} -c 'import {', '.join(modules)}'")


def test_programs_of_the_core_name_the_python_of_the_build(run_in_core):
    found = run_in_core(f"for name in {' '.join(CORE)}; do rospack find $name; done").split()
    assert len(found) == len(CORE) and all(
        Path(path).parts[: len(WORKSPACE.parts)] == WORKSPACE.parts for path in found
    )
    for package in ("hero_driver", "hero_tutorial"):
        programs = [path for path in (WORKSPACE / "devel" / "lib" / package).iterdir() if os.access(path, os.X_OK)]
        lines = {path.name: path.read_text(encoding="utf-8").splitlines()[0] for path in programs if path.is_file()}
        assert set(lines.values()) == {f"#!{sys.executable}"}, lines


def test_simulated_robots_walk_with_the_core_alone(run_in_core):
    probe = ROOT / "test" / "workspaces" / "wait_for_odometry.py"
    run_in_core(
        textwrap.dedent(
            f"""
            trap 'kill $(jobs -p) 2>/dev/null; wait' EXIT
            export ROS_MASTER_URI=http://localhost:{find_free_port()}
            roslaunch -p "${{ROS_MASTER_URI##*:}}" hero_bringup hero_bringup.launch count:=2 port:={find_free_port()} \
              >launch.log 2>&1 &
            {sys.executable} {probe} hero_0 hero_1 || {{ cat launch.log; exit 1; }}
            rosrun hero_examples random_walk _robots:=0-1 >walk.log 2>&1 &
            {sys.executable} - <<'END'
            from hero_client import Swarm
            swarm = Swarm([0, 1])
            swarm.wait_until_ready(60.0)
            for _ in swarm.rate(10):
                if all(abs(robot.velocity.linear_m_s) > 0.01 for robot in swarm):
                    break
            END
            """
        ),
        ROS_HOME=str(WORKSPACE / "ros_home"),
        ROS_HOSTNAME="localhost",
    )


@pytest.mark.parametrize("package", UNIT_TESTS)
def test_unit_tests_of_the_core_pass_with_the_core_alone(run_in_core, package):
    run_in_core(f"{sys.executable} -m pytest -q -p no:cacheprovider src/hero/{package}/test/unit --hypothesis-seed=0")


@pytest.mark.skipif(not HAS_CATKIN_TOOLS, reason="catkin-tools is not installed")
def test_run_tests_of_an_added_package_runs_units_rostests_and_launches(run_in_core):
    for name in (
        "hero_description",
        "hero_monitor",
    ):  # RViz shows robots in the colors of the monitor, which is not built
        copy_package(name)
    # roslaunch-check and rostest take the first python3 on PATH.
    path = f"{Path(sys.executable).parent}:$PATH"
    run(
        f"catkin build --no-status --no-deps hero_description\n. devel/setup.bash\nexport PATH={path}\n"
        "catkin run_tests --no-status --no-deps hero_description",
        ROS_HOSTNAME="localhost",
    )
    results = WORKSPACE / "build" / "hero_description" / "test_results" / "hero_description"
    kinds = {"pytest.xml", "rosunit-display.xml", "roslaunch-check_launch.xml"}
    assert kinds <= {file.name for file in results.iterdir()}
