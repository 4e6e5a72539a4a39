"""Many robots at stock rates as cheaply as possible, to load a rosserial TCP server; no physics.

Prints one JSON line at the end, or at SIGINT: what was sent, what commands came, how late. Needs neither ROS nor numpy.
Rates and sizes are those of the stock robot: bursts of odom, five transforms and encoder 29.4 times per
second, laser 4.98, log 0.98, time request every 2.53 s.
"""

import argparse
import heapq
import json
import selectors
import signal
import socket
import struct
import threading
import time
from typing import List, Tuple

from hero_driver.rosserial import packets, payloads
from hero_sim.robot.declarations import SERVICE, STOCK_TOPICS, assign_ids, encode_declarations

BURST_PERIOD_S = 0.034
LASER_PERIOD_S = 0.201
LOG_PERIOD_S = 1.02
TIME_PERIOD_S = 2.53

ZERO = bytes(48)

TOPICS = [topic for topic in STOCK_TOPICS if topic.kinds != SERVICE]
SENT, RECEIVED = assign_ids(TOPICS)


def declare(number):
    """Return the packets with which robot number declares its topics (services are left out)."""
    return packets.encode_packet(packets.ID_TIME, bytes(8)) + encode_declarations("hero_%d" % number, TOPICS)


def text(value):
    """Return value as it lies in a message."""
    return struct.pack("<I", len(value)) + value.encode()


class Packet:
    """A packet of which only the first bytes of the payload change: written once, then patched."""

    def __init__(self, topic_id, payload, changing):
        """changing: the slice of the payload that is different each time."""
        constant = payload[: changing.start] + payload[changing.stop :]
        self.data = bytearray(packets.encode_packet(topic_id, payload))
        self._place = slice(packets.HEADER_LENGTH + changing.start, packets.HEADER_LENGTH + changing.stop)
        self._sum = (topic_id & 0xFF) + (topic_id >> 8) + packets.sum_bytes(constant)

    def patch(self, changing):
        """Put other bytes in and correct the checksum."""
        self.data[self._place] = changing
        self.data[-1] = 255 - (self._sum + sum(changing)) % 256


class Templates:
    """The messages of one robot, to which only stamps are added."""

    def __init__(self, number):
        name = "hero_%d/" % number
        pose = struct.pack("<7d", 0, 0, 0, 0, 0, 0, 1)
        transform_tails = [text(name + "odom") + text(name + "base_link") + pose] + [
            text(name + "base_link") + text(name + child) + pose
            for child in ("left_wheel_link", "right_wheel_link", "hat_link", "laser_link")
        ]
        scan = struct.pack("<7f", -3.1416, 3.1416, 0.395, 0, 0, 0.0368, 0.2368)
        laser_tail = text(name + "laser_link") + scan + (struct.pack("<I", 16) + bytes(64)) * 2
        odom_tail = text(name + "odom") + text(name + "base_link") + bytes(680)
        self._encoder_frame = text(name + "encoder")
        encoder_tail = self._encoder_frame + bytes(88)
        encoder_changes = slice(4, 12 + len(self._encoder_frame) + 16)
        no_header = b"\xff\xff\xff\xff" + bytes(8)
        self._odom = Packet(SENT["odom"], bytes(12) + odom_tail, slice(0, 12))
        self._transforms = [Packet(SENT["tf"], b"\x01" + bytes(15) + tail, slice(8, 16)) for tail in transform_tails]
        self._encoder = Packet(SENT["encoder"], no_header + encoder_tail, encoder_changes)
        self._laser = Packet(SENT["laser"], bytes(12) + laser_tail, slice(4, 12))

    def make_burst(self, number, stamp):
        """Return the packets of one burst with stamp (8 bytes).

        number is odom's seq, by which losses are noticed; the robot drives on by a few ticks with each burst.
        """
        self._odom.patch(struct.pack("<I", number) + stamp)
        for packet in self._transforms:
            packet.patch(stamp)
        ticks = struct.pack("<2d", 3.0 * number, 2.0 * number)
        self._encoder.patch(stamp + self._encoder_frame + ticks)
        return [self._odom.data, *(packet.data for packet in self._transforms), self._encoder.data]

    def make_laser(self, stamp):
        """Return one laser packet with stamp (8 bytes)."""
        self._laser.patch(stamp)
        return self._laser.data


