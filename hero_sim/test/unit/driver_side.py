"""The driver's half of the conversation with a simulated swarm, in simulated time and without a socket."""

import collections
import struct

from hero_driver.rosserial import packets, payloads
from hero_sim import main
from hero_sim.build import build_swarm
from hero_sim.robot.models import HERO

SERVER_START_S = 1_700_000_000

SENT, RECEIVED = HERO.sent_ids, HERO.received_ids
"""Ids of the stock robot's topics."""

VELOCITY, POSITION = (RECEIVED[kind + "_controller/cmd_vel"] for kind in ("velocity", "position"))

STOCK_SUBSCRIPTIONS = [1, 1, 3, 3, 1, 3, 1, 3, 3, 1, 3, 3]
"""Ids of the packets by which a robot declares what it reads: topics 1, requests of services 3."""

Arrival = collections.namedtuple("Arrival", "at_ms topic_id payload")


def parse_options(*arguments):
    return main.parse_options(main.build_parser(), arguments)


class DriverSide:
    """Connects, requests topics, answers time requests and keeps what each robot sends.

    Attributes:
        arrivals: per robot, every packet with the simulated time at which it was sent.
    """

    def __init__(self, *arguments, answer_time=True, connect=True):
        self.reports = []
        options = parse_options(*arguments)
        self.swarm = build_swarm(options, ["127.0.0.1"] * options.count, self.reports.append)
        self.answer_time = answer_time
        self.connect = connect
        count = len(self.swarm.robots)
        self.readers = [packets.PacketReader() for _ in range(count)]
        self.arrivals = [[] for _ in range(count)]
        self.connects = [[] for _ in range(count)]

    def run(self, ms):
        end_ms = self.swarm.now_ms + ms
        while self.swarm.now_ms < end_ms:
            next_ms = max(self.swarm.now_ms + 1, self.swarm.next_due_ms)  # before, there is nothing to serve
            for index in self.swarm.advance(min(next_ms, end_ms)):
                self._serve(index)

    def _serve(self, index):
        robot = self.swarm.robots[index]
        if robot.wants_connection:
            self.connects[index].append(self.swarm.now_ms)
            if self.connect:
                robot.connection_made(self.swarm.now_ms)
            else:
                robot.connection_failed(self.swarm.now_ms)
            self.swarm.reschedule(index)
        self._collect(index)

    def _collect(self, index):
        robot = self.swarm.robots[index]
        data = b"".join(robot.outbox)
        robot.outbox.clear()
        for packet in self.readers[index].receive_bytes(data):
            self.arrivals[index].append(Arrival(self.swarm.now_ms, packet.topic_id, packet.payload))
            if packet.topic_id == packets.ID_TIME and self.answer_time:
                self.send(index, packets.ID_TIME, payloads.encode_time(self.server_time()))

    def server_time(self):
        return payloads.split_seconds(SERVER_START_S + self.swarm.now_ms / 1000.0)

    def send(self, index, topic_id, payload=b""):
        self.send_bytes(index, packets.encode_packet(topic_id, payload))

    def send_bytes(self, index, data):
        self.swarm.robots[index].receive_bytes(self.swarm.now_ms, data)

    def send_twist(self, index, linear_m_s, turn_rad_s, topic_id=VELOCITY):
        self.send(index, topic_id, struct.pack("<6d", linear_m_s, 0, 0, 0, 0, turn_rad_s))

    def start_streaming(self):
        """Boot, request topics from everybody, wait until they stream and have finished booting.

        Until 3 s of uptime the position controller holds a robot where it is, whatever else it is told.
        """
        self.run(2500)
        for index in range(len(self.swarm.robots)):
            self.send(index, packets.ID_PUBLISHER)
        self.run(1700)
        assert all(robot.configured and not robot.motors.motors.attached for robot in self.swarm.robots)

    def drive(self, index, linear_m_s, turn_rad_s, ms, topic_id=VELOCITY):
        """Repeat a Twist every 100 ms for this long."""
        for _ in range(ms // 100):
            self.send_twist(index, linear_m_s, turn_rad_s, topic_id)
            self.run(100)

    def list_packets(self, index, topic_id, since_ms=0):
        return [
            arrival for arrival in self.arrivals[index] if arrival.topic_id == topic_id and arrival.at_ms >= since_ms
        ]

    def list_logs(self, index):
        return [(arrival.at_ms, payloads.decode_log(arrival.payload).text) for arrival in self.list_packets(index, 7)]

    def true_pose(self, index):
        return self.swarm.world.poses[index].tolist()

    def measure_speed(self, index):
        return max(abs(self.swarm.world.speeds_m_s[index]).tolist())


def read_text(payload, start):
    (length,) = struct.unpack_from("<I", payload, start)
    return payload[start + 4 : start + 4 + length].decode(), start + 4 + length


def read_odom(payload):
    """Return stamp (s, ns), frame ids, pose x y qz qw and twist linear, turn."""
    stamp = struct.unpack_from("<II", payload, 4)
    frame_id, start = read_text(payload, 12)
    child_id, start = read_text(payload, start)
    values = struct.unpack_from("<85d", payload, start)
    assert start + 85 * 8 == len(payload)
    return stamp, (frame_id, child_id), (values[0], values[1], values[5], values[6]), (values[43], values[48])


def read_encoder(payload):
    """Return the eleven values."""
    return struct.unpack_from("<11d", payload, len(payload) - 88)


def read_laser(payload):
    """Return seq, ranges and intensities."""
    (seq,) = struct.unpack_from("<I", payload, 0)
    values = struct.unpack_from("<16f", payload, len(payload) - 132)
    return seq, values, struct.unpack_from("<16f", payload, len(payload) - 64)
