"""A program that moves robots in one of MODES; for stop_bench.

stop_commander.py MODE COUNT
Prints a line when it is connected. Each line on standard input is an order, answered by the monotonic time at which it
was obeyed: go (move all robots from now on), zero (send each two zero Twists, and nothing more). So is Ctrl-C, which
sends zeros and ends.
"""

import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import rospy
from geometry_msgs.msg import Twist
from std_srvs.srv import Trigger

from hero_msgs.msg import Motor

VELOCITY, POSITION = "velocity_controller", "position_controller"
TUNINGS = {"velocity tuning": VELOCITY, "position tuning": POSITION}
MODES = ("velocity", "position", "cmd_motor", *TUNINGS)
PERIOD_S = 0.1
SPEED_M_S, TURN_RAD_S = 0.1, 0.5
PULSES_US = (1420, 1580)
CALLS_AT_ONCE = 20
ZEROS_APART_S = 0.06
CALLS = 3
"""A robot that a stop keeps deaf answers the second or third."""


class Commander:
    """The publishers of one topic per robot, or the services of one per robot."""

    def __init__(self, mode, count):
        """Return when all are connected."""
        self._moving = threading.Event()
        self._names = ["/hero_%d/" % number for number in range(count)]
        self._tuned = TUNINGS.get(mode)
        topic, kind = ("cmd_motor", Motor) if mode == "cmd_motor" else (f"{mode}_controller/cmd_vel", Twist)
        self._command = Motor(*PULSES_US) if kind is Motor else Twist()
        if kind is Twist:
            self._command.linear.x, self._command.angular.z = SPEED_M_S, TURN_RAD_S
        self._zeros = self._advertise(VELOCITY + "/cmd_vel", Twist)
        self._publishers = [] if self._tuned else self._advertise(topic, kind)
        for name in self._names if self._tuned else ():
            rospy.wait_for_service(f"{name}{self._tuned}/pid_calibration")
        threading.Thread(target=self._repeat, daemon=True).start()

    def _advertise(self, topic, kind):
        publishers = [rospy.Publisher(name + topic, kind, queue_size=1, tcp_nodelay=True) for name in self._names]
        while not all(publisher.get_num_connections() for publisher in publishers):
            rospy.sleep(0.02)
        return publishers

    def _repeat(self):
        rate = rospy.Rate(1.0 / PERIOD_S)
        while not rospy.is_shutdown():
            if self._moving.wait(PERIOD_S):
                for publisher in self._publishers:
                    publisher.publish(self._command)
                rate.sleep()

    def obey(self, order):
        """Do what a line says; return the time at which that began."""
        began_s = time.monotonic()
        if order == "zero":
            self._moving.clear()
            # Twice: a command of its own that is under way on another topic may be read after the first one.
            for pause_s in (ZEROS_APART_S, 0.0):
                for publisher in self._zeros:
                    publisher.publish(Twist())
                time.sleep(pause_s)
        elif self._tuned:
            with ThreadPoolExecutor(CALLS_AT_ONCE) as pool:
                list(pool.map(self._tune, self._names))
        else:
            self._moving.set()
        return began_s

    def _tune(self, name):
        for _ in range(CALLS):
            try:
                rospy.ServiceProxy(f"{name}{self._tuned}/pid_calibration", Trigger)()
                return
            except rospy.ServiceException as error:
                rospy.logwarn("%s", error)


def main():
    """Run from the command line."""
    rospy.init_node("stop_commander", anonymous=True, disable_signals=True)
    commander = Commander(sys.argv[1], int(sys.argv[2]))

    print("connected", flush=True)
    try:
        for line in sys.stdin:
            print(commander.obey(line.strip()), flush=True)
    except KeyboardInterrupt:
        print(commander.obey("zero"), flush=True)


if __name__ == "__main__":
    main()
