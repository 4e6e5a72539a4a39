#!/usr/bin/env python3
"""Teleop in a real pseudo-terminal: real key bytes in, Twist messages out, the terminal's settings before and after."""

import os
import pty
import signal
import subprocess
import sys
import termios
import threading
import time
import unittest

import rospy
import rostest
from geometry_msgs.msg import Twist

from hero_test.waiting import wait_for

DEADLINE_S = 30.0

# The shell owns the terminal, as it does for a user, and keeps it open when teleop has ended.
FOREGROUND_SHELL = 'trap : INT TERM HUP; "$@"; echo "status=$?="; cat >/dev/null'


class Recorder:
    """The commands that one robot got, with their times of arrival."""

    def __init__(self, robot_id):
        self.received = []
        self.subscriber = rospy.Subscriber(
            "/hero_%d/velocity_controller/cmd_vel" % robot_id, Twist, self.receive, tcp_nodelay=True
        )

    def receive(self, twist):
        self.received.append((time.monotonic(), twist.linear.x, twist.angular.z))

    def wait_for(self, condition, what):
        """Wait for a message from now on that condition(linear, turn) likes."""
        start = len(self.received)
        return wait_for(
            lambda: any(condition(linear, turn) for _, linear, turn in self.received[start:]), what
        )


def is_running(pid):
    """Return whether a process runs; one that has ended may still be listed until its parent looks."""
    try:
        with open("/proc/%d/stat" % pid) as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


class Terminal:
    """A pseudo-terminal with a shell that runs teleop in the foreground."""

    def __init__(self, *arguments):
        self.master_fd, self.slave_fd = pty.openpty()
        self.open_fds = [self.master_fd, self.slave_fd]
        self.before = termios.tcgetattr(self.slave_fd)
        program = subprocess.check_output(["catkin_find", "--first-only", "--libexec", "hero_examples", "teleop"])
        self.shell = subprocess.Popen(
            # setsid --ctty makes the terminal the shell's own, so that Ctrl-C is a signal there.
            ["setsid", "--ctty", "sh", "-c", FOREGROUND_SHELL, "sh", program.decode().strip(), *arguments],
            stdin=self.slave_fd,
            stdout=self.slave_fd,
            stderr=self.slave_fd,
        )
        self.text = ""
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()

    def read(self):
        while True:
            try:
                data = os.read(self.master_fd, 4096)
            except OSError:
                return
            if not data:
                return
            self.text += data.decode("utf-8", "replace")

    def type(self, keys):
        os.write(self.master_fd, keys.encode())

    def teleop_pid(self):
        """Return the pid of the shell's child, teleop; 0 while there is none."""
        listed = subprocess.run(["pgrep", "-P", str(self.shell.pid)], stdout=subprocess.PIPE, check=False).stdout
        return int(listed.split()[0]) if listed else 0

    def status(self):
        """Return the exit status of teleop, as the shell shows it; None while it runs."""
        parts = self.text.rpartition("status=")[2].partition("=")
        return int(parts[0]) if parts[1] and parts[0].isdecimal() else None

    def settings(self):
        return termios.tcgetattr(self.slave_fd)

    def close(self):
        """End everything; a teleop that still ran would be taken for the next test's."""
        # Once the status is shown, the shell's child is what keeps the terminal open; that ends with it.
        pid = self.teleop_pid() if self.status() is None else 0
        self.shell.kill()
        self.shell.wait()
        wait_for(lambda: not pid or not is_running(pid), "the end of teleop with its terminal")
        self.hang_up()

    def hang_up(self):
        """Close the terminal as a terminal window does; safe twice."""
        for fd in self.open_fds:
            os.close(fd)
        self.open_fds = []


