"""Fixtures of the fault suite: its own ROS master and node, the short or long form, the table of results."""

import json
import os

import pytest
import rospy
from rig import Master


class Effort:
    """How much is tried: the short form that script/test runs, or the long one of script/soak."""

    def __init__(self, is_long, minutes):
        self.is_long = is_long
        self.minutes = minutes  # for what is as long as one likes

    def choose(self, short, long):
        """Return one of the two."""
        return long if self.is_long else short


def pytest_terminal_summary(terminalreporter):
    from simulated_robots import SEED

    terminalreporter.write_line("the simulated robots were drawn with HERO_SEED=%d" % SEED)


def pytest_addoption(parser):
    parser.addoption("--long", action="store_true", help="the long form, as script/soak runs it")
    parser.addoption("--minutes", type=float, default=1.0, help="length of the soak in the long form")
    parser.addoption("--table", default="", help="file to which the rows of the table are added")


@pytest.fixture(scope="session")
def effort(request):
    return Effort(request.config.getoption("--long"), request.config.getoption("--minutes"))


@pytest.fixture(scope="session")
def master():
    with Master() as started:
        os.environ.update(started.environment)
        rospy.init_node("faults", disable_signals=True, anonymous=True)
        yield started
        rospy.signal_shutdown("the faults are over")


@pytest.fixture
def record(request):
    """Return what writes one row of the table: record(fault, tried, survived, lost)."""

    def write(fault, tried, survived, lost="nothing"):
        row = {"fault": fault, "tried": tried, "survived": survived, "lost": lost}
        path = request.config.getoption("--table")
        if path:
            with open(path, "a", encoding="utf-8") as table:
                table.write(json.dumps(row) + "\n")
        print("%(fault)s: %(survived)d of %(tried)d survived, lost: %(lost)s" % row)
        assert survived == tried, row

    return write


@pytest.fixture
def start_driver(master):
    """Return what starts a driver, which ends after the test; as DriverProcess()."""
    from hero_test.driver_case import DriverProcess

    drivers = []

    def start(**options):
        drivers.append(DriverProcess(**options))
        return drivers[-1]

    yield start
    for driver in drivers:
        driver.__exit__()
