"""A swarm that runs for minutes or hours: nothing is lost, and the driver's resources do not grow.

Twenty robots at stock rates get commands at 10 Hz and are listened to without a gap. Beside them, round after round:
a subscriber comes and goes, a robot connects again, another one's power is cut, a third one's service is called.
"""

import contextlib
import sys
import time
from typing import NamedTuple

import numpy as np
import rospy
from measuring import read_one_cpu_s
from rig import (
    BENCH,
    EMULATED_NAMES,
    STOCK_NAMES,
    Holdings,
    Program,
    count_holdings,
    count_robots_names,
    start_python,
    wait_until_commanded,
)

from hero_driver.rosserial import packets
from hero_msgs.msg import Encoder
from hero_msgs.srv import SetPID
from hero_test.driver_case import Recorder
from hero_test.fake_robot import FakeRobot
from hero_test.waiting import wait_for

ROBOTS = 20
BESIDES = 3
CALLED, RETURNING, CUT = 60, 61, 62
SERVICE = "/hero_%d/velocity_controller/pid_parameters" % CALLED

SAMPLES_MIN = 4
SAMPLE_S = 60.0
ROUND_S = 5.0
WARM_UP_SHARE = 1.0 / 6.0
"""Python keeps what it has needed at the worst moment so far; that moment comes later than the first round."""

MEMORY_GROWTH_MB_PER_H = 2.0
"""What counts as flat, by the line through the samples; in runs below an hour, over the whole run."""

WARM_UP_MB = 5.0
"""What Python takes and keeps in the first minutes; the short form is over by then."""

CPU_GROWTH_SHARE = 0.2
"""What may come of other work on the machine."""

FLICKER = 2.0
"""Files and threads by which samples differ: rospy notices within half a second that a subscriber left."""

HOURS_OF_A_DAY = 24.0


class Sample(NamedTuple):
    """What one interval came to."""

    at_s: float  # since the start
    holdings: Holdings
    cpu_percent: float  # of one core
    messages: int
    lost: int
    p99_ms: float

    def describe(self):
        """Return one line."""
        return (
            "%6.1f min: %.1f MB, %d threads, %d files, %d registrations, CPU %.1f %%, %d messages, %d lost, p99 %.1f ms"
        ) % (
            self.at_s / 60.0,
            self.holdings.memory_kb / 1000.0,
            self.holdings.threads,
            self.holdings.files,
            self.holdings.registrations,
            self.cpu_percent,
            self.messages,
            self.lost,
            self.p99_ms,
        )


class Watch:
    """Takes the samples of a driver and its listener."""

    def __init__(self, driver, listener):
        self._driver = driver
        self._listener = listener
        self._start_s = self._then_s = time.monotonic()
        self._cpu_then_s = self._read_cpu_s()
        self.transforms = 0
        self.samples = []

    def skip(self):
        """Begin anew; return what the listener got, of which only the transforms count."""
        window = self._listener.ask("window")
        self.transforms += window["transforms"]
        self._then_s, self._cpu_then_s = time.monotonic(), self._read_cpu_s()
        return window

    def take(self):
        """Take a sample of the time since the last one, in which all robots were heard."""
        wait_for(lambda: not self._listener.ask("silent"), "all robots at the listener")
        now_s, cpu_s = time.monotonic(), self._read_cpu_s()
        window = self._listener.ask("window")
        self.transforms += window["transforms"]
        assert window["disordered"] == 0, window
        sample = Sample(
            now_s - self._start_s,
            count_holdings(self._driver),
            100.0 * (cpu_s - self._cpu_then_s) / (now_s - self._then_s),
            window["messages"],
            window["lost"],
            window["p99_ms"],
        )
        self._then_s, self._cpu_then_s = now_s, cpu_s
        self.samples.append(sample)
        print(sample.describe(), flush=True)

    def _read_cpu_s(self):
        return read_one_cpu_s(self._driver.process.pid)


class Bustle:
    """What comes and goes beside the swarm."""

    def __init__(self, driver):
        self._driver = driver
        self._called = FakeRobot(CALLED).connect(driver.address)
        self._returning = FakeRobot(RETURNING).connect(driver.address)
        self._cut = FakeRobot(CUT).connect(driver.address)
        self.rounds = 0

    def close(self):
        """Let the robots leave."""
        for robot in (self._called, self._returning, self._cut):
            robot.close()

    def act(self):
        """Do everything once; everything must have come to its end."""
        # A subscriber in the middle of the messages, which takes a few and leaves.
        recorder = Recorder("/hero_%d/encoder" % (self.rounds % ROBOTS), Encoder)
        recorder.wait_count(3)
        recorder.subscriber.unregister()
        self._returning.close()
        self._returning = self._replace(RETURNING)
        before, self._cut = self._cut, self._replace(CUT)
        wait_for(lambda: before.ended, "the end of the connection that power left")
        before.close()
        rospy.wait_for_service(SERVICE, 60.0)
        # Anew each time, as the programs of a class do it.
        assert rospy.ServiceProxy(SERVICE, SetPID)(1.0, 1.0, 1.0, 1.0, 1.0, 1.0).success
        self._called.received.clear()
        self.rounds += 1

    def _replace(self, number):
        robot = FakeRobot(number).connect(self._driver.address)
        wait_for(lambda: robot.payloads_with_id(packets.ID_TIME), "the answer to a robot's time request")
        return robot