class TeleopTest(unittest.TestCase):
    def setUp(self):
        self.recorder = Recorder(0)

    def tearDown(self):
        self.recorder.subscriber.unregister()

    def start(self, *arguments):
        terminal = Terminal(*arguments)
        self.addCleanup(terminal.close)
        wait_for(lambda: "Hold a key" in terminal.text or terminal.status() is not None, "the help text")
        wait_for(lambda: self.recorder.subscriber.get_num_connections() > 0, "teleop's publisher")
        return terminal

    def drive(self, terminal):
        """Hold w until a command arrives: the first ones may come before the connection is up."""

        def pressed_and_arrived():
            terminal.type("w")
            return self.recorder.received and self.recorder.received[-1][1] > 0.0

        wait_for(pressed_and_arrived, "a forward command")

    def assert_last_two_are_stops(self):
        last_two = self.recorder.received[-2:]
        self.assertEqual([(0.0, 0.0)] * 2, [(linear, turn) for _, linear, turn in last_two])
        self.assertGreater(last_two[1][0] - last_two[0][0], 0.051)

    def test_keys_drive_and_letting_go_stops(self):
        terminal = self.start()
        self.drive(terminal)
        self.recorder.wait_for(lambda linear, turn: linear == turn == 0.0, "the stop after the last key")
        for keys, condition in (
            ("x", lambda linear, turn: linear < 0.0 and turn == 0.0),
            ("sa", lambda linear, turn: linear == 0.0 and turn > 0.0),
            (" d", lambda linear, turn: linear == 0.0 and turn < 0.0),
            ("sq", lambda linear, turn: linear > 0.0 and turn > 0.0),
            ("s\x1b[A", lambda linear, turn: linear > 0.0 and turn == 0.0),
            ("s\x1b[C", lambda linear, turn: linear == 0.0 and turn < 0.0),
            ("s++w", lambda linear, turn: abs(linear - 0.14) < 1e-6),
            ("s---W", lambda linear, turn: abs(linear - 0.08) < 1e-6),
            ("s>a", lambda linear, turn: abs(turn - 1.75) < 1e-6),
        ):
            terminal.type(keys)
            self.recorder.wait_for(condition, "the command of %r" % keys)

    def test_a_stop_key_stops_at_once(self):
        terminal = self.start()
        for stop in ("s", " "):
            self.drive(terminal)
            terminal.type(stop)
            self.recorder.wait_for(lambda linear, turn: linear == turn == 0.0, "the stop of %r" % stop)

    def test_an_idle_teleop_is_silent(self):
        terminal = self.start()
        self.drive(terminal)
        wait_for(
            lambda: self.recorder.received and time.monotonic() - self.recorder.received[-1][0] > 1.0, "silence"
        )
        self.assertEqual((0.0, 0.0), self.recorder.received[-1][1:])

    def test_keys_choose_the_robot_and_the_one_left_stops(self):
        second = Recorder(1)
        terminal = self.start("_robots:=0 1")
        wait_for(lambda: second.subscriber.get_num_connections() > 0, "the second publisher")
        self.drive(terminal)
        terminal.type("1w")
        second.wait_for(lambda linear, turn: linear > 0.0, "a command of the second robot")
        wait_for(lambda: self.recorder.received[-1][1] == 0.0, "the stop of the first robot")
        terminal.type("\tw")
        self.recorder.wait_for(lambda linear, turn: linear > 0.0, "a command of the first robot after Tab")
        terminal.type("gw")
        second.wait_for(lambda linear, turn: linear > 0.0, "a command of all robots")
        terminal.type("7")
        wait_for(lambda: "hero_7 is not among" in terminal.text, "a word about a robot that is not there")
        second.subscriber.unregister()

    def check_end(self, end, status):
        terminal = self.start()
        self.drive(terminal)
        self.assertNotEqual(terminal.before, terminal.settings())
        end(terminal)
        wait_for(lambda: terminal.status() is not None, "the end of teleop")
        self.assertEqual(status, terminal.status(), terminal.text)
        wait_for(lambda: terminal.before == terminal.settings(), "the terminal as it was")
        return terminal

    def test_ctrl_c_stops_the_robot_and_restores_the_terminal(self):
        self.check_end(lambda terminal: terminal.type("\x03"), 0)
        self.assert_last_two_are_stops()

    def test_ctrl_d_stops_the_robot_and_restores_the_terminal(self):
        self.check_end(lambda terminal: terminal.type("\x04"), 0)
        self.assert_last_two_are_stops()

    def test_signals_stop_the_robot_and_restore_the_terminal(self):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            self.check_end(lambda terminal, number=number: os.kill(terminal.teleop_pid(), number), 0)
            self.assert_last_two_are_stops()

    def test_rosnode_kill_stops_the_robot_and_restores_the_terminal(self):
        self.check_end(lambda terminal: subprocess.check_call(["rosnode", "kill", "/teleop"]), 0)
        self.assert_last_two_are_stops()

    def test_a_closed_terminal_stops_the_robot(self):
        terminal = self.start()
        self.drive(terminal)
        pid = terminal.teleop_pid()
        terminal.hang_up()
        wait_for(lambda: not os.path.exists("/proc/%d" % pid) or terminal.shell.poll() is not None, "the end")
        wait_for(lambda: self.recorder.received[-1][1:] == (0.0, 0.0), "the stop")
        wait_for(lambda: time.monotonic() - self.recorder.received[-1][0] > 0.5, "the last message")
        self.assert_last_two_are_stops()

    def test_without_a_terminal_one_line_says_what_to_do(self):
        done = subprocess.run(
            ["rosrun", "hero_examples", "teleop"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            check=False,
        )
        self.assertEqual(1, done.returncode)
        self.assertEqual(1, len(done.stdout.decode().strip().splitlines()), done.stdout.decode())
        self.assertIn("plain terminal", done.stdout.decode())


if __name__ == "__main__":
    rospy.init_node("test_teleop")
    rostest.rosrun("hero_examples", "teleop", TeleopTest, sys.argv)
