"""Commands of one robot -> what its motors are told, with the firmware's gates, limits and three watchdogs.

Pure: time enters in the robot's own milliseconds. Source: VelocityControl.ino, PositionControl.ino and
MotorDriver.ino, as measured on the stock robot.
"""

from typing import List, Optional, Tuple

from .kinematics import MAX_LINEAR_M_S, MAX_TURN_RAD_S, Pose, compose, invert, split_to_wheels
from .world import MAX_WHEEL_M_S, POSITION_PID_LAG_S, VELOCITY_PID_LAG_S, World

COMMAND_GAP_MS = 50
"""A Twist that comes earlier after the last accepted one is dropped, a stop too (VelocityControl.ino:159)."""

CONTROL_MS = 21
"""Between two runs of the velocity PID, 47.6 Hz (VelocityControl.ino:112)."""

VELOCITY = "velocity"
POSITION = "position"
MOTOR = "motor"
TUNING = "tuning"

HOLD_MS = {VELOCITY: 1000, POSITION: 3000}
"""So long after a command its PID runs (VelocityControl.ino:110, PositionControl.ino:105)."""

MOTOR_HOLD_MS = 1000
"""So long after the last write the motors keep their pulse (MotorDriver.ino:111)."""

HALT_US = 1500
PULSE_RANGE_US = (1000, 2000)
"""Servo pulses."""

FULL_PULSE_US = 200.0
DEAD_ZONE_US = 8.0
"""Pulse beyond the centre at which a servo runs at full speed, and below which it stands (assumptions, after
continuous-rotation servos of this size)."""
LAG_S = {VELOCITY: VELOCITY_PID_LAG_S, POSITION: POSITION_PID_LAG_S}
"""How fast each PID leads the servos to its target."""

_TUNING_TURN_M_S = 0.08


class Body:
    """The hardware of one robot, as its firmware sees it: a row of the world.

    Attributes:
        odom_origin: where the robot's odom frame truly lies in the world, since its pose was last set. A
        restart
            changes nothing: the driver goes on where it was.
    """

    def __init__(self, world: World, index: int) -> None:
        """Be the robot at index of world."""
        self.world = world
        self.index = index
        self.odom_origin = self.true_pose

    @property
    def true_pose(self) -> Pose:
        """Where the robot is in the world."""
        x_m, y_m, theta_rad = self.world.poses[self.index].tolist()
        return (x_m, y_m, theta_rad)

    def carry(self, before: Pose) -> None:
        """Be told that somebody carried the robot here from before: its odom frame came with it."""
        self.odom_origin = compose(self.true_pose, compose(invert(before), self.odom_origin))

    def read_wheels(self, time_ms: int) -> List[float]:
        """Return the travel (m) of the left and right wheel at time_ms of the world."""
        return self.world.read_wheels(self.index, time_ms)

    def chase(self, wheels_m_s: Tuple[float, float], lag_s: float) -> None:
        """Let a PID with this lag lead the wheels to these speeds."""
        self.world.targets_m_s[self.index] = wheels_m_s
        self.world.pid_lag_s[self.index] = lag_s

    def resume(self, lag_s: float) -> None:
        """Let the PID run on towards the last target."""
        self.world.pid_lag_s[self.index] = lag_s

    def hold(self) -> None:
        """Keep the servos' last pulses: no PID runs any more."""
        self.world.pid_lag_s[self.index] = 0.0

    def push(self, wheels_m_s: Tuple[float, float]) -> None:
        """Give the servos pulses that stand for these speeds, without a PID."""
        self.world.pid_lag_s[self.index] = 0.0
        self.world.commands_m_s[self.index] = wheels_m_s

    def halt(self) -> None:
        """Take the pulses away."""
        self.push((0.0, 0.0))
        self.world.targets_m_s[self.index] = 0.0


