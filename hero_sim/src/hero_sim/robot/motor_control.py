"""Servo pulses from the commands of one robot, with the firmware's PIDs, gates, limits and watchdogs.

Pure: time enters in the robot's own milliseconds. Source: VelocityControl.ino, PositionControl.ino and
MotorDriver.ino, by what they do, and measurements of the stock robot. The two controllers know nothing of each
other: two that are commanded at once write pulses in turn, and a zero for one leaves the other driving.
"""

from typing import Callable, List, Sequence

import numpy as np

from hero_node import clamp
from hero_node.robot_constants import MAX_ANGULAR_RAD_S, MAX_LINEAR_M_S, PULSE_RANGE_US

from ..robot_constants import (
    COMMAND_GAP_MS,
    MOTOR_WATCHDOG_MS,
    POSITION_LIMIT_US,
    POSITION_WATCHDOG_MS,
    VELOCITY_LIMIT_US,
    VELOCITY_WATCHDOG_MS,
)
from ..world.body import Body
from ..world.kinematics import split_to_wheels
from .clock import NEVER_MS
from .flash import Flash
from .motor_pid import POSITION_GAINS, VELOCITY_GAINS, Gains, MotorPid
from .servo_pins import ServoPins
from .wheel_odometry import WheelOdometry

CONTROL_MS = 21
"""Time between two runs of a controller, 47.6 Hz (VelocityControl.ino:112)."""

_WHEEL_SIGNS = (-1, 1)
"""The servos are mounted as mirror images: a pulse below the center drives the left wheel forward."""

VELOCITY_TUNING_MS = (41000, 65000)
POSITION_TUNING_MS = (11000, 49000)
"""Self-tuning ends by itself, without a result, after between these times (measured)."""

_VELOCITY_TUNING_START_US = 130
_VELOCITY_TUNING_US = (-50, 210)
"""Its relay would switch at 1 m/s, which no wheel reaches: its output stays 80 us beyond 130 us, as the wheels turn."""

_POSITION_TUNING_STEP_US = 145
_POSITION_TUNING_BAND_TICKS = 10
"""Fitted to the measured path of 0.46 m in 6 s."""


class MotorDriver:
    """The servos' pulses and their watchdog.

    Attributes:
        centers_us: the robot's calibration: the pulses at which its wheels should rest, left and right.
        attached: whether pulses go out.
        stop_at_ms: when the watchdog stops them.
        held_us: how long the calls of write() and stop() have blocked the robot's loop; the caller resets it.
    """

    def __init__(self, body: Body, centers_us: Sequence[float], pins: ServoPins) -> None:
        """Begin without pulses; centers that no servo has are taken for 1500, as of an erased flash."""
        low_us, high_us = PULSE_RANGE_US
        self._body = body
        self._pins = pins
        self.held_us = 0
        self.centers_us = [int(pulse_us) if low_us < pulse_us < high_us else 1500 for pulse_us in centers_us]
        self.attached = False
        self.stop_at_ms = NEVER_MS
        self._pulses_us = (0, 0)

    def write(self, now_ms: int, left_us: int, right_us: int) -> None:
        """Write pulses, limited to 1000..2000 us."""
        self.stop_at_ms = now_ms + MOTOR_WATCHDOG_MS + 1
        self.held_us += self._pins.write(now_ms * 1000 + self.held_us)
        pulses_us = (left_us, right_us)
        if self.attached and pulses_us == self._pulses_us:
            return
        self.attached = True
        self._pulses_us = pulses_us
        low_us, high_us = PULSE_RANGE_US
        self._body.write_pulses(min(max(left_us, low_us), high_us), min(max(right_us, low_us), high_us))

    def drive(self, now_ms: int, outputs_us: Sequence[int]) -> None:
        """Write the controllers' outputs beyond the centers, forward positive."""
        pulses_us = [
            center_us + sign * output_us
            for center_us, sign, output_us in zip(self.centers_us, _WHEEL_SIGNS, outputs_us)
        ]
        self.write(now_ms, *pulses_us)

    def stop(self) -> None:
        """Stop the pulses."""
        self.attached = False
        self.stop_at_ms = NEVER_MS
        self.held_us += self._pins.detach()
        self._body.release()


