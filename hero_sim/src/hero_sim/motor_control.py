"""Commands of one robot -> servo pulses, with the firmware's PIDs, gates, limits and three watchdogs.

Pure: time enters in the robot's own milliseconds. Source: VelocityControl.ino, PositionControl.ino and
MotorDriver.ino, by what they do, and measurements of the stock robot. The two controllers know nothing of each
other, so two that are commanded at once write pulses in turn, as on the robot.
"""

import math
from typing import Callable, List, Optional, Sequence, Tuple

from .body import Body
from .kinematics import MAX_LINEAR_M_S, MAX_TURN_RAD_S, TICK_M, split_to_wheels
from .motor_pid import POSITION_GAINS, VELOCITY_GAINS, Gains, MotorPid
from .wheel_odometry import WheelOdometry

COMMAND_GAP_MS = 50
"""A Twist that comes earlier after the last accepted one is dropped, a stop too (VelocityControl.ino:159)."""

CONTROL_MS = 21
"""Between two runs of a controller, 47.6 Hz (VelocityControl.ino:112)."""

VELOCITY_HOLD_MS = 1000
POSITION_HOLD_MS = 3000
"""So long after a command its PID runs (VelocityControl.ino:110, PositionControl.ino:105)."""

MOTOR_HOLD_MS = 1000
"""So long after the last write the motors keep their pulse (MotorDriver.ino:111)."""

VELOCITY_LIMIT_US = 250.0
POSITION_LIMIT_US = 130.0
"""How far from the centre each PID goes."""

PULSE_RANGE_US = (1000, 2000)
"""Servo pulses."""

_WHEEL_SIGNS = (-1, 1)
"""The servos are mounted as mirror images: a pulse below the centre drives the left wheel forward."""

_TUNING_START_US = 130
_TUNING_STEP_US = 80
_TUNING_BAND_TICKS = 1


class MotorDriver:
    """The servos' pulses and the watchdog over them.

    Attributes:
        centres_us: what the robot takes for the pulses at which its wheels stand, left and right.
        attached: whether pulses go out.
        halt_at_ms: when the watchdog ends them.
    """

    def __init__(self, body: Body, centres_us: Sequence[float]) -> None:
        """Begin without pulses; centres that no servo has are taken for 1500, as of an erased flash."""
        self._body = body
        self.centres_us = [
            int(centre_us) if PULSE_RANGE_US[0] < centre_us < PULSE_RANGE_US[1] else 1500
            for centre_us in centres_us
        ]
        self.attached = False
        self.halt_at_ms = 0
        self._pulses_us = (0, 0)

    def write(self, now_ms: int, left_us: int, right_us: int) -> None:
        """Put out pulses, limited to 1000..2000 us."""
        self.halt_at_ms = now_ms + MOTOR_HOLD_MS + 1
        pulses_us = (left_us, right_us)
        if self.attached and pulses_us == self._pulses_us:
            return
        self.attached = True
        self._pulses_us = pulses_us
        low_us, high_us = PULSE_RANGE_US
        self._body.write_pulses(min(max(left_us, low_us), high_us), min(max(right_us, low_us), high_us))

    def drive(self, now_ms: int, outputs_us: Sequence[int]) -> None:
        """Put out what controllers want beyond the centres, forward positive."""
        left_us, right_us = (
            centre_us + sign * output_us
            for centre_us, sign, output_us in zip(self.centres_us, _WHEEL_SIGNS, outputs_us)
        )
        self.write(now_ms, left_us, right_us)

    def halt(self) -> None:
        """Take the pulses away."""
        self.attached = False
        self._body.release()


