"""Scripts for robots, run on simulated ones in process: unchanged, in virtual time, and without ROS."""

import subprocess
import sys

import pytest

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


def run(tmp_path, text, *options, arguments=("argument",)):
    script = tmp_path / "script.py"
    script.write_text(text)
    command = [sys.executable, "-m", "hero_sim.in_process", *options, str(script), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_script_for_robots_runs_unchanged_on_stepped_ones(tmp_path):
    first, again = (run(tmp_path, SCRIPT, "--count", "3") for _ in range(2))
    assert first.returncode == 0, first.stderr
    assert first.stdout.startswith("argument Pose(x_m=0.")
    assert first.stdout.splitlines()[1].startswith("3 2 4")
    assert "s simulated; hero_0 at (" in first.stderr and "hero_2" not in first.stderr
    assert first.stdout == again.stdout


def test_modules_beside_the_script_have_its_time_and_others_do_not(tmp_path):
    (tmp_path / "beside.py").write_text("from time import monotonic, sleep\n")
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "__init__.py").write_text("from time import monotonic\n")
    text = "import beside, package, time\nbeside.sleep(100.0)\nprint(beside.monotonic(), time.time())\n"
    ended = run(tmp_path, text + "print(package.monotonic is beside.monotonic)\n")
    assert (ended.returncode, ended.stdout) == (0, "100.0 100.0\nFalse\n"), ended.stderr


def test_libraries_keep_the_time_of_the_machine(tmp_path):
    text = "import time, threading\nfrom time import monotonic\nthreading.Event().wait(0.01)\n"
    ended = run(tmp_path, text + "import sched\nassert sched._time is not monotonic\nprint(monotonic(), time.time())\n")
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
def test_a_program_with_parameters_runs_until_its_time_is_over(tmp_path, arguments, status, message):
    ended = run(tmp_path, PROGRAM, "--count", "2", "--seconds", "3", arguments=arguments)
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
def test_what_simulated_robots_cannot_do_is_one_line(tmp_path, text, message):
    ended = run(tmp_path, text)
    assert ended.returncode == 1
    assert message in ended.stderr and "Traceback" not in ended.stderr


def test_an_option_that_cannot_be_used_is_one_line(tmp_path):
    ended = run(tmp_path, "", "--model", "hero_minus")
    assert ended.returncode == 1
    assert "--model hero_minus: must be one of" in ended.stderr and "Traceback" not in ended.stderr