class EmulatedRobot:
    """One connection."""

    def __init__(self, number, address, keeps_times=True):
        """keeps_times: without it stamps_s and commands_s stay empty."""
        self.number = number
        self._keeps_times = keeps_times
        self.templates = Templates(number)
        self.reader = packets.PacketReader()
        self.socket = socket.create_connection(address)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, True)
        self.socket.setblocking(False)
        self.synchronized_s = None
        self.closed = False
        self.bursts = self.commands = 0
        self.stamps_s = []  # when bursts were sent
        self.commands_s = []  # pairs: when a command was sent, when it came

    def count_due(self, now_s):
        """Return how many bursts there should have been at the stock rate."""
        return 0.0 if self.synchronized_s is None else (now_s - self.synchronized_s) / BURST_PERIOD_S

    def send(self, data):
        """Send all of data; a server that does not read is waited for."""
        view = memoryview(data)
        while view:
            try:
                view = view[self.socket.send(view) :]
            except BlockingIOError:
                time.sleep(0.001)
            except OSError:
                self.closed = True
                return

    def receive(self, now_s):
        """Take what the server sends; return whether the handshake was completed by it."""
        try:
            data = self.socket.recv(65536)
        except OSError:
            data = b""
        if not data:
            self.closed = True
            return False
        is_new = False
        for topic_id, payload in self.reader.receive_bytes(data):
            if topic_id == packets.ID_PUBLISHER:
                self.send(declare(self.number))
            elif topic_id == packets.ID_TIME and self.synchronized_s is None:
                self.synchronized_s = now_s
                is_new = True
            elif topic_id == RECEIVED["velocity_controller/cmd_vel"] and payload != ZERO:
                # Zeros are the driver's own: it stops robots whose commander has disconnected.
                self.commands += 1
                if self._keeps_times:
                    # The commander writes the time of sending into linear.y, which robots ignore.
                    self.commands_s.append((struct.unpack_from("<d", payload, 8)[0], time.time()))
        return is_new


def run(address, count, seconds, speed, first=0, keeps_times=True, is_ended=lambda: False):
    """Return the result of count robots for seconds after all have joined, or until is_ended()."""
    started_s = time.monotonic()
    robots = [EmulatedRobot(first + index, address, keeps_times) for index in range(count)]
    selector = selectors.DefaultSelector()
    for robot in robots:
        selector.register(robot.socket, selectors.EVENT_READ, robot)
    due: List[Tuple[float, int, str, EmulatedRobot]] = []
    order = 0
    all_joined_s = None
    measure_end_s = started_s + seconds + 30.0
    while True:
        now_s = time.monotonic()
        if now_s >= measure_end_s or is_ended():
            break
        timeout_s = max(0.0, due[0][0] - now_s) if due else 0.05
        for key, _ in selector.select(min(timeout_s, 0.05)):
            robot = key.data
            if robot.receive(time.monotonic()):
                phase_s = BURST_PERIOD_S * (robot.number * 0.618 % 1.0)
                for kind in ("burst", "laser", "log", "time"):
                    order += 1
                    heapq.heappush(due, (time.monotonic() + phase_s, order, kind, robot))
            if robot.closed:
                selector.unregister(robot.socket)
        if all_joined_s is None:
            joined_s = [robot.synchronized_s for robot in robots if robot.synchronized_s is not None]
            if len(joined_s) == len(robots):
                all_joined_s = max(joined_s)
                measure_end_s = time.monotonic() + seconds
        now_s = time.monotonic()
        while due and due[0][0] <= now_s:
            due_s, _, kind, robot = heapq.heappop(due)
            if robot.closed:
                continue
            time_ns = time.time_ns()
            stamp = struct.pack("<II", *divmod(time_ns, 10**9))
            if kind == "burst":
                robot.send(b"".join(robot.templates.make_burst(robot.bursts, stamp)))
                robot.bursts += 1
                if keeps_times:
                    robot.stamps_s.append(time_ns / 1e9)
                period_s = BURST_PERIOD_S
            elif kind == "laser":
                robot.send(robot.templates.make_laser(stamp))
                period_s = LASER_PERIOD_S
            elif kind == "log":
                line = "\x1b[96m[/hero_%d] Conected at time %d\x1b[0m" % (robot.number, now_s * 1000 % 10**9)
                log = payloads.encode_log(payloads.Log(payloads.LOG_INFO, line))
                robot.send(packets.encode_packet(packets.ID_LOG, log))
                period_s = LOG_PERIOD_S
            else:
                robot.send(packets.encode_packet(packets.ID_TIME, bytes(8)))
                period_s = TIME_PERIOD_S
            order += 1
            heapq.heappush(due, (due_s + period_s / speed, order, kind, robot))
    now_s = time.monotonic()
    return {
        "joined_s": None if all_joined_s is None else all_joined_s - started_s,
        "bursts_sent": sum(robot.bursts for robot in robots),
        # A server that does not keep up does not read, and a robot then waits with the next burst.
        "bursts_due": sum(robot.count_due(now_s) * speed for robot in robots),
        "thrown_out": sum(robot.closed for robot in robots),
        "transforms": 5 * sum(robot.bursts for robot in robots),
        "commands": sum(robot.commands for robot in robots),
        "odom_stamps_s": [stamp_s for robot in robots for stamp_s in robot.stamps_s],
        "commands_s": [pair for robot in robots for pair in robot.commands_s],
    }


def main():
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=11411)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--first-id", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=10.0, help="time after the last robot has joined")
    parser.add_argument("--speed", type=float, default=1.0, help="multiplies all rates")
    parser.add_argument("--counts", action="store_true", help="keep no times, for runs of hours")
    options = parser.parse_args()
    ended = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: ended.set())
    address = (options.host, options.port)
    result = run(
        address,
        options.count,
        options.seconds,
        options.speed,
        options.first_id,
        not options.counts,
        ended.is_set,
    )
    print(json.dumps(result))


if __name__ == "__main__":
    main()
