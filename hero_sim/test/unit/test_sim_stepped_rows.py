"""RobotRows against the originals of its rules: the scalar firmware's parts and the driver's, millisecond by
millisecond."""

import math
import struct

import numpy as np
import pytest
from driver_side import RECEIVED, SENT
from stepped_worlds import build_world

from hero_driver.commands import velocity_shaper
from hero_driver.commands.velocity_shaper import STOP_PAYLOADS, VelocityShaper, check_twist
from hero_driver.corrections import PLUS_WHEELS, WheelGeometry
from hero_driver.corrections.message_layouts import make_proximity
from hero_driver.corrections.tick_odometry import TickOdometry
from hero_driver.rosserial import packets, payloads
from hero_node import Pose
from hero_sim.robot.commands import CommandTable
from hero_sim.robot.firmware import Firmware
from hero_sim.robot.flash import Flash
from hero_sim.robot.messages import encode_laser
from hero_sim.robot.models import HERO, MODELS
from hero_sim.robot.motor_control import MotorControl
from hero_sim.robot.ranges import calibrate, convert_to_ranges
from hero_sim.robot.sensing import DISTANCE_MS, Sensing
from hero_sim.robot.servo_pins import CORE_2, ServoPins
from hero_sim.stepped.robot_rows import RobotRows, correct_ranges
from hero_sim.stepped.rules.command_shaper import INTERVAL_MS
from hero_sim.world.body import Body, SharedReadings
from hero_sim.world.world import STEP_MS

READY_MS = 5000
"""The scalar robots were switched on so long ago: in its first 3 s a position controller always runs."""

SHAPED_TYPES = {
    RECEIVED["velocity_controller/cmd_vel"]: "geometry_msgs/Twist",
    RECEIVED["position_controller/cmd_vel"]: "geometry_msgs/Twist",
    RECEIVED["cmd_motor"]: "hero_msgs/Motor",
}


def encode_twist(linear_m_s, angular_rad_s):
    return struct.pack("<6d", linear_m_s, 0, 0, 0, 0, angular_rad_s)


def read_proximity(laser_payload):
    """Return the ranges of a laser message as the driver corrects them and hero_client's Robot.proximity shows them."""
    ranges_m = np.array(struct.unpack_from("<8f", make_proximity(laser_payload, 0, 0, 0.2), -68))
    return np.roll(np.where(ranges_m == -np.inf, 0.0, ranges_m), -4)


@pytest.fixture(autouse=True)
def _driver_in_milliseconds(monkeypatch):
    """Let the driver's shapers count whole milliseconds, as the simulator does."""
    monkeypatch.setattr(velocity_shaper, "COMMAND_INTERVAL_S", INTERVAL_MS)


