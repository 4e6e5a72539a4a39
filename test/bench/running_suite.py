"""A ROS master, the driver and simulated robots, for programs that measure or record the examples."""

import os
import subprocess
import time
from typing import List

import rosgraph
import rospy
from measuring import start, stop

from hero_msgs.msg import RobotArray
from hero_test.processes import find_free_port

READY_TIMEOUT_S = 60.0


class RunningSuite:
    """Robots that are ready, until close(). This process is a ROS node then, so it has one suite in its life."""

    def __init__(self, robots, *arguments):
        """Start robots simulated robots; arguments: more of hero_bringup.launch, e.g. arena:=obstacles."""
        self.processes = []
        master_port, self.port = find_free_port(), find_free_port()
        os.environ["ROS_MASTER_URI"] = "http://localhost:%d" % master_port
        self.launch = self.start(
            ["roslaunch", "--no-summary", "-p", str(master_port), "hero_bringup", "hero_bringup.launch"]
            + ["host:=127.0.0.1", "port:=%d" % self.port, "count:=%d" % robots, *arguments],
            stdout=subprocess.DEVNULL,
        )
        try:
            self.wait_for(rosgraph.is_master_online, "a ROS master")
            rospy.init_node("running_suite", disable_signals=True)
            newest: List[RobotArray] = []
            subscriber = rospy.Subscriber("/hero_driver/robots", RobotArray, newest.append, queue_size=1)
            self.wait_for(
                lambda: newest and sum(robot.state == robot.READY for robot in newest[-1].robots) == robots,
                "%d robots that are ready" % robots,
            )
            subscriber.unregister()
        except BaseException:
            self.close()
            raise

    def wait_for(self, condition, what, timeout_s=READY_TIMEOUT_S):
        """Return the first true value of condition()."""
        deadline_s = time.monotonic() + timeout_s
        while time.monotonic() < deadline_s and self.launch.poll() is None:
            value = condition()
            if value:
                return value
            time.sleep(0.02)
        raise SystemExit("bench: timed out waiting for " + what)

    def start(self, command, **options):
        """Start a program that ends with the suite."""
        process = start(command, dict(os.environ), **options)
        self.processes.append(process)
        return process

    def start_program(self, package, name, *arguments, **options):
        """Start a program of a package, itself and not roslaunch or rosrun around it."""
        found = subprocess.check_output(["catkin_find", "--first-only", "--libexec", package, name], text=True)
        return self.start([found.strip(), *arguments], **options)

    def start_example(self, name, *arguments, **options):
        """Start a program of hero_examples."""
        return self.start_program("hero_examples", name, *arguments, **options)

    def close(self):
        """End everything, the last first; may be called twice."""
        while self.processes:
            stop(self.processes.pop())

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()
