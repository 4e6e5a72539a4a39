#!/usr/bin/env python3
"""Recordings of simulated robots behind the real driver: contents, ends, plot and export."""

import csv
import glob
import math
import os
import shutil
import signal
import subprocess
import tempfile
import unittest

import rosbag
import rosgraph
import rospy
import rostest
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

from hero_test.processes import find_program, has_traceback
from hero_test.small_disk import SmallDisk
from hero_test.waiting import wait_for

RECORD = find_program("hero_recording", "record")
TIMEOUT_S = 600.0  # only a test that fails waits so long; a busy machine needs its time
ROBOT_TOPICS = ("odom", "encoder", "proximity", "ground_truth")


def is_subscribed(namespace):
    """Return whether each recorded topic of a robot has a subscriber."""
    subscribed = dict(rosgraph.Master("/test").getSystemState()[1])
    return all(namespace + topic in subscribed for topic in ROBOT_TOPICS)


class RecordTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)

    def start(self, *command, stdout=subprocess.PIPE, **options):
        # A session of its own, as a terminal or roslaunch gives it.
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=stdout,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            **options,
        )
        if process.stdout is not None:
            self.addCleanup(process.stdout.close)
        self.addCleanup(lambda: process.poll() is None and os.killpg(process.pid, signal.SIGKILL))
        return process

    def start_recording(self, name, *arguments, **options):
        """Start to record into a folder of this name; return the process."""
        return self.start(RECORD, "--folder", os.path.join(self.folder, name), *arguments, **options)

    def finish(self, process):
        """Wait for the end; return exit code and output."""
        output = process.communicate(timeout=TIMEOUT_S)[0].decode()
        self.assertFalse(has_traceback(output), output)
        return process.returncode, output

    def end(self, process, number=signal.SIGINT):
        """Send a signal as Ctrl-C does, to all of the session; return exit code and output."""
        os.killpg(process.pid, number)
        return self.finish(process)

    def files(self, pattern="*"):
        return sorted(os.path.relpath(path, self.folder) for path in glob.glob(os.path.join(self.folder, pattern)))

    def wait_for_files(self, pattern):
        """Wait until there are files, which the recorder has opened then; return them."""
        return wait_for(lambda: self.files(pattern), pattern)

    def assert_one_closed_bag(self, name):
        self.assertEqual(self.files(name + "/*.active"), [])
        (bag,) = self.files(name + "/*.bag")
        rosbag.Bag(os.path.join(self.folder, bag)).close()

    def test_robots_that_join_later_are_recorded_plotted_and_exported(self):
        launch = [
            "roslaunch",
            "--wait",
            "hero_recording",
            "record.launch",
            "folder:=.",
            "split_mb:=1",
            "compression:=none",
        ]
        # As a shell does: roslaunch's nodes run elsewhere, and know the folder by PWD.
        recording = self.start(*launch, cwd=self.folder, env=dict(os.environ, PWD=self.folder))
        self.wait_for_files("hero_*_0.bag.active")
        simulator = [find_program("hero_sim", "hero_sim"), "--port", "21297", "--first-id", "7", "--quiet"]
        late = self.start(*simulator, "__name:=late_sim")
        # The recorder asks the ROS master for new topics once in a while; nobody else listens to these.
        wait_for(lambda: is_subscribed("/hero_7/"), "subscriptions to hero_7")
        self.turn_hero_7()
        self.wait_for_files("hero_*_1.bag*")
        code, output = self.end(recording)
        self.end(late)
        self.assertEqual(code, 0, output)
        bags = self.files("hero_*.bag")
        self.assertGreaterEqual(len(bags), 2, output)
        self.assertEqual(self.files("*.active"), [], output)
        for name in bags:
            self.assertIn(os.path.join(self.folder, name), output)
        topics, lines = set(), []
        for name in bags:
            with rosbag.Bag(os.path.join(self.folder, name)) as bag:
                topics |= set(bag.get_type_and_topic_info().topics)
                lines += [line.msg for _, line, _ in bag.read_messages(["/rosout"])]
        self.assertFalse([line for line in lines if "Subscribing" in line], "the recorder does not flood the log")
        for topic in ROBOT_TOPICS:
            self.assertIn("/hero_0/" + topic, topics)
            self.assertIn("/hero_7/" + topic, topics)
        expected = {"/tf", "/tf_static", "/rosout", "/diagnostics", "/hero_driver/robots", "/hero_sim/arena"}
        self.assertLessEqual(expected, topics)
        self.assertIn("/hero_7/velocity_controller/cmd_vel", topics)
        self.assertNotIn("/hero_0/laser", topics)
        self.check_programs(bags)

    def turn_hero_7(self):
        """Let it turn until its odometry shows that, and stop it, with commands that are recorded."""
        publisher = rospy.Publisher("/hero_7/velocity_controller/cmd_vel", Twist, queue_size=1)
        speeds = []
        subscriber = rospy.Subscriber(
            "/hero_7/odom", Odometry, lambda message: speeds.append(message.twist.twist.angular.z)
        )

        wait_for(lambda: publisher.get_num_connections() == 2, "the driver and the recorder")

        def is_turning():
            publisher.publish(Twist(angular=Vector3(0.0, 0.0, 2.0)))
            return max(speeds, default=0.0) > 1.0

        wait_for(is_turning, "hero_7 to turn")
        publisher.publish(Twist())
        wait_for(lambda: speeds[-1] < 0.1, "hero_7 to stop")
        subscriber.unregister()

    def check_programs(self, bags):
        """Let the other programs of this package read the bags."""
        calls = ("plot", "--out", "drawn"), ("export", "--out", "tables")
        processes = [
            self.start(find_program("hero_recording", name), *arguments, *bags, cwd=self.folder)
            for name, *arguments in calls
        ]
        (plot_code, plotted), (export_code, exported) = map(self.finish, processes)
        self.assertEqual((plot_code, export_code), (0, 0), plotted + exported)
        self.assertGreaterEqual(len(self.files("drawn_*.png")), 2, plotted)
        (row,) = [line for line in plotted.splitlines() if line.startswith("hero_7")]
        self.assertTrue(math.isfinite(float(row.split()[7])), row)
        with open(os.path.join(self.folder, "tables", "hero_7", "odometry.csv"), encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        self.assertGreater(max(float(row["angular_rad_s"]) for row in rows), 1.0)
        times_s = [float(row["time_s"]) for row in rows]
        self.assertEqual(times_s, sorted(times_s))

    def test_a_recording_whose_recorder_was_killed_is_repaired(self):
        recording = self.start_recording("killed", "--compression", "none")

        def has_whole_chunk():
            # The first chunk is whole as soon as the second one begins; rosbag writes them as they are.
            return any(os.path.getsize(os.path.join(self.folder, path)) > 900 * 1024 for path in self.files("*/*.bag*"))

        wait_for(has_whole_chunk, "900 kB")
        children = subprocess.run(["pgrep", "-P", str(recording.pid)], check=True, stdout=subprocess.PIPE)
        os.kill(int(children.stdout.split()[0]), signal.SIGKILL)
        code, output = self.finish(recording)
        self.assertEqual(code, 1, output)
        self.assertIn("repaired", output)
        self.assertEqual(self.files("*/*.active"), [])
        (path,) = self.files("*/*.bag")
        with rosbag.Bag(os.path.join(self.folder, path)) as bag:
            self.assertGreater(bag.get_message_count("/hero_0/odom"), 10)

    def test_no_recorder_goes_on_when_the_program_is_killed(self):
        process = self.start_recording("killed")
        self.wait_for_files("killed/*.active")
        process.kill()  # the program alone
        wait_for(lambda: not self.files("killed/*.active"), "closed files")
        self.assert_one_closed_bag("killed")

    def test_recordings_stop_on_a_full_disk_whatever_reads_their_output(self):
        disk = SmallDisk(self.folder, "60m")
        self.addCleanup(disk.close)
        self.folder = disk.path
        read_end, write_end = os.pipe()
        os.close(read_end)
        with os.fdopen(write_end, "wb") as closed, open("/dev/full", "wb") as full:
            outputs = {"read": subprocess.PIPE, "closed": closed, "full": full}
            recordings = {
                name: self.start_recording(name, "--min-free-mb", "30", stdout=stdout)
                for name, stdout in outputs.items()
            }
        for name in recordings:
            self.wait_for_files(name + "/hero_*.bag.active")
        self.assertEqual([recording.poll() for recording in recordings.values()], [None] * 3)
        disk.take(40 * 10**6)
        code, output = self.finish(recordings["read"])
        self.assertRegex(output, r"stopped: only \d+ MB are left in .* less than the limit of 30 MB")
        for name, recording in recordings.items():
            self.assertEqual(recording.wait(TIMEOUT_S), 1, name)
            self.assert_one_closed_bag(name)

    def test_each_signal_ends_a_recording_with_closed_bags(self):
        numbers = {"int": signal.SIGINT, "term": signal.SIGTERM, "hup": signal.SIGHUP}
        recordings = {name: self.start_recording(name, stdout=subprocess.DEVNULL) for name in numbers}
        for name, recording in recordings.items():
            self.wait_for_files(name + "/hero_*.bag.active")
            # To record alone: roslaunch and service managers signal one process, and its recorder is its own.
            os.kill(recording.pid, numbers[name])
        for name, recording in recordings.items():
            self.assertEqual(recording.wait(TIMEOUT_S), 0, name)
            self.assert_one_closed_bag(name)

    def test_a_recording_that_cannot_start_says_why_and_leaves_no_files(self):
        without_master = dict(os.environ, ROS_MASTER_URI="http://127.0.0.1:9")
        cases = [
            (self.start_recording("disk", "--min-free-mb", "1e9"), 1, "nothing is recorded"),
            (self.start_recording("split", "--split-mb", "0"), 2, "must be a whole number from 1 to"),
            (self.start_recording("master", env=without_master), 1, "no ROS master at"),
        ]
        for process, expected, words in cases:
            code, output = self.finish(process)
            self.assertEqual(code, expected, output)
            self.assertIn(words, output)
        self.assertEqual(self.files("**/*.bag*"), [])


if __name__ == "__main__":
    rospy.init_node("test_record")
    rostest.rosrun("hero_recording", "test_record", RecordTest)