class _Controller:
    """What velocity and position controller have in common.

    Attributes:
        gains: of the left and right wheel.
        tuning: whether it tunes itself.
        due_ms: when run() has something to do, None while nobody commands.
        dropped: commands that came too early.
    """

    def __init__(
        self, motors: MotorDriver, default: Gains, stored: Sequence[float], limit_us: float, hold_ms: int
    ) -> None:
        """Begin without a command; stored are six gains of the flash, limit_us holds for each output."""
        self._motors = motors
        self._hold_ms = hold_ms
        # A proportional gain that is not above zero is one of an erased flash.
        self.pids = [
            MotorPid(Gains(*gains) if gains[0] > 0.0 else default, limit_us)
            for gains in (stored[:3], stored[3:])
        ]
        self.targets = [0.0, 0.0]
        self.tuning = False
        self.dropped = 0
        self.commanded_ms: Optional[int] = None
        self._ran_ms = -CONTROL_MS

    @property
    def due_ms(self) -> Optional[int]:
        if self.commanded_ms is None:
            return None
        return max(self._ran_ms + CONTROL_MS, self.commanded_ms)

    def set_gains(self, gains: Sequence[float]) -> None:
        """Take lkp lki lkd rkp rki rkd."""
        for pid, three in zip(self.pids, (gains[:3], gains[3:])):
            pid.set_gains(Gains(*three))

    def is_too_early(self, now_ms: int) -> bool:
        """Return whether a command at now_ms has to be dropped, and count it."""
        # While it tunes itself, it keeps its watchdog fresh; a Twist ends that all the same, as measured.
        early = (
            not self.tuning and self.commanded_ms is not None and now_ms - self.commanded_ms < COMMAND_GAP_MS
        )
        self.dropped += early
        return early

    def command(self, now_ms: int, targets: Sequence[float]) -> None:
        """Take targets for the wheels; a wheel that has to turn round starts its PID anew."""
        for pid, target, last in zip(self.pids, targets, self.targets):
            if target * last < 0.0:
                pid.reset()
        self.targets = list(targets)
        self.commanded_ms = now_ms
        self.tuning = False

    def stop(self) -> None:
        """Forget the command; motors are halted by the caller."""
        for pid in self.pids:
            pid.reset()
        self.commanded_ms = None
        self.tuning = False

    def is_due(self, now_ms: int) -> bool:
        """Return whether the controller runs at now_ms; its watchdog ends that for good."""
        if self.commanded_ms is None:
            return False
        if now_ms - self.commanded_ms >= self._hold_ms:
            self.commanded_ms = None
            return False
        if now_ms - self._ran_ms < CONTROL_MS:
            return False
        self._ran_ms = now_ms
        return True

    def run_pids(self, now_ms: int, measured: Sequence[float]) -> None:
        """Write what the PIDs make of the measured wheels."""
        for pid, target, value in zip(self.pids, self.targets, measured):
            pid.run(now_ms, target, value)
        self._motors.drive(now_ms, [pid.output_us for pid in self.pids])