class Controller:
    """Common base of velocity and position controller.

    Attributes:
        pids: of the left and right wheel.
        targets: of the left and right wheel (m/s or ticks).
        tuning: whether it tunes itself.
    """

    def __init__(
        self, motors: MotorDriver, default: Gains, stored: List[float], limit_us: float, timeout_ms: int
    ) -> None:
        """Begin without a command; stored are the six gains of the flash, limit_us holds for each output."""
        self._motors = motors
        self._stored = stored
        self._timeout_ms = timeout_ms
        # A proportional gain that is not above zero is one of an erased flash.
        self.pids = [
            MotorPid(Gains(*gains) if gains[0] > 0.0 else default, limit_us) for gains in (stored[:3], stored[3:])
        ]
        self.targets = [0.0, 0.0]
        self.tuning = False
        self._tuning_end_ms = 0
        self._watchdog_ms = 0
        self._ran_ms = 0

    def find_due(self, now_ms: int) -> int:
        """Return when the controller runs next, NEVER_MS if its watchdog forbids that."""
        due_ms = max(self._ran_ms + CONTROL_MS, now_ms)
        return due_ms if due_ms - self._watchdog_ms < self._timeout_ms else NEVER_MS

    def set_gains(self, gains: Sequence[float]) -> None:
        """Set lkp lki lkd rkp rki rkd, in the flash too."""
        self._stored[:] = gains
        for pid, three in zip(self.pids, (gains[:3], gains[3:])):
            pid.set_gains(Gains(*three))

    def is_too_early(self, now_ms: int) -> bool:
        """Return whether a command at now_ms is dropped."""
        return now_ms - self._watchdog_ms < COMMAND_GAP_MS

    def command(self, now_ms: int, targets: Sequence[float]) -> None:
        """Set targets for the wheels; a wheel that has to reverse restarts its PID."""
        for pid, target, last in zip(self.pids, targets, self.targets):
            if target * last < 0.0:
                pid.reset()
        self.targets = list(targets)
        self._watchdog_ms = now_ms
        self.tuning = False

    def stop(self) -> None:
        """Idle from now on; the next command is accepted at once, and the caller stops the motors."""
        for pid in self.pids:
            pid.reset()
        self._watchdog_ms = 0
        self.tuning = False

    def start_tuning(self, now_ms: int, for_ms: int) -> None:
        """Tune for for_ms; the last targets stay."""
        self.tuning = True
        self._watchdog_ms = now_ms
        self._tuning_end_ms = now_ms + for_ms

    def continue_tuning(self, now_ms: int) -> bool:
        """Reset the watchdog; return whether this was the last run of the tuning."""
        self._watchdog_ms = now_ms
        self.tuning = now_ms < self._tuning_end_ms
        return not self.tuning

    def is_due(self, now_ms: int) -> bool:
        """Return whether the controller runs at now_ms, which counts as a run."""
        if self.find_due(now_ms) > now_ms:
            return False
        self._ran_ms = now_ms
        return True

    def run_pids(self, now_ms: int, measured: Sequence[float]) -> None:
        """Write the PIDs' outputs for the measured wheels."""
        for pid, target, value in zip(self.pids, self.targets, measured):
            pid.run(now_ms, target, value)
        self._motors.drive(now_ms, [pid.output_us for pid in self.pids])


