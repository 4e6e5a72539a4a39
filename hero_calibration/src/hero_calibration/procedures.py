"""All robots at once through a procedure: each step is given to all of them, and each one's data is judged alone.

A robot that fails is stopped, keeps its reason, and takes no further part; the others go on. Time is that of ROS, so
that simulated time works too.
"""

import math
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Callable, Dict, List, Optional, Sequence, Tuple

import numpy as np
import rospy

from hero_client.geometry import Pose
from hero_client.program import Program
from hero_msgs.srv import SetIRCalibration, SetMotor, SetPID

from . import dead_zone, infrared, speed_response
from .errors import CalibrationError
from .probe import Probe

LEFT, RIGHT = 0, 1
POLL_S = 0.02

REST_S = 0.6
COMMAND_PERIOD_S = 0.1
STOP_GAP_S = 0.15
"""Between two stops: the robot drops a command that comes within 50 ms."""

TURN_S = 2.5
"""For 45 degrees; the position controller ends 3 s after its command."""

TURN_REACHED_RAD = math.radians(1.5)
TURN_TOLERANCE_RAD = math.radians(10.0)
SCAN_TIMEOUT_S = 15.0

CLIMBS = 3
TURN_TRIES = 3
TEST_TRIES = 6
"""A staircase takes 40 s, a test of velocity 4 s."""

Report = Callable[[str], None]


class EndedError(Exception):
    """The program was told to end in the middle of a procedure."""


class MotorResult:
    """Staircase of one robot: pulses us, speeds m/s of both wheels (NaN: not heard), dead zones."""

    def __init__(
        self, pulses_us: Sequence[int], speeds_m_s: np.ndarray, zones: Sequence[dead_zone.DeadZone]
    ) -> None:
        self.pulses_us = list(pulses_us)
        self.speeds_m_s = speeds_m_s
        self.zones = list(zones)

    @property
    def centres_us(self) -> List[int]:
        """What the robot is given."""
        return [int(round(zone.centre_us)) for zone in self.zones]


class VelocityResult:
    """Gains of one robot, and how its wheels followed before and after."""

    def __init__(
        self,
        before: Sequence[speed_response.Response],
        after: Sequence[speed_response.Response],
        gains: Sequence[speed_response.Gains],
    ) -> None:
        self.before = list(before)
        self.after = list(after)
        self.gains = [*gains[LEFT], *gains[RIGHT]]

    @staticmethod
    def mean_error(responses: Sequence[speed_response.Response]) -> float:
        """Return the mean error of both wheels."""
        return float(np.mean([response.mean_error for response in responses]))


class InfraredResult:
    """Constants of one robot's sensors, and how far off its ranges were before and after (m)."""

    def __init__(self, counts_m2: Sequence[float], before_m: np.ndarray, after_m: np.ndarray) -> None:
        self.counts_m2 = list(counts_m2)
        self.before_m = before_m
        self.after_m = after_m


