"""Network faults between hosts that are network namespaces: delay, stalls, cut cables, changed addresses.

The PC with the master and the first driver is the namespace that run.py gave to this process; robots and a second
PC are others, joined to it by virtual cables. Nothing of the machine's own network is touched.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import rosgraph
from rig import Program, count_holdings, start_python

from hero_msgs.msg import Encoder, Robot
from hero_test.driver_case import Recorder
from hero_test.nonempty import nonempty
from hero_test.processes import find_free_port
from hero_test.waiting import wait_for

ROBOTS = 5
PC, ROBOT_NET, SECOND_PC = "10.98.1.1", "10.98.1.2", "10.98.2.2"
OTHER_ROBOT_NET = "10.98.1.9"


def run(command):
    subprocess.run(command.split(), check=True)


class Host:
    """A network namespace with one virtual cable to this one."""

    def __init__(self, cable, near, far):
        self._process = subprocess.Popen(["unshare", "--net", "sleep", "infinity"])
        self.prefix = ["nsenter", "--net=/proc/%d/ns/net" % self._process.pid]
        own = os.readlink("/proc/self/ns/net")
        wait_for(lambda: os.readlink("/proc/%d/ns/net" % self._process.pid) != own, "a namespace")
        self.cable = cable
        run(f"ip link add {cable}0 type veth peer name {cable}1")
        run("ip link set %s1 netns %d" % (cable, self._process.pid))
        run(f"ip address add {near}/24 dev {cable}0")
        run(f"ip link set {cable}0 up")
        self.run("ip link set lo up")
        self.run(f"ip address add {far}/24 dev {cable}1")
        self.run(f"ip link set {cable}1 up")
        self.far = far

    def run(self, command):
        """Run a command there."""
        subprocess.run([*self.prefix, *command.split()], check=True)

    def cut(self):
        """Pull the cable: nothing is answered any more, and nobody is told."""
        run(f"ip link set {self.cable}0 down")

    def restore(self):
        run(f"ip link set {self.cable}0 up")

    def end(self):
        self._process.kill()
        self._process.wait()


@pytest.fixture(scope="module")
def master():
    """As elsewhere, but at an address that the second PC can reach."""
    import rospy
    from rig import Master

    if os.environ.get("HERO_OWN_NETWORK") != "yes":
        pytest.skip("this system lets no test have network namespaces of its own (unshare --net): run it as root")
    hosts = [Host("robots", PC, ROBOT_NET), Host("second", "10.98.2.1", SECOND_PC)]
    hosts[1].run("ip route add default via 10.98.2.1")
    with Master(host=PC) as started:
        os.environ.update(started.environment)
        os.environ.pop("ROS_HOSTNAME")
        os.environ["ROS_IP"] = PC
        rospy.init_node("faults", disable_signals=True, anonymous=True)
        started.hosts = hosts
        yield started
        rospy.signal_shutdown("the faults are over")
    for host in hosts:
        host.end()


class Watch:
    """What arrives of each robot of one driver."""

    def __init__(self, driver, numbers):
        self.driver = driver
        self.numbers = list(numbers)
        self.recorders = {
            number: Recorder("/hero_%d/encoder" % number, Encoder, connected=False) for number in self.numbers
        }

    def wait_all_heard(self, what):
        """Return after how many seconds all robots are ready, and heard anew."""
        start_s = time.monotonic()
        counts = {number: len(recorder.messages) for number, recorder in self.recorders.items()}

        def are_heard():
            return all(
                len(self.recorders[number].messages) > counts[number] + 3
                and self.driver.fleet.find("/hero_%d" % number, Robot.READY)
                for number in self.numbers
            )

        wait_for(are_heard, what, 150.0)
        return time.monotonic() - start_s

    def count_lost(self, marks):
        """Return how many readings since marks are missing; the robots' own stamps are 34 ms apart."""
        lost = 0
        for number, recorder in self.recorders.items():
            stamps = [message.header.stamp.to_sec() for message in recorder.messages[marks[number] :]]
            gaps = [later - earlier for earlier, later in zip(stamps, stamps[1:])]
            lost += sum(max(0, round(gap / 0.034) - 1) for gap in gaps if gap > 0.06)
        return lost

    def count_gaps(self, marks):
        """Return how many messages since marks are missing by the driver's numbers; stamps say nothing under jitter,
        by which the robots' clocks are set."""
        numbers = [[m.header.seq for m in r.messages[marks[n] :]] for n, r in self.recorders.items()]
        return sum(seqs[-1] - seqs[0] + 1 - len(seqs) for seqs in numbers)

    def mark(self):
        return {number: len(recorder.messages) for number, recorder in self.recorders.items()}

    def close(self):
        for recorder in self.recorders.values():
            recorder.subscriber.unregister()