class MotorControl:
    """The controllers and the motor driver of one robot.

    Attributes:
        motors: what writes the pulses.
        velocity, position: the controllers, for their gains.
        due_ms: when run() has something to do, NEVER_MS while nothing drives.
    """

    def __init__(
        self,
        name: str,
        body: Body,
        odometry: WheelOdometry,
        flash: Flash,
        pins: ServoPins,
        rng: np.random.RandomState,
        log: Callable[[str], None],
    ) -> None:
        """Begin as after power-on, with the flash's parameters; rng draws how long tuning lasts."""
        self._name = name
        self._body = body
        self._odometry = odometry
        self._rng = rng
        self._log = log
        self.motors = motors = MotorDriver(body, flash.motor_centers_us, pins)
        self.velocity = Controller(motors, VELOCITY_GAINS, flash.velocity_pid, VELOCITY_LIMIT_US, VELOCITY_WATCHDOG_MS)
        self.position = Controller(motors, POSITION_GAINS, flash.position_pid, POSITION_LIMIT_US, POSITION_WATCHDOG_MS)
        self._start_ticks = [0, 0]
        self._tuning_start_ticks = [0, 0]
        self._relay = [1, 1]
        self._reschedule(0)

    def _reschedule(self, now_ms: int) -> None:
        self.due_ms = min(self.motors.stop_at_ms, self.velocity.find_due(now_ms), self.position.find_due(now_ms))

    def receive_twist(self, controller: Controller, now_ms: int, linear_m_s: float, angular_rad_s: float) -> bool:
        """Receive a Twist for a controller; return whether it was a zero that was accepted.

        The position controller drives as far as that speed reaches in a second.
        """
        if controller.is_too_early(now_ms):
            return False
        targets = split_to_wheels(clamp(linear_m_s, MAX_LINEAR_M_S), clamp(angular_rad_s, MAX_ANGULAR_RAD_S))
        if controller is self.position:
            self._start_ticks = self._count_ticks(now_ms)
            targets = (targets[0] / self._odometry.tick_m, targets[1] / self._odometry.tick_m)
        stops = not any(targets)
        if stops:
            self._log(f"\x1b[93m[/{self._name}] Reseting PID...\x1b[0m")
            controller.stop()
            self.motors.stop()
        else:
            controller.command(now_ms, targets)
        self._reschedule(now_ms)
        return stops

    def receive_pulses(self, now_ms: int, left_us: int, right_us: int) -> None:
        """Receive a Motor command; a controller that is commanded too overwrites it."""
        self.motors.write(now_ms, left_us, right_us)
        self._reschedule(now_ms)

    def start_tuning(self, controller: Controller, now_ms: int) -> None:
        """Begin a controller's self-tuning, which ends by its own failure or by a Twist that is not dropped."""
        self._log(f"\x1b[94m[/{self._name}] Starting Motors Auto Tuning! Wait... \x1b[0m")
        is_position = controller is self.position
        limits_ms = POSITION_TUNING_MS if is_position else VELOCITY_TUNING_MS
        controller.start_tuning(now_ms, int(self._rng.randint(*limits_ms)))
        self._tuning_start_ticks = self._count_ticks(now_ms)
        self._relay = [1, 1]
        start_us = 0 if is_position else _VELOCITY_TUNING_START_US
        self.motors.drive(now_ms, (start_us, start_us))
        self._reschedule(now_ms)

    def run(self, now_ms: int) -> None:
        """Do what is due; the velocity controller reads the encoders, and so takes a reading away from the odometry."""
        if self.position.is_due(now_ms):
            if self.position.tuning:
                self._tune_position(now_ms, self._count_ticks_since(now_ms, self._tuning_start_ticks))
            else:
                self.position.run_pids(now_ms, self._count_ticks_since(now_ms, self._start_ticks))
        if self.velocity.is_due(now_ms):
            self._odometry.read_encoders(now_ms * 1000, *self._body.read_wheels(now_ms))
            if self.velocity.tuning:
                self._tune(self.velocity, now_ms, self._odometry.filtered_m_s, _VELOCITY_TUNING_US)
            else:
                self.velocity.run_pids(now_ms, self._odometry.filtered_m_s)
        if now_ms >= self.motors.stop_at_ms:
            self.motors.stop()
        self._reschedule(now_ms)

    def _tune_position(self, now_ms: int, moved_ticks: Sequence[int]) -> None:
        """Rock each wheel about its place."""
        for wheel, ticks in enumerate(moved_ticks):
            if self._relay[wheel] * ticks > _POSITION_TUNING_BAND_TICKS:
                self._relay[wheel] = -self._relay[wheel]
        self._tune(self.position, now_ms, moved_ticks, [_POSITION_TUNING_STEP_US * relay for relay in self._relay])

    def _tune(self, controller: Controller, now_ms: int, measured: Sequence[float], outputs_us: Sequence[int]) -> None:
        if controller.continue_tuning(now_ms):
            for side in ("Left", "Right"):
                self._log(f"\x1b[92m {side} Motor Tuning Failure! Using default values.\x1b[0m")
                self._log(f"\x1b[94m {side} Motor Best PID params (0.000000, 0.000000, 0.000000) \x1b[0m")
        self.motors.drive(now_ms, outputs_us)
        text = "[%f,%f], [%f,%f]->[%d,%d]" % (*controller.targets, *measured, *outputs_us)
        self._log(f"\x1b[93m[/{self._name}] Tunning Motor Set: {text}\x1b[0m")

    def _count_ticks(self, now_ms: int) -> List[int]:
        return self._odometry.count_ticks(*self._body.read_wheels(now_ms))

    def _count_ticks_since(self, now_ms: int, start_ticks: Sequence[int]) -> List[int]:
        return [now - start for now, start in zip(self._count_ticks(now_ms), start_ticks)]
