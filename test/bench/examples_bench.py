"""Measures CPU, command rate and time to end of each example program with a simulated swarm.

Every program drives all robots at once, for real: random obstacles, goals, formations. Started by script/bench.
"""

import argparse
import os
import pty
import signal
import subprocess
import tempfile
import threading
import time

import rospy
from measuring import print_machine, read_cpu_s
from running_suite import RunningSuite
from sensor_msgs.msg import Joy

from hero_test.watches.swarm_watch import SwarmWatch

SETTLE_S = 4.0
"""From the first command: subscriptions of all robots, and the first seconds of listening to /tf."""

END_TIMEOUT_S = 10.0


def list_cases(robots):
    """Return {title: (program, arguments)} for this many robots."""
    everybody = "_robots:=0-%d" % (robots - 1)
    far = "; ".join(["30 0 90"] * robots)
    return {
        "random_walk": ("random_walk", [everybody]),
        "go_to_goal": ("go_to_goal", [everybody, "_goals:=" + far]),
        "go_to_goal, avoiding": ("go_to_goal", [everybody, "_goals:=" + far, "_avoid:=true"]),
        "go_to_goal, goals in world": ("go_to_goal", [everybody, "_goals:=" + far, "_frame:=world"]),
        "swarm_go_to": ("swarm_go_to", [everybody, "_formation:={shape: circle, spacing_m: 0.3}"]),
        "follow": ("follow", [everybody]),
        "led_show": ("led_show", [everybody]),
        "teleop, all robots": ("teleop", [everybody]),
        "teleop_joy": ("teleop_joy", [everybody]),
        "measure_delay": ("measure_delay", [everybody, "_turns:=1000", f"_plot:={tempfile.gettempdir()}/delay.png"]),
    }


class CommandCount:
    """Numbers of the commands of each kind that every robot got."""

    def __init__(self, robots):
        self.counts = {}
        for robot_id in range(robots):
            for topic in ("velocity_controller/cmd_vel", "led"):
                name = "/hero_%d/%s" % (robot_id, topic)
                self.counts[name] = 0
                rospy.Subscriber(name, rospy.AnyMsg, self.take, name, queue_size=10)

    def take(self, message, name):
        """Count a message on the topic called name."""
        self.counts[name] += 1

    def take_out(self, topic):
        """Return the counts of one topic."""
        return [count for name, count in self.counts.items() if name.endswith(topic)]


class Hands:
    """A user meanwhile: holds a key in a terminal, and a joystick's button and stick."""

    def __init__(self):
        self.master_fd, self.slave_fd = pty.openpty()
        self.stick = rospy.Publisher("/joy", Joy, queue_size=1)
        self.ended = threading.Event()
        os.write(self.master_fd, b"g")
        for act in (self.hold, self.look):
            threading.Thread(target=act, daemon=True).start()

    def hold(self):
        """Press the key and hold the stick until ended is set."""
        while not self.ended.wait(0.05):
            self.stick.publish(Joy(axes=[0.2, 0.5], buttons=[0, 0, 0, 0, 1]))
            os.write(self.master_fd, b"q")

    def look(self):
        """Read what the terminal shows, so that it never fills."""
        while os.read(self.master_fd, 65536):
            continue


def measure(suite, case, robots, seconds, commands, truth):
    """Return the figures of one program."""
    program, arguments = case
    topic = "/led" if program == "led_show" else "/cmd_vel"
    hands = Hands() if program.startswith("teleop") else None
    process = suite.start_example(
        program,
        "__name:=" + program,
        *arguments,
        stdin=hands.slave_fd if hands else subprocess.DEVNULL,
        stdout=hands.slave_fd if hands else subprocess.DEVNULL,
    )
    before = sum(commands.take_out(topic))
    suite.wait_for(lambda: sum(commands.take_out(topic)) > before + robots, "commands of " + program)
    time.sleep(SETTLE_S)
    counts, cpu_s, start_s = commands.take_out(topic), read_cpu_s(process.pid), time.monotonic()
    time.sleep(seconds)
    elapsed_s = time.monotonic() - start_s
    cpu = (read_cpu_s(process.pid) - cpu_s) / elapsed_s
    rates_hz = [(after - count) / elapsed_s for after, count in zip(commands.take_out(topic), counts)]
    rates_hz = sorted(rate_hz for rate_hz in rates_hz if rate_hz > 0.0)  # nobody commands a leader
    if process.poll() is not None:
        raise SystemExit("%s ended with %d while it was measured" % (program, process.returncode))
    end_s = time.monotonic()
    process.send_signal(signal.SIGINT)
    process.wait(END_TIMEOUT_S)
    ended_s = time.monotonic() - end_s
    suite.wait_for(lambda: truth.at_rest(*truth.rows), "robots at rest", 10.0)
    rest_s = time.monotonic() - end_s
    if hands:
        hands.ended.set()
    return {
        "cpu_percent": round(100.0 * cpu, 1),
        "rate_hz": [round(rates_hz[0], 2), round(rates_hz[-1], 2)],
        "ended_s": round(ended_s, 2),
        "at_rest_s": round(rest_s, 2),
    }


def main():
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=5.0, help="measured time of each program")
    parser.add_argument("--only", default="", help="only programs whose line contains this")
    options = parser.parse_args()
    print_machine()
    with RunningSuite(options.count, "arena:=empty") as suite:  # no walls before the goals
        commands = CommandCount(options.count)
        truth = SwarmWatch(range(options.count))
        truth.wait_until_complete()
        print("%d robots" % options.count)
        print("| program | CPU of one core | commands per robot | ended after Ctrl-C | robots stopped |")
        print("|---|---|---|---|---|", flush=True)
        for title, case in list_cases(options.count).items():
            if options.only in title:
                found = measure(suite, case, options.count, options.seconds, commands, truth)
                print(
                    "| %s | %.1f %% | %.1f..%.1f Hz | %.2f s | %.2f s |"
                    % (title, found["cpu_percent"], *found["rate_hz"], found["ended_s"], found["at_rest_s"]),
                    flush=True,
                )


if __name__ == "__main__":
    main()
