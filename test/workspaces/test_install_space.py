"""The suite starts from the install space of catkin_make.

It is installed from what script/test has built by catkin_make, in whose devel space everything else runs, and names
neither that nor the sources. test_core.py tests the devel space of catkin build, of a copy of the sources.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import sources
from hero_test.nonempty import nonempty
from hero_test.processes import find_free_port

ROOT = Path(__file__).resolve().parents[2]

BUILT = ROOT / ".work" / "ws"
INSTALLED = BUILT / "install"
SCRATCH = ROOT / ".work" / "workspaces" / "install_space"
BUILD_TIMEOUT_S = 1800.0
PROBE_TIMEOUT_S = 120.0
ASK_PROGRAMS = Path(__file__).with_name("ask_programs.py")
LAUNCH_FILES = sources.find("launch/*.launch")
PACKAGES = sources.PACKAGES
PROGRAMS = [
    (path.parent.name, program)
    for path in sources.find("CMakeLists.txt")
    for program in re.findall(
        r"hero_add_(?:(?:program|node|script)\((?:nodes/)?|page_script\(\S+ )([\w.]+)",
        path.read_text().replace("${PROJECT_NAME}", path.parent.name),
    )
]
# Debian 13's catkin takes only the second name.
CMAKE_ARGUMENTS = f"-DPYTHON_EXECUTABLE={sys.executable} -DPython_EXECUTABLE={sys.executable}"

# Without the variables of a workspace that happens to be sourced.
OVERLAY = ("CMAKE_PREFIX_PATH", "ROS_PACKAGE_PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "PKG_CONFIG_PATH")
FROM_OTHER_ROS = bool(os.environ.get("CONDA_PREFIX")) or Path("/opt/ros/noetic").exists()
ENVIRONMENT = {name: value for name, value in os.environ.items() if FROM_OTHER_ROS or name not in OVERLAY}


def run(script, directory, timeout_s=PROBE_TIMEOUT_S):
    """Run a bash script and return its output; its failure fails the test with that output."""
    process = subprocess.Popen(
        ["bash", "-eo", "pipefail", "-c", script],
        cwd=str(directory),
        env=ENVIRONMENT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )
    try:
        output = process.communicate(timeout=timeout_s)[0].decode(errors="replace")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        output = process.communicate()[0].decode(errors="replace") + f"\nno end after {timeout_s:.0f} s"
    assert process.returncode == 0, f"{script}\n{output[-6000:]}"
    return output


class Workspace:
    """A built workspace: sourcing `setup` makes its packages available."""

    def __init__(self, setup, directory):
        self.setup = setup
        self.directory = directory

    def run(self, script):
        return run(f". {self.setup}\n{script}", self.directory)


@pytest.fixture(scope="module")
def workspace():
    """The install space of all packages, and a folder for what the tests make."""
    for folder in (SCRATCH, INSTALLED):
        shutil.rmtree(str(folder), ignore_errors=True)
    SCRATCH.mkdir(parents=True)
    # As `make install` does, but without a look at what to build again: other tests use the devel space.
    run(f"cmake -P {BUILT}/build/cmake_install.cmake", SCRATCH, BUILD_TIMEOUT_S)
    return Workspace(INSTALLED / "setup.bash", SCRATCH)


def test_nothing_installed_names_the_sources_or_what_was_built(workspace):
    elsewhere = (f"{ROOT}/[^.]", f"{BUILT}/(src|build|devel)")
    run(f"! grep -rIE '{'|'.join(elsewhere)}' {INSTALLED}", SCRATCH)


def test_every_package_is_found_only_in_the_workspace(workspace):
    packages = sorted(set(PACKAGES) - {"hero", "hero_options"})  # rospack knows no metapackages
    found = workspace.run(f"for name in {' '.join(packages)}; do rospack find $name; done").split()
    assert len(found) == len(packages)
    assert all(path.startswith(f"{INSTALLED}/") for path in found), found


def test_every_module_can_be_imported(workspace):
    modules = []
    for folder in PACKAGES.values():
        source = folder / "src"
        for path in sorted(source.rglob("*.py")):
            name = ".".join(path.relative_to(source).with_suffix("").parts)
            if not name.endswith("__main__"):
                modules.append(name[: -len(".__init__")] if name.endswith(".__init__") else name)
    modules += ["hero_msgs.msg", "hero_msgs.srv"]
    program = textwrap.dedent(
        """
        import importlib, sys
        for name in sys.argv[3:]:
            try:
                path = importlib.import_module(name).__file__
                assert path.startswith(sys.argv[1]), path
            except ModuleNotFoundError as error:
                if error.name not in sys.argv[2].split():
                    raise
        """
    )
    optional = " ".join(sorted(sources.WITHOUT_ROSDEP_KEY))
    workspace.run(f"{sys.executable} - {INSTALLED}/ '{optional}' {' '.join(modules)} <<'END'\n{program}\nEND")


def test_every_launch_file_can_be_read(workspace):
    names = " ".join(f"{path.parents[1].name}/{path.name}" for path in LAUNCH_FILES)
    program = textwrap.dedent(
        """
        import sys
        from roslaunch import config, rlutil
        for name in sys.argv[1:]:
            (path,) = rlutil.resolve_launch_arguments(name.split("/"))
            print(path, [node.type for node in config.load_config_default([path], None).nodes])
        """
    )
    workspace.run(f"{sys.executable} - {names} <<'END'\n{program}\nEND")


def find_programs(workspace):
    """Return the paths of the programs of a workspace, as rosrun finds them."""
    program = textwrap.dedent(
        """
        import sys
        from catkin.find_in_workspaces import find_in_workspaces
        for name in sys.argv[1:]:
            package, program = name.split("/")
            print(*find_in_workspaces(["libexec"], project=package, path=program, first_match_only=True))
        """
    )
    names = " ".join("/".join(names) for names in PROGRAMS)
    paths = workspace.run(f"{sys.executable} - {names} <<'END'\n{program}\nEND").split()
    assert len(paths) == len(PROGRAMS)
    return paths


def test_programs_are_found_and_name_the_python_of_the_build(workspace):
    first_lines = [Path(path).read_text(encoding="utf-8").splitlines()[0] for path in find_programs(workspace)]
    assert list(nonempty(first_lines)) == [f"#!{sys.executable}"] * len(PROGRAMS)


def test_a_program_answers_whatever_python3_is_first(workspace):
    # As with pyenv or conda: the first python3 on PATH is another one, without rospy.
    other = workspace.directory / "other_python"
    other.mkdir()
    (other / "python3").write_text("#!/bin/sh\necho No module named rospy\nexit 1\n")
    (other / "python3").chmod(0o755)
    assert workspace.run(f"PATH={other}:$PATH {find_programs(workspace)[0]} --help").startswith("usage: ")


def test_programs_answer_help_without_a_master(workspace):
    answers = workspace.run(
        f"ROS_MASTER_URI=http://localhost:1 {sys.executable} {ASK_PROGRAMS} {' '.join(find_programs(workspace))}"
    )
    for program, (help_answer, refusal) in nonempty(json.loads(answers).items()):
        status, text, errors = help_answer
        assert (status, errors) == (0, ""), f"{program}: {errors}"
        assert text.startswith("usage: ") and len(text.splitlines()) > 3, f"{program}: {text}"
        status, text, errors = refusal
        assert (status, text) == (2, ""), f"{program}: {errors}"
        assert errors.splitlines()[-1].startswith(f"{Path(program).name}: error: "), f"{program}: {errors}"


def test_a_package_with_messages_and_programs_builds_on_what_is_installed(workspace):
    overlay = workspace.directory / "overlay"
    shutil.copytree(str(ROOT / "hero_sim"), str(overlay / "src" / "hero_sim"))
    workspace.run(f"cd {overlay}; catkin_make {CMAKE_ARGUMENTS} -DCATKIN_ENABLE_TESTING=OFF")
    assert os.access(str(overlay / "devel" / "lib" / "hero_sim" / "hero_sim"), os.X_OK)


def test_a_module_that_is_not_installed_is_named_in_one_line(workspace):
    missing = workspace.directory / "missing"
    missing.mkdir()
    (missing / "tqdm.py").write_text("raise ModuleNotFoundError(\"No module named 'tqdm'\")\n")
    output = workspace.run(f"PYTHONPATH={missing}:$PYTHONPATH rosrun hero_recording export 2>&1 || true")
    assert output.startswith("export: No module named 'tqdm'; script/bootstrap") and output.count("\n") == 1


def test_workers_of_a_program_do_not_start_it_again(workspace):
    """Processes that multiprocessing spawns load the program that spawned them."""
    experiment = workspace.directory / "short.yaml"
    experiment.write_text("behavior: aggregation\nrobots: 2\ntime_s: 1\nseeds: {count: 1}\nmetrics: [dispersion]\n")
    workspace.run(f"rosrun hero_swarm run {experiment} --jobs 1")
    assert (workspace.directory / "short" / "runs.csv").is_file()


def test_driver_and_simulated_robots_start_and_odometry_arrives(workspace):
    """The main path of the suite, on ports of its own, from this workspace."""
    program = textwrap.dedent(
        """
        . {setup}
        master_port={master_port} robot_port={robot_port}
        export ROS_MASTER_URI=http://localhost:$master_port ROS_HOSTNAME=localhost ROS_HOME={directory}/ros_home
        roslaunch -p $master_port hero_bringup hero_bringup.launch host:=127.0.0.1 port:=$robot_port count:=2 \\
            >{directory}/launch.log 2>&1 &
        launch=$!
        trap 'kill -INT $launch; wait $launch || true; tail -n 40 {directory}/launch.log' EXIT
        {python} {wait_for_odometry} hero_0 hero_1
        """
    ).format(
        setup=workspace.setup,
        directory=workspace.directory,
        python=sys.executable,
        master_port=find_free_port(),
        robot_port=find_free_port(),
        wait_for_odometry=Path(__file__).with_name("wait_for_odometry.py"),
    )
    run(program, workspace.directory)