class MotorControl:
    """The controllers and the motor driver of one robot.

    Attributes:
        motors: what puts out the pulses.
        velocity, position: the controllers, for their gains.
        due_ms: when run() has something to do, None while nobody commands.
    """

    def __init__(
        self,
        body: Body,
        odometry: WheelOdometry,
        centres_us: Sequence[float],
        velocity_gains: Sequence[float],
        position_gains: Sequence[float],
    ) -> None:
        """Begin halted, with what the flash holds; six gains each, left and right."""
        self._body = body
        self._odometry = odometry
        self.motors = MotorDriver(body, centres_us)
        self.velocity = _Controller(
            self.motors, VELOCITY_GAINS, velocity_gains, VELOCITY_LIMIT_US, VELOCITY_HOLD_MS
        )
        self.position = _Controller(
            self.motors, POSITION_GAINS, position_gains, POSITION_LIMIT_US, POSITION_HOLD_MS
        )
        self._start_ticks = [0, 0]
        self._relay = [1, 1]
        self.due_ms: Optional[int] = None

    def _reschedule(self) -> None:
        wanted_ms = [self.motors.halt_at_ms] if self.motors.attached else []
        for controller in (self.velocity, self.position):
            due_ms = controller.due_ms
            if due_ms is not None:
                wanted_ms.append(due_ms)
        self.due_ms = min(wanted_ms) if wanted_ms else None

    def receive_velocity(self, now_ms: int, linear_m_s: float, turn_rad_s: float) -> bool:
        """Take a Twist for the velocity controller; return whether it was a stop that was taken."""
        if self.velocity.is_too_early(now_ms):
            return False
        wheels_m_s = _limit_to_wheels(linear_m_s, turn_rad_s)
        self._take(self.velocity, now_ms, wheels_m_s)
        return wheels_m_s is None

    def receive_position(self, now_ms: int, world_ms: int, linear_m_s: float, turn_rad_s: float) -> bool:
        """Take a Twist for the position controller, which goes as far as that speed reaches in a second.

        Return whether it was a stop that was taken; world_ms is the world's time of now_ms.
        """
        if self.position.is_too_early(now_ms):
            return False
        wheels_m_s = _limit_to_wheels(linear_m_s, turn_rad_s)
        self._start_ticks = self._count_ticks(world_ms)
        ways_ticks = None if wheels_m_s is None else [wheel_m_s / TICK_M for wheel_m_s in wheels_m_s]
        self._take(self.position, now_ms, ways_ticks)
        return wheels_m_s is None

    def _take(self, controller: _Controller, now_ms: int, targets: Optional[Sequence[float]]) -> None:
        if targets is None:
            controller.stop()
            self.motors.halt()
        else:
            controller.command(now_ms, targets)
        self._reschedule()

    def receive_pulses(self, now_ms: int, left_us: int, right_us: int) -> None:
        """Take a Motor command; a controller that is commanded too overwrites it."""
        self.motors.write(now_ms, left_us, right_us)
        self._reschedule()

    def start_tuning(self, now_ms: int, world_ms: int, of_velocity: bool) -> None:
        """Begin a controller's self-tuning, which goes on until it gets a Twist."""
        controller = self.velocity if of_velocity else self.position
        controller.tuning = True
        controller.commanded_ms = now_ms
        self._start_ticks = self._count_ticks(world_ms)
        self._relay = [1, 1]
        start_us = _TUNING_START_US if of_velocity else 0
        self.motors.drive(now_ms, (start_us, start_us))
        self._reschedule()

    def run(self, now_ms: int, world_ms: int, read_encoders: Callable[[int, int], None]) -> Optional[str]:
        """Do what is due; return what a self-tuning says of it.

        The velocity controller reads the encoders anew with read_encoders(now_ms, world_ms), and so takes a
        reading away from the odometry.
        """
        line = None
        if self.position.is_due(now_ms):
            way_ticks = self._count_way(world_ms)
            if self.position.tuning:
                line = self._tune_position(now_ms, way_ticks)
            else:
                self.position.run_pids(now_ms, way_ticks)
        if self.velocity.is_due(now_ms):
            read_encoders(now_ms, world_ms)
            if self.velocity.tuning:
                line = self._tune_velocity(now_ms)
            else:
                self.velocity.run_pids(now_ms, self._odometry.filtered_m_s)
        if self.motors.attached and now_ms >= self.motors.halt_at_ms:
            self.motors.halt()
        self._reschedule()
        return line

    def _tune_velocity(self, now_ms: int) -> str:
        # Its relay would switch at 1 m/s, which no wheel reaches: it stays where it starts.
        outputs_us = (_TUNING_STEP_US - _TUNING_START_US, _TUNING_START_US + _TUNING_STEP_US)
        self.velocity.commanded_ms = now_ms
        self.motors.drive(now_ms, outputs_us)
        return _describe_tuning(self.velocity.targets, self._odometry.filtered_m_s, outputs_us)

    def _tune_position(self, now_ms: int, way_ticks: Sequence[int]) -> str:
        """Rock each wheel about where it stands."""
        self.position.commanded_ms = now_ms
        for wheel, ticks in enumerate(way_ticks):
            if self._relay[wheel] * ticks > _TUNING_BAND_TICKS:
                self._relay[wheel] = -self._relay[wheel]
        outputs_us = [_TUNING_STEP_US * relay for relay in self._relay]
        self.motors.drive(now_ms, outputs_us)
        return _describe_tuning(self.position.targets, way_ticks, outputs_us)

    def _count_ticks(self, world_ms: int) -> List[int]:
        return self._odometry.count_ticks(*self._body.read_wheels(world_ms))

    def _count_way(self, world_ms: int) -> List[int]:
        return [now - start for now, start in zip(self._count_ticks(world_ms), self._start_ticks)]

    def halt(self) -> None:
        """Switch the motors off and forget all commands."""
        self.velocity.stop()
        self.position.stop()
        self.motors.halt()
        self._reschedule()


def _describe_tuning(targets: Sequence[float], measured: Sequence[float], outputs_us: Sequence[int]) -> str:
    values = (*targets, *measured, *outputs_us)
    return "Tunning Motor Set: [%f,%f], [%f,%f]->[%d,%d]" % values


def _limit_to_wheels(linear_m_s: float, turn_rad_s: float) -> Optional[Tuple[float, float]]:
    """Return the wheels' speeds (m/s) for a Twist within the firmware's limits, None for a stop."""
    linear_m_s = math.copysign(min(abs(linear_m_s), MAX_LINEAR_M_S), linear_m_s)
    turn_rad_s = math.copysign(min(abs(turn_rad_s), MAX_TURN_RAD_S), turn_rad_s)
    if linear_m_s == 0.0 and turn_rad_s == 0.0:
        return None
    return split_to_wheels(linear_m_s, turn_rad_s)
