"""Thousands of reconnects and power cuts: the driver leaks nothing."""

import struct

import emulated_swarm
from rig import EMULATED_NAMES, STOCK_NAMES, count_holdings, count_robots_names
from service_check import ServiceCheck

from hero_msgs.msg import Robot
from hero_test.driver_case import list_driver_topics
from hero_test.fake_robot import FakeRobot
from hero_test.waiting import wait_for

SWARM = 10
MEMORY_GROWTH_KB = 5000
"""Pages that Python has got and keeps; what leaks with each of hundreds of returns would be more."""


class Swarm:
    """Robots whose connections end as a test likes; they say what emulated robots say."""

    def __init__(self, driver, first=100):
        self._address = driver.address
        self._numbers = range(first, first + SWARM)
        self._links = []

    def join(self):
        """Dial, declare, wait for the answer to the first time request, and send one burst."""
        links = [emulated_swarm.EmulatedRobot(number, self._address) for number in self._numbers]
        for link in links:
            link.socket.setblocking(True)
            link.socket.settimeout(60.0)
            while link.synchronized_s is None and not link.closed:
                link.receive(1.0)
            assert not link.closed, link.number
            link.send(b"".join(link.templates.make_burst(0, struct.pack("<II", 1, 0))))
        old, self._links = self._links, links
        return old

    def leave(self):
        """Hang up, as robots do that change the network."""
        for link in self._links:
            link.socket.close()
        self._links = []

    def cut_power(self):
        """Come again without ever having hung up; the driver ends the old connections, of which nothing comes."""
        for link in self.join():
            while not link.closed:
                link.receive(1.0)
            link.socket.close()


def count_states(driver):
    return sum(robot.state == Robot.READY for robot in driver.fleet.newest.robots)


def run_rounds(driver, swarm, rounds, act):
    """Do act() in rounds; return what the driver held after the first ones and after the last."""

    def settle():
        # What waits for the ROS master is dropped with a connection: these stay until all topics are there.
        swarm.cut_power()
        wait_for(lambda: is_settled(driver), "the topics of all robots")

    warm_up = max(3, rounds // 10)
    for _ in range(warm_up):
        act()
    settle()
    before = count_holdings(driver)
    for _ in range(rounds - warm_up):
        act()
    settle()

    def is_flat():
        now = count_holdings(driver)
        return now.threads <= before.threads and now.files <= before.files + SWARM

    wait_for(is_flat, lambda: count_holdings(driver).describe_growth(before))
    return before, count_holdings(driver)


def is_settled(driver):
    """Return whether the master knows the topics of each robot of a swarm, and the driver has no more to say."""
    return count_robots_names(driver) == EMULATED_NAMES * SWARM + STOCK_NAMES


def judge(record, fault, count, before, after):
    """Write the row; the figures must be flat."""
    assert after.registrations == before.registrations, after.describe_growth(before)
    assert after.memory_kb <= before.memory_kb + MEMORY_GROWTH_KB, after.describe_growth(before)
    record(
        fault,
        count,
        count,
        "nothing; from %d MB: %s" % (before.memory_kb / 1000, after.describe_growth(before)),
    )


def test_reconnects_leak_nothing(start_driver, effort, record):
    driver = start_driver(parameters={"grace_s": 3600.0})
    witness = FakeRobot(1).connect(driver.address)
    service = ServiceCheck(driver, witness)
    swarm = Swarm(driver)
    rounds = effort.choose(100, 10000) // SWARM

    def act():
        swarm.join()
        swarm.leave()

    before, after = run_rounds(driver, swarm, rounds, act)
    service.verify(10)
    judge(record, "reconnects (FIN), %d robots at a time" % SWARM, rounds * SWARM, before, after)
    witness.close()


def test_power_cuts_leak_nothing(start_driver, effort, record):
    driver = start_driver(parameters={"grace_s": 3600.0})
    witness = FakeRobot(1).connect(driver.address)
    service = ServiceCheck(driver, witness)
    swarm = Swarm(driver)
    rounds = effort.choose(8, 1000)
    before, after = run_rounds(driver, swarm, rounds, swarm.cut_power)
    wait_for(lambda: count_states(driver) == SWARM + 1, "all robots to be ready")
    service.verify(10)
    judge(record, "power cuts (no FIN) of a swarm of %d" % SWARM, rounds, before, after)
    swarm.leave()
    witness.close()


def test_departed_robots_leak_nothing(start_driver, effort, record):
    # So many new robots in so short a time are more than one address may have otherwise.
    driver = start_driver(parameters={"grace_s": 0.0, "max_connections_per_address": 5000})
    rounds = effort.choose(2, 100)

    def act():
        swarm = Swarm(driver)
        swarm.join()
        wait_for(lambda: list_driver_topics("/hero_109", driver.node), "topics of the last one")
        swarm.leave()
        wait_for(lambda: not count_robots_names(driver), "all topics to be gone")

    act()
    before = count_holdings(driver)
    for _ in range(rounds):
        act()
    after = count_holdings(driver)
    assert after.files <= before.files and after.threads <= before.threads, after.describe_growth(before)
    judge(record, "robots that leave for good", rounds * SWARM, before, after)
