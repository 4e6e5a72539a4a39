"""What untrusted peers can do, tested from outside: other addresses and names, forged log lines, path traversal."""

import contextlib
import itertools
import re
import socket

import emulated_swarm
import pytest
import rosgraph
import rospy
from bad_peer import declare_topic
from service_check import ServiceCheck
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool

from hero_driver.rosserial import payloads
from hero_msgs.msg import RobotArray
from hero_test.driver_case import Recorder
from hero_test.fake_robot import PUB, STOCK_DECLARATIONS, Declaration, FakeRobot
from hero_test.stock_messages import STRING_MD5, make_text
from hero_test.waiting import wait_for

EVIL_NAMES = (
    "/hero_7/../../etc/passwd",
    "/hero_7/\n[FATAL] [1.0]: all is lost",
    "/hero_7/\x1b]0;title\x07",
    "/hero_7/\u202egnp.exe",
    "/hero_7/%s%n%d",
    "/hero_7/$(reboot)",
    "/hero_7/<b>bold</b>",
    "~/hero_7",
    "/",
    "",
)
EVIL_TYPES = ("os/system", "../msg/String", "std_msgs/String\n", "subprocess/Popen", "__main__/x")


def list_names(node):
    """Return what a node publishes, subscribes to and serves."""
    state = rosgraph.Master("/faults").getSystemState()
    return {name for part in state for name, nodes in part if node in nodes}


def test_a_default_bind_is_warned_about_with_the_remedy(start_driver, record):
    driver = start_driver(parameters={"host": "0"})  # another name of the default
    line = driver.wait_line("can pose as a robot")
    assert "~host" in line and "~allow" in line
    quiet = start_driver(parameters={"host": "127.0.0.1"})
    quiet.wait_line("listening on 127.0.0.1")
    guarded = start_driver(parameters={"allow": ["127.0.0.0/8"]})
    guarded.wait_line("listening on 0.0.0.0")
    assert not quiet.find_lines("can pose as a robot") and not guarded.find_lines("can pose as a robot")
    record("a default bind on all addresses, said with its remedy", 1, 1)


def test_addresses_outside_the_allow_list_get_no_byte(start_driver, record):
    driver = start_driver(parameters={"allow": ["127.0.0.7/32"]})
    robot = FakeRobot(1, source_host="127.0.0.7").connect(driver.address)
    service = ServiceCheck(driver, robot)
    tries = 50
    heard = 0
    for number in range(tries):
        with socket.socket() as peer:
            peer.bind(("127.0.0.%d" % (10 + number), 0))
            peer.settimeout(60.0)
            peer.connect(driver.address)
            try:
                peer.sendall(emulated_swarm.declare(2))
                heard += len(peer.recv(100))
            except OSError:
                continue
    assert not driver.fleet.find("/hero_2")
    service.verify()
    robot.close()
    record("connections from addresses that are not in ~allow", tries, tries - bool(heard) * tries)


def test_robots_cannot_escape_their_namespace_or_run_code(start_driver, record):
    driver = start_driver()
    evil = [Declaration(PUB, 150 + n, name, "std_msgs/String", STRING_MD5) for n, name in enumerate(EVIL_NAMES)]
    evil += [Declaration(PUB, 180 + n, "/hero_7/t%d" % n, kind, STRING_MD5) for n, kind in enumerate(EVIL_TYPES)]
    # FakeRobot puts its own name into names with braces only.
    robot = FakeRobot(7, declarations=STOCK_DECLARATIONS)
    robot.declarations += evil
    robot.connect(driver.address)
    service = ServiceCheck(driver, robot)
    service.verify()
    outside = [
        name
        for name in list_names(driver.node)
        if not re.fullmatch(rf"/hero_7/[a-z_/]+|/tf|/rosout|/clock|/diagnostics|{driver.node}/\w+", name)
    ]
    robot.close()
    assert not driver.find_lines("Traceback")
    record("names and types made to break out", len(evil), len(evil) - len(outside), "nothing; each is refused")