class ScalarRobot:
    """One robot of the parts that the simulator behind sockets is made of, and its half of the driver."""

    def __init__(self, world, index, model, infrared):
        name, errors = "hero_%d" % index, world.errors
        body = Body(world, index, infrared)
        body.booted_ms = -READY_MS
        calibration = calibrate(errors.alpha_counts_m2[index], errors.beta_counts[index])
        self.flash = flash = Flash(calibration.tolist(), np.rint(errors.servo_center_us[index]).tolist())
        self.sensing = Sensing(name, body, False, flash, model)
        rng = np.random.RandomState(0)
        self.motors = MotorControl(name, body, self.sensing.odometry, flash, ServoPins(CORE_2), rng, lambda text: None)
        self.table = CommandTable(name, self.sensing, self.motors, flash, lambda text: None, pytest.fail, model)
        self.model = model
        self.shapers = {topic_id: VelocityShaper(STOP_PAYLOADS[kind]) for topic_id, kind in SHAPED_TYPES.items()}
        self.odometry = TickOdometry(PLUS_WHEELS if model.is_plus else WheelGeometry())
        self.inbox = []
        self.ticks = (0.0, 0.0)
        self.distance_m = math.nan

    def offer(self, now_ms, topic_id, payload):
        if SHAPED_TYPES[topic_id] == "geometry_msgs/Twist":
            payload = check_twist(payload)
        self.shapers[topic_id].offer(payload)
        self.send(now_ms)  # the driver takes at once what may go

    def call(self, topic_id, payload, now_ms):
        self.table.receive(packets.Packet(topic_id, payload), READY_MS + now_ms)

    def set_odometry(self, now_ms, *pose):
        self.call(RECEIVED["set_odom"], struct.pack("<3d", *pose), now_ms)
        self.odometry.set_pose(Pose(*pose))
        self.ticks = (0.0, 0.0)

    def send(self, now_ms):
        for topic_id, shaper in self.shapers.items():
            payload = shaper.take(now_ms)
            if payload is not None:
                self.inbox.append((topic_id, payload))

    def read_commands(self, now_ms):
        inbox, self.inbox = sorted(self.inbox, key=lambda command: list(SHAPED_TYPES).index(command[0])), []
        for command in inbox:
            self.call(*command, now_ms)

    def run_cycle(self, now_ms):
        for packet in packets.PacketReader().receive_bytes(self.sensing.run_cycle(READY_MS + now_ms, (0, 0))):
            if packet.topic_id == SENT["laser"]:
                header = len(packet.payload) - struct.calcsize("<7fI16fI16f")
                self.counts = struct.unpack_from("<16f", packet.payload, header + 28 + 4 + 64 + 4)[::2]
                self.proximity = read_proximity(packet.payload)
            elif packet.topic_id == SENT["encoder"]:
                (frame_length,) = struct.unpack_from("<I", packet.payload, 12)
                self.ticks = struct.unpack_from("<2d", packet.payload, 16 + frame_length)
                self.odometry.integrate(*self.ticks, now_ms / 1000.0)

    def measure_distance(self, now_ms):
        if self.model.is_plus and now_ms % DISTANCE_MS == 0:
            packet = self.sensing.measure_distance(READY_MS + now_ms)
            (self.distance_m,) = struct.unpack_from("<f", packet, len(packet) - 5)

    def run_motors(self, now_ms, control):
        motors = self.motors.motors
        if control or (motors.attached and READY_MS + now_ms >= motors.stop_at_ms):
            self.motors.run(READY_MS + now_ms)


class ScalarRobots:
    """The same robots, world and timers as RobotRows; what may differ is every rule."""

    def __init__(self, world, models):
        self.world = world
        self.now_ms = -1
        infrared = SharedReadings(world)
        self.robots = [ScalarRobot(world, index, model, infrared) for index, model in enumerate(models)]
        for robot in self.robots:
            robot.sensing.begin(READY_MS)
        self._control_ms, self._read_ms = 9, 50
        read_infrared, self._readings = world.read_infrared, {}

        def read_all_at_once(which):  # so that the noise is drawn in the same order
            if self.now_ms not in self._readings:
                self._readings = {self.now_ms: read_infrared(np.arange(len(world.poses)))}
            return self._readings[self.now_ms][which]

        world.read_infrared = read_all_at_once

    def advance(self, until_ms):
        while self.now_ms < until_ms:
            self.now_ms += 1
            self._run_millisecond(self.now_ms)

    def _run_millisecond(self, now_ms):
        control = now_ms == self._control_ms
        for robot in self.robots:
            robot.send(now_ms)
        if READY_MS + now_ms == self.robots[0].sensing.due_ms:
            for robot in self.robots:
                robot.run_cycle(now_ms)
            self._control_ms += control
        else:
            self._control_ms += 21 * control
            for robot in self.robots:
                robot.run_motors(now_ms, control)
        for robot in self.robots:
            robot.measure_distance(now_ms)
        if now_ms == self._read_ms:
            self._read_ms += 51
            for robot in self.robots:
                robot.read_commands(now_ms)
        if now_ms == self.world.time_ms + STEP_MS:
            self.world.step()


