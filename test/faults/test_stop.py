"""Stops while something hangs or is gone: the ROS master, another driver, connections, the commanding program."""

import contextlib
import signal
import socket
import subprocess
import sys

import pytest
import rosgraph
import rospy
from geometry_msgs.msg import Twist
from rig import Master, start_python
from simulated_robots import SPEED_M_S, GroundTruth, drive, start_simulator, wait_until_stopped
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from hero_client.ros import Drivers
from hero_msgs.msg import Robot
from hero_sim.srv import InjectFault
from hero_test.driver_case import make_publisher, receives_topic
from hero_test.fake_robot import READ_CYCLE_S, FakeRobot
from hero_test.nonempty import nonempty
from hero_test.processes import find_free_port, suspended
from hero_test.waiting import wait_for

ROBOTS = 3
HALF_OPEN = 100
PRESSES = 3
TUNING_M_S = 0.01
"""Simulated robots that tune themselves rock or spin faster than this."""

COMMANDER = """
import rospy
from geometry_msgs.msg import Twist
rospy.init_node("commander", anonymous=True)
twist = Twist()
twist.linear.x = %g
publisher = rospy.Publisher("%s", Twist, queue_size=1)
while not rospy.is_shutdown():
    publisher.publish(twist)
    rospy.sleep(0.1)
"""


@pytest.fixture(scope="module")
def simulated(master):
    """A driver with simulated robots of its own."""
    from hero_test.driver_case import DriverProcess

    port = find_free_port()
    with DriverProcess({"port": port, "allow_self_tuning": True}) as driver, start_simulator(ROBOTS, port):
        for number in range(ROBOTS):
            driver.fleet.wait_ready("/hero_%d" % number)
        yield driver


@pytest.fixture
def field(simulated):
    """A driver with robots, and where they truly are; the robots are released and stand afterwards."""
    ground_truths = [GroundTruth(number) for number in range(ROBOTS)]
    yield simulated, ground_truths
    for ground_truth in ground_truths:
        ground_truth.close()
    # rospy may miss a publisher that comes before the end of its predecessor in the same node is known.
    heard = ["/hero_%d/%s_controller/cmd_vel" % (n, kind) for n in range(ROBOTS) for kind in ("velocity", "position")]
    try:
        wait_for(lambda: not any(receives_topic(simulated.node, topic) for topic in heard), "the publishers to go")
    finally:
        rospy.ServiceProxy(simulated.node + "/stop", SetBool)(True)
        wait_for(lambda: is_confirmed(simulated), "the driver's confirmation")
        rospy.ServiceProxy(simulated.node + "/stop", SetBool)(False)
        wait_for(lambda: not simulated.fleet.newest.stopped, "the release")


def is_confirmed(driver):
    """Return whether a driver says that all its robots are stopped and at rest."""
    report = driver.fleet.newest
    return report.stopped and all(robot.stop_state == Robot.AT_REST for robot in report.robots)


@contextlib.contextmanager
def asking(drivers_known):
    """Yield the Drivers of a program that has just started, once it has found so many."""
    drivers = Drivers()
    wait_for(lambda: len(drivers.names()) == drivers_known and drivers.read(), lambda: f"{drivers.names()}")
    yield drivers
    drivers.close()


def test_a_stop_needs_no_master(field, master, record):
    driver, ground_truths = field
    topic = make_publisher(driver.node + "/stop_request", Bool)
    service = rospy.ServiceProxy(driver.node + "/stop", SetBool, persistent=True)
    service(False)  # it finds the driver while the master answers
    drive(ground_truths)
    with suspended(master.pid):
        for request in (lambda stopped: topic.publish(Bool(stopped)), service):
            for _ in range(PRESSES):
                request(True)
            wait_until_stopped(ground_truths)
            wait_for(lambda: is_confirmed(driver), "the driver's confirmation")
            request(False)
            wait_for(
                lambda: all(ground_truth.is_moving for ground_truth in nonempty(ground_truths)), "all robots to move"
            )
        for ground_truth in ground_truths:
            ground_truth.command = Twist()
        wait_until_stopped(ground_truths)
    service.close()
    record("three times STOP by topic and by service, and zeros, while the ROS master hangs", 3, 3)


def test_a_stop_works_after_the_master_was_killed(record):
    with Master() as own, start_python("stop_without_master.py", own.pid, environment=own.environment) as program:
        at_rest = program.read()["at_rest"]
    record("a stop after the ROS master was killed", 1, int(at_rest))


def test_half_open_connections_do_not_delay_a_stop(field, record):
    driver, ground_truths = field
    drive(ground_truths)
    uri = rosgraph.Master("/faults").lookupService(driver.node + "/stop")
    host, port = uri[len("rosrpc://") :].rstrip("/").rsplit(":", 1)
    with contextlib.ExitStack() as stack:
        for _ in range(HALF_OPEN):
            sock = stack.enter_context(socket.create_connection((host, int(port))))
            sock.sendall(b"\x10\x00")
        answer = rospy.ServiceProxy(driver.node + "/stop", SetBool)(True)
        assert answer.success, answer.message
        wait_until_stopped(ground_truths)
        requests = make_publisher(driver.node + "/stop_request", Bool)
        requests.publish(Bool(False))
        wait_for(lambda: not driver.fleet.newest.stopped, "the release")
    record("%d connections to the driver that send 2 bytes and wait" % HALF_OPEN, 2, 2)


