"""The driver ends or runs out of resources while robots move: signals, full disks, clock changes, its own bugs."""

import signal
import socket
import sys
import time

import pytest
import rospy
from geometry_msgs.msg import Twist
from rig import HERE
from service_check import ServiceCheck
from simulated_robots import SPEED_M_S, GroundTruth, drive, start_simulator, wait_until_stopped

from hero_driver.rosserial import packets, payloads
from hero_msgs.msg import Encoder
from hero_test import stock_messages
from hero_test.driver_case import Recorder, make_publisher
from hero_test.fake_robot import READ_CYCLE_S, TIME_PACKET, FakeRobot
from hero_test.nonempty import nonempty
from hero_test.processes import find_free_port, suspended
from hero_test.small_disk import SmallDisk
from hero_test.waiting import wait_for

ROBOTS = 3
SILENCE_S = 4.0
NOT_AT_REST = "not known to be at rest"
"""What the driver says at its end of robots whose wheels did not show that they stopped."""


@pytest.fixture(scope="module")
def field(master):
    """Simulated robots that dial one port, whoever listens there; returns the port and where they truly are."""
    port = find_free_port()
    with start_simulator(ROBOTS, port):
        yield port, [GroundTruth(number) for number in range(ROBOTS)]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], ids=lambda s: s.name)
def test_robots_stop_when_the_driver_ends_and_can_be_driven_again(field, start_driver, effort, record, number):
    """Before it ends in order, the driver has seen all wheels at rest; after SIGKILL robots stop by themselves."""
    port, ground_truths = field
    tries = effort.choose(1, 10)
    distances_m, doubts = [], []
    driver = start_driver(parameters={"port": port}, name="ended_driver")
    for _ in range(tries):
        drive(ground_truths)
        marks = [len(ground_truth.path) - 1 for ground_truth in ground_truths]
        driver.process.send_signal(number)
        assert driver.wait_end() == (0 if number != signal.SIGKILL else -signal.SIGKILL)
        doubts += driver.find_lines(NOT_AT_REST)
        wait_until_stopped(ground_truths)
        distances_m += [ground_truth.measure_from(mark) for ground_truth, mark in zip(ground_truths, marks)]
        driver.fleet.close()
        # As roslaunch does with respawn: the same node, while the robots and the programs wait.
        driver = start_driver(parameters={"port": port}, name="ended_driver")
        wait_for(
            lambda: all(ground_truth.is_moving for ground_truth in nonempty(ground_truths)), "all robots to move again"
        )
    record(
        "%s while %d robots drive at 0.1 m/s" % (number.name, ROBOTS),
        len(distances_m),
        len(distances_m) - ROBOTS * len(doubts),
        f"at most {max(distances_m):.3f} m driven on",
    )


def test_the_driver_ends_although_the_master_hangs(master, start_driver, record):
    driver = start_driver()
    # A number of its own: the master may go on to list what this driver could not take down.
    robot = FakeRobot(90).connect(driver.address)
    driver.fleet.wait_ready("/hero_90")
    with suspended(master.pid):
        driver.process.send_signal(signal.SIGTERM)
        code = driver.wait_end()
    robot.close()
    record("SIGTERM while the ROS master hangs", 1, int(code == 0))


def test_a_driver_that_was_suspended_keeps_its_robots(start_driver, record):
    driver = start_driver(parameters={"silence_timeout_s": SILENCE_S})
    robot = FakeRobot(1).connect(driver.address)
    service = ServiceCheck(driver, robot)
    service.verify()
    robot.is_silent = True
    with suspended(driver.process.pid):
        end_s = time.monotonic() + 1.2 * SILENCE_S
        wait_for(lambda: time.monotonic() > end_s, "the time that would make it lose a silent robot")
        driver.fleet.newest = None
    wait_for(lambda: driver.fleet.newest, "the driver")
    driver.fleet.newest = None
    wait_for(lambda: driver.fleet.newest, "a report that comes after its first look at the robots")
    robot.is_silent = False
    robot.send_bytes(TIME_PACKET)
    assert service.verify(20) and not driver.find_lines("hero_1 left")
    robot.close()
    record("the driver is suspended for longer than robots may be silent", 1, 1)


# Where its log goes.


@pytest.mark.parametrize("when", ["from the start", "while it runs"])
def test_a_full_disk_affects_only_the_logs(start_driver, record, tmp_path, request, when):
    disk = SmallDisk(tmp_path, "32k")
    request.addfinalizer(disk.close)
    if when == "from the start":
        disk.take(32 * 1024)
    driver = start_driver(environment={"ROS_LOG_DIR": disk.path})
    robot = FakeRobot(1).connect(driver.address)
    service = ServiceCheck(driver, robot)
    for count in range(200):
        # Each robot's own words go into the log: 60 kB, of which half fits.
        robot.log("line %d %s" % (count, "x" * 300))
        if count % 50 == 0:
            service.verify()
    driver.wait_line("hero_driver: the log file cannot be written .*No space left")
    lines = len(driver.find_lines("log file cannot be written"))
    assert service.verify(20) and lines == 1
    robot.close()
    tracebacks = len(driver.find_lines("Traceback"))
    record("a full disk below the log directory, " + when, 1, int(tracebacks == 0), "log lines")


def test_an_impossible_log_directory_affects_only_the_logs(start_driver, record):
    driver = start_driver(environment={"ROS_LOG_DIR": "/proc/no/such/place"})
    robot = FakeRobot(1).connect(driver.address)
    ServiceCheck(driver, robot).verify(20)
    robot.close()
    assert driver.find_lines("/proc/no/such/place") and not driver.find_lines("Traceback")
    record("no log directory", 1, 1, "the log file")


