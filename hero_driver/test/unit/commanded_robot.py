"""One robot and the driver's way out to it, in the driver's own time: no socket, no thread, no machine to wait for.

The driver's parts are the real ones from the bridge to the link; the link is a network with a delay, and at its other
end is a robot that reads every 51 ms, by the firmware's rules (fake_motors).
"""

import contextlib
import heapq
import struct
from types import SimpleNamespace
from unittest import mock

from hero_driver import peer
from hero_driver.commands.command_queue import CommandSettings
from hero_driver.commands.velocity_shaper import STOP_PAYLOADS
from hero_driver.corrections.correction_settings import CorrectionSettings
from hero_driver.fleet.namespaces import identify
from hero_driver.ros import robot_bridge, robot_commands
from hero_driver.rosserial import packets
from hero_driver.rosserial.session import Session, SessionLimits
from hero_driver.stops import delivery
from hero_driver.transport.event_loop import POLL_INTERVAL_S
from hero_test.fake_motors import FakeMotors
from hero_test.fake_robot import ENCODER_INTERVAL_S, READ_CYCLE_S, STOCK_DECLARATIONS, SUB, WINDOW_LENGTH, FakeRobot

VELOCITY = "/hero_1/velocity_controller/cmd_vel"
POSITION = "/hero_1/position_controller/cmd_vel"
MOTORS = "/hero_1/cmd_motor"
LIGHT = "/hero_1/led"


class Clock:
    """The driver's time, and what it wants to do later."""

    def __init__(self):
        self.now_s = 100.0
        self._due = []
        self._count = 0

    def monotonic(self):
        return self.now_s

    def call_later(self, delay_s, call):
        self._count += 1
        heapq.heappush(self._due, (self.now_s + delay_s, self._count, call))

    def run(self, duration_s):
        end_s = self.now_s + duration_s
        while self._due and self._due[0][0] <= end_s:
            self.now_s, _, call = heapq.heappop(self._due)
            call()
        self.now_s = end_s

    @contextlib.contextmanager
    def is_the_drivers(self):
        """Let the driver's parts see this time."""
        with contextlib.ExitStack() as stack:
            for module in (peer, delivery, robot_commands):
                stack.enter_context(mock.patch.object(module, "time", self))
            yield self