def test_a_hung_driver_does_not_delay_stops_of_others(field, start_driver, record):
    driver, ground_truths = field
    hung = start_driver()
    robot = FakeRobot(90, has_motors=True).connect(hung.address)
    hung.fleet.wait_ready("/hero_90")
    with asking(2) as drivers:
        with suspended(hung.process.pid):
            drive(ground_truths)
            for _ in range(10):
                drivers.request_stop(True)
            wait_until_stopped(ground_truths)
            wait_for(lambda: is_confirmed(driver), "the driver's confirmation")
            wait_for(lambda: drivers.stop_status().level == "error", "a verdict")
            assert drivers.stop_status().text == f"NOT STOPPED: driver {hung.node[1:]} does not answer"
            drivers.request_stop(False)
            wait_for(lambda: not driver.fleet.newest.stopped, "the release")
            drive(ground_truths)
            drivers.request_stop(True)
            wait_until_stopped(ground_truths)
        wait_for(lambda: is_confirmed(hung), "the stop, once it goes on")
    robot.close()
    record("eleven stops of two drivers, one of which hangs", 11, 11)


@pytest.mark.parametrize("controller", ["velocity_controller", "position_controller"])
def test_robots_stop_when_their_commander_is_killed(start_driver, record, controller):
    """These robots have no watchdogs: nothing but a stop brings them to rest."""
    driver = start_driver()
    robot = FakeRobot(91, read_cycle_s=READ_CYCLE_S, has_motors=True).connect(driver.address)
    driver.fleet.wait_ready("/hero_91")
    topic = f"/hero_91/{controller}/cmd_vel"
    commander = subprocess.Popen([sys.executable, "-c", COMMANDER % (SPEED_M_S, topic)])
    wait_for(lambda: robot.motors.is_turning, "the robot to move")
    commander.kill()
    commander.wait()
    wait_for(lambda: not robot.motors.is_turning, "the robot to stop")
    robot.close()
    record(f"the program that commands the {controller} is killed", 1, 1)


def test_a_stop_during_a_radio_pause_arrives(field, record):
    driver, ground_truths = field
    for ground_truth in ground_truths:
        ground_truth.close()
    positions = [GroundTruth(number, "position_controller") for number in range(ROBOTS)]
    for ground_truth in positions:
        ground_truth.command.linear.x = SPEED_M_S
    wait_for(lambda: all(ground_truth.is_moving for ground_truth in positions), "all robots to move")
    inject = rospy.ServiceProxy("/hero_sim/fault", InjectFault)
    assert inject("stall:for=0.3").success
    assert rospy.ServiceProxy(driver.node + "/stop", SetBool)(True).success
    wait_until_stopped(positions)
    wait_for(lambda: is_confirmed(driver), "the driver's confirmation")
    for ground_truth in positions:
        ground_truth.close()
    record("a radio that carries nothing for 0.3 s with the stop in it, position control", ROBOTS, ROBOTS)


def test_a_robot_that_hung_stops_when_it_resumes(field, record):
    driver, ground_truths = field
    drive(ground_truths)
    inject = rospy.ServiceProxy("/hero_sim/fault", InjectFault)
    assert inject("frozen:for=2,robot=0").success
    assert rospy.ServiceProxy(driver.node + "/stop", SetBool)(True).success
    wait_until_stopped(ground_truths)
    wait_for(lambda: is_confirmed(driver), "the driver's confirmation")
    record("a robot whose program stands still for 2 s with the stop in it", 1, 1)


@pytest.mark.parametrize("controller", ["velocity_controller", "position_controller"])
def test_a_stop_ends_the_self_tuning_of_simulated_robots(field, record, controller):
    driver, ground_truths = field
    for ground_truth in ground_truths:
        ground_truth.close()
        name = f"/{ground_truth.name}/{controller}/pid_calibration"
        rospy.wait_for_service(name, 60.0)
        rospy.ServiceProxy(name, Trigger)()
    watchers = [GroundTruth(number) for number in range(ROBOTS)]
    wait_for(lambda: all(watcher.path and watcher.path[-1][2] > TUNING_M_S for watcher in watchers), "the tuning")
    assert rospy.ServiceProxy(driver.node + "/stop", SetBool)(True).success
    wait_for(lambda: is_confirmed(driver), "the driver's confirmation")
    wait_until_stopped(watchers)
    for watcher in watchers:
        watcher.close()
    record(f"simulated robots that tune the {controller}, then a stop", ROBOTS, ROBOTS)


def test_self_tuning_robots_stop_when_the_driver_ends(start_driver, record):
    driver = start_driver()
    robots = [FakeRobot(number, read_cycle_s=READ_CYCLE_S, has_motors=True) for number in (94, 95)]
    for robot, controller in zip(robots, ("velocity_controller", "position_controller")):
        robot.connect(driver.address)
        driver.fleet.wait_ready(robot.namespace)
        robot.start_tuning(controller)
    driver.process.send_signal(signal.SIGTERM)
    assert driver.wait_end() == 0
    resting = sum(not robot.motors.is_turning for robot in robots)
    for robot in robots:
        robot.close()
    assert not driver.find_lines("not known to be at rest")
    record("SIGTERM while two robots tune themselves", 2, resting)
