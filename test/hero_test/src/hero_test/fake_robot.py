"""A scripted robot behind a real TCP socket: says what the stock robot says, and whatever else a test wants.

It takes packets as the firmware does (read cycle, receive window, the motion rules of fake_motors) and keeps them
for the test. It knows nothing of the driver's code or of ROS. Source: firmware v3.8 as
measured: ids in call order, publishers from 125, subscribers from 100; one burst of declarations for each request.
"""

import contextlib
import fcntl
import select
import socket
import struct
import sys
import termios
import threading
import time
from typing import Callable, Dict, List, NamedTuple, Optional

from hero_test import robot_packets
from hero_test.fake_motors import FakeMotors

BUFFER_LENGTH = 4096
ANSWER_MD5 = "937c9679a518e3a18d831e57125ea522"
TWIST_MD5 = "9f195f881246fdfa2798d1d3eebca84a"

TIME_REQUEST_INTERVAL_S = 2.5
READ_CYCLE_S = 0.051
WINDOW_LENGTH = 2144
"""Bytes that the robot's TCP takes before the firmware reads them, all in one read."""

ENCODER_INTERVAL_S = 0.034
TUNING_INTERVAL_S = 1.0 / 47.0
"""Between two log lines of a robot that tunes itself."""

REQUEST_PACKET = robot_packets.encode_packet(robot_packets.PUBLISHER, b"")
TIME_PACKET = robot_packets.encode_packet(robot_packets.TIME, bytes(8))

PUB, SUB = robot_packets.PUBLISHER, robot_packets.SUBSCRIBER
ANSWERS, REQUESTS = robot_packets.SERVICE_ANSWERS, robot_packets.SERVICE_REQUESTS


class Declaration(NamedTuple):
    """One endpoint; {} in the name stands for hero_N."""

    kind: int  # the id of the packet that declares it
    topic_id: int
    name: str
    message_type: str
    md5sum: str
    buffer_length: int = BUFFER_LENGTH


STOCK_DECLARATIONS = (
    Declaration(PUB, 125, "/{}/laser", "sensor_msgs/LaserScan", "90c7ef2dc6895d81024acba2ac42f369"),
    Declaration(ANSWERS, 126, "/{}/ir_calibration", "hero_common/SetIRCalibration", ANSWER_MD5),
    Declaration(PUB, 127, "/{}/imu", "sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2"),
    Declaration(PUB, 128, "/{}/encoder", "hero_common/Encoder", "b5586cdbae9b740afc6a1f403a2d7dde"),
    Declaration(PUB, 129, "/tf", "tf/tfMessage", "94810edda583a504dfda3829e70d7eec"),
    Declaration(PUB, 130, "/{}/odom", "nav_msgs/Odometry", "cd5e73d190d741a2f92e81eda573aca7"),
    Declaration(ANSWERS, 131, "/{}/set_odom", "hero_common/SetOdom", ANSWER_MD5),
    Declaration(ANSWERS, 132, "/{}/motors_parameters", "hero_common/SetMotor", ANSWER_MD5),
    Declaration(ANSWERS, 133, "/{}/position_controller/pid_parameters", "hero_common/SetPID", ANSWER_MD5),
    Declaration(ANSWERS, 134, "/{}/position_controller/pid_calibration", "std_srvs/Trigger", ANSWER_MD5),
    Declaration(ANSWERS, 135, "/{}/velocity_controller/pid_parameters", "hero_common/SetPID", ANSWER_MD5),
    Declaration(ANSWERS, 136, "/{}/velocity_controller/pid_calibration", "std_srvs/Trigger", ANSWER_MD5),
    Declaration(SUB, 100, "/{}/led", "std_msgs/ColorRGBA", "a29a96539573343b1310c73607334b00"),
    Declaration(SUB, 101, "{}/laser_enable", "std_msgs/Bool", "8b94c1b53db61fb6aed406028ad6332a"),
    Declaration(
        REQUESTS,
        102,
        "/{}/ir_calibration",
        "hero_common/SetIRCalibration",
        "27748d949ad62e65750ad22074426005",
    ),
    Declaration(REQUESTS, 103, "/{}/set_odom", "hero_common/SetOdom", "938fa65709584ad8e77d238529be13b8"),
    Declaration(SUB, 104, "/{}/cmd_motor", "hero_common/Motor", "44d4249d207ce6a89de3d72080e4d0b5"),
    Declaration(REQUESTS, 105, "/{}/motors_parameters", "hero_common/SetMotor", "44d4249d207ce6a89de3d72080e4d0b5"),
    Declaration(SUB, 106, "/{}/position_controller/cmd_vel", "geometry_msgs/Twist", TWIST_MD5),
    Declaration(
        REQUESTS,
        107,
        "/{}/position_controller/pid_parameters",
        "hero_common/SetPID",
        "f0d0bdba02bc62a48d52638e38dc8a4b",
    ),
    Declaration(
        REQUESTS,
        108,
        "/{}/position_controller/pid_calibration",
        "std_srvs/Trigger",
        "d41d8cd98f00b204e9800998ecf8427e",
    ),
    Declaration(SUB, 109, "/{}/velocity_controller/cmd_vel", "geometry_msgs/Twist", TWIST_MD5),
    Declaration(
        REQUESTS,
        110,
        "/{}/velocity_controller/pid_parameters",
        "hero_common/SetPID",
        "f0d0bdba02bc62a48d52638e38dc8a4b",
    ),
    Declaration(
        REQUESTS,
        111,
        "/{}/velocity_controller/pid_calibration",
        "std_srvs/Trigger",
        "d41d8cd98f00b204e9800998ecf8427e",
    ),
)