class Session:
    """The robots under calibration and the clock."""

    def __init__(self, program: Program, probes: Sequence[Probe], report: Report) -> None:
        """Work with probes until program ends; report takes lines for people."""
        self._program = program
        self.probes = list(probes)
        self._report = report

    @property
    def active(self) -> List[Probe]:
        """Robots that have not failed."""
        return [probe for probe in self.probes if probe.failure is None]

    def pause(self, duration_s: float) -> None:
        """Wait for so long in ROS time. Raises: EndedError if the program is to end."""
        end_s = rospy.get_time() + duration_s
        while True:
            left_s = end_s - rospy.get_time()
            if left_s <= 0.0:
                return
            if not self._program.sleep(min(left_s, POLL_S)):
                raise EndedError

    def each(
        self, step: str, work: Callable[[Probe], None], probes: Optional[Sequence[Probe]] = None
    ) -> None:
        """Do work for robots, side by side; a CalibrationError fails that robot alone. None: for all active ones."""
        probes = self.active if probes is None else probes
        if not probes:
            return

        def work_on(probe: Probe) -> None:
            try:
                work(probe)
            except CalibrationError as error:
                probe.failure = "%s: %s" % (step, error)

        with ThreadPoolExecutor(min(32, len(probes))) as pool:
            list(pool.map(work_on, probes))
        for probe in probes:
            if probe.failure is not None:
                probe.drive(0.0)
                self._report("%s failed: %s" % (probe.name, probe.failure))

    def repeat(
        self,
        step: str,
        tries: int,
        move: Callable[[Sequence[Probe]], None],
        judge: Callable[[Probe, bool], None],
    ) -> None:
        """Let robots move and judge what was seen; who cannot be judged has other tries, then fails.

        Wi-Fi stands still for a second now and then, and takes readings and commands with it. judge is told whether
        this try is the last.
        """
        waiting = self.active
        for attempt in range(tries):
            again: List[Probe] = []
            is_last = attempt + 1 == tries

            def try_judging(probe: Probe, is_last: bool = is_last, again: List[Probe] = again) -> None:
                try:
                    judge(probe, is_last)
                except CalibrationError as error:
                    if is_last or probe.find_silence():
                        raise
                    self._report("%s once more: %s: %s" % (probe.name, step, error))
                    again.append(probe)

            move(waiting)
            self.each(step, try_judging, waiting)
            waiting = again
            if not waiting:
                return

    def stop(self) -> None:
        """Stop all robots, also those that failed; works also while the program ends."""
        for _ in range(2):
            for probe in self.probes:
                probe.drive(0.0)
            time.sleep(STOP_GAP_S)

    def rest(self) -> None:
        """Stop all robots and wait until they stand."""
        for _ in range(2):
            for probe in self.active:
                probe.drive(0.0)
            self.pause(REST_S / 2.0)

    # -- motors --------------------------------------------------------------------------------------------

    def calibrate_motors(self) -> Dict[int, MotorResult]:
        """Find the dead zones of all servos and write their centres; return what was found, by robot."""
        pulses_us = dead_zone.list_pulses()
        begins_s: List[float] = []
        results: Dict[int, MotorResult] = {}

        def climb(probes: Sequence[Probe]) -> None:
            begins_s.clear()
            for pulse_us in pulses_us:
                for probe in probes:
                    probe.push(pulse_us)
                begins_s.append(rospy.get_time())
                self.pause(dead_zone.PULSE_S)
            self.rest()

        def judge(probe: Probe, _is_last: bool) -> None:
            speeds = dead_zone.measure_stairs(probe.read_wheels(), begins_s)
            zones = []
            for wheel, name in ((LEFT, "left"), (RIGHT, "right")):
                try:
                    zones.append(dead_zone.find_dead_zone(pulses_us, speeds[wheel]))
                except CalibrationError as error:
                    raise CalibrationError("the %s wheel %s" % (name, error)) from error
            result = MotorResult(pulses_us, speeds, zones)
            probe.call("motors_parameters", SetMotor, *result.centres_us)
            results[probe.robot_id] = result

        self.repeat("motors", CLIMBS, climb, judge)
        return results

    # -- velocity ------------------------------------------------------------------------------------------

    def calibrate_velocity(self, motors: Dict[int, MotorResult]) -> Dict[int, VelocityResult]:
        """Find gains for all wheels and write them; return what was found, by robot."""
        searches: Dict[int, Tuple[speed_response.GainSearch, ...]] = {}
        for probe in self.active:
            found = motors.get(probe.robot_id)
            gains = (
                [zone.gain_m_s_us for zone in found.zones]
                if found
                else [speed_response.NOMINAL_GAIN_M_S_US] * 2
            )
            searches[probe.robot_id] = tuple(speed_response.GainSearch(gain) for gain in gains)
        before = self._test_velocity()
        rounds = speed_response.GainSearch.count_rounds()
        for number in range(rounds):
            self._report("velocity: gains %d of %d" % (number + 1, rounds))
            self.each(
                "velocity", lambda probe: set_gains(probe, [s.next_gains() for s in searches[probe.robot_id]])
            )
            for robot_id, responses in self._test_velocity().items():
                for search, response in zip(searches[robot_id], responses):
                    search.receive(response)
        self.each("velocity", lambda probe: set_gains(probe, [s.best()[0] for s in searches[probe.robot_id]]))
        after = self._test_velocity()
        return {
            robot_id: VelocityResult(
                before[robot_id], after[robot_id], [s.best()[0] for s in searches[robot_id]]
            )
            for robot_id in after
        }

    def _test_velocity(self) -> Dict[int, List[speed_response.Response]]:
        """Turn all robots to the left and to the right; return the responses of both wheels, by robot."""
        begins_s: List[float] = []
        responses: Dict[int, List[speed_response.Response]] = {}

        def turn(probes: Sequence[Probe]) -> None:
            begins_s.clear()
            for side in (1.0, -1.0):
                self.rest()
                begins_s.append(rospy.get_time())
                while rospy.get_time() < begins_s[-1] + speed_response.STEP_S:
                    for probe in probes:
                        probe.drive(side * speed_response.TURN_RAD_S)
                    self.pause(COMMAND_PERIOD_S)
            self.rest()

        def judge(probe: Probe, is_last: bool) -> None:
            readings = probe.read_wheels()
            starts = [speed_response.find_start(readings, begin_s, is_last) for begin_s in begins_s]
            ends_s = [begin_s + speed_response.STEP_S for begin_s in begins_s]
            # Turning to the left, the left wheel goes back and the right one ahead.
            responses[probe.robot_id] = [
                speed_response.judge(
                    [
                        speed_response.measure_speed(readings, ahead * ticks, start, end_s)
                        for start, end_s, ahead in zip(starts, ends_s, signs)
                    ]
                )
                for ticks, signs in (
                    (readings.left_ticks, (-1.0, 1.0)),
                    (readings.right_ticks, (1.0, -1.0)),
                )
            ]

        self.repeat("velocity", TEST_TRIES, turn, judge)
        return responses

    # -- infrared ------------------------------------------------------------------------------------------

    def calibrate_infrared(self, samples: int) -> Dict[int, InfraredResult]:
        """Measure all sensors of robots that face a wall, write their constants, and measure again.

        samples: scans for each sensor; for the second turn as infrared.count_check_samples() says.
        """
        starts: Dict[int, Pose] = {}
        directions: Dict[int, float] = {}
        counts_m2: Dict[int, List[float]] = {}
        first = self._go_round("infrared", samples, starts, directions)

        def write(probe: Probe) -> None:
            counts_m2[probe.robot_id] = infrared.compute_calibration(first[probe.robot_id])
            probe.call("ir_calibration", SetIRCalibration, *counts_m2[probe.robot_id])

        self.each("infrared", write)
        second = self._go_round("check of infrared", infrared.count_check_samples(samples), starts, directions)
        results = {}
        for probe in self.active:
            robot_id = probe.robot_id
            results[robot_id] = InfraredResult(
                counts_m2[robot_id],
                infrared.range_errors_m(first[robot_id]),
                infrared.range_errors_m(second[robot_id]),
            )
        return results

    def _go_round(
        self, title: str, samples: int, starts: Dict[int, Pose], directions: Dict[int, float]
    ) -> Dict[int, List[infrared.Facing]]:
        """Turn each sensor to the wall; starts and directions of the wall are those of the first look."""
        seen: Dict[int, List[infrared.Facing]] = {probe.robot_id: [] for probe in self.active}
        for step in range(infrared.BEAMS):
            sensor = (infrared.AHEAD - step) % infrared.BEAMS
            self._report(
                "%s: sensor that looks %s, %d of %d"
                % (title, infrared.name_beam(sensor), step + 1, infrared.BEAMS)
            )
            self._collect_scans(samples)
            angles_rad: Dict[int, float] = {}

            def look(probe: Probe, sensor: int = sensor, angles_rad: Dict[int, float] = angles_rad) -> None:
                counts, ranges_m = probe.read_scans()
                pose = probe.read_pose()
                start = starts.setdefault(probe.robot_id, pose)
                facing = infrared.Facing(sensor, counts.tolist(), ranges_m.tolist(), 0.0)
                turned_rad = infrared.estimate_turn_rad(facing)
                direction_rad = directions.setdefault(probe.robot_id, pose.yaw_rad - turned_rad)
                moved_m = (pose.x_m - start.x_m) * math.cos(direction_rad)
                moved_m += (pose.y_m - start.y_m) * math.sin(direction_rad)
                seen[probe.robot_id].append(facing._replace(moved_m=moved_m))
                angles_rad[probe.robot_id] = infrared.BEAM_STEP_RAD - turned_rad

            self.each(title, look)
            self._turn(title, angles_rad)
        return seen

    def _collect_scans(self, samples: int) -> None:
        """Wait until every active robot has sent so many scans, or no more come."""
        for probe in self.active:
            probe.forget_scans()
        end_s = rospy.get_time() + max(SCAN_TIMEOUT_S, samples / 2.0)
        while rospy.get_time() < end_s and any(probe.count_scans() < samples for probe in self.active):
            self.pause(POLL_S)

    def _turn(self, step: str, angles_rad: Dict[int, float]) -> None:
        """Turn every active robot to the left by its angle, on the spot; other tries for what is left of it."""
        wanted_rad: Dict[int, float] = {}

        def plan(probe: Probe) -> None:
            wanted_rad[probe.robot_id] = probe.read_pose().yaw_rad + angles_rad[probe.robot_id]

        self.each(step, plan)
        for tolerance_rad in (0.0, *[TURN_TOLERANCE_RAD / 2.0] * (TURN_TRIES - 1)):
            turning = [
                probe for probe in self.active if abs(self._left_rad(probe, wanted_rad)) > tolerance_rad
            ]
            if not turning:
                break
            for probe in turning:
                probe.turn(self._left_rad(probe, wanted_rad))
            end_s = rospy.get_time() + TURN_S
            self.pause(TURN_S / 4.0)
            while rospy.get_time() < end_s and any(
                abs(self._left_rad(probe, wanted_rad)) > TURN_REACHED_RAD for probe in turning
            ):
                self.pause(POLL_S)
            self.rest()

        def check(probe: Probe) -> None:
            left_rad = self._left_rad(probe, wanted_rad)
            probe.read_pose()
            if abs(left_rad) > TURN_TOLERANCE_RAD:
                raise CalibrationError(
                    "could not turn on the spot: %.0f degrees are missing; calibrate its motors, or free its wheels"
                    % abs(math.degrees(left_rad))
                )

        self.each(step, check)

    @staticmethod
    def _left_rad(probe: Probe, wanted_rad: Dict[int, float]) -> float:
        """Return how far a robot still has to turn; nothing for one that cannot be heard, which check() finds."""
        try:
            return math.remainder(wanted_rad[probe.robot_id] - probe.read_pose().yaw_rad, 2.0 * math.pi)
        except CalibrationError:
            return 0.0