def start_robots(host, address, port, first=0):
    """Return simulated robots that run at host and dial address."""
    command = [sys.executable, "-m", "hero_sim", "--count", str(ROBOTS), "--first-id", str(first)]
    return Program(*command, "--host", address, "--port", str(port), "--quiet", prefix=host.prefix)


@pytest.fixture(scope="module")
def lab(master):
    """A driver here, robots on a host of their own, and a relay there that they dial."""
    from hero_test.driver_case import DriverProcess

    robots = master.hosts[0]
    with DriverProcess({"report_period_s": 0.2}, name="lab_driver") as driver:
        port = driver.address[1]
        with start_python("relay.py", ROBOT_NET, 11411, PC, port, prefix=robots.prefix) as relay:
            relay.read()
            yield driver, robots, relay, port


@pytest.fixture
def through_relay(lab):
    driver, robots, relay, _ = lab
    with start_robots(robots, ROBOT_NET, 11411):
        watch = Watch(driver, range(ROBOTS))
        watch.wait_all_heard("all robots")
        yield driver, relay, watch
        watch.close()
    relay.ask("clear")
    wait_for(lambda: not any(driver.fleet.find("/hero_%d" % n, Robot.READY) for n in range(ROBOTS)), "robots to go")


@pytest.fixture
def by_cable(lab):
    driver, robots, _, port = lab
    with start_robots(robots, PC, port):
        watch = Watch(driver, range(ROBOTS))
        watch.wait_all_heard("all robots")
        yield driver, robots, watch
        watch.close()
    wait_for(lambda: not any(driver.fleet.find("/hero_%d" % n, Robot.READY) for n in range(ROBOTS)), "robots to go")


def count_returns(driver):
    return sum(robot.reconnects for robot in driver.fleet.newest.robots)


def test_jitter_of_200_ms_loses_nothing(through_relay, effort, record):
    driver, relay, watch = through_relay
    returns, marks = count_returns(driver), watch.mark()
    relay.ask("jitter 0.2")
    count = effort.choose(60, 600)
    wait_for(
        lambda: all(len(r.messages) > marks[n] + count for n, r in nonempty(watch.recorders.items())), "messages", 60.0
    )
    lost = watch.count_gaps(marks)
    bad = sum(robot.bad_packets for robot in driver.fleet.newest.robots)
    record(
        "200 ms of jitter in the path of %d robots" % ROBOTS,
        ROBOTS,
        ROBOTS - (count_returns(driver) - returns),
        "%d of %d readings, %d frames" % (lost, count * ROBOTS, bad),
    )
    assert (lost, bad) == (0, 0)


def test_stalls_of_3_s_keep_every_connection(through_relay, effort, record):
    driver, relay, watch = through_relay
    returns = count_returns(driver)
    back_s = []
    for _ in range(effort.choose(1, 5)):
        relay.ask("stall 3")
        back_s.append(watch.wait_all_heard("all robots after a stall"))
    tries = ROBOTS * len(back_s)
    record(
        "nothing for 3 s, then all at once",
        tries,
        tries - (count_returns(driver) - returns),
        f"no connection; heard again {max(back_s):.1f} s after the stall began",
    )


def test_a_cut_cable_is_detected_and_all_robots_return(by_cable, effort, record):
    driver, robots, watch = by_cable
    cut_s = effort.choose(7.0, 30.0)
    robots.cut()
    start_s = time.monotonic()
    wait_for(
        lambda: all(driver.fleet.find("/hero_%d" % n, Robot.AWAY) for n in range(ROBOTS)),
        "all robots to be away",
    )
    noticed_s = time.monotonic() - start_s
    wait_for(lambda: time.monotonic() - start_s >= cut_s, "the end of the cut", cut_s + 5.0)
    robots.restore()
    back_s = watch.wait_all_heard("all robots after the cut")
    record(
        "the cable of %d robots is cut for %.0f s" % (ROBOTS, cut_s),
        ROBOTS,
        ROBOTS,
        f"what was sent meanwhile; away after {noticed_s:.1f} s, back {back_s:.1f} s after the end",
    )


