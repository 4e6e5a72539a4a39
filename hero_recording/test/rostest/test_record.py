#!/usr/bin/env python3
"""Recordings of simulated robots behind the real driver: contents, ends, plot and export."""

import csv
import glob
import os
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

import rosbag
import rosgraph
import rospy
import rostest
from geometry_msgs.msg import Twist, Vector3

from hero_test.waiting import wait_for

RECORD = ["rosrun", "hero_recording", "record"]
TIMEOUT_S = 60.0
ROBOT_TOPICS = ("odom", "encoder", "proximity", "ground_truth")
DISK_STEP = 400 * 10**6
"""Bytes that are taken from the disk at once; others on this machine take less in the seconds of the test."""


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

    def end(self, process, number=signal.SIGINT):
        """Send a signal as Ctrl-C does, to all of the session; return exit code and output."""
        os.killpg(process.pid, number)
        output = process.communicate(timeout=TIMEOUT_S)[0].decode()
        return process.returncode, output

    def files(self, pattern="*"):
        return sorted(os.path.basename(path) for path in glob.glob(os.path.join(self.folder, pattern)))

    def wait_for_data(self, least=1):
        """Wait until this many bytes are on the disk; rosbag writes them in chunks."""

        def has_grown():
            return sum(os.path.getsize(path) for path in glob.glob(self.folder + "/*.bag*")) >= least

        wait_for(has_grown, "recording of %d bytes in %s: %s" % (least, self.folder, self.files()))

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
        wait_for(lambda: self.files("hero_*_0.bag.active"), "recording")
        late = self.start(
            *(
                "rosrun",
                "hero_sim",
                "hero_sim",
                "--port",
                "21297",
                "--first-id",
                "7",
                "--quiet",
                "__name:=late_sim",
            )
        )
        publisher = rospy.Publisher("/hero_7/velocity_controller/cmd_vel", Twist, queue_size=1)
        wait_for(publisher.get_num_connections, "hero_7")
        # The recorder asks the ROS master for new topics once in a while; nobody else listens to these.
        wait_for(lambda: is_subscribed("/hero_7/"), "subscriptions to hero_7")
        wait_for(lambda: self.files("hero_*_1.bag*"), "second file of a split")
        for _ in range(15):
            publisher.publish(Twist(angular=Vector3(0.0, 0.0, 2.0)))
            time.sleep(0.1)
        publisher.publish(Twist())
        code, output = self.end(recording)
        self.end(late)
        self.assertEqual(code, 0, output)
        bags = self.files("hero_*.bag")
        self.assertGreaterEqual(len(bags), 2, output)
        self.assertEqual(self.files("*.active"), [], output)
        for name in bags:
            self.assertIn(os.path.join(self.folder, name), output)
        topics = set()
        for name in bags:
            with rosbag.Bag(os.path.join(self.folder, name)) as bag:
                topics |= set(bag.get_type_and_topic_info().topics)
        for topic in ROBOT_TOPICS:
            self.assertIn("/hero_0/" + topic, topics)
            self.assertIn("/hero_7/" + topic, topics)
        expected = {"/tf", "/tf_static", "/rosout", "/diagnostics", "/hero_driver/robots", "/hero_sim/arena"}
        self.assertLessEqual(expected, topics)
        self.assertIn("/hero_7/velocity_controller/cmd_vel", topics)
        self.assertNotIn("/hero_0/laser", topics)
        self.check_plot(bags)
        self.check_export(bags)

    def check_plot(self, bags):
        result = subprocess.run(
            ["rosrun", "hero_recording", "plot", *bags, "--out", "drawn"],
            cwd=self.folder,
            capture_output=True,
            check=False,
        )
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(len(self.files("drawn_*.png")), 5, result.stdout)
        row = next(line for line in result.stdout.decode().splitlines() if line.startswith("hero_7"))
        delay_ms = float(row.split()[7])
        self.assertLess(abs(delay_ms), 100.0, row)

    def check_export(self, bags):
        command = ["rosrun", "hero_recording", "export", *bags, "--out", "tables"]
        subprocess.run(command, cwd=self.folder, check=True, stdout=subprocess.PIPE)
        with open(os.path.join(self.folder, "tables", "hero_7", "odometry.csv"), encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        self.assertGreater(max(float(row["angular_rad_s"]) for row in rows), 1.0)
        times_s = [float(row["time_s"]) for row in rows]
        self.assertEqual(times_s, sorted(times_s))

    def test_a_recording_whose_recorder_was_killed_is_repaired(self):
        recording = self.start(*RECORD, "--folder", self.folder, "--compression", "none")
        # The first chunk is whole as soon as the second one begins.
        self.wait_for_data(900 * 1024)
        children = subprocess.run(["pgrep", "-P", str(recording.pid)], check=True, stdout=subprocess.PIPE)
        os.kill(int(children.stdout.split()[0]), signal.SIGKILL)
        output = recording.communicate(timeout=TIMEOUT_S)[0].decode()
        self.assertEqual(recording.returncode, 1, output)
        self.assertIn("repaired", output)
        self.assertEqual(self.files("*.active"), [])
        with rosbag.Bag(glob.glob(self.folder + "/*.bag")[0]) as bag:
            self.assertGreater(bag.get_message_count("/hero_0/odom"), 10)

    def fill_the_disk_while_recording(self, stdout=subprocess.PIPE):
        """Record until the disk is full; return the recording and the limit (MB) at which it had to stop."""
        free_mb = shutil.disk_usage(self.folder).free / 1e6
        limit_mb = int(free_mb - DISK_STEP / 1e6 / 2)
        recording = self.start(*RECORD, "--folder", self.folder, "--min-free-mb", str(limit_mb), stdout=stdout)
        wait_for(lambda: self.files("hero_*.bag.active"), "recording")
        self.assertIsNone(recording.poll())
        with open(os.path.join(self.folder, "filler"), "wb") as filler:
            os.posix_fallocate(filler.fileno(), 0, DISK_STEP)
        return recording, limit_mb

    def assert_one_closed_bag(self):
        self.assertEqual(self.files("*.active"), [])
        (name,) = self.files("*.bag")
        rosbag.Bag(os.path.join(self.folder, name)).close()

    def test_a_recording_stops_cleanly_when_the_disk_is_full(self):
        recording, limit_mb = self.fill_the_disk_while_recording()
        output = recording.communicate(timeout=TIMEOUT_S)[0].decode()
        self.assertEqual(recording.returncode, 1, output)
        self.assertRegex(output, r"stopped: only \d+ MB are left in .* less than the limit of %d MB" % limit_mb)
        self.assert_one_closed_bag()

    def test_the_disk_is_watched_with_a_closed_output(self):
        read_end, write_end = os.pipe()
        os.close(read_end)
        with os.fdopen(write_end, "wb") as closed_pipe:
            recording, _ = self.fill_the_disk_while_recording(closed_pipe)
        self.assertEqual(recording.wait(TIMEOUT_S), 1)
        self.assert_one_closed_bag()

    def test_the_disk_is_watched_with_a_full_output(self):
        with open("/dev/full", "wb") as full:
            recording, _ = self.fill_the_disk_while_recording(full)
        self.assertEqual(recording.wait(TIMEOUT_S), 1)
        self.assert_one_closed_bag()

    def test_each_signal_ends_a_recording_with_closed_bags(self):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            with self.subTest(number):
                recording = self.start(*RECORD, "--folder", self.folder)
                recording.stdout.close()
                wait_for(lambda: self.files("hero_*.bag.active"), "recording")
                # To record alone: roslaunch and service managers signal one process, and its recorder is its own.
                os.kill(recording.pid, number)
                self.assertEqual(recording.wait(TIMEOUT_S), 0)
                self.assert_one_closed_bag()
                os.remove(os.path.join(self.folder, self.files("*.bag")[0]))

    def test_wrong_options_are_refused_in_one_line(self):
        environment = dict(os.environ, ROS_MASTER_URI="http://127.0.0.1:9")
        for arguments, code, words, env in (
            (["--min-free-mb", "1e9"], 1, "nothing is recorded", None),
            (["--split-mb", "0"], 2, "must be 1..", None),
            (["--name", "../x"], 2, "--name", None),
            (["--topics", "("], 2, "not a regular expression", None),
            (["--robots", "one"], 2, "--robots", None),
            (["--seconds", "inf"], 2, "--seconds inf", None),
            (["--seconds", "nan"], 2, "--seconds nan", None),
            ([], 1, "no ROS master at", environment),
        ):
            result = subprocess.run(
                [*RECORD, "--folder", self.folder, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                timeout=TIMEOUT_S,
                check=False,
                env=env,
            )
            output = result.stdout.decode()
            self.assertEqual(result.returncode, code, output)
            self.assertIn(words, output)
            self.assertNotIn("Traceback", output)
        self.assertEqual(self.files(), [])


if __name__ == "__main__":
    rospy.init_node("test_record")
    rostest.rosrun("hero_recording", "test_record", RecordTest)