class MotorControl:
    """The controllers and the motor driver of one robot.

    Attributes:
        mode: who commands the motors, None for nobody.
        due_ms: when run() has something to do (robot's time), None while nobody commands.
        centres_us: middle of each servo's dead zone.
        dropped: commands that came too early.
    """

    def __init__(self, body: Body) -> None:
        """Begin halted."""
        self.mode: Optional[str] = None
        self.due_ms: Optional[int] = None
        self.centres_us: Tuple[float, float] = (float(HALT_US), float(HALT_US))
        self.dropped = 0
        self._body = body
        self._velocity_at_ms = -COMMAND_GAP_MS
        self._position_at_ms = -COMMAND_GAP_MS
        self._pid_until_ms = 0
        self._off_at_ms = 0

    def receive_velocity(self, now_ms: int, linear_m_s: float, turn_rad_s: float) -> bool:
        """Take a Twist for the velocity controller; return whether it was a stop that was taken."""
        if now_ms - self._velocity_at_ms < COMMAND_GAP_MS:
            self.dropped += 1
            return False
        self._velocity_at_ms = now_ms
        return self._take_twist(VELOCITY, now_ms, linear_m_s, turn_rad_s)

    def receive_position(self, now_ms: int, linear_m_s: float, turn_rad_s: float) -> bool:
        """Take a Twist for the position controller; return whether it was a stop that was taken."""
        if now_ms - self._position_at_ms < COMMAND_GAP_MS:
            self.dropped += 1
            return False
        self._position_at_ms = now_ms
        return self._take_twist(POSITION, now_ms, linear_m_s, turn_rad_s)

    def _take_twist(self, mode: str, now_ms: int, linear_m_s: float, turn_rad_s: float) -> bool:
        # A comparison with NaN is false, so NaN passes constrain() and ends in both terms below as in C.
        linear_m_s = min(max(linear_m_s, -MAX_LINEAR_M_S), MAX_LINEAR_M_S)
        turn_rad_s = min(max(turn_rad_s, -MAX_TURN_RAD_S), MAX_TURN_RAD_S)
        if linear_m_s == 0.0 and turn_rad_s == 0.0:
            self.halt()
            return True
        if self.mode != mode:
            self.due_ms = now_ms + CONTROL_MS
        self.mode = mode
        self._pid_until_ms = now_ms + HOLD_MS[mode]
        self._off_at_ms = self._pid_until_ms + MOTOR_HOLD_MS
        self._body.chase(split_to_wheels(linear_m_s, turn_rad_s), LAG_S[mode])
        self.due_ms = min(self.due_ms or now_ms + CONTROL_MS, now_ms + CONTROL_MS)
        return False

    def receive_pulses(self, now_ms: int, left_us: int, right_us: int) -> None:
        """Take a Motor command: servo pulses, limited to 1000..2000 us; more than the centre is forward."""
        self.mode = MOTOR
        self._off_at_ms = now_ms + MOTOR_HOLD_MS
        self.due_ms = self._off_at_ms + 1
        left_m_s, right_m_s = (
            _convert_pulse(pulse_us, centre_us)
            for pulse_us, centre_us in zip((left_us, right_us), self.centres_us)
        )
        self._body.push((left_m_s, right_m_s))

    def start_tuning(self, now_ms: int) -> None:
        """Begin the PID's self-tuning: the robot turns on the spot until a Twist comes."""
        self.mode = TUNING
        self.due_ms = now_ms + CONTROL_MS
        self._body.push((-_TUNING_TURN_M_S, _TUNING_TURN_M_S))

    def run(self, now_ms: int) -> bool:
        """Do what is due; return whether the velocity controller read the encoders."""
        if self.mode in (VELOCITY, POSITION):
            if now_ms <= self._pid_until_ms:
                self.due_ms = now_ms + CONTROL_MS
                self._body.resume(LAG_S[self.mode])
                return self.mode == VELOCITY
            if now_ms <= self._off_at_ms:
                self._body.hold()
                self.due_ms = self._off_at_ms + 1
                return False
        if self.mode == TUNING:
            self.due_ms = now_ms + CONTROL_MS
            return True
        self.halt()
        return False

    def halt(self) -> None:
        """Switch the motors off."""
        self.mode = None
        self.due_ms = None
        self._body.halt()

    def freeze(self) -> None:
        """Stand for a loop() that no longer calls the controllers: pulses stay, and so no watchdog works."""
        self._body.hold()


def _convert_pulse(pulse_us: int, centre_us: float) -> float:
    """Return the wheel speed (m/s) that a servo pulse stands for."""
    pulse_us = min(max(pulse_us, PULSE_RANGE_US[0]), PULSE_RANGE_US[1])
    beyond_us = pulse_us - centre_us
    if abs(beyond_us) <= DEAD_ZONE_US:
        return 0.0
    return min(max(beyond_us / FULL_PULSE_US, -1.0), 1.0) * MAX_WHEEL_M_S