class Velocity(NamedTuple):
    """One velocity command."""

    name: str
    linear_m_s: float
    angular_rad_s: float

    @property
    def is_zero(self) -> bool:
        """Whether it is a stop."""
        return self.linear_m_s == 0.0 and self.angular_rad_s == 0.0


def encode_answer(success: bool, message: str) -> bytes:
    """Return the response of any stock service."""
    text = message.encode()
    return struct.pack("<?I", success, len(text)) + text


def boot_line(name: str, firmware: str = "v3.8") -> str:
    """Return what a robot says first after power-on."""
    return "\x1b[94m[/%s] Firmware: %s | Hardware: v2.5 | Config: v2.3 | IP: 10.42.0.17 \x1b[0m" % (
        name,
        firmware,
    )


def heartbeat_line(name: str, uptime_s: float) -> str:
    """Return what a robot says once a second."""
    return "\x1b[96m[/%s] Conected at time %d\x1b[0m" % (name, uptime_s * 1000)


class FakeRobot:
    """One robot; connect() or serve() begin its one connection, and a test may begin another after its end.

    Attributes (read by tests, all in order of arrival):
        received: packets from the driver; velocities: those with a Twist, whether the firmware takes them or not;
        motors: what the firmware makes of them; requests: how often topics were asked for; ended: why the
        connection is over, empty while it stands.
        answers: service name -> function of the request that returns the answer, or None for no answer.
        is_silent: says nothing of its own; is_stalled: does not read; declares: whether requests are answered.
    """

    def __init__(
        self,
        number: int = 0,
        declarations: Optional[List[Declaration]] = None,
        source_host: str = "127.0.0.1",
        read_cycle_s: float = 0.0,
        receive_buffer_length: int = 0,
        has_motors: bool = False,
    ) -> None:
        """read_cycle_s: 0 reads at once, READ_CYCLE_S as the firmware; receive_buffer_length: of TCP, 0: usual.

        has_motors: publishes its encoders, and pid_calibration makes it tune itself.
        """
        self.name = "hero_%d" % number
        self.namespace = "/" + self.name
        chosen = STOCK_DECLARATIONS if declarations is None else declarations
        self.declarations = [entry._replace(name=entry.name.format(self.name)) for entry in chosen]
        self.received: List[robot_packets.Packet] = []
        self.velocities: List[Velocity] = []
        self.motors = FakeMotors()
        self.requests = 0
        self.ended = ""
        self.answers: Dict[str, Callable[[bytes], Optional[bytes]]] = {}
        self.declares = True
        self.is_silent = False
        self.is_stalled = False
        self.address = ""
        self._source_host = source_host
        self._read_cycle_s = read_cycle_s
        self._receive_buffer_length = receive_buffer_length
        self._has_motors = has_motors
        self._socket: Optional[socket.socket] = None
        self._threads: List[threading.Thread] = []
        self._write_lock = threading.Lock()
        self._closing = threading.Event()

    # The connection.

    def connect(self, address) -> "FakeRobot":
        """Dial the driver at address (host, port)."""
        sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        if self._receive_buffer_length:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, self._receive_buffer_length)
        sock.settimeout(60.0)
        sock.bind((self._source_host, 0))
        sock.connect(address)
        self._begin(sock)
        return self

    def close(self) -> None:
        """Leave with a FIN; safe to call twice."""
        self._closing.set()
        sock = self._socket
        if sock is not None:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)
        self._join_threads()
        if sock is not None:
            sock.close()
            self._socket = None

    def reset(self) -> None:
        """Leave with a RST."""
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self._closing.set()
        self._join_threads()
        self._socket.close()
        self._socket = None

    def _join_threads(self) -> None:
        while self._threads:
            self._threads.pop().join()

    @property
    def is_connected(self) -> bool:
        """Whether neither side has ended the connection."""
        return self._socket is not None and not self.ended

    # What it says.

    def send_bytes(self, data: bytes) -> None:
        """Send anything; a connection that the driver has closed is no error, ended tells it."""
        with self._write_lock, contextlib.suppress(OSError):
            self._socket.sendall(data)

    def count_unacknowledged(self) -> int:
        """Return the bytes that the driver's TCP does not have yet."""
        assert self._socket is not None
        return int.from_bytes(fcntl.ioctl(self._socket.fileno(), termios.TIOCOUTQ, bytes(4)), sys.byteorder)

    def send_packet(self, topic_id: int, payload: bytes) -> None:
        """Send one packet."""
        self.send_bytes(robot_packets.encode_packet(topic_id, payload))

    def send(self, name: str, payload: bytes) -> None:
        """Publish on one of its own topics, by the name that it declared."""
        self.send_packet(self.find_id(name, (PUB,)), payload)

    def log(self, text: str, level: int = robot_packets.LOG_INFO) -> None:
        """Send a log line."""
        self.send_packet(robot_packets.LOG, robot_packets.encode_log(level, text))

    def declare(self) -> None:
        """Send the burst that answers a request for topics."""
        self.send_bytes(TIME_PACKET + self.encode_declarations())

    def encode_declarations(self) -> bytes:
        """Return all declarations as packets."""
        return b"".join(
            robot_packets.encode_packet(entry.kind, robot_packets.encode_declaration(*entry[1:]))
            for entry in self.declarations
        )

    def answer(self, name: str, payload: bytes) -> None:
        """Send the answer of one of its services."""
        self.send_packet(self.find_id(name, (ANSWERS,)), payload)

    def find_id(self, name: str, kinds) -> int:
        """Return the id of the endpoint called name (below its namespace unless it has a slash in front)."""
        full_name = name if name.startswith("/") else "%s/%s" % (self.namespace, name)
        for entry in self.declarations:
            if entry.kind in kinds and "/" + entry.name.lstrip("/") == full_name:
                return entry.topic_id
        raise KeyError(full_name)

    # What it got.

    def payloads_on(self, name: str) -> List[bytes]:
        """Return what it received on a topic, or as requests of a service, in order."""
        topic_id = self.find_id(name, (SUB, REQUESTS))
        return [packet.payload for packet in list(self.received) if packet.topic_id == topic_id]

    def payloads_with_id(self, topic_id: int) -> List[bytes]:
        """Return what it received under an id, in order."""
        return [packet.payload for packet in list(self.received) if packet.topic_id == topic_id]

    def _begin(self, sock: socket.socket) -> None:
        sock.settimeout(60.0)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.address = "%s:%d" % sock.getsockname()[:2]
        self.ended = ""
        self._closing.clear()
        self._socket = sock
        targets = [lambda: self._run(sock)] + [self._run_motors] * self._has_motors
        self._threads = [threading.Thread(target=target, name=self.name, daemon=True) for target in targets]
        for thread in self._threads:
            thread.start()

    def start_tuning(self, controller: str = "velocity_controller") -> None:
        """Tune one of its controllers, as after a call of its pid_calibration."""
        self.log("\x1b[94m[/%s] Starting Motors Auto Tuning! Wait... \x1b[0m" % self.name)
        self.motors.start_tuning(controller)

    def _run_motors(self) -> None:
        """Send encoder readings and, while it tunes itself, the lines that the firmware logs.

        As on the robot, those that a pause left out are not made up for.
        """
        encoder_s = tuning_s = time.monotonic()
        while not self._closing.wait(max(min(encoder_s, tuning_s) - time.monotonic(), 0.0)):
            now_s = time.monotonic()
            if now_s >= encoder_s:
                encoder_s = now_s + ENCODER_INTERVAL_S
                if self.requests and not self.is_silent:
                    self.send("encoder", self.motors.encode_encoder(self.name, now_s, time.time()))
            if now_s >= tuning_s:
                tuning_s = now_s + TUNING_INTERVAL_S
                if self.motors.is_tuning and not self.is_silent:
                    text = "Tunning Motor Set: [0.000000,0.000000], [0.050000,0.050000]->[-50,210]"
                    self.log("\x1b[93m[/%s] %s\x1b[0m" % (self.name, text))

    def _run(self, sock: socket.socket) -> None:
        reader = robot_packets.PacketReader()
        next_time_request_s = time.monotonic() + TIME_REQUEST_INTERVAL_S
        while not self._closing.is_set():
            now_s = time.monotonic()
            if now_s >= next_time_request_s:
                next_time_request_s = now_s + TIME_REQUEST_INTERVAL_S
                if not self.is_silent:
                    self.send_bytes(TIME_PACKET)
            if self._read_cycle_s or self.is_stalled:
                self._closing.wait(self._read_cycle_s or READ_CYCLE_S)
            ready, _, _ = select.select([sock], [], [], 0.0 if self._read_cycle_s else 0.05)
            if not ready or self.is_stalled:
                continue
            try:
                data = sock.recv(WINDOW_LENGTH)
            except OSError as error:
                self.ended = self.ended or str(error)
                return
            if not data:
                self.ended = "closed by the driver"
                return
            self.motors.begin_read(time.monotonic())
            for packet in reader.receive_bytes(data):
                self._take(packet)

    def _take(self, packet: robot_packets.Packet) -> None:
        self.received.append(packet)
        if packet.topic_id == robot_packets.PUBLISHER:
            self.requests += 1
            if self.declares:
                self.declare()
            return
        for entry in self.declarations:
            if entry.topic_id != packet.topic_id:
                continue
            if entry.kind == REQUESTS:
                self._serve(entry.name, packet.payload)
            elif entry.name.endswith("/cmd_vel") and len(packet.payload) == 48:
                self._take_velocity(entry.name, packet.payload)
            elif entry.name.endswith("/cmd_motor"):
                self.motors.take_pulses(packet.payload)
            elif entry.name.endswith("/led"):
                self.motors.take_led()

    def _serve(self, name: str, request: bytes) -> None:
        prefix = self.namespace + "/"
        short_name = name[len(prefix) :] if name.startswith(prefix) else name
        make_answer = self.answers.get(short_name, lambda _: encode_answer(True, short_name))
        if self._has_motors and short_name.endswith("/pid_calibration"):
            self.start_tuning(short_name.split("/")[0])
            make_answer = self.answers.get(short_name, lambda _: encode_answer(False, "PID Autotuning!"))
        answer = make_answer(request)
        if answer is not None:
            self.answer(short_name, answer)

    def _take_velocity(self, name: str, payload: bytes) -> None:
        parts = struct.unpack("<6d", payload)
        velocity = Velocity(name, parts[0], parts[5])
        self.velocities.append(velocity)
        self.motors.take_velocity(name, velocity.is_zero)
