"""Robots behind a link without ROS, in virtual time: perfect wheels, and a note of all that is sent."""

import math

from hero_client.robots.robot_base import BaseRobot
from hero_client.robots.swarm_base import BaseSwarm
from hero_client.values.background_motion import BackgroundMotion
from hero_client.values.errors import StaleDataError
from hero_node import Clock, HeroError, Pose, Velocity, wrap_angle
from hero_node.robot_constants import HERO

STEP_S = 0.01


class FakeClock(Clock):
    """The time of all robots, which passes only in sleep(); what has joined is moved meanwhile."""

    now_s = 100.0

    def __init__(self):
        self.joined = []
        self.is_to_continue = True

    def sleep(self, duration_s):
        end_s = self.now_s + duration_s
        while end_s - self.now_s > 1e-9:
            step_s = min(STEP_S, end_s - self.now_s)
            self.now_s += step_s
            for one in list(self.joined):
                one.advance(step_s)
        return self.is_to_continue


class FakeMotion(BackgroundMotion):
    """Steps that are taken when they are due; asking for the result lets the time pass."""

    def __init__(self, clock, steps):
        super().__init__()
        self._clock, self._steps, self._is_cancelled = clock, steps, False
        self.set_running_or_notify_cancel()
        clock.joined.append(self)
        self._take(None)

    def _take(self, sent):
        try:
            self._due_s = self._clock.now_s + self._steps.send(sent)
        except StopIteration:
            self.set_result(None)
        except (HeroError, ValueError, TypeError) as error:
            self.set_exception(error)
        if self.done():
            self._clock.joined.remove(self)

    def advance(self, step_s):
        if self._clock.now_s >= self._due_s - 1e-9:
            self._take(not self._is_cancelled)

    def cancel(self):
        self._is_cancelled = True
        return not self.done()

    def cancel_and_wait(self):
        self.cancel()
        while not self.done():
            self._take(False)

    def exception(self, timeout=None):
        while not self.done():
            self._clock.sleep(STEP_S)
        return super().exception(timeout)

    def result(self, timeout=None):
        self.exception()
        return super().result(timeout)


class FakeLink:
    """A robot whose data are silent_s old, that is ready after ready_s, and that notes what it is sent."""

    def __init__(self, clock):
        self.clock, self.pose = clock, Pose(0.0, 0.0, 0.0)
        self.velocity = Velocity(0.0, 0.0)
        self.ranges = [math.inf] * 8
        self.silent_s = {"odom": 0.03, "proximity": 0.1}
        self.sent, self.colors, self.warned, self.subscribed, self.waited = [], [], [], [], []
        self.odometries = []
        self.is_stopped, self.connected, self.closed = False, True, 0
        self.ready_s = clock.now_s
        self.localized, self.model = None, HERO
        self.origin = Pose(0.0, 0.0, 0.0)
        clock.joined.append(self)

    def advance(self, step_s):
        linear_m_s, angular_rad_s = self.velocity
        yaw_rad = self.pose.yaw_rad + angular_rad_s * step_s / 2.0
        self.pose = Pose(
            self.pose.x_m + linear_m_s * step_s * math.cos(yaw_rad),
            self.pose.y_m + linear_m_s * step_s * math.sin(yaw_rad),
            wrap_angle(self.pose.yaw_rad + angular_rad_s * step_s),
        )

    def missing(self):
        return None if self.clock.now_s >= self.ready_s - 1e-9 else "nothing subscribes"

    def subscribe(self, topic):
        self.subscribed.append(topic)

    def age_s(self, topic):
        return self.silent_s.get(topic, math.inf)

    def wait_for_next(self, topic, timeout_s, count=1):
        self.waited.append((topic, timeout_s, count))
        if self.age_s(topic) == math.inf:
            self.clock.sleep(timeout_s)
            raise StaleDataError("no message on %s" % topic)

    def read_pose(self):
        return self.pose

    def read_velocity(self):
        return self.velocity

    def read_ranges(self):
        return list(self.ranges)

    def read_infrared_counts(self):
        return [5.0] * 8

    def read_distance(self):
        return 0.7

    def read_neighbors(self):
        return ["neighbor"]

    def find_localized(self, frame, timeout_s):
        if isinstance(self.localized, Exception):
            raise self.localized
        return self.localized

    def find_origin(self, frame, timeout_s):
        return self.origin

    def send_velocity(self, linear_m_s, angular_rad_s):
        self.velocity = Velocity(linear_m_s, angular_rad_s)
        self.sent.append((round(self.clock.now_s - 100.0, 3), linear_m_s, angular_rad_s))

    def send_color(self, rgb):
        self.colors.append((round(self.clock.now_s - 100.0, 3), rgb))

    def set_odometry(self, pose):
        self.odometries.append(pose)

    def describe_stop(self):
        return "the driver has stopped all robots"

    def start(self, steps):
        return FakeMotion(self.clock, steps)

    def log_warning(self, text):
        self.warned.append(text)

    def close(self):
        self.closed += 1


class FakeSwarm(BaseSwarm):
    """Robots with these numbers, 0.5 m apart along y, each in its own odometry; their origins say so."""

    def __init__(self, *numbers):
        clock = FakeClock()
        self.links, self.logged = [], []
        for row, _ in enumerate(numbers):
            link = FakeLink(clock)
            link.origin = Pose(0.0, 0.5 * row, 0.0)
            self.links.append(link)
        super().__init__([BaseRobot(number, link) for number, link in zip(numbers, self.links)], clock)

    def _log(self, level, text):
        self.logged.append((round(self.now_s - 100.0, 3), level, text))


def make_robot(number=3):
    """Return a robot and its link."""
    link = FakeLink(FakeClock())
    return BaseRobot(number, link), link
