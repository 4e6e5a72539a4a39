"""Robots that send garbage to a real driver; in the long form, coverage-guided fuzzing of the code that reads it."""

import os
import random
import re
import subprocess

import emulated_swarm
import pytest
from rig import HERE
from service_check import ServiceCheck

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
