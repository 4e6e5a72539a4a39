"""Simulated robots under calibration, stepped in virtual time: a session and its probes without ROS."""

from hero_calibration.errors import CalibrationError
from hero_calibration.robots.probe import Probe
from hero_calibration.robots.session import Session
from hero_node import Pose


class StepProbe(Probe):
    """The robot at a row of RobotRows.

    Attributes:
        is_lost: whether the network carries nothing from and to it.
    """

    def __init__(self, robots, row):
        super().__init__(row)
        self.robots = robots
        self.is_lost = False
        self.written = {}
        self.readings = 0

    def drive(self, angular_rad_s, linear_m_s=0.0):
        self.send(self.robots.send_velocity, linear_m_s, angular_rad_s)

    def turn(self, angle_rad):
        self.send(self.robots.send_position, 0.0, angle_rad)

    def set_pulses(self, left_us, right_us):
        self.send(self.robots.send_pulses, left_us, right_us)

    def stop(self):
        self.drive(0.0)
        self.turn(0.0)

    def send(self, method, *values):
        if not self.is_lost:
            method(self.robot_id, *values)

    def write(self, key, values):
        if self.is_lost:
            raise CalibrationError("%s is not answered" % key)
        self.written[key] = list(values)
        {
            "motor_centers_us": self.robots.set_motor_centers,
            "velocity_gains": self.robots.set_velocity_gains,
            "infrared_counts_m2": self.robots.set_infrared_calibration,
        }[key](self.robot_id, values)

    def receive_cycle(self, now_s, ticks, pose):
        if not self.is_lost:
            self.readings += 1
            self.receive_encoder(now_s, now_s, self.readings, *ticks)
            self.receive_pose(now_s, Pose(*pose))

    def receive_ranges(self, now_s, counts, ranges_m):
        if not self.is_lost:
            self.receive_scan(now_s, counts, ranges_m)


class StepSession(Session):
    """All robots of a RobotRows.

    Attributes:
        events: what is to be done at a time (s), by time.
        end_s: when the program is told to end; None: never.
    """

    def __init__(self, robots):
        super().__init__([StepProbe(robots, row) for row in range(len(robots.odometry))])
        self.robots = robots
        self.events = {}
        self.end_s = None
        robots.on_cycle.append(self.receive_cycles)
        robots.on_scan.append(self.receive_scans)

    @property
    def now_s(self):
        return self.robots.now_ms / 1000.0

    def sleep(self, duration_s):
        self.robots.advance(self.robots.now_ms + max(1, round(1000.0 * duration_s)))
        for time_s in [time_s for time_s in self.events if time_s <= self.now_s]:
            self.events.pop(time_s)()
        return self.end_s is None or self.now_s < self.end_s

    def map(self, work, probes):
        for probe in probes:
            work(probe)

    def receive_cycles(self, rows):
        now_s, ticks, poses = self.now_s, self.robots.ticks[rows].tolist(), self.robots.odometry[rows].tolist()
        for row, *reading in zip(rows.tolist(), ticks, poses):
            self.probes[row].receive_cycle(now_s, *reading)

    def receive_scans(self, rows):
        now_s, counts, ranges_m = self.now_s, self.robots.counts[rows].tolist(), self.robots.ranges_m[rows].tolist()
        for row, *scan in zip(rows.tolist(), counts, ranges_m):
            self.probes[row].receive_ranges(now_s, *scan)
