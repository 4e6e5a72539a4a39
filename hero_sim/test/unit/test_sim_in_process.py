"""Scripts for robots, run on simulated ones in process: unchanged, in virtual time, and without ROS."""

import builtins
import subprocess
import sys
from types import SimpleNamespace

import pytest

import hero_client
from hero_sim import in_process

SCRIPT = """
import sys, time
from hero_client import Robot, Swarm, rate

with Robot(1) as robot:
    robot.forward(0.1)
    print(sys.argv[1], robot.pose)
with Swarm.discover() as swarm, Swarm([0, 1]) as pair:
    begun_s = time.time()
    while time.time() < begun_s + 20.0:
        pair.drive(0.0, 1.0)
        time.sleep(0.5)
    for time_s in rate(10):
        if time_s > 20.0:
            break
    print(len(swarm), len(pair), round(time.monotonic()))
"""


@pytest.fixture(name="run")
def fixture_run(tmp_path, monkeypatch, capsys):
    """Return a function that runs a script with options in this process, which afterwards is as it was."""

    def run(text, *options, arguments=("argument",)):
        script, known = tmp_path / "script.py", set(sys.modules)
        script.write_text(text)
        with monkeypatch.context() as patch:
            patch.setattr(hero_client, "_CHOSEN", {})
            patch.setattr(builtins, "__import__", builtins.__import__)
            patch.setattr(sys, "argv", list(sys.argv))
            patch.setattr(sys, "path", list(sys.path))
            status = in_process.main([*options, str(script), *arguments])
        for name in set(sys.modules) - known:
            if str(tmp_path) in (getattr(sys.modules[name], "__file__", None) or ""):
                del sys.modules[name]
        out, err = capsys.readouterr()
        return SimpleNamespace(returncode=status, stdout=out, stderr=err)

    return run


def test_scripts_run_as_programs_of_their_own(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    command = [sys.executable, "-m", "hero_sim.in_process", "--count", "3", str(script), "argument"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0 and ended.stdout.startswith("argument Pose(x_m=0."), ended.stderr


def test_a_script_for_robots_runs_unchanged_on_stepped_ones(run):
    first, again = (run(SCRIPT, "--count", "3") for _ in range(2))
    assert first.returncode == 0, first.stderr
    assert first.stdout.startswith("argument Pose(x_m=0.")
    assert first.stdout.splitlines()[1].startswith("3 2 4")
    assert "s simulated; hero_0 at (" in first.stderr and "hero_2" not in first.stderr
    assert first.stdout == again.stdout


def test_modules_beside_the_script_have_its_time_and_others_do_not(tmp_path, run):
    (tmp_path / "beside.py").write_text("from time import monotonic, sleep\n")
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "__init__.py").write_text("from time import monotonic\n")
    text = "import beside, package, time\nbeside.sleep(100.0)\nprint(beside.monotonic(), time.time())\n"
    ended = run(text + "print(package.monotonic is beside.monotonic)\n")
    assert (ended.returncode, ended.stdout) == (0, "100.0 100.0\nFalse\n"), ended.stderr


def test_libraries_keep_the_time_of_the_machine(run):
    text = "import time, threading\nfrom time import monotonic\nthreading.Event().wait(0.01)\n"
    ended = run(text + "import sched\nassert sched._time is not monotonic\nprint(monotonic(), time.time())\n")
    assert (ended.returncode, ended.stdout) == (0, "0.0 0.0\n"), ended.stderr


PROGRAM = """
from hero_client import Program, open_swarm, read_parameters, run
from hero_node.parameters import number, robot_ids

def drive():
    with Program("my_program") as program:
        parameters = read_parameters({"robots": robot_ids("all"), "linear_m_s": number(0.05, 0.0, 0.2, "m/s")})
        with open_swarm(program, parameters["robots"]) as swarm:
            for _ in program.rate(10):
                swarm.drive(parameters["linear_m_s"], 0.0)
                swarm.report_missing()

run(drive)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        ((), 0, "3.2 s simulated; hero_0 at ("),
        (("_robots:=1", "_linear_m_s:=0.1"), 0, "3.2 s simulated; hero_1 at ("),
        (("_linear_m_s:=3",), 1, "~linear_m_s is 3, but must be a number from 0 to 0.2 m/s (script.py, line 7)"),
    ],
)
def test_a_program_with_parameters_runs_until_its_time_is_over(run, arguments, status, message):
    ended = run(PROGRAM, "--count", "2", "--seconds", "3", arguments=arguments)
    assert ended.returncode == status, ended.stderr
    assert message in ended.stderr and "Traceback" not in ended.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("from hero_client import Robot\nRobot(1).encoder", "encoder of hero_1 is a ROS message, which robots"),
        ("from hero_client import Robot\nRobot(7)", "script.py: hero_7 is not there: --count 4 simulates fewer"),
        ("from hero_client import Robot\nRobot(7)", "simulates fewer (script.py, line 2)"),
    ],
)
def test_what_simulated_robots_cannot_do_is_one_line(run, text, message):
    ended = run(text)
    assert ended.returncode == 1
    assert message in ended.stderr and "Traceback" not in ended.stderr


def test_an_option_that_cannot_be_used_is_one_line(run):
    ended = run("", "--model", "hero_minus")
    assert ended.returncode == 1
    assert "--model hero_minus: must be one of" in ended.stderr and "Traceback" not in ended.stderr


def test_only_perfect_robots_drive_straight(run):
    text = "from hero_client import Robot\nwith Robot(0) as robot:\n    robot.drive(0.1, 0.0, duration_s=2.0)\n"
    for options, is_straight in (((), False), (("--perfect",), True)):
        assert (run(text + "    print(robot.pose.yaw_rad)", *options).stdout == "0.0\n") == is_straight


def test_robots_are_four_unless_counted_and_named_where_they_ended(run, tmp_path):
    text = "from hero_client import Swarm\nwith Swarm.discover() as swarm:\n    print(len(swarm))\n"
    drive = text + "    swarm[1].forward(0.05)\n    swarm[1].drive(0.0, 0.5, duration_s=1.0)\n    1 / 0\n"
    ended = run(text, arguments=())
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "4\n", "0.1 s simulated\n")
    with pytest.raises(ZeroDivisionError):
        run(drive, "--perfect", "--seed=3")
    ended = run("", "--count=2", "--arena=/nowhere.yaml")
    assert ended.returncode == 1 and "arena /nowhere.yaml" in ended.stderr
    ended = run("import sys\nfrom hero_client import Robot, Swarm\nSwarm([5])", "--count=2", "--seed=3")
    assert ended.returncode == 1 and "hero_5 is not there: --count 2 simulates fewer" in ended.stderr
    assert in_process.main([str(tmp_path / "gone.py")]) == 1
