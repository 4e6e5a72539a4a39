"""Faults of ROS programs and the master: they hang, die, connect in large numbers, flood the driver, restart."""

import os
import signal
import subprocess
import threading

import pytest
import rospy
from geometry_msgs.msg import Twist
from rig import STOCK_NAMES, count_holdings, start_python
from rosgraph_msgs.msg import Clock
from scripted_publisher import ScriptedPublisher
from service_check import ServiceCheck

from hero_msgs.srv import SetPID
from hero_test.driver_case import has_connection, list_driver_topics, make_publisher, receives_topic
from hero_test.fake_robot import FakeRobot
from hero_test.processes import suspended
from hero_test.stock_messages import make_laser
from hero_test.waiting import wait_for


@pytest.fixture
def served(start_driver):
    """A driver with one robot, and what shows that it is served."""
    driver = start_driver(parameters={"max_packets_per_s": 100000, "max_bytes_per_s": 50000000})
    robot = FakeRobot(1).connect(driver.address)
    yield driver, robot, ServiceCheck(driver, robot)
    robot.close()


def start_reader(driver, topic):
    """Return a program that listens to a topic, once it is connected."""
    reader = subprocess.Popen(["rostopic", "echo", topic], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wait_for(lambda: has_connection(driver.node, topic, "rostopic"), "a reader of " + topic)
    return reader


def test_a_suspended_subscriber_affects_no_other(served, effort, record):
    driver, robot, service = served
    reader = start_reader(driver, "/hero_1/laser")
    # The buffers of the system hold some MB; this is more.
    scan = make_laser("hero_1", rospy.Time(3), [0.1] * 8) + bytes(3500)
    rounds = effort.choose(20, 200)
    before = count_holdings(driver)
    with suspended(reader.pid):
        for _ in range(rounds):
            for _ in range(100):
                robot.send("laser", scan)
            service.verify()
        growth = count_holdings(driver).describe_growth(before)
    reader.kill()
    reader.wait()
    fault = "a subscriber that is stopped (SIGSTOP), %d MB on its topic" % (rounds * 0.37)
    record(fault, rounds, rounds, "its own oldest messages; " + growth)


def test_dying_subscribers_affect_no_other(served, effort, record):
    driver, _, service = served
    deaths = effort.choose(4, 40)
    service.verify()
    for _ in range(deaths):
        reader = start_reader(driver, "/hero_1/encoder")
        os.kill(reader.pid, signal.SIGKILL)
        service.verify(5)
        reader.wait()
    wait_for(lambda: not has_connection(driver.node, "/hero_1/encoder", "rostopic"), "the dead to be forgotten")
    record("a subscriber dies (SIGKILL)", deaths, deaths)


def test_subscribers_that_come_and_go_leak_nothing(served, effort, record):
    driver, _, service = served
    count, rounds = effort.choose((10, 3), (100, 10))
    service.verify()

    def come_and_go():
        with start_python("many_subscribers.py", "/hero_1/encoder", count) as program:
            connected = program.read()
            assert connected == count, connected
            service.verify()
        wait_for(
            lambda: not has_connection(driver.node, "/hero_1/encoder", "many_subscribers"), "the subscribers to be gone"
        )

    come_and_go()
    before = count_holdings(driver)
    for _ in range(rounds):
        come_and_go()
    service.verify()
    # Python gives memory back late, and rospy ends its threads when it looks at its connections.
    wait_for(
        lambda: count_holdings(driver).threads <= before.threads and count_holdings(driver).files <= before.files,
        lambda: count_holdings(driver).describe_growth(before),
    )
    growth = count_holdings(driver).describe_growth(before)
    record("%d subscribers come and go" % (count * rounds), count * rounds, count * rounds, "nothing; " + growth)


def test_a_publisher_at_1_khz_delays_no_other_and_its_stop_arrives(served, effort, record):
    _, robot, service = served
    publisher = make_publisher("/hero_1/velocity_controller/cmd_vel", Twist)
    count = effort.choose(1000, 20000)
    command = Twist()
    rate = rospy.Rate(1000)
    for number in range(count):
        command.linear.x = 0.01 + 0.0001 * (number % 1000)
        publisher.publish(command)
        rate.sleep()
        if number % 500 == 0:
            service.verify()
    publisher.publish(Twist())
    wait_for(lambda: [v.is_zero for v in robot.velocities[-2:]] == [True, True], "two stops")
    taken = len(robot.velocities)
    assert taken < count / 2
    record("%d velocities at 1 kHz, then a stop" % count, 1, 1, "all but the newest each 60 ms (%d taken)" % taken)


def test_a_publisher_that_goes_while_it_is_connected_to_may_return(served, record):
    driver, _, service = served
    topic = "/hero_1/cmd_vel"
    with ScriptedPublisher(topic) as publisher:
        publisher.refuses = True
        publisher.announce()
        wait_for(lambda: publisher.refused, "a connection that is refused")
        wait_for(lambda: not receives_topic(driver.node, topic), "the refused connection to be forgotten")
        publisher.refuses = False
        publisher.announce()
        wait_for(lambda: publisher.connections, "a connection")
        wait_for(lambda: receives_topic(driver.node, topic), "the driver to know of it")
    record("a publisher that goes while the driver connects to it returns", 1, 1)


def test_a_publisher_that_replaces_another_of_its_program_is_heard(served, record):
    _, robot, service = served
    topic = "/hero_1/cmd_vel"
    with ScriptedPublisher(topic) as publisher:
        publisher.announce()
        wait_for(lambda: publisher.connections, "a connection")
        publisher.announce()  # of no effect while the connection stands
        service.verify()
        publisher.connections[0].close()
        wait_for(lambda: len(publisher.connections) > 1, "a connection to the second publisher")
    record("a publisher is closed and another one opened by the same program", 1, 1)


def test_fifty_simultaneous_service_calls_are_answered(served, effort, record):
    _, _, service = served
    name = "/hero_1/velocity_controller/pid_parameters"
    rospy.wait_for_service(name, 60.0)
    calls = effort.choose(2, 20)
    answers, failures = [], []

    def call():
        for _ in range(calls):
            try:
                answers.append(rospy.ServiceProxy(name, SetPID)(1.0, 1.0, 1.0, 1.0, 1.0, 1.0).success)
            except rospy.ServiceException as error:
                failures.append(str(error))

    threads = [threading.Thread(target=call) for _ in range(50)]
    for thread in threads:
        thread.start()
    service.verify(10)
    for thread in threads:
        thread.join()
    assert not failures, failures[:3]
    record("50 clients call one service at once", 50 * calls, sum(answers))


def test_a_restarted_master_learns_of_every_robot(master, served, effort, record):
    driver, robot, service = served
    tries = effort.choose(1, 10)
    wait_for(lambda: len(list_driver_topics("/hero_1", driver.node)) == STOCK_NAMES, "all topics")
    for _ in range(tries):
        service.verify()
        master.kill()
        # Existing connections keep working without it.
        service.verify(20)
        master.start()
        wait_for(lambda: len(list_driver_topics("/hero_1", driver.node)) == STOCK_NAMES, "all topics again")
        service.verify()
    driver.wait_line("the ROS master was started again: .* registered again")
    # A program that starts now finds the robot, and a publisher that is registered now reaches it.
    with start_python("many_subscribers.py", "/hero_1/encoder", 1) as program:
        assert program.read() == 1
    twist = make_publisher("/hero_1/position_controller/cmd_vel", Twist)
    twist.publish(Twist())
    wait_for(lambda: robot.payloads_on("position_controller/cmd_vel"), "a command of a new program")
    record(
        "the ROS master is killed and started again",
        tries,
        tries,
    )


def test_paused_simulated_time_stops_nothing(start_driver, record):
    rospy.set_param("/use_sim_time", True)
    try:
        driver = start_driver()
        robot = FakeRobot(3).connect(driver.address)
        service = ServiceCheck(driver, robot)
        service.verify(10)
        clock = rospy.Publisher("/clock", Clock, queue_size=1, latch=True)
        clock.publish(Clock(rospy.Time(1000)))
        wait_for(lambda: driver.fleet.newest.header.stamp == rospy.Time(1000), "a report at simulated time")
        service.verify(10)
        # It goes back, as a bag does that begins anew.
        clock.publish(Clock(rospy.Time(500)))
        wait_for(lambda: driver.fleet.newest.header.stamp == rospy.Time(500), "a report at an earlier time")
        service.verify(10)
        clock.unregister()
        robot.close()
        driver.process.send_signal(signal.SIGTERM)
        assert driver.wait_end() == 0
    finally:
        rospy.delete_param("/use_sim_time")
    record("/use_sim_time without a clock, with one that stands, with one that goes back", 3, 3)