def test_robots_cannot_forge_log_lines_of_others(start_driver, record):
    driver = start_driver()
    robot = FakeRobot(7).connect(driver.address)
    service = ServiceCheck(driver, robot)
    texts = [
        "first\n[FATAL] [1.0]: hero_1 left",
        "\r[ERROR] over it",
        "\x1b[2J\x1b[1;1Hclean",
        "\u202edrawkcab",
        "a\x00b",
        "\x85next \u2028line",
        "%s %d %(name)s {0}",
        "x" * 4000,
    ]
    for text in texts:
        robot.log(text, payloads.LOG_WARN)
    robot.log("the end")
    driver.wait_line("hero_7: the end")
    service.verify()
    robot.close()
    lines = list(driver.lines)
    forged = [line for line in lines if not re.match(r"\x1b?\[?\d*m?\[(DEBUG|INFO|WARN|ERROR|FATAL)\] \[\d{9,}", line)]
    odd = [line for line in lines if re.search(r"[\x00-\x08\x0b-\x1a\x1c-\x1f\x7f\u2028\u202e\x85]", line)]
    assert not forged and not odd, (forged, odd)
    record(
        "log texts made to forge lines",
        len(texts),
        len(texts),
        "their control characters, and all beyond 400",
    )


@pytest.mark.parametrize("kind", ["a connection", "a robot"])
def test_no_peer_exceeds_the_limits(start_driver, record, kind):
    driver = start_driver(parameters={"max_connections_per_address": 5, "max_connections": 50})
    friend = FakeRobot(1, source_host="127.0.0.7").connect(driver.address)
    service = ServiceCheck(driver, friend)
    socks = []
    for number in range(20):
        sock = socket.socket()
        sock.bind(("127.0.0.66", 0))
        sock.connect(driver.address)
        socks.append(sock)
        if kind == "a robot":
            sock.sendall(emulated_swarm.declare(100 + number) + declare_topic(0, 150, "/hero_1/x", "a/B", STRING_MD5))
    driver.wait_line("~max_connections_per_address")
    wait_for(lambda: driver.find_lines("refused"), "a refusal")
    service.verify()
    taken = sum(robot.namespace.startswith("/hero_1") and robot.id >= 100 for robot in driver.fleet.newest.robots)
    for sock in socks:
        sock.close()
    friend.close()
    record(f"20 times {kind} from one address that may have 5", 1, int(taken <= 5), "what was beyond the limit")


def test_a_robot_cannot_impersonate_the_driver(start_driver, record):
    driver = start_driver()
    rospy.wait_for_service(driver.node + "/stop", 60.0)
    rospy.ServiceProxy(driver.node + "/stop", SetBool)(True)
    robot = FakeRobot(
        declarations=[
            Declaration(PUB, 125, "/hero_0/state", "std_msgs/String", STRING_MD5),
            Declaration(PUB, 126, driver.node + "/stop_request", "std_msgs/Bool", Bool._md5sum),
            Declaration(PUB, 127, "/hero_0/fleet", "hero_msgs/RobotArray", RobotArray._md5sum),
        ]
    ).connect(driver.address)
    driver.fleet.wait_ready("/hero_0")
    states = Recorder("/hero_0/state", String)
    robot.send_packet(126, b"\x00")
    # On the same connection, so it comes after the other.
    robot.send_packet(125, make_text("still here"))
    states.wait_count(1)
    robot.close()
    held = [driver.fleet.newest.stopped, "/hero_0/fleet" not in list_names(driver.node)]
    assert all(held)
    record("a robot that speaks for the fleet", len(held), sum(held))


def test_new_robot_names_are_rate_limited_per_address(start_driver, record):
    driver = start_driver(parameters={"max_connections_per_address": 20})
    friend = FakeRobot(1, source_host="127.0.0.7").connect(driver.address)
    service = ServiceCheck(driver, friend)
    numbers = itertools.count(100)

    def is_refused():
        # Together, and each until the driver has taken it: one by one, a slow PC would take fewer than it may.
        with contextlib.ExitStack() as stack:
            socks = [stack.enter_context(socket.socket()) for _ in range(20)]
            for sock in socks:
                sock.bind(("127.0.0.66", 0))
                sock.settimeout(60.0)
                sock.connect(driver.address)
            for sock in socks:
                with contextlib.suppress(ConnectionError):
                    sock.sendall(emulated_swarm.declare(next(numbers)))
                    sock.shutdown(socket.SHUT_WR)
            for sock in socks:
                with contextlib.suppress(ConnectionError):
                    while sock.recv(4096):
                        pass
        return driver.find_lines("new robots from one address")

    wait_for(is_refused, "a refusal", 60.0)
    service.verify()
    # Whoever has another address need not wait.
    other = FakeRobot(2, source_host="127.0.0.8").connect(driver.address)
    driver.fleet.wait_ready("/hero_2")
    other.close()
    friend.close()
    known = [number for number in range(100, 120) if driver.find_lines("hero_%d " % number)]
    record("new names from one address", 20, len(known), "what was beyond the limit")
