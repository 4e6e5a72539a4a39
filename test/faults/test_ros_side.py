"""What ROS programs and the master do to the driver: hang, die, come in crowds, flood it, start again."""

import os
import signal
import subprocess
import threading
import time

import pytest
import rospy
from driver_case import frozen, has_connection, list_driver_topics, make_publisher
from fake_robot import FakeRobot
from geometry_msgs.msg import Twist
from life_signs import Life
from rig import STOCK_NAMES, count_holdings, start_python
from rosgraph_msgs.msg import Clock
from steady_time import StallWatch
from stock_messages import make_laser

from hero_msgs.srv import SetPID
from hero_test.waiting import wait_for

BACK_WITHIN_S = 10.0


@pytest.fixture
def served(start_driver):
    """A driver with one robot, and what shows that it is served."""
    driver = start_driver(parameters={"max_packets_per_s": 100000, "max_bytes_per_s": 50000000})
    robot = FakeRobot(1).connect(driver.address)
    yield driver, robot, Life(driver, robot)
    robot.close()


def start_reader(driver, topic):
    """Return a program that listens to a topic, once it is connected."""
    reader = subprocess.Popen(
        ["rostopic", "echo", topic], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    wait_for(lambda: has_connection(driver.node, topic, "rostopic"), "a reader of " + topic)
    return reader


def test_a_subscriber_that_is_stopped_costs_nobody_else_anything(served, effort, record):
    driver, robot, life = served
    reader = start_reader(driver, "/hero_1/laser")
    # The buffers of the system hold some MB; this is more.
    scan = make_laser("hero_1", rospy.Time(3), [0.1] * 8) + bytes(3500)
    rounds = effort.choose(20, 200)
    before = count_holdings(driver)
    with frozen(reader.pid):
        for _ in range(rounds):
            for _ in range(100):
                robot.send("laser", scan)
            life.show()
        growth = count_holdings(driver).describe_growth(before)
    reader.kill()
    reader.wait()
    fault = "a subscriber that is stopped (SIGSTOP), %d MB on its topic" % (rounds * 0.37)
    record(fault, rounds, rounds, "its own oldest messages; " + growth)


def test_subscribers_that_die_cost_nobody_else_anything(served, effort, record):
    driver, _, life = served
    deaths = effort.choose(4, 40)
    life.show()
    for _ in range(deaths):
        reader = start_reader(driver, "/hero_1/encoder")
        os.kill(reader.pid, signal.SIGKILL)
        life.show(5)
        reader.wait()
    wait_for(
        lambda: not has_connection(driver.node, "/hero_1/encoder", "rostopic"), "the dead to be forgotten"
    )
    record("a subscriber dies (SIGKILL)", deaths, deaths)


def test_subscribers_that_come_and_go_leave_nothing_behind(served, effort, record):
    driver, _, life = served
    crowd, rounds = effort.choose((20, 5), (100, 10))
    life.show()

    def come_and_go():
        with start_python("crowd.py", "/hero_1/encoder", crowd) as program:
            connected = program.read()
            assert connected == crowd, connected
            life.show()
        wait_for(
            lambda: not has_connection(driver.node, "/hero_1/encoder", "crowd"), "the crowd to be gone"
        )

    come_and_go()
    before = count_holdings(driver)
    for _ in range(rounds):
        come_and_go()
    life.show()
    # Python gives memory back late, and rospy ends its threads when it looks at its connections.
    wait_for(
        lambda: count_holdings(driver).threads <= before.threads
        and count_holdings(driver).files <= before.files,
        lambda: count_holdings(driver).describe_growth(before),
    )
    growth = count_holdings(driver).describe_growth(before)
    record(
        "%d subscribers come and go" % (crowd * rounds), crowd * rounds, crowd * rounds, "nothing; " + growth
    )


def test_a_publisher_at_1_khz_delays_nobody_and_its_stop_arrives(served, effort, record):
    _, robot, life = served
    publisher = make_publisher("/hero_1/velocity_controller/cmd_vel", Twist)
    count = effort.choose(2000, 20000)
    command, stop = Twist(), Twist()
    start_s = time.monotonic()
    for number in range(count):
        command.linear.x = 0.01 + 0.0001 * (number % 1000)
        publisher.publish(command)
        time.sleep(max(0.0, start_s + 0.001 * number - time.monotonic()))
        if number % 500 == 0:
            life.show()
    with StallWatch() as watch:
        publisher.publish(stop)
        wait_for(lambda: [v.is_zero for v in robot.velocities[-2:]] == [True, True], "two stops")
    # It reads at once: only a machine that stood still lets it drop the second.
    least = 1 if watch.stood_still else 2
    assert [v.is_zero for v in robot.accepted[-least:]] == [True] * least, "stops that are taken"
    taken = len(robot.accepted)
    record(
        "%d velocities at 1 kHz, then a stop" % count,
        1,
        1,
        "all but the newest each 60 ms (%d taken)" % taken,
    )


def test_fifty_clients_that_call_at_once_get_their_answers(served, effort, record):
    _, _, life = served
    name = "/hero_1/velocity_controller/pid_parameters"
    rospy.wait_for_service(name, 20.0)
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
    life.show(10)
    for thread in threads:
        thread.join()
    assert not failures, failures[:3]
    record("50 clients call one service at once", 50 * calls, sum(answers))


def test_a_master_that_is_killed_and_started_again_knows_every_robot(master, served, effort, record):
    driver, robot, life = served
    tries = effort.choose(1, 10)
    back_s = []
    wait_for(lambda: len(list_driver_topics("/hero_1", driver.node)) == STOCK_NAMES, "all topics")
    for _ in range(tries):
        life.show()
        master.kill()
        # What is connected goes on without it.
        life.show(20)
        master.start()
        started_s = time.monotonic()
        wait_for(lambda: len(list_driver_topics("/hero_1", driver.node)) == STOCK_NAMES, "all topics again")
        back_s.append(time.monotonic() - started_s)
        life.show()
    driver.wait_line("the ROS master was started again: .* registered anew")
    # A program that starts now finds the robot, and a publisher that is registered now reaches it.
    with start_python("crowd.py", "/hero_1/encoder", 1) as program:
        assert program.read() == 1
    twist = make_publisher("/hero_1/position_controller/cmd_vel", Twist)
    twist.publish(Twist())
    wait_for(lambda: robot.payloads_on("position_controller/cmd_vel"), "a command of a new program")
    record(
        "the ROS master is killed and started again",
        tries,
        sum(time_s < BACK_WITHIN_S for time_s in back_s),
        "nothing; all registered again after %.1f s" % max(back_s),
    )


def test_simulated_time_that_does_not_run_stops_nothing(start_driver, record):
    rospy.set_param("/use_sim_time", True)
    try:
        driver = start_driver()
        robot = FakeRobot(3).connect(driver.address)
        life = Life(driver, robot)
        life.show(10)
        clock = rospy.Publisher("/clock", Clock, queue_size=1, latch=True)
        clock.publish(Clock(rospy.Time(1000)))
        wait_for(lambda: driver.fleet.newest.header.stamp == rospy.Time(1000), "a report at simulated time")
        life.show(10)
        # It goes back, as a bag does that begins anew.
        clock.publish(Clock(rospy.Time(500)))
        wait_for(lambda: driver.fleet.newest.header.stamp == rospy.Time(500), "a report at an earlier time")
        life.show(10)
        clock.unregister()
        robot.close()
        driver.process.send_signal(signal.SIGTERM)
        assert driver.wait_end() == 0
    finally:
        rospy.delete_param("/use_sim_time")
    record("/use_sim_time without a clock, with one that stands, with one that goes back", 3, 3)