def set_gains(probe: Probe, gains: Sequence[speed_response.Gains]) -> None:
    """Give a robot gains of the left and the right wheel. Raises: CalibrationError."""
    probe.call("velocity_controller/pid_parameters", SetPID, *gains[LEFT], *gains[RIGHT])


def find_obstacle(probe: Probe, beside_wall: bool) -> Optional[str]:
    """Return what stands too near to a robot, in words; None if nothing does.

    beside_wall: whether it should stand before a wall; else it needs room on all sides. Readings are raw, so that a
    robot whose sensors are not calibrated sees too.
    """
    try:
        counts, _ = probe.read_scans()
    except CalibrationError as error:
        return str(error)
    if beside_wall:
        ahead = counts[infrared.AHEAD]
        low, high = infrared.WALL_COUNTS
        if not low <= ahead <= high:
            return "its sensor ahead reads %.0f counts, and %.0f are usual for a white wall 10 cm away" % (
                ahead,
                infrared.NOMINAL_COUNTS_M2 / infrared.WALL_M**2,
            )
    looking_at_wall = {infrared.AHEAD - 1, infrared.AHEAD, infrared.AHEAD + 1} if beside_wall else set()
    for sensor in np.argsort(counts)[::-1].tolist():
        if sensor not in looking_at_wall and counts[sensor] > infrared.NEAR_COUNTS:
            return "something stands about %.0f cm %s of it" % (
                100.0 * infrared.estimate_distance_m(counts[sensor]),
                infrared.name_beam(sensor),
            )
    return None
