"""Robots that send garbage to a real driver."""

import os
import random

import emulated_swarm
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
