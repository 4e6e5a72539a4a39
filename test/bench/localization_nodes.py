"""CPU of the nodes track and localize, and the age of their poses, for robots that turn on the spot.

The nodes run as launched; this process replaces camera and driver. It renders one turn of the robots beforehand, and
publishes images and odometry at the times at which a camera and a driver would. Where this machine cannot do that
beside the nodes, ROS time runs slower than the clock: an image costs as much CPU as at full speed.
"""

import bisect
import contextlib
import math
import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import rospy
from measuring import read_cpu_s, read_one_cpu_s, start, start_master, stop
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image

from hero_localization.camera.frame_source import keep_freed_memory
from hero_localization.filter.swarm_localizer import PUBLISH_RATE_HZ
from hero_localization.simulated_camera.renderer import CameraRenderer
from hero_localization.simulated_camera.view import PrintedTag
from hero_localization.tracking.settings import describe_camera, update
from hero_msgs.msg import RobotPose, RobotPoses
from hero_sim.world.arena import build_rectangle

ARENA_M = (2.5, 1.4)
ROWS = 5
TURN_S = 3.0
TURN_RAD_S = 2.0 * math.pi / TURN_S
ODOMETRY_GROUPS, ODOMETRY_HZ = 5, 30.0
"""Groups of robots that send one after another between two images, and how often each robot sends at most."""
SETTLE_S = 5.0
START_S = 60.0


def place_robots(count):
    """Return poses (N, 3) in a grid."""
    across_m, up_m = np.meshgrid(np.linspace(-1.1, 1.1, math.ceil(count / ROWS)), np.linspace(-0.56, 0.56, ROWS))
    return np.column_stack((across_m.ravel(), up_m.ravel(), np.zeros(across_m.size)))[:count]


def render_turn(options, poses):
    """Return the images (H, W) of one turn of all robots."""
    renderer = CameraRenderer(options, build_rectangle(*ARENA_M, 0), [PrintedTag(index) for index in range(len(poses))])
    speeds = np.column_stack((np.zeros(len(poses)), np.full(len(poses), TURN_RAD_S)))
    count = round(TURN_S * options.rate_hz)
    turns_rad = 2.0 * math.pi * np.arange(count) / count
    return [renderer.render(poses + (0.0, 0.0, turn_rad), speeds) for turn_rad in turns_rad]


class CameraAndDriver:
    """Publishers of images and odometry, and what came of them."""

    def __init__(self, options, images, count, speed):
        """speed: of ROS time, by that of the clock."""
        self.speed, self._begin_s, self._begin_clock_s = speed, time.time(), time.monotonic()
        self._clock = rospy.Publisher("/clock", Clock, queue_size=10, tcp_nodelay=True) if speed != 1.0 else None
        self._frame_s, self._delay_s = 1.0 / options.rate_hz, options.delay_s + options.delay_jitter_s / 2.0
        self.arrivals_s, self.measured_s, self.published_s, self.tracked = {}, {}, [], 0
        self._groups = ODOMETRY_GROUPS * math.ceil(options.rate_hz / ODOMETRY_HZ)
        self._images, self._index, self._start_s = images, 0, self._begin_s
        self._image = rospy.Publisher("/camera/image_raw", Image, queue_size=1)
        self._odometry = [
            rospy.Publisher("/hero_%d/odom" % index, Odometry, queue_size=5, tcp_nodelay=True) for index in range(count)
        ]
        rospy.Subscriber("/track/measured_poses", RobotPoses, self._note_measured, queue_size=50, tcp_nodelay=True)
        rospy.Subscriber("/localization/poses", RobotPoses, self._note_published, queue_size=50, tcp_nodelay=True)

    def read_s(self):
        """Return ROS time, also between two messages on /clock."""
        return self._begin_s + self.speed * (time.monotonic() - self._begin_clock_s)

    def _sleep_until(self, time_s):
        time.sleep(max(0.0, time_s - self.read_s()) / self.speed)
        if self._clock is not None:
            self._clock.publish(Clock(rospy.Time.from_sec(self.read_s())))

    def _note_measured(self, report):
        self.measured_s[report.header.stamp.to_nsec()] = self.read_s()

    def _note_published(self, report):
        self.published_s.append((report.header.stamp.to_sec(), self.read_s()))
        self.tracked = sum(robot.state == RobotPose.TRACKED for robot in report.robots)

    def run(self, is_done):
        """Publish until is_done(), from where the last call ended."""
        frame_s, late_frames = self._frame_s, math.floor(self._delay_s / self._frame_s)
        while not is_done():
            frame_start_s = self._start_s + self._index * frame_s
            for group in range(ODOMETRY_GROUPS):
                now_s = frame_start_s + group * frame_s / ODOMETRY_GROUPS
                self._sleep_until(now_s)
                first = (self._index * ODOMETRY_GROUPS + group) % self._groups
                self._send_odometry(self._odometry[first :: self._groups], now_s)
            taken_s = frame_start_s - late_frames * frame_s
            self._sleep_until(taken_s + self._delay_s)
            self._send_image(self._index - late_frames, taken_s)
            self._index += 1

    def _send_odometry(self, publishers, now_s):
        message, yaw_rad = Odometry(), TURN_RAD_S * (now_s - self._start_s)
        message.header.stamp = rospy.Time.from_sec(now_s)
        message.pose.pose.orientation.z = math.sin(yaw_rad / 2.0)
        message.pose.pose.orientation.w = math.cos(yaw_rad / 2.0)
        for publisher in publishers:
            publisher.publish(message)

    def _send_image(self, index, taken_s):
        gray = self._images[index % len(self._images)]
        message = Image(height=gray.shape[0], width=gray.shape[1], encoding="mono8", step=gray.shape[1])
        message.header.stamp = rospy.Time.from_sec(taken_s)
        message.data = gray.tobytes()
        self.arrivals_s[message.header.stamp.to_nsec()] = self.read_s()
        self._image.publish(message)

    def list_ages_s(self, from_s):
        """Return for how long each image was under way in track, and until localize published the poses after it."""
        stamps_s = [stamp_s for stamp_s, _ in self.published_s]
        ages_s = []
        for stamp_ns, measured_s in sorted(self.measured_s.items()):
            next_report = bisect.bisect_left(stamps_s, measured_s)
            if stamp_ns * 1e-9 >= from_s and next_report < len(stamps_s):
                arrival_s = self.arrivals_s[stamp_ns]
                ages_s.append((measured_s - arrival_s, self.published_s[next_report][1] - arrival_s))
        return np.array(ages_s) / self.speed


