"""Many robots at once, advanced by call: the firmware's rules and the driver's corrections as arrays over robots.

Pure: no bytes, sockets, threads, ROS or clock. Same world and calls, same bytes. The robots share the phases of their
timers, which depend on the time alone, so that a world of a batch gives what it gives alone. Left out of the firmware:
boot, self-tuning, the IMU hat, faults, and the time for which a command or a servo pulse (of core 3) blocks its loop.
"""

import copy
from functools import partial
from typing import Callable, Collection, List, Optional, Sequence, Tuple

import numpy as np

from hero_driver.corrections import CLAMP_TOLERANCE_M, PLUS_WHEELS, WheelGeometry
from hero_node.robot_constants import (
    BODY_RADIUS_M,
    MAX_ANGULAR_RAD_S,
    MAX_LINEAR_M_S,
    MAX_RIM_RANGE_M,
    MIN_RIM_RANGE_M,
    SERVO_CENTER_US,
)

from ..link.wifi import Radio
from ..robot.clock import NEVER_MS
from ..robot.firmware import SPIN_MS
from ..robot.models import HERO, RobotModel
from ..robot.motor_control import CONTROL_MS
from ..robot.motor_pid import POSITION_GAINS, VELOCITY_GAINS
from ..robot.ranges import calibrate, convert_to_ranges
from ..robot.sensing import CYCLE_MS, DISTANCE_MS, LASER_GATE_MS, LASER_READ_MS
from ..robot_constants import (
    LED_WATCHDOG_MS,
    POSITION_LIMIT_US,
    POSITION_WATCHDOG_MS,
    VELOCITY_LIMIT_US,
    VELOCITY_WATCHDOG_MS,
)
from ..world.kinematics import split_to_wheels
from ..world.world import STEP_MS, View, World
from .rules.command_shaper import CommandShaper, Rows, Values
from .rules.radio_rows import RadioRows
from .rules.readings import DISTANCE, SCAN, WHEELS, Readings
from .rules.robot_mask import simplify
from .rules.servo_pulses import ServoPulses
from .rules.tick_odometry import TickOdometryRows
from .rules.wheel_controllers import WheelControllers
from .rules.wheel_encoders import WheelEncoders

_LIMITS = np.array([[MAX_LINEAR_M_S], [MAX_ANGULAR_RAD_S]])

Hook = Callable[[np.ndarray], None]
"""Called with the rows (K,) of the robots whose data the program has just received."""


