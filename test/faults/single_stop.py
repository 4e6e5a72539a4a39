"""Program single_stop.py: drives a robot by one part of the suite, sends one stop by it, and dies or hangs at once.

single_stop.py PART NAME END [first]: on a line on its input it stops; `first` stops it before it has driven anything.
END: KILL, STOP (it hangs), or CONT (it goes on).
"""

import os
import select
import signal
import sys
import time

import rospy

PERIOD_S = 0.05
SPEED_M_S = 0.05


class Group:
    """A Robot, which sends its stops as a Swarm does."""

    def __init__(self, number):
        from hero_client import Robot
        from hero_client.robots.group import send_stops

        self.robot = Robot(number)
        self.send_stops = send_stops

    def drive(self):
        self.robot.drive(SPEED_M_S, 0.0)

    def stop(self):
        next(self.send_stops([self.robot]))


class Teleop:
    """The keys of the keyboard."""

    def __init__(self, number):
        from hero_client import Swarm
        from hero_client.apps.keyboard_teleop import KeyboardTeleop

        self.teleop = KeyboardTeleop(Swarm([number]), SPEED_M_S, 1.0)

    def press(self, key):
        self.teleop.press(key, time.monotonic())
        self.teleop.step(time.monotonic())

    def drive(self):
        self.press("w")

    def stop(self):
        self.press("s")


class Monitor:
    """What pages do to robots, and their dead man's switch."""

    def __init__(self, number):
        from hero_client import Drivers
        from hero_monitor.background import Background
        from hero_monitor.control.drive_requests import DriveRequests

        rospy.init_node("monitor", anonymous=True, disable_signals=True)
        self.robot = "hero_%d" % number
        self.commander = DriveRequests(Drivers(), Background())

    def drive(self):
        self.commander.drive(1, self.robot, SPEED_M_S, 0.0)

    def stop(self):
        self.commander.dead_man.stop(self.robot)
        self.commander.step()


class Calibration:
    """A robot under calibration."""

    def __init__(self, number):
        from hero_calibration.robots.ros_probe import RosProbe

        rospy.init_node("calibration", anonymous=True, disable_signals=True)
        self.probe = RosProbe(number, "hero")

    def drive(self):
        self.probe.drive(0.0, SPEED_M_S)

    def stop(self):
        self.probe.stop()


PARTS = {"group": Group, "teleop": Teleop, "monitor": Monitor, "calibration": Calibration}


def main():
    """Run from the command line."""
    part, name, end, *first = sys.argv[1:]
    program = PARTS[part](int(name.rpartition("_")[2]))
    while not first and not select.select([sys.stdin], [], [], PERIOD_S)[0]:
        program.drive()
    program.stop()
    os.kill(os.getpid(), getattr(signal, "SIG" + end))
    while True:
        time.sleep(PERIOD_S)
        if part == "monitor":
            program.commander.step()  # as it does all the time


if __name__ == "__main__":
    main()