def measure_nodes(options, count, seconds, rounds, speed):
    """Print CPU (of one core) of track and localize, and the ages of images and poses, in each of some rounds.

    seconds: of the clock; speed: of ROS time, by that.
    """
    keep_freed_memory()
    images = render_turn(options, place_robots(count))
    with contextlib.ExitStack() as stack:
        environment = stack.enter_context(start_master())
        os.environ["ROS_MASTER_URI"] = environment["ROS_MASTER_URI"]
        path = str(Path(stack.enter_context(tempfile.TemporaryDirectory())) / "camera.yaml")
        update(path, describe_camera(options.geometry, {}))
        rospy.set_param("/use_sim_time", speed != 1.0)
        rospy.init_node("camera_and_driver", disable_signals=True)
        source = CameraAndDriver(options, images, count, speed)

        def start_node(program, *arguments):
            command = ["catkin_find", "--first-only", "--libexec", "hero_localization", program]
            found = subprocess.check_output(command, text=True, env=environment).strip()
            process = start([found, *arguments], environment, stdout=subprocess.DEVNULL)
            stack.callback(stop, process)
            return process.pid

        pids = (
            start_node("track", "_file:=" + path),
            start_node("localize", "_robots:=0-%d" % (count - 1), "_rate_hz:=%g" % (speed * PUBLISH_RATE_HZ)),
        )
        deadline_s = time.monotonic() + START_S
        source.run(lambda: source.tracked == count or time.monotonic() > deadline_s)
        if source.tracked < count:
            raise SystemExit("bench: %d of %d robots are tracked after %.0f s" % (source.tracked, count, START_S))
        settled_s = time.monotonic() + SETTLE_S
        source.run(lambda: time.monotonic() > settled_s)
        for _ in range(rounds):
            measure_round(source, pids, seconds)


def measure_round(source, pids, seconds):
    """Print CPU and ages of the next seconds; pids: of track and localize."""
    from_s, end_s, before_s = source.read_s(), time.monotonic() + seconds, _read_parts_s(pids)
    source.run(lambda: time.monotonic() > end_s)
    parts_s = np.subtract(_read_parts_s(pids), before_s)
    ages_ms = 1e3 * source.list_ages_s(from_s)
    sent = sum(stamp_ns * 1e-9 >= from_s for stamp_ns in source.arrivals_s)
    print("\n%d robots, load %.1f: used %d of %d images" % (source.tracked, os.getloadavg()[0], len(ages_ms), sent))
    cpu = 100.0 * np.array((parts_s[0] + parts_s[1], parts_s[2])) / seconds
    print(f"CPU of track {cpu[0]:.0f} %, of localize {cpu[1]:.0f} % of a core")
    text = "by image, ms: %.1f in track and %.1f in its search, of each that was used; %.1f in localize, of each sent"
    print(text % tuple(1e3 * parts_s / (len(ages_ms), len(ages_ms), sent)))
    for name, ages in zip(("track publishes", "localize publishes"), ages_ms.T if source.speed == 1.0 else ()):
        text = "from an image's arrival until %s: %.0f ms on average, 99 %% within %.0f ms, at most %.0f ms"
        print(text % (name, ages.mean(), np.percentile(ages, 99), ages.max()))


def _read_parts_s(pids):
    """Return the CPU seconds of track without its search, of this search, and of localize."""
    track_s = read_one_cpu_s(pids[0])
    return track_s, read_cpu_s(pids[0]) - track_s, read_cpu_s(pids[1])