class CommandedRobot:
    """The robot, the network to it, and the driver's parts that command it.

    Attributes:
        writes: (s, bytes), one for each time that the driver wrote to the socket.
        taken: (s, topic name, payload), as the robot read them.
        network_s: time from the driver to the robot's TCP; the acknowledgement takes as long again.
    """

    def __init__(self, clock, network_s=0.0, phase_s=0.0, has_readings=False, motors=None):
        self.clock = clock
        self.network_s = network_s
        self.writes = []
        self.taken = []
        self.motors = motors or FakeMotors()
        self.closed = False
        self.handed_length = 0
        self.warnings = []
        self.lines = []
        self.stopped = False
        self._acknowledged_length = 0
        self._hangs_until_s = 0.0
        self._is_reading = False
        self._read_began_s = 0.0
        self._longest_read_s = 0.0
        self._buffer = b""
        self._reader = packets.PacketReader()
        self.bridge = robot_bridge.RobotBridge(
            identify("/hero_1/odom"),
            owner=self,
            loop=None,
            log=SimpleNamespace(log_throttled=lambda level, key, text: self.lines.append(text)),
            transforms=SimpleNamespace(add=None),
            registrar=SimpleNamespace(submit=lambda job, always=False: True),  # nothing is registered with a master
            corrections=CorrectionSettings(),
            commands=CommandSettings(allow_self_tuning=True, command_max_age_s=10.0),
            max_names=100,
        )
        self.peer = peer.Peer(
            self, Session(SessionLimits(), clock.now_s), None, self, clock.call_later, bridge=self.bridge
        )
        self.bridge.corrections.odometry.restart(False, self.peer.wheels)
        self.bridge.attach(self.peer)
        self._names = {}
        self._senders = {}
        subscribed = FakeRobot(1, [entry for entry in STOCK_DECLARATIONS if entry.kind == SUB])
        for event in self.peer.session.receive_bytes(subscribed.encode_declarations(), clock.now_s, 0.0):
            self.bridge.declare(event, event.info.name)
            self._names[event.info.topic_id] = event.info.name
        self.stops = delivery.StopDelivery(clock.call_later, self)
        clock.call_later(phase_s, self._read)
        clock.call_later(0.0, self._watch_commanders)
        if has_readings:
            clock.call_later(phase_s, self._send_reading)

    # What commands and stops ask of the gateway.

    def stop_robot(self, _):
        self.stops.begin(self.peer)

    def note_change(self):
        pass

    def warn_late(self):
        self.lines.append("late")

    def warn_robot(self, _, text):
        self.warnings.append(text)

    # What the driver's parts know of a link.

    def send_packet(self, data):
        self.writes.append((self.clock.now_s, data))
        self.handed_length += len(data)
        handed_length = self.handed_length

        def arrive():
            self._buffer += data
            self.clock.call_later(self.network_s, acknowledge)

        def acknowledge():
            self._acknowledged_length = handed_length

        self.clock.call_later(self.network_s, arrive)

    def read_unacknowledged_length(self):
        return self.handed_length - self._acknowledged_length

    # The robot.

    def hang(self, for_s):
        """Read nothing and send nothing for some time; TCP acknowledges what comes."""
        self._hangs_until_s = self.clock.now_s + for_s

    def _read(self):
        if self.clock.now_s < self._hangs_until_s:
            self.clock.call_later(self._hangs_until_s - self.clock.now_s, self._read)
            return
        self.motors.begin_read(self.clock.now_s)
        self._read_began_s = self.clock.now_s
        self._read_on()

    def _read_on(self):
        """Read what has come, and what comes while that takes time: nothing else runs before all is read."""
        data, self._buffer = self._buffer[:WINDOW_LENGTH], self._buffer[WINDOW_LENGTH:]
        now_s = self.clock.now_s
        for packet in self._reader.receive_bytes(data):
            name = self._names[packet.topic_id]
            self.taken.append((now_s, name, packet.payload))
            if name == MOTORS:
                self.motors.take_pulses(packet.payload)
            elif name == LIGHT:
                self.motors.take_led()
            else:
                self.motors.take_velocity(name, not any(packet.payload))
        self._is_reading = bool(data)
        self._longest_read_s = max(self._longest_read_s, now_s - self._read_began_s)
        if data:
            self.clock.call_later(max(self.motors.read_s - now_s, 0.0), self._read_on)
        else:
            self.clock.call_later(READ_CYCLE_S, self._read)

    def _send_reading(self):
        if self.clock.now_s < self._hangs_until_s:
            self.clock.call_later(self._hangs_until_s - self.clock.now_s, self._send_reading)
            return
        if self._is_reading:
            self.clock.call_later(0.001, self._send_reading)
            return
        ticks = self.motors.count_ticks(self.clock.now_s)
        self.peer.session.last_receive_s = self.clock.now_s
        self.peer.wheels.read_ticks(ticks, ticks)
        self.clock.call_later(ENCODER_INTERVAL_S, self._send_reading)

    def find_longest_read_s(self):
        """Return for how long the robot did nothing but read, at most."""
        return self._longest_read_s

    def list_motor_packets(self):
        """Return the servo pulses among all that the driver wrote."""
        written = packets.PacketReader().receive_bytes(b"".join(data for _, data in self.writes))
        return [packet for packet in written if self._names[packet.topic_id] == MOTORS]

    # The programs.

    def _watch_commanders(self):
        self.bridge.commands.watch_commanders(self.clock.now_s)
        self.clock.call_later(POLL_INTERVAL_S, self._watch_commanders)

    def publish(self, name, payload, node="/program", source=None, is_old=False):
        """Let a node publish on a motion topic, or on an alias of it (source)."""
        source = source or name
        sender = self._senders.setdefault((node, source), SimpleNamespace(header={"callerid": node}))
        self.bridge.commands._subscribers[source] = SimpleNamespace(last_sender=sender, is_old=is_old)
        ros_type = "hero_msgs/Motor" if name == MOTORS else "geometry_msgs/Twist"
        self.bridge.commands.choose_receiver(name, source, ros_type)(payload)

    def publish_velocity(self, linear_m_s, name=VELOCITY, **settings):
        """Let a node publish a Twist."""
        self.publish(name, struct.pack("<6d", linear_m_s, 0.0, 0.0, 0.0, 0.0, 0.0), **settings)

    def publish_at(self, rate_hz, duration_s, linear_m_s=0.1, **settings):
        """Let a node publish Twists for some time."""
        for _ in range(int(rate_hz * duration_s)):
            self.publish_velocity(linear_m_s, **settings)
            self.clock.run(1.0 / rate_hz)

    def command(self, name, payload):
        """Offer a motion command, as the subscriber to its topic does."""
        kind = "hero_msgs/Motor" if name == MOTORS else "geometry_msgs/Twist"
        self.bridge.commands.queue.offer_motion(name, payload, STOP_PAYLOADS[kind], self.clock.now_s)
        self.peer.send_commands()

    def drive(self, linear_m_s, name=VELOCITY):
        """Offer a Twist."""
        self.command(name, struct.pack("<6d", linear_m_s, 0.0, 0.0, 0.0, 0.0, 0.0))

    def list_speeds(self, name=VELOCITY):
        """Return (s, m/s) of each Twist that the robot read on a topic."""
        return [(at_s, struct.unpack("<6d", payload)[0]) for at_s, topic, payload in self.taken if topic == name]