class Trend(NamedTuple):
    """A figure over time, by the line through its samples after the warm-up."""

    start: float
    per_hour: float
    hours: float

    @property
    def growth(self):
        """How much more it was at the end, by the line."""
        return self.per_hour * self.hours

    def describe(self, unit, is_long):
        """Return it in words; minutes tell of an hour, seconds do not."""
        if not is_long:
            return f"{self.start:.1f}{unit}, {round(self.growth, 1) + 0.0:+.1f}"
        return "%.1f%s, %+.2f per hour (extrapolated to 24 h: %+.1f)" % (
            self.start,
            unit,
            # No minus in front of a nought.
            round(self.per_hour, 2) + 0.0,
            round(self.per_hour * HOURS_OF_A_DAY, 1) + 0.0,
        )


def find_trend(samples, read):
    """Return the trend of read(sample)."""
    samples = samples[int(len(samples) * WARM_UP_SHARE) :]
    hours = np.array([sample.at_s for sample in samples]) / 3600.0
    per_hour, at_zero = np.polyfit(hours, [read(sample) for sample in samples], 1)
    return Trend(at_zero + per_hour * hours[0], per_hour, hours[-1] - hours[0])


@contextlib.contextmanager
def swarm_at_work(driver):
    """Give the programs: swarm, commander, listener."""
    robots = ["--count", str(ROBOTS)]
    with contextlib.ExitStack() as stack:
        listener = stack.enter_context(start_python("listener.py", *robots))
        listener.read()
        commander = stack.enter_context(
            Program(sys.executable, str(BENCH / "ros_load.py"), "command", "--counts", *robots)
        )
        wait_until_commanded(ROBOTS)
        swarm = stack.enter_context(
            Program(
                sys.executable,
                str(BENCH / "emulated_swarm.py"),
                *("--port", str(driver.address[1]), "--seconds", "1e9", "--counts"),
                *robots,
            )
        )
        yield swarm, commander, listener


def work(watch, bustle, samples, sample_s, round_s):
    """Let the swarm work for so many samples of sample_s each, with a round of the bustle every round_s."""
    next_sample_s = next_round_s = time.monotonic()
    for _ in range(samples):
        next_sample_s += sample_s
        while time.monotonic() < next_sample_s:
            bustle.act()
            next_round_s = max(next_round_s + round_s, time.monotonic())
            time.sleep(max(0.0, min(next_round_s, next_sample_s) - time.monotonic()))
        watch.take()


def judge(samples, is_long):
    """Return the trends in words; the driver must be flat."""
    held = {
        "memory": find_trend(samples, lambda sample: sample.holdings.memory_kb / 1000.0),
        "threads": find_trend(samples, lambda sample: sample.holdings.threads),
        "files": find_trend(samples, lambda sample: sample.holdings.files),
        "registrations": find_trend(samples, lambda sample: sample.holdings.registrations),
        "CPU": find_trend(samples, lambda sample: sample.cpu_percent),
    }
    units = {"memory": " MB", "CPU": " %"}
    words = "; ".join(f"{name} {trend.describe(units.get(name, ''), is_long)}" for name, trend in held.items())
    memory_max = MEMORY_GROWTH_MB_PER_H * max(1.0, held["memory"].hours) if is_long else WARM_UP_MB
    assert held["memory"].growth <= memory_max, words
    assert max(held["threads"].growth, held["files"].growth) <= FLICKER, words
    assert samples[-1].holdings.registrations <= samples[0].holdings.registrations, words
    # A few seconds tell nothing of the CPU.
    assert not is_long or held["CPU"].growth <= CPU_GROWTH_SHARE * held["CPU"].start, words
    return words


def test_nothing_is_lost_and_the_driver_does_not_grow(start_driver, effort, record):
    driver = start_driver(parameters={"grace_s": 3600.0})
    with swarm_at_work(driver) as (swarm, commander, listener):
        bustle = Bustle(driver)
        watch = Watch(driver, listener)
        wait_for(lambda: not listener.ask("silent"), "all robots at the listener")
        bustle.act()
        names = EMULATED_NAMES * ROBOTS + STOCK_NAMES * BESIDES
        wait_for(lambda: count_robots_names(driver) == names, "all topics of all robots")
        watch.skip()
        if effort.is_long:
            work(watch, bustle, max(SAMPLES_MIN, round(effort.minutes)), SAMPLE_S, ROUND_S)
        else:
            work(watch, bustle, SAMPLES_MIN, 1.0, 0.0)
        bustle.close()
        sent = commander.interrupt()["commands"]
        robots = swarm.interrupt()
        wait_for(
            lambda: watch.skip() and watch.transforms >= robots["transforms"],
            lambda: "all of %d transforms, got %d" % (robots["transforms"], watch.transforms),
        )
    samples = watch.samples
    missing = sent - robots["commands"]
    record(
        "%.3g minutes of %d robots at stock rates with %d commands" % (samples[-1].at_s / 60.0, ROBOTS, sent),
        ROBOTS,
        ROBOTS - robots["thrown_out"],
        "%d of %d messages, %d of %d transforms; %d commands whose place a newer one took"
        % (
            sum(sample.lost for sample in samples),
            sum(sample.messages for sample in samples),
            robots["transforms"] - watch.transforms,
            robots["transforms"],
            missing,
        ),
    )
    assert sum(sample.lost for sample in samples) == 0
    assert robots["transforms"] == watch.transforms
    # A velocity that has to wait gives way to a newer one: the busier the machine, the more.
    assert missing < sent / 2
    record(
        "beside them: a subscriber that comes and goes, a reconnect, a power cut, a service call",
        bustle.rounds,
        bustle.rounds,
    )
    record(
        f"what the driver holds and uses stays the same, by a line through {len(samples)} samples",
        1,
        1,
        judge(samples, effort.is_long),
    )