def compare(rows, scalar):
    robots, world, other = scalar.robots, rows.world, scalar.world
    np.testing.assert_array_equal(world.commands_m_s, other.commands_m_s)
    np.testing.assert_array_equal(world.poses, other.poses)
    np.testing.assert_array_equal(rows.ticks, [robot.ticks for robot in robots])
    np.testing.assert_array_equal(rows.counts, [robot.counts for robot in robots])
    np.testing.assert_array_equal(rows.proximity_m, [robot.proximity for robot in robots])
    np.testing.assert_array_equal(rows.distance_m.astype(np.float32), [robot.distance_m for robot in robots])
    odometry = [robot.odometry for robot in robots]
    poses = [(each.x_m, each.y_m, math.remainder(each.yaw_rad, math.tau)) for each in odometry]
    np.testing.assert_allclose(rows.odometry, poses, rtol=0, atol=1e-6)
    velocities = [(each.linear_m_s, each.angular_rad_s) for each in odometry]
    np.testing.assert_allclose(rows.velocities, velocities, rtol=0, atol=1e-9)


def act_at_random(rng, rows, scalar):
    """Do the same to one robot of both."""
    now_ms, row = rows.now_ms, int(rng.randint(len(rows.ticks)))
    robot = scalar.robots[row]
    deed = rng.choice(
        ["velocity", "position", "pulses", "stop", "stop position", "rest", "odometry", "gains", "centers", "infrared"],
        p=[0.45, 0.1, 0.1, 0.1, 0.05, 0.02, 0.06, 0.04, 0.04, 0.04],
    )
    twist = (rng.uniform(-0.25, 0.25), rng.choice([0.0, rng.uniform(-9.0, 9.0)]))
    if deed in ("velocity", "stop"):
        twist = (0.0, 0.0) if deed == "stop" else twist
        rows.send_velocity(row, *twist)
        robot.offer(now_ms, RECEIVED["velocity_controller/cmd_vel"], encode_twist(*twist))
    elif deed in ("position", "stop position"):
        twist = (0.0, 0.0) if deed == "stop position" else twist
        rows.send_position(row, *twist)
        robot.offer(now_ms, RECEIVED["position_controller/cmd_vel"], encode_twist(*twist))
    elif deed in ("pulses", "rest"):
        pulses_us = (1500, 1500) if deed == "rest" else rng.randint(900, 2100, 2).tolist()
        rows.send_pulses(row, *pulses_us)
        robot.offer(now_ms, RECEIVED["cmd_motor"], struct.pack("<2h", *pulses_us))
    elif deed == "odometry":
        pose = rng.uniform(-4.0, 4.0, 3).tolist()
        rows.set_odometry(row, *pose)
        robot.set_odometry(now_ms, *pose)
    elif deed == "gains":
        gains = np.float32(rng.uniform(-50.0, 2000.0, 6)).tolist()
        rows.set_velocity_gains(row, gains)
        robot.call(RECEIVED["velocity_controller/pid_parameters"], struct.pack("<6f", *gains), now_ms)
    elif deed == "centers":
        centers_us = rng.randint(1480, 1520, 2).tolist()
        rows.set_motor_centers(row, centers_us)
        robot.call(RECEIVED["motors_parameters"], struct.pack("<2h", *centers_us), now_ms)
    else:
        constants = rng.choice([np.nan, 0.4, 0.5], 8).tolist()
        rows.set_infrared_calibration(row, constants)
        robot.flash.ir_calibration_counts_m2 = constants  # no call takes nan, a robot that was never calibrated has it


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_robot_rows_do_what_the_scalar_robots_and_the_driver_do(seed):
    rng = np.random.RandomState(seed)
    models = [HERO, MODELS["hero_plus"], HERO] if seed % 2 else [HERO] * 3
    rows = RobotRows(build_world(3, seed, models=models), models=models)
    scalar = ScalarRobots(build_world(3, seed, models=models), models)
    while rows.now_ms < 12000:
        for each in (rows, scalar):
            each.advance(rows.now_ms)
        compare(rows, scalar)
        for _ in range(rng.randint(4)):
            act_at_random(rng, rows, scalar)
        rows.advance(rows.now_ms + int(rng.randint(1, 300)))


