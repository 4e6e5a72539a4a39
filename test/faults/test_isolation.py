"""Good robots at stock rates beside one misbehaving peer at a time: the robots lose nothing."""

import sys
import time

import emulated_swarm
import pytest
import rospy
from rig import (
    BENCH,
    EMULATED_NAMES,
    Program,
    count_holdings,
    count_robots_names,
    start_python,
    wait_until_commanded,
)

from hero_msgs.msg import Encoder
from hero_test import stock_messages
from hero_test.fake_robot import FakeRobot
from hero_test.waiting import wait_for

GOOD_ROBOTS = 8, 20
"""In the short form and in the long one."""
REGISTRATIONS_S = 600.0
"""A ROS master that hardly gets to run has hundreds of topics of a misbehaving peer to take down."""

NEWCOMER = 77

BAD_PEERS = {
    "garbage": "sends garbage at full speed",
    "byte_by_byte": "sends one byte per second on 50 connections",
    "connects": "connects and leaves, as fast as it can",
    "silent_connections": "holds connections that say nothing",
    "never_reads": "asks and never reads the answers",
    "huge_packets": "sends huge packets",
    "many_topics": "declares 10,000 topics",
    "renames": "comes under a new name each time",
    "stays": "comes under a new name each time and stays a while",
    "claims_an_id": "claims another robot's id",
    "claims_topics": "claims another robot's topics",
    "foreign_transforms": "sends another robot's transforms",
    "log_flood": "floods the log",
    "service_answers": "floods answers of services",
    "bad_md5": "declares types with a wrong md5",
}


class Scene:
    """A driver, good robots, a listener to all of them, a commander and bad peers, each a process of its own."""

    def __init__(self, count, driver, peers, listener, swarm, commander):
        self.count = count
        self.driver = driver
        self.peers = peers
        self.listener = listener
        self.swarm = swarm
        self.commander = commander
        self.transforms = 0
        self.quiet_p99_ms = None

    def hear(self, seconds):
        """Return when the good robots have been heard for about so long since the last window."""
        count = int(seconds * 2 * self.count / emulated_swarm.BURST_PERIOD_S)
        wait_for(lambda: self.listener.ask("count") >= count, "%d messages" % count)

    def end_window(self):
        """Return what the listener got since the last call."""
        window = self.listener.ask("window")
        self.transforms += window["transforms"]
        return window


@pytest.fixture(scope="module")
def scene(master, effort):
    from hero_test.driver_case import DriverProcess

    count = effort.choose(*GOOD_ROBOTS)
    robots = ["--count", str(count)]
    with DriverProcess({"grace_s": 1.0}, name="isolating_driver") as driver:
        port = str(driver.address[1])
        path = {"PYTHONPATH": ":".join(sys.path)}
        with start_python("bad_peer.py", "--port", port, environment=path) as peers, start_python(
            "listener.py", *robots
        ) as listener, Program(sys.executable, str(BENCH / "ros_load.py"), "command", *robots) as commander:
            listener.read()
            wait_until_commanded(count)
            with Program(
                sys.executable,
                str(BENCH / "emulated_swarm.py"),
                "--port",
                port,
                "--seconds",
                "100000",
                *robots,
            ) as swarm:
                started = Scene(count, driver, peers, listener, swarm, commander)
                wait_for(lambda: not listener.ask("silent"), "all robots at the listener")
                wait_for(
                    lambda: count_robots_names(driver) == EMULATED_NAMES * count,
                    "all topics of all robots",
                )
                yield started


def join_and_leave(driver):
    """Let one more robot join, until what it sends arrives in ROS; return how long that took."""
    robot = FakeRobot(NEWCOMER, source_host="127.0.0.77")
    encoders = []
    start_s = time.monotonic()
    subscriber = rospy.Subscriber(robot.namespace + "/encoder", Encoder, encoders.append, tcp_nodelay=True)

    def is_heard():
        if not robot.is_connected:
            robot.close()
            robot.connect(driver.address)
        robot.send("encoder", stock_messages.make_encoder(robot.name, rospy.Time.now(), 1.0, 1.0))
        return encoders

    try:
        wait_for(is_heard, lambda: "the newcomer: %s" % (robot.ended or driver.lines[-20:]), REGISTRATIONS_S)
        return time.monotonic() - start_s
    finally:
        robot.close()
        subscriber.unregister()


@pytest.mark.parametrize("kind", BAD_PEERS)
def test_a_misbehaving_peer_costs_other_robots_no_message(scene, effort, record, kind):
    seconds = effort.choose(0.5, 10.0)
    if effort.is_long:
        # What these robots' delays are by themselves.
        scene.end_window()
        scene.hear(seconds)
        scene.quiet_p99_ms = scene.end_window()["p99_ms"]
    before = count_holdings(scene.driver)
    scene.end_window()
    # Each from an address of its own: what one has used up of its allowance does not tame the next.
    scene.peers.ask("%s 127.0.0.%d" % (kind, 100 + list(BAD_PEERS).index(kind)))
    scene.hear(seconds)
    joined_s = join_and_leave(scene.driver)
    worst = count_holdings(scene.driver).describe_growth(before)
    did = scene.peers.ask("end")
    window = scene.end_window()
    assert did["connects"], did
    assert (window["silent"], window["lost"], window["disordered"]) == ([], 0, 0), (window, did)
    wait_for(
        lambda: count_holdings(scene.driver).registrations <= before.registrations,
        lambda: f"the bad peer's topics to go: {count_holdings(scene.driver).describe_growth(before)}",
        REGISTRATIONS_S,
    )
    growth = count_holdings(scene.driver).describe_growth(before)
    lost = "nothing"
    if effort.is_long:
        lost += f"; p99 {window['p99_ms']:.1f} ms, without it {scene.quiet_p99_ms:.1f} ms"
        lost += f"; a new robot joined in {joined_s:.1f} s; at worst {worst}; after it {growth}"
    record("one of %d peers %s" % (scene.count + 1, BAD_PEERS[kind]), 1, 1, lost)


def test_all_robots_stayed_and_every_transform_arrived(scene, record):
    scene.end_window()
    commanded = scene.commander.interrupt()["commands_s"]
    sent = scene.swarm.interrupt()
    wait_for(
        lambda: scene.end_window() and scene.transforms >= sent["transforms"],
        lambda: "all of %d transforms, got %d" % (sent["transforms"], scene.transforms),
    )
    received = {stamp_s for stamp_s, _ in sent["commands_s"]}
    missing = [stamp_s for stamp_s in commanded if stamp_s not in received]
    record(
        "all of the above: %d robots stayed, %d transforms and %d commands"
        % (scene.count, sent["transforms"], len(commanded)),
        scene.count,
        scene.count - sent["thrown_out"],
        "%d transforms, %d commands whose place a newer one took"
        % (sent["transforms"] - scene.transforms, len(missing)),
    )
    assert sent["transforms"] == scene.transforms
    # A velocity that has to wait gives way to a newer one: the busier the machine, the more.
    assert len(missing) < len(commanded) / 2