def test_robots_keep_their_identity_when_their_address_changes(lab, record):
    driver, robots, _, port = lab
    watch = Watch(driver, range(ROBOTS))
    with start_robots(robots, PC, port):
        watch.wait_all_heard("all robots")
        robots.cut()
    # No word of the end came through; the same robots come with other addresses.
    robots.run(f"ip address add {OTHER_ROBOT_NET}/24 dev robots1")
    robots.run(f"ip address del {ROBOT_NET}/24 dev robots1")
    robots.run(f"ip address replace {OTHER_ROBOT_NET}/24 dev robots1")
    robots.restore()
    start_s = time.monotonic()
    with start_robots(robots, PC, port):

        def have_moved():
            found = [driver.fleet.find("/hero_%d" % number, Robot.READY) for number in range(ROBOTS)]
            return all(robot and robot.address.startswith(OTHER_ROBOT_NET + ":") for robot in found)

        wait_for(have_moved, lambda: f"all robots at their new address: {driver.fleet.newest}", 60.0)
        watch.wait_all_heard("all robots at their new address")
        back_s = time.monotonic() - start_s
    watch.close()
    robots.run(f"ip address add {ROBOT_NET}/24 dev robots1")
    record("robots get another address", ROBOTS, ROBOTS, f"what was sent meanwhile; back after {back_s:.1f} s")


def test_killing_one_of_two_drivers_does_not_affect_the_other(by_cable, master, record):
    from hero_test.driver_case import DriverProcess

    driver, _, watch = by_cable
    second = master.hosts[1]
    options = {"name": "second_driver", "prefix": second.prefix, "environment": {"ROS_IP": SECOND_PC}}
    port = 11411
    killed = DriverProcess({"port": port, "report_period_s": 0.2}, **options)
    with start_robots(second, SECOND_PC, port, first=50):
        others = Watch(killed, range(50, 50 + ROBOTS))
        others.wait_all_heard("robots of the second PC")
        returns, marks = count_returns(driver), watch.mark()
        killed.process.kill()
        killed.wait_end()
        killed.fleet.close()
        start_s = time.monotonic()
        again = DriverProcess({"port": port, "report_period_s": 0.2}, **options)
        others.driver = again
        others.wait_all_heard("robots of the second PC again")
        back_s = time.monotonic() - start_s
        watch.wait_all_heard("robots of the first PC")
        lost = watch.count_lost(marks)
        others.close()
    again.__exit__()
    assert count_returns(driver) == returns
    record(
        "of two drivers on two hosts one is killed and started again",
        ROBOTS,
        ROBOTS,
        "%d readings of the other's robots; its own back %.1f s after the start" % (lost, back_s),
    )


def test_running_out_of_ports_does_not_affect_connected_robots(by_cable, record):
    driver, _, watch = by_cable
    ports = Path("/proc/sys/net/ipv4/ip_local_port_range")
    usual = ports.read_text()
    returns, marks = count_returns(driver), watch.mark()
    taken = find_free_port()
    ports.write_text("%d %d" % (taken, taken))
    try:
        # New connections of this PC have no port to come from; the robots' own go on.
        with pytest.raises((OSError, rosgraph.MasterException)):
            for _ in range(3):
                rosgraph.Master("/faults").lookupNode(driver.node)
                count_holdings(driver)
        wait_for(lambda: all(len(r.messages) > marks[n] + 60 for n, r in nonempty(watch.recorders.items())), "messages")
    finally:
        ports.write_text(usual)
    wait_for(lambda: rosgraph.Master("/faults").lookupNode(driver.node), "the master to be reached again")
    assert driver.process.poll() is None
    record(
        "no ports are left",
        ROBOTS,
        ROBOTS - (count_returns(driver) - returns),
        "%d readings" % watch.count_lost(marks),
    )