class RobotRows:
    """The robots of one or more worlds, one row each, calibrated, connected and at rest.

    A program on arrays sends with index arrays, advances, and reads the arrays; those below are updated in place:

        robots.send_velocity(np.arange(1000), linear_m_s, angular_rad_s)  # (1000,) each
        robots.advance(robots.now_ms + 100)
        robots.odometry[:, :2], robots.proximity_m.min(axis=1)

    Rows are numbers or index arrays, world after world: in a batch of worlds with N robots each, robot k of world e has
    row e * N + k. Commands pass the driver's shaping and reach the firmware with its next read, 51 ms apart; the other
    calls (light, odometry, gains, calibrations) work at once.

    Attributes:
        now_ms: how far everything has been advanced.
        world: ground truth.
        models: of each robot.
        ticks: of both wheels since the odometry was last set (R, 2), whole numbers, read every 34 ms.
        odometry_ms: when the program received these (R,).
        scan_ms: when the program received these (R,), every 205 ms.
        distance_rows: of those that have a distance sensor.
        distance_ms: when the program received the distance (R,), every 50 ms.
        commands: the velocity that was sent last, linear m/s and angular rad/s (R, 2).
        on_cycle, on_scan, on_distance: called when the program has received odometry and ticks, ranges, distances.
    """

    def __init__(self, world: World, radios: Sequence[Radio] = (), models: Sequence[RobotModel] = ()) -> None:
        """Take the robots of world, which are at rest, from the world's time on; first readings are there at once.

        radios: the Wi-Fi of each robot; without, readings and commands arrive at once. models: of each robot, whose
        bodies are in the world already; without, all are stock robots.
        """
        rows = len(world.poses)
        self.models = models = models or [HERO] * rows
        self.world = world
        self.now_ms = now_ms = world.time_ms
        self._radios = RadioRows(radios)
        self._is_ideal = not radios
        self._measured = Readings(rows)
        self._received = received = self._measured if self._is_ideal else Readings(rows)
        self.on_cycle: List[Hook] = []
        self.on_scan: List[Hook] = []
        self.on_distance: List[Hook] = []
        self._rows = np.arange(rows)
        self._lights = np.zeros((rows, 4), dtype=np.float32)
        self._light_end_ms = np.zeros(rows, dtype=np.int64)
        errors = world.errors
        self._calibration_counts_m2 = calibrate(errors.alpha_counts_m2, errors.beta_counts)
        self._encoders = WheelEncoders(world, np.array([model.tick_m for model in models]))
        self._odometry = TickOdometryRows([PLUS_WHEELS if model.is_plus else WheelGeometry() for model in models])
        self.ticks, self.odometry_ms = received.ticks, received.odometry_ms
        self.scan_ms, self.distance_ms = received.scan_ms, received.distance_ms
        self._view: Optional[View] = None  # of the newest scan, until it is read
        self.distance_rows = np.array([model.is_plus for model in models]).nonzero()[0]
        self._distance_view: Optional[View] = None
        self._distance_due_ms = now_ms if len(self.distance_rows) else NEVER_MS
        self._servos = ServoPulses(world, np.rint(errors.servo_center_us.T))
        self._velocity = WheelControllers(rows, VELOCITY_GAINS, VELOCITY_LIMIT_US, VELOCITY_WATCHDOG_MS)
        self._position = WheelControllers(rows, POSITION_GAINS, POSITION_LIMIT_US, POSITION_WATCHDOG_MS)
        self._start_ticks = np.zeros((2, rows))
        self.commands = np.zeros((rows, 2))
        self._velocity_commands = CommandShaper(rows, 0.0)
        self._position_commands = CommandShaper(rows, 0.0)
        self._pulse_commands = CommandShaper(rows, SERVO_CENTER_US)
        self._topics: Tuple[Tuple[CommandShaper, Callable[..., None]], ...] = (
            (self._velocity_commands, partial(self._receive_twists, self._velocity)),
            (self._position_commands, partial(self._receive_twists, self._position)),
            (self._pulse_commands, self._receive_pulses),
        )
        self._cycle_ms = now_ms
        self._scanned_ms = now_ms - LASER_GATE_MS - 1
        self._measure(now_ms)
        received.receive(self._measured, self._rows, now_ms, (WHEELS, SCAN))
        # The first read is that of a robot that was configured a millisecond before its first cycle; a controller that
        # is commanded in it runs a millisecond later.
        self._read_ms = now_ms + SPIN_MS - 1
        self._control_ms = now_ms + SPIN_MS - 2 * CONTROL_MS

    # -- commands --------------------------------------------------------------------------------------------

    def send_velocity(self, rows: Rows, linear_m_s: Values, angular_rad_s: Values) -> None:
        """Send velocities to the velocity controller, as a program does through the driver.

        One value for all rows, or one for each. Raises: ValueError for one that is not finite.
        """
        self._velocity_commands.offer(self.now_ms, rows, linear_m_s, angular_rad_s)
        self.commands[rows, 0], self.commands[rows, 1] = linear_m_s, angular_rad_s

    def send_position(self, rows: Rows, linear_m_s: Values, angular_rad_s: Values) -> None:
        """Send velocities to the position controller, which drives as far as they reach in a second."""
        self._position_commands.offer(self.now_ms, rows, linear_m_s, angular_rad_s)

    def send_pulses(self, rows: Rows, left_us: Values, right_us: Values) -> None:
        """Send servo pulses (whole microseconds), which the motors keep for one second."""
        self._pulse_commands.offer(self.now_ms, rows, left_us, right_us)

    def send_light(self, rows: Rows, rgba: Values) -> None:
        """Show a color (4,), or one for each row (K, 4), red green blue alpha from 0 to 1, for 15 s."""
        self._lights[rows] = rgba
        self._light_end_ms[rows] = self.now_ms + LED_WATCHDOG_MS

    @property
    def lights(self) -> np.ndarray:
        """The visible lights (R, 4), red green blue alpha; dark 15 s after the last command."""
        return self._lights * (self.now_ms <= self._light_end_ms)[:, None]

    def set_odometry(self, row: int, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Set the odometry of one robot, which also zeroes its tick counters."""
        self._encoders.zero(row)
        self._odometry.set_pose(row, x_m, y_m, yaw_rad)
        self._radios.drop_readings(row)
        self._received.odometry[row] = self._odometry.poses[:, row]
        self._received.velocities[row] = self._received.ticks[row] = 0.0

    def set_velocity_gains(self, row: int, gains: Sequence[float]) -> None:
        """Set lkp lki lkd rkp rki rkd of one robot; a wheel's three with a negative one are ignored."""
        self._velocity.set_gains(row, gains)

    def set_motor_centers(self, row: int, centers_us: Sequence[int]) -> None:
        """Set the pulses at which the left and right wheel of one robot should rest, from the next command on."""
        self._servos.centers_us[:, row] = centers_us

    def set_infrared_calibration(self, row: int, constants_counts_m2: Sequence[float]) -> None:
        """Set the constants of the eight sensors of one robot, rear first; nan means not calibrated."""
        self._read_scan()
        self._calibration_counts_m2[row] = constants_counts_m2

    @property
    def odometry(self) -> np.ndarray:
        """x m, y m, yaw rad in hero_N/odom (R, 3), as the driver computes it from ticks. Read again after advance()."""
        return self._odometry.poses.T if self._is_ideal else self._received.odometry

    @property
    def velocities(self) -> np.ndarray:
        """Linear m/s and angular rad/s in hero_N/base_link (R, 2), as the driver computes them from the ticks."""
        return self._odometry.measure_velocities().T if self._is_ideal else self._received.velocities

    @property
    def proximity_m(self) -> np.ndarray:
        """Ranges from the robot's center (R, 8), front first, counter-clockwise.

        inf nothing in range, 0 too close, nan not calibrated. Read again after advance().
        """
        return self._read_scan().proximity_m

    @property
    def distance_m(self) -> np.ndarray:
        """The distance ahead of the robot's center by HeRo+'s sensor (R,), nan without. Read again after advance()."""
        return self._read_distance().distance_m

    @property
    def ranges_m(self) -> np.ndarray:
        """Ranges of the eight sensors (R, 8) as in /laser, rear first."""
        return self._read_scan().ranges_m

    @property
    def counts(self) -> np.ndarray:
        """Readings of the eight sensors (R, 8), rear first."""
        return self._read_scan().counts

    # -- time passes -----------------------------------------------------------------------------------------

    def advance(self, until_ms: int) -> None:
        """Move everything on to until_ms, which may not lie in the past."""
        if until_ms < self.now_ms:
            raise ValueError("it is %d ms already, later than %d ms" % (self.now_ms, until_ms))
        world, servos, radios = self.world, self._servos, self._radios
        while True:
            now_ms = min(
                self._cycle_ms, self._distance_due_ms, self._control_ms, self._read_ms, servos.check_ms, radios.due_ms
            )
            world.step((min(now_ms, until_ms + 1) - world.time_ms - 1) // STEP_MS)
            if now_ms > until_ms:
                break
            self.now_ms = now_ms
            if now_ms >= radios.due_ms:
                self._receive_readings(now_ms)
            if now_ms >= self._cycle_ms:
                self._run_cycle(now_ms)
                # Sending a cycle takes about a millisecond; controllers that are due wait for it.
                self._control_ms = max(self._control_ms, now_ms + 1)
            if now_ms >= self._distance_due_ms:
                self._measure_distance(now_ms)
            if now_ms >= self._control_ms:
                self._run_controllers(now_ms)
            if now_ms >= servos.check_ms:
                servos.check_watchdog(now_ms)
            if now_ms >= self._read_ms:
                self._read_commands(now_ms)
            if now_ms == world.time_ms + STEP_MS:
                world.step()
        self.now_ms = until_ms

    def _run_cycle(self, now_ms: int) -> None:
        """Send the robots' readings."""
        has_scan = self._measure(now_ms)
        parts = (WHEELS, SCAN) if has_scan else (WHEELS,)
        if not self._is_ideal:
            self._measured.odometry = self._odometry.poses.T
            self._measured.velocities = self._odometry.measure_velocities().T
        self._send(now_ms, self._rows, parts)

    def _send(self, now_ms: int, rows: np.ndarray, parts: Collection[str]) -> None:
        if self._is_ideal:
            self._call_hooks(rows, parts)
        else:
            self._radios.send_readings(now_ms, copy.deepcopy(self._measured), rows, parts)

    def _measure_distance(self, now_ms: int) -> None:
        self._distance_due_ms = now_ms + DISTANCE_MS
        self._distance_view = self.world.observe()
        self._measured.distance_ms[self.distance_rows] = now_ms
        if not self._is_ideal:
            self._read_distance()
        self._send(now_ms, self.distance_rows, (DISTANCE,))

    def _read_distance(self) -> Readings:
        if self._distance_view is not None:
            rows, view = self.distance_rows, self._distance_view
            self._measured.distance_m[rows] = self.world.read_distances(rows, view)
            self._distance_view = None
        return self._received

    def _measure(self, now_ms: int) -> bool:
        """Read the encoders, and the infrared sensors if their gate is open; return whether it was."""
        measured = self._measured
        has_scan = now_ms - self._scanned_ms > LASER_GATE_MS
        if has_scan:
            self._scanned_ms = now_ms
            self._view = self.world.observe()
            measured.scan_ms[:] = now_ms
            if not self._is_ideal:
                self._read_scan()
        self._encoders.read(now_ms, True)
        measured.ticks[:] = self._encoders.ticks.T
        measured.odometry_ms[:] = now_ms
        self._odometry.integrate(self._encoders.ticks, now_ms)
        self._cycle_ms = now_ms + CYCLE_MS
        if self._cycle_ms - self._scanned_ms > LASER_GATE_MS:
            self._cycle_ms += LASER_READ_MS
        return has_scan

    def _read_scan(self) -> Readings:
        """Compute the newest scan, which takes long, when it is read; return what was received."""
        if self._view is not None:
            measured = self._measured
            measured.counts[:] = self.world.read_infrared(self._rows, self._view)
            # Messages hold single precision.
            measured.ranges_m[:] = convert_to_ranges(measured.counts, self._calibration_counts_m2).astype(np.float32)
            measured.proximity_m[:] = correct_ranges(measured.ranges_m)
            self._view = None
        return self._received

    def _receive_readings(self, now_ms: int) -> None:
        for readings, row, parts in self._radios.receive_readings(now_ms):
            rows = np.array([row])
            self._received.receive(readings, rows, now_ms, parts)
            self._call_hooks(rows, parts)

    def _call_hooks(self, rows: np.ndarray, parts: Collection[str]) -> None:
        for part, hooks in ((WHEELS, self.on_cycle), (SCAN, self.on_scan), (DISTANCE, self.on_distance)):
            for hook in hooks if part in parts else ():
                hook(rows)

    def _run_controllers(self, now_ms: int) -> None:
        self._control_ms = now_ms + CONTROL_MS
        if now_ms < self._position.end_ms:
            active = self._position.find_active(now_ms)
            self._position.run(now_ms, self._encoders.count(now_ms) - self._start_ticks, active)
            self._servos.drive(now_ms, self._position.outputs_us, active)
        if now_ms < self._velocity.end_ms:
            active = self._velocity.find_active(now_ms)
            self._encoders.read(now_ms, active)
            self._velocity.run(now_ms, self._encoders.filtered_m_s, active)
            self._servos.drive(now_ms, self._velocity.outputs_us, active)

    def _read_commands(self, now_ms: int) -> None:
        self._read_ms = now_ms + SPIN_MS
        for topic, (shaper, receive) in enumerate(self._topics):
            sent = shaper.take(now_ms)
            if self._is_ideal:
                if len(sent.rows):
                    receive(now_ms, sent.rows, sent.values)
                continue
            shaper.delay_until(sent.rows, self._radios.send_commands(topic, sent))
            for rows, values in self._radios.receive_commands(topic, now_ms):
                receive(now_ms, rows, values)

    # -- what the firmware does with a command ---------------------------------------------------------------

    def _receive_twists(self, controller: WheelControllers, now_ms: int, rows: np.ndarray, values: np.ndarray) -> None:
        accepted = controller.find_accepted(now_ms, rows)
        rows, twists = rows[accepted], np.maximum(np.minimum(values[:, accepted], _LIMITS), -_LIMITS)
        targets = np.array(split_to_wheels(*twists))
        if controller is self._position:
            self._start_ticks[:, rows] = self._encoders.count(now_ms)[:, rows]
            targets /= self._encoders.tick_m[rows]
        stopped = controller.command(now_ms, rows, targets)
        if len(stopped):
            self._servos.stop(stopped)

    def _receive_pulses(self, now_ms: int, rows: np.ndarray, values: np.ndarray) -> None:
        pulses_us, which = np.zeros((2, len(self._rows))), np.zeros(len(self._rows), dtype=bool)
        pulses_us[:, rows], which[rows] = values, True
        self._servos.write(now_ms, pulses_us, simplify(which))


def correct_ranges(ranges_m: np.ndarray) -> np.ndarray:
    """Return ranges of /laser (R, 8) as programs see them, by the driver's make_proximity(), front first.

    inf for nothing in range, 0 for too close; NaN for a sensor that is not calibrated stays.
    """
    corrected_m = np.roll(ranges_m, -4, axis=1)
    with np.errstate(invalid="ignore"):  # comparisons with NaN
        near = corrected_m <= BODY_RADIUS_M + MIN_RIM_RANGE_M + CLAMP_TOLERANCE_M
        far = corrected_m >= BODY_RADIUS_M + MAX_RIM_RANGE_M - CLAMP_TOLERANCE_M
    corrected_m[near] = 0.0
    corrected_m[far] = np.inf
    return corrected_m