def test_a_closed_output_affects_only_the_output(start_driver, record):
    # As `hero_driver | head -n 1`.
    deafen = (
        "import os, sys; end, start = os.pipe(); os.dup2(start, 1); os.dup2(start, 2); os.close(end);"
        "os.execv(sys.argv[1], sys.argv[1:])"
    )
    driver = start_driver(prefix=[sys.executable, "-c", deafen])
    robot = FakeRobot(1).connect(driver.address)
    service = ServiceCheck(driver, robot)
    for count in range(20):
        robot.log("line %d" % count)
    service.verify(20)
    robot.close()
    record("standard output is closed", 1, 1, "what it would have printed")


# Its clock.


@pytest.mark.parametrize("step_s", [3600, -3600], ids=["forwards", "backwards"])
def test_setting_the_clock_by_an_hour_loses_nothing(start_driver, record, tmp_path, step_s):
    clock = tmp_path / "clock"
    driver = start_driver(prefix=[sys.executable, str(HERE / "broken_driver.py"), "clock", str(clock)])
    robot = FakeRobot(1).connect(driver.address)
    service = ServiceCheck(driver, robot)
    encoders = Recorder("/hero_1/encoder", Encoder)

    def ask_time():
        """Do as the robot: its clock follows the answer."""
        asked = len(robot.payloads_with_id(packets.ID_TIME))
        robot.send_bytes(TIME_PACKET)
        wait_for(lambda: len(robot.payloads_with_id(packets.ID_TIME)) > asked, "the time")
        return rospy.Time(*payloads.decode_time(robot.payloads_with_id(packets.ID_TIME)[-1]))

    start = ask_time()
    wait_for(lambda: driver.fleet.newest, "a report")
    reports = driver.fleet.newest.header.stamp
    for count in range(1, 101):
        stamp = start + rospy.Duration(0.03 * count)
        robot.send("encoder", stock_messages.make_encoder("hero_1", stamp, float(count), float(count)))
        if count == 50:
            encoders.wait_count(50)
            clock.write_text("%d" % step_s)
            start = ask_time() - rospy.Duration(0.03 * count)
    ticks = [message.left_ticks for message in encoders.wait_count(100)]
    stepped = abs((encoders.messages[-1].header.stamp - encoders.messages[49].header.stamp).to_sec() - step_s)
    # Reports go on too.
    wait_for(
        lambda: abs((driver.fleet.newest.header.stamp - reports).to_sec() - step_s) < 60.0,
        "a report after the step",
    )
    service.verify()
    robot.close()
    assert stepped < 30.0, stepped
    record(
        "clock of the PC set by %+d s" % step_s,
        100,
        sum(a == b for a, b in zip(ticks, map(float, range(1, 101)))),
    )


# Its files.


def test_running_out_of_files_does_not_affect_connected_robots(start_driver, record):
    driver = start_driver(prefix=["prlimit", "--nofile=96:96"])
    robot = FakeRobot(1).connect(driver.address)
    service = ServiceCheck(driver, robot)
    service.verify()
    others = [socket.create_connection(driver.address) for _ in range(90)]
    line = driver.wait_line("cannot take more connections")
    assert "limit of open files" in line
    service.verify(40)
    for other in others:
        other.close()
    late = FakeRobot(2).connect(driver.address)
    ServiceCheck(driver, late).verify()
    service.verify(10)
    for each in (robot, late):
        each.close()
    assert not driver.find_lines("Traceback")
    record(
        "no more files, 50 messages each way",
        50,
        50,
        "connections beyond the limit, until there are files again",
    )


# Its own mistakes.


def test_a_driver_bug_in_one_connection_closes_only_that_one(start_driver, record, tmp_path):
    trigger = tmp_path / "break"
    driver = start_driver(prefix=[sys.executable, str(HERE / "broken_driver.py"), "open_link", str(trigger)])
    robot = FakeRobot(1).connect(driver.address)
    service = ServiceCheck(driver, robot)
    trigger.write_text("")
    unlucky = FakeRobot(2).connect(driver.address)
    wait_for(lambda: unlucky.ended, "the unlucky one to be closed")
    driver.wait_line("bug in the driver, please report it: RuntimeError")
    service.verify()
    trigger.unlink()
    unlucky.close()
    unlucky.connect(driver.address)
    driver.fleet.wait_ready("/hero_2")
    for each in (robot, unlucky):
        each.close()
    record("an exception while a connection is taken", 1, 1, "that connection")


def test_a_broken_event_loop_stops_the_robots_and_ends_the_driver(start_driver, record, tmp_path):
    trigger = tmp_path / "break"
    driver = start_driver(prefix=[sys.executable, str(HERE / "broken_driver.py"), "loop", str(trigger)])
    robots = [FakeRobot(number, read_cycle_s=READ_CYCLE_S, has_motors=True) for number in (92, 93)]
    for robot in robots:
        robot.connect(driver.address)
        driver.fleet.wait_ready(robot.namespace)
    robots[0].start_tuning()
    command = Twist()
    command.linear.x = SPEED_M_S
    make_publisher("/hero_93/velocity_controller/cmd_vel", Twist).publish(command)
    wait_for(lambda: robots[1].motors.is_turning, "motion")
    trigger.write_text("")
    code = driver.wait_end()
    wait_for(lambda: all(robot.ended for robot in nonempty(robots)), "the end of the connections")
    stops = [velocity.is_zero for velocity in robots[1].velocities if "velocity_controller" in velocity.name]
    for robot in robots:
        robot.close()
    assert code == 1 and stops[-2:] == [True, True]
    assert driver.find_lines("the driver broke: RuntimeError")
    record(
        "an exception in the loop of the sockets, a robot that tunes itself and one that drives",
        2,
        sum(not robot.motors.is_turning for robot in robots),
        "the driver",
    )
