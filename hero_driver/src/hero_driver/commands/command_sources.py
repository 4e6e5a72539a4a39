"""Which programs command one robot on its motion topics, how regularly, and whether it takes their zeros. Pure."""

import collections
import math
from typing import Deque, Dict, NamedTuple, Optional

from hero_node.robot_constants import MAX_WATCHDOG_S

from ..corrections.wheel_motion import WheelMotion

REGULAR_INTERVALS = 5
"""Intervals from which on a program commands regularly; fewer may be single commands, or a short burst."""

INTERVALS_KEPT = 8
"""Its period is the longest of these intervals: a program with jitter, or with pauses, is not taken for a hung one."""

SILENT_PERIODS = 4

WATCH_PERIOD_S = 0.2
"""Time between two looks for silence beyond which the driver itself was suspended or too busy."""

RIVAL_SILENCE_S = 0.5
"""A program that commands regularly, and did so within this time or SILENT_PERIODS, drives the robot at this moment."""

ZERO_SHOWS_S = 0.5
"""Time after a zero in which the wheels of an ordinary robot come to rest, and readings that show it at least:"""

STILL_READINGS = 2

COUNT_PERIOD_S = 1.0
RATE_MAX_HZ = 150.0
"""Programs command at 10 to 50 Hz; a loop that does not sleep, thousands of times per second."""

STUCK_READINGS = 145
"""Readings (29 per second) without a turn of the wheels, after which a commanded robot counts as stuck: 5 s."""


class _Zero(NamedTuple):
    """A zero that ended all motion, and how many readings of its wheels the robot had sent."""

    now_s: float
    readings: int


class CommandSource:
    """A publisher (`sender`, of `node`) that commands a robot on one motion topic by `source`, while no other one does.

    Attributes:
        moves: whether its newest command moves the robot.
        commanded_s: when that came; later where the driver could not hear what followed.
    """

    def __init__(self, sender: object, node: str, source: str) -> None:
        """sender identifies the connection, node is its name in ROS, source the topic in ROS that it publishes."""
        self.sender = sender
        self.node = node
        self.source = source
        self.moves = False
        self.commanded_s = 0.0
        self._was_forgiven = False  # since its newest command
        self._intervals_s: Optional[Deque[float]] = None  # None before the first command

    def note_command(self, moves: bool, now_s: float) -> None:
        """Note its next command, received at now_s; moves: whether the command moves the robot."""
        interval_s = now_s - self.commanded_s
        # What it does after a silence tells its period anew: the silence itself is none.
        begins = interval_s > MAX_WATCHDOG_S or self.has_fallen_silent(RIVAL_SILENCE_S, now_s)
        self.moves, self.commanded_s, self._was_forgiven = moves, now_s, False
        if self._intervals_s is None or begins:
            self._intervals_s = collections.deque(maxlen=INTERVALS_KEPT)
        else:
            self._intervals_s.append(interval_s)

    def forgive_pause(self, pause_s: float, now_s: float) -> None:
        """Do not count a pause of the driver as silence, but once between two commands: programs do hang."""
        if not self._was_forgiven:
            self._was_forgiven = True
            self.commanded_s = min(self.commanded_s + pause_s, now_s)

    def find_period_s(self) -> Optional[float]:
        """Return the period of its commands, None while they are not known to be regular."""
        intervals_s = self._intervals_s
        return max(intervals_s) if intervals_s and len(intervals_s) >= REGULAR_INTERVALS else None

    def has_fallen_silent(self, silence_s: float, now_s: float) -> bool:
        """Return whether it commanded regularly, and has been silent for silence_s and for SILENT_PERIODS."""
        if now_s - self.commanded_s < silence_s:
            return False
        period_s = self.find_period_s()
        return period_s is not None and now_s - self.commanded_s >= SILENT_PERIODS * period_s