def test_ranges_of_all_counts_are_those_of_the_driver():
    for constant in (np.nan, 0.5, 0.423, 0.05):
        counts = np.arange(1024.0).reshape(-1, 8)
        ranges_m = convert_to_ranges(counts, np.full(8, constant)).astype(np.float32).astype(float)
        seen = []
        for row in convert_to_ranges(counts, np.full(8, constant)).tolist():
            seen.append(read_proximity(encode_laser("hero_0", 0, (0, 0), row, [0.0] * 8)))
        np.testing.assert_array_equal(correct_ranges(ranges_m), seen)
    assert {0.0, np.inf} < set(np.ravel(seen))


class WholeFirmware:
    """The whole firmware of one robot with its bytes, from its first cycle on, which is at 0 ms as in RobotRows."""

    def __init__(self, world):
        flash = Flash([0.5] * 8)
        rng = np.random.RandomState(0)
        self.world = world
        body = Body(world, 0, SharedReadings(world))
        self.firmware = Firmware(0, body, flash, rng, "127.0.0.1", False, CORE_2, pytest.fail)
        self.firmware.switch_on(0)
        while not self.has_sent(SENT["odom"]):
            now_ms = self.firmware.due_ms
            if now_ms >= READY_MS and not self.firmware.configured:
                self.send(now_ms, packets.ID_PUBLISHER)
            self.firmware.run(now_ms)
            if self.firmware.wants_connection:
                self.firmware.connection_made(now_ms)
        self.start_ms = world.time_ms = now_ms

    def has_sent(self, topic_id):
        reader = packets.PacketReader()
        sent = [packet.topic_id for data in self.firmware.outbox for packet in reader.receive_bytes(data)]
        return topic_id in sent

    def send(self, now_ms, topic_id, payload=b""):
        self.firmware.receive_bytes(now_ms, packets.encode_packet(topic_id, payload))

    def run_millisecond(self, now_ms):
        self.firmware.outbox.clear()
        self.firmware.run(self.start_ms + now_ms)
        if self.start_ms + now_ms == self.world.time_ms + STEP_MS:
            self.world.step()


@pytest.mark.slow
def test_the_timers_are_those_of_the_whole_firmware():
    rows, whole = RobotRows(build_world(1, 0, scale=0.0)), WholeFirmware(build_world(1, 0, scale=0.0))
    rng, command_ms, cycles, scans = np.random.RandomState(1), 0, [], []
    rows.on_cycle.append(lambda which: cycles.append(rows.now_ms))
    rows.on_scan.append(lambda which: scans.append(rows.now_ms))
    for now_ms in range(1, 10000):
        rows.advance(now_ms)
        whole.run_millisecond(now_ms)
        assert whole.has_sent(SENT["odom"]) == (cycles[-1:] == [now_ms])
        assert whole.has_sent(SENT["laser"]) == (scans[-1:] == [now_ms])
        assert rows.world.commands_m_s.tolist() == whole.world.commands_m_s.tolist()
        if now_ms >= command_ms:
            # Never a zero, after which the firmware's controllers begin at another time than ours.
            twist = (rng.uniform(0.05, 0.2), rng.uniform(-2.0, 2.0))
            rows.send_velocity(0, *twist)
            whole.send(whole.start_ms + now_ms, RECEIVED["velocity_controller/cmd_vel"], encode_twist(*twist))
            whole.send(whole.start_ms + now_ms, packets.ID_TIME, payloads.encode_time(payloads.split_seconds(1e9)))
            command_ms = now_ms + int(rng.randint(60, 900))
    assert rows.world.travels_m.tolist() == whole.world.travels_m.tolist()
