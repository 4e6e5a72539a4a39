"""Robots that send garbage to a real driver; in the long form, coverage-guided fuzzing of the code that reads it."""

import os
import random
import re
import subprocess

import emulated_swarm
import pytest
import rospy
import rosservice
from rig import HERE
from service_check import ServiceCheck

from hero_msgs.srv import SetPID
from hero_test.fake_robot import STOCK_DECLARATIONS, FakeRobot

GARBLED = 5


def garble(data, chance):
    """Return data with some bits flipped, parts cut out and parts said twice."""
    changed = bytearray(data)
    for _ in range(chance.randrange(1, 8)):
        place = chance.randrange(len(changed))
        kind = chance.randrange(3)
        if kind == 0:
            changed[place] ^= chance.randrange(1, 256)
        elif kind == 1:
            del changed[place : place + chance.randrange(60)]
        else:
            changed[place:place] = changed[place : place + chance.randrange(60)]
    return bytes(changed)


def test_garbled_robots_do_not_affect_the_driver_or_other_robots(start_driver, effort, record):
    driver = start_driver()
    witness = FakeRobot(1).connect(driver.address)
    service = ServiceCheck(driver, witness)
    chance = random.Random(effort.choose(5, os.getpid()))
    conversations = effort.choose(200, 20000)
    for count in range(conversations):
        number = 10 + count % GARBLED
        burst = emulated_swarm.declare(number)
        burst += b"".join(bytes(part) for part in emulated_swarm.Templates(number).make_burst(count, bytes(8))) * 3
        robot = FakeRobot(number, declarations=STOCK_DECLARATIONS, source_host="127.0.0.%d" % number)
        robot.declares = False
        robot.connect(driver.address)
        data = garble(burst, chance)
        while data:
            length = chance.randrange(1, 2000)
            robot.send_bytes(data[:length])
            data = data[length:]
        robot.close()
        if count % 20 == 0:
            service.verify()
    service.verify(10)
    witness.close()
    assert not driver.find_lines("Traceback|made a mistake"), driver.find_lines("Traceback|mistake")[:3]
    record("conversations of garbled robots", conversations, conversations)


def test_invalid_service_requests_never_reach_a_robot(start_driver, record):
    driver = start_driver()
    robot = FakeRobot(1).connect(driver.address)
    service = ServiceCheck(driver, robot)
    refused = 0
    requests = [
        (name, SetPID, [value] + [1.0] * 5)
        for name in ("velocity_controller/pid_parameters", "position_controller/pid_parameters")
        for value in (float("nan"), float("inf"), -float("inf"), 1e30, -1e30, 3e38)
    ]
    for name, service_type, values in requests:
        full_name = "/hero_1/" + name
        rospy.wait_for_service(full_name, 60.0)
        with pytest.raises(rospy.ServiceException, match="finite"):
            rospy.ServiceProxy(full_name, service_type)(*values)
        refused += robot.payloads_on(name) == []
    assert rosservice.get_service_type("/hero_1/set_odom") == "hero_msgs/SetOdom"
    service.verify()
    robot.close()
    record("service requests with NaN, inf and absurd PIDs", len(requests), refused, "nothing; each is refused")


def test_coverage_guided_fuzzing_finds_no_bytes_that_raise(effort, record, tmp_path):
    """Only in the long form: it needs atheris, from PyPI, and minutes."""
    if not effort.is_long:
        return
    interpreter = os.environ.get("HERO_FUZZ_PYTHON")
    if not interpreter:
        pytest.skip("atheris could not be installed from PyPI; see .work/log/fuzz.log")
    corpus = tmp_path / "corpus"
    corpus.mkdir()
    (corpus / "stock").write_bytes(b"\x60" + emulated_swarm.declare(0))
    seconds = os.environ.get("HERO_FUZZ_SECONDS", "120")
    done = subprocess.run(
        [
            interpreter,
            str(HERE / "fuzz_codec.py"),
            "-max_total_time=" + seconds,
            "-max_len=8000",
            str(corpus),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=str(tmp_path),
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    runs = int(re.findall(r"Done (\d+) runs", done.stdout)[-1])
    record("inputs of coverage-guided fuzzing (atheris)", runs, runs)