class CommandSources:
    """The programs that command one robot: on each motion topic the one of the newest command."""

    def __init__(self, wheels: WheelMotion) -> None:
        self._wheels = wheels
        self._by_topic: Dict[str, CommandSource] = {}
        self._zero: Optional[_Zero] = None  # until its effect shows
        self._looked_s = math.inf
        self._commands, self._counted_s, self._rate_hz = 0, math.inf, 0.0
        self._resting_readings = 0  # number of readings when motion was last not commanded

    def note_command(
        self, name: str, source: str, sender: object, node: str, moves: bool, now_s: float
    ) -> CommandSource:
        """A command came on the motion topic called name; return its commander. The others are its attributes."""
        self._forgive_pause(now_s)
        self._commands += 1
        commander = self._by_topic.get(name)
        ends_motion = not moves and self.are_moving
        if commander is None or commander.sender is not sender or commander.source != source:
            commander = self._by_topic[name] = CommandSource(sender, node, source)
        commander.note_command(moves, now_s)
        if moves:
            self._zero = None
        elif ends_motion and not self.are_moving:
            self._zero = _Zero(now_s, self._wheels.readings)
        return commander

    def find(self, name: str) -> Optional[CommandSource]:
        """Return what moves the robot on a motion topic, None where its newest command was a stop."""
        commander = self._by_topic.get(name)
        return commander if commander is not None and commander.moves else None

    @property
    def are_moving(self) -> bool:
        """Return whether a program has asked for motion, and not for a stop, since the last stop()."""
        for commander in self._by_topic.values():  # noqa: SIM110 - any() costs four times as much, per command
            if commander.moves:
                return True
        return False

    def stop(self) -> None:
        """The robot is being stopped, whatever was commanded."""
        self._zero = None
        for commander in self._by_topic.values():
            commander.moves = False

    def _forgive_pause(self, now_s: float) -> None:
        """Notice a pause of the driver itself, before what was heard in it counts or what was not."""
        pause_s = now_s - self._looked_s
        if pause_s > WATCH_PERIOD_S:
            self._looked_s = now_s
            for commander in self._by_topic.values():
                commander.forgive_pause(pause_s, now_s)

    def is_zero_missed(self, now_s: float) -> bool:
        """Return, once, whether the wheels show that the robot missed a zero, which its firmware drops after a hang."""
        if self._zero is None or now_s - self._zero.now_s < ZERO_SHOWS_S:
            return False
        wheels, is_heard = self._wheels, self._wheels.readings > self._zero.readings
        self._zero = None
        return wheels.readings > 0 and not (is_heard and wheels.still_readings >= STILL_READINGS)

    def find_silent(self, silence_s: float, now_s: float) -> Optional[CommandSource]:
        """Return a program that moves the robot and has fallen silent, or None; pauses of the driver do not count."""
        self._forgive_pause(now_s)
        self._looked_s = now_s
        for commander in self._by_topic.values():
            if commander.moves and commander.has_fallen_silent(silence_s, now_s):
                return commander
        return None

    def find_fault(self, now_s: float) -> str:
        """Return what is wrong with how the robot is commanded, empty if nothing is; to be called regularly."""
        if not 0.0 <= now_s - self._counted_s < COUNT_PERIOD_S:
            self._rate_hz = self._commands / max(now_s - self._counted_s, COUNT_PERIOD_S)
            self._commands, self._counted_s = 0, now_s
        # Motor pulses near a servo's center turn no wheel; after its last command the robot stops by itself.
        if not any(
            source.moves and now_s - source.commanded_s < MAX_WATCHDOG_S and source.source.endswith("cmd_vel")
            for source in self._by_topic.values()
        ):
            self._resting_readings = self._wheels.readings
        still_readings = min(self._wheels.still_readings, self._wheels.readings - self._resting_readings)
        if self._rate_hz <= RATE_MAX_HZ and still_readings < STUCK_READINGS:
            return ""
        nodes = ", ".join(sorted({source.node or "a program" for source in self._by_topic.values()}))
        if self._rate_hz > RATE_MAX_HZ:
            return f"{nodes} sends {self._rate_hz:.0f} commands per second: let its loop sleep, as by rospy.Rate(10)"
        return f"its wheels have not turned for 5 s, although {nodes} commands it: are its battery and motors good?"

    def needs_another_stop(self, commander: CommandSource, now_s: float) -> bool:
        """Return whether a stop of commander has to end motion of other topics, which no other program drives now."""
        others = [
            other
            for other in self._by_topic.values()
            if other is not commander and other.moves and now_s - other.commanded_s < MAX_WATCHDOG_S
        ]
        return bool(others) and not any(
            other.node != commander.node
            and other.find_period_s() is not None
            and not other.has_fallen_silent(RIVAL_SILENCE_S, now_s)
            for other in others
        )
