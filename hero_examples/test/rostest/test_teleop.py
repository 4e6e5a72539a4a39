#!/usr/bin/env python3
"""Teleop in a real pseudo-terminal: real key bytes in, Twist messages out, the terminal's settings before and after."""

import os
import pty
import signal
import subprocess
import sys
import termios
import threading
import unittest

import rosnode
import rospy
import rostest

from hero_test.processes import ExampleProgram, find_program
from hero_test.waiting import wait_for
from hero_test.watches.command_watch import CommandWatch

# The shell owns the terminal, as it does for a user, and keeps it open when teleop has ended.
FOREGROUND_SHELL = 'trap : INT TERM HUP; "$@"; echo "status=$?="; cat >/dev/null'


def is_running(pid):
    """Return whether a process runs; one that has ended may still be listed until its parent looks."""
    try:
        with open("/proc/%d/stat" % pid) as stat:
            return stat.read().rpartition(")")[2].split()[:1] not in ([], ["Z"])  # nothing: it went while it was read
    except OSError:
        return False


class Terminal:
    """A pseudo-terminal with a shell that runs teleop in the foreground."""

    def __init__(self, *arguments):
        self.master_fd, self.slave_fd = pty.openpty()
        self.open_fds = [self.master_fd, self.slave_fd]
        self.before = termios.tcgetattr(self.slave_fd)
        program = find_program("hero_examples", "teleop")
        self.shell = subprocess.Popen(
            # setsid --ctty makes the terminal the shell's own, so that Ctrl-C is a signal there.
            ["setsid", "--ctty", "sh", "-c", FOREGROUND_SHELL, "sh", program, *arguments],
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
        """Close the terminal as a terminal window does; may be called twice."""
        for fd in self.open_fds:
            os.close(fd)
        self.open_fds = []


class TeleopTest(unittest.TestCase):
    def start(self, robot_id):
        """Start a teleop of this robot in its own terminal; node teleop_N."""
        terminal = Terminal("__name:=teleop_%d" % robot_id, "_robots:=%d" % robot_id)
        self.addCleanup(terminal.close)
        return terminal

    def drive(self, terminal, commands, robot_id):
        """Press w until a command arrives: the first ones may come before the connection is up."""
        wait_for(lambda: "Hold a key" in terminal.text, lambda: "the help text, not %s" % terminal.text)

        def pressed_and_arrived():
            terminal.type("w")
            return commands.commands[robot_id] and commands.commands[robot_id][-1][0] > 0.0

        wait_for(pressed_and_arrived, "a forward command")

    def test_keys_drive_and_letting_go_stops(self):
        commands = CommandWatch([0])
        terminal = self.start(0)
        self.drive(terminal, commands, 0)
        commands.wait_for_stops(0)
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
            commands.wait_for_answer(0, lambda keys=keys: terminal.type(keys), condition, "the command of %r" % keys)
        terminal.type("7")
        wait_for(lambda: "hero_7 is not in this swarm" in terminal.text, "a word about a robot that is not there")

    def test_every_end_stops_the_robot_and_restores_the_terminal(self):
        ends = {
            "Ctrl-C": lambda robot_id, terminal: terminal.type("\x03"),
            "Ctrl-D": lambda robot_id, terminal: terminal.type("\x04"),
            "SIGINT": lambda robot_id, terminal: os.kill(terminal.teleop_pid(), signal.SIGINT),
            "SIGTERM": lambda robot_id, terminal: os.kill(terminal.teleop_pid(), signal.SIGTERM),
            "SIGHUP": lambda robot_id, terminal: os.kill(terminal.teleop_pid(), signal.SIGHUP),
            "rosnode kill": lambda robot_id, terminal: rosnode.kill_nodes(["/teleop_%d" % robot_id]),
        }
        commands = CommandWatch(range(len(ends)))
        terminals = [self.start(robot_id) for robot_id in range(len(ends))]
        for robot_id, (name, end_it) in enumerate(ends.items()):
            terminal = terminals[robot_id]
            self.drive(terminal, commands, robot_id)
            self.assertNotEqual(terminal.before, terminal.settings())
            end_it(robot_id, terminal)
            wait_for(lambda t=terminal: t.status() is not None, "the end of teleop by " + name)
            self.assertEqual(0, terminal.status(), "%s: %s" % (name, terminal.text))
            wait_for(lambda t=terminal: t.before == t.settings(), "the terminal as it was")
            commands.wait_for_stops(robot_id)

    def test_two_pupils_drive_two_robots_and_one_name_is_there_once(self):
        commands = CommandWatch([0, 1])
        terminals = [Terminal("_robots:=%d" % robot_id) for robot_id in range(2)]
        for robot_id, terminal in enumerate(terminals):
            self.addCleanup(terminal.close)
            self.drive(terminal, commands, robot_id)
        first = self.start(2)
        wait_for(lambda: "Hold a key" in first.text, "the first one")
        again = self.start(2)
        wait_for(lambda: again.status() == 1, "the end of the second one of that name")
        self.assertIn("/teleop_2 already runs", again.text)

    def test_launch_files_name_the_node_by_its_robots(self):
        for ids, name in (("3", "3"), ("0-2", "0_2"), ("'0 1'", "0_1")):
            command = "roslaunch --nodes hero_bringup hero_teleop%%s.launch id:=%s" % ids
            self.assertEqual(subprocess.getoutput(command % ""), "/hero_teleop_" + name)
            nodes = set(subprocess.getoutput(command % "_joy").split())
            self.assertEqual(nodes, {"/hero_teleop_joy_" + name, "/hero_teleop_joy_%s_device" % name})
        self.assertEqual(subprocess.getoutput(command % "" + " name:=ada"), "/ada")

    def test_a_closed_terminal_stops_the_robot(self):
        commands = CommandWatch([0])
        terminal = self.start(0)
        self.drive(terminal, commands, 0)
        pid = terminal.teleop_pid()
        terminal.hang_up()
        wait_for(lambda: not is_running(pid), "the end of teleop")
        commands.wait_for_stops(0)

    def test_without_a_terminal_one_line_says_what_to_do(self):
        program = ExampleProgram("teleop")
        self.assertEqual(1, program.wait_end())
        self.assertEqual(1, len(program.lines), program.lines)
        self.assertIn("plain terminal", program.text())


if __name__ == "__main__":
    rospy.init_node("test_teleop")
    rostest.rosrun("hero_examples", "teleop", TeleopTest, sys.argv)
