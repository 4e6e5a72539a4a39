"""One robot by the rules of the stock firmware (v3.8): bytes and time in, bytes and motor commands out.

Pure: no socket, no clock, no thread. Time enters in whole milliseconds, as the firmware's millis() counts it,
so the robot runs as fast as its caller likes. Two things stand for the hardware: a Body (wheels, sensors,
motors) and a radio, which connects when wants_connection is set and sends what is in outbox.
Source: the firmware's files named at the constants, and measurements of the complete stock firmware.
"""

from collections import deque
from typing import Callable, Deque, List, Optional, Tuple

import numpy as np

from hero_driver.rosserial import packets, payloads

from ..errors import CommandError
from ..robot_constants import CONNECT_TIMEOUT_MS, RECEIVE_WINDOW_LENGTH, TIME_LOST_MS
from ..world.body import Body
from . import declarations
from .clock import NEVER_MS, RobotClock
from .commands import CommandTable
from .flash import Flash
from .models import HERO, RobotModel
from .motor_control import MotorControl
from .sensing import Sensing
from .servo_pins import ServoPins

BOOT_MS = 518
"""Time from power-on to the attempt to connect (Wi-Fi that is there at once)."""

IMU_LOG_MS = 57
"""Time from the connection to the line about the IMU (IMUSensor.ino:99)."""

WELCOME_MS = 1120
"""Time from the connection to the first pass of loop(): lights of welcome (LEDStatus.ino:93-108)."""

SPIN_MS = 51
"""Time between two spins, configured: SYNC_RATE 20 Hz (config.h:49), 1000/20 + 1."""

UNCONFIGURED_SPIN_MS = 101
"""The same while unconfigured: loop() waits 50 ms, and the gate passes every second time."""

LOG_MS = 1001
UNCONFIGURED_LOG_MS = 1019
"""Time between two lines "Conected at time" (ROSHandle.ino:116)."""

TIME_REQUEST_MS = 2500
"""Time between two time requests (SYNC_SECONDS 5 * 500, node_handle.h)."""

ANSWER_MS = (42, 75)
"""Time from the arrival of a service call to its answer (measured)."""

_TIME_REQUEST = packets.encode_packet(packets.ID_TIME, bytes(8))


class Firmware:
    """The program of one robot.

    Times of attributes and arguments are the caller's; the robot's own count from power-on is inside.

    Attributes:
        name: hero_N, in topics and frames.
        due_ms: when run() has to be called next.
        connected: whether the radio has a connection.
        wants_connection: whether the firmware is connecting.
        outbox: packets for the radio, in order.
        configured: whether the robot streams.
        body: its hardware.
        crash_reason: why the robot has to be restarted, None while it runs.
    """

    def __init__(
        self,
        robot_id: int,
        body: Body,
        flash: Flash,
        rng: np.random.RandomState,
        address: str,
        has_imu_hat: bool,
        servo_timing: str,
        report: Callable[[str], None],
        model: RobotModel = HERO,
    ) -> None:
        """Build a robot that is switched off; address is for its boot line, report takes lines for users."""
        self.model = model
        self.robot_id = robot_id
        self.name = "hero_%d" % robot_id
        self.world = ""
        """Addition to the boot line that tells the driver in which of several worlds the robot boots."""
        self.flash = flash
        self.rng = rng
        self.body = body
        self.outbox: List[bytes] = []
        self.connected = False
        self.due_ms = 0
        self.zero_topics_next = False
        self.answer_delay_ms = 0
        self._address = address
        self._has_imu_hat = has_imu_hat
        self._servo_timing = servo_timing
        self._report = report
        self._phase: Optional[Callable[[int], None]] = None  # what runs next; None: off
        self._setup: List[Tuple[int, Callable[[int], None]]] = []
        self._reset_memory()

    def _reset_memory(self) -> None:
        """Give everything that lives in RAM its first value."""
        name, body, flash = self.name, self.body, self.flash
        self.clock = RobotClock()
        self.sensing = Sensing(name, body, self._has_imu_hat, flash, self.model)
        pins = ServoPins(self._servo_timing)
        self.motors = MotorControl(name, body, self.sensing.odometry, flash, pins, self.rng, self.log)
        self._commands = CommandTable(name, self.sensing, self.motors, flash, self.log, self.warn, self.model)
        self._declarations = declarations.encode_declarations(name, self.model.topics)
        self.configured = False
        self.crash_reason: Optional[str] = None
        self.outbox.clear()
        self.wants_connection = False
        self._received = bytearray()
        self._pending: Deque[packets.Packet] = deque()
        self._spinning = False
        self._blocked_us = 0
        self._is_held = False
        self._answers: List[Tuple[int, bytes]] = []
        self._advertised = False
        self._blocked_until_ms: Optional[int] = None
        self._next_spin_ms = 0
        self._next_log_ms = 0
        self._last_request_ms = 0
        self._last_answer_ms = 0
        self._arrived_at_ms = 0

    # -- power ---------------------------------------------------------------------------------------------

    def switch_on(self, now_ms: int, robot_id: Optional[int] = None) -> None:
        """Boot at now_ms, as robot robot_id if that is given (a robot whose flash was erased)."""
        if robot_id is not None:
            self.robot_id = robot_id
            self.name = "hero_%d" % robot_id
        self.switch_off()
        self.body.booted_ms = now_ms
        self._phase = self._connect_first
        self.due_ms = now_ms + BOOT_MS

    def switch_off(self) -> None:
        """Cut the power; the caller cuts the radio's connection."""
        self._phase = None
        self.body.release()
        self._reset_memory()
        self.due_ms = NEVER_MS

    @property
    def is_on(self) -> bool:
        """Return whether the robot has power."""
        return self._phase is not None

    def freeze(self, now_ms: int, for_ms: int) -> None:
        """Block the program for for_ms: nothing is read, sent or watched, the motors keep their pulses."""
        self._blocked_until_ms = self.due_ms = now_ms + for_ms

    # -- radio ---------------------------------------------------------------------------------------------

    def connection_made(self, now_ms: int) -> None:
        """The radio has a connection."""
        self.connected = True
        self._received.clear()
        self._pending.clear()
        self._end_connecting(now_ms)

    def connection_failed(self, now_ms: int) -> None:
        """No server answers; the next spin tries again."""
        self._end_connecting(now_ms)

    def _end_connecting(self, now_ms: int) -> None:
        self.wants_connection = False
        if self._phase == self._connect_first:
            self._begin_setup(now_ms)
        elif self._blocked_until_ms is not None:
            self._unblock(now_ms)

    def connection_lost(self) -> None:
        """The connection ended; the firmware notices in its next spin."""
        self.connected = False

    def receive_bytes(self, now_ms: int, data: bytes) -> None:
        """Put bytes into the radio's buffer; the next spin reads them."""
        if not self._received:
            self._arrived_at_ms = now_ms
        self._received += data

    @property
    def received_length(self) -> int:
        """Number of bytes in the radio's buffer."""
        return len(self._received)

    def block_writing(self, now_ms: int) -> None:
        """The radio accepts no more bytes: the whole loop blocks until it does, or 5 s."""
        if self._blocked_until_ms is None and self._phase == self._run_loop:
            self.freeze(now_ms, CONNECT_TIMEOUT_MS)

    def unblock_writing(self, now_ms: int) -> None:
        """The radio accepts bytes again."""
        if self._blocked_until_ms is not None and not self.wants_connection:
            self._unblock(now_ms)

    def _unblock(self, now_ms: int) -> None:
        self._blocked_until_ms = None
        self.due_ms = now_ms

    def send(self, data: bytes) -> None:
        """Hand packets to the radio; without a connection they are lost."""
        if self.connected:
            self.outbox.append(data)

    def log(self, text: str) -> None:
        """Send a log line (level info, as all of the firmware's are)."""
        line = payloads.encode_log(payloads.Log(payloads.LOG_INFO, text))
        self.send(packets.encode_packet(packets.ID_LOG, line))

    def warn(self, text: str) -> None:
        """Report a line to users, not to the server."""
        self._report(f"{self.name}: {text}")

    # -- time passes ---------------------------------------------------------------------------------------

    def run(self, now_ms: int) -> None:
        """Do everything that is due at now_ms, and set due_ms."""
        if self._phase is None:
            self.due_ms = NEVER_MS
            return
        if self._blocked_until_ms is not None:
            if now_ms < self._blocked_until_ms:
                self.due_ms = self._blocked_until_ms
                return
            self._blocked_until_ms = None
            self.wants_connection = False
        self._phase(now_ms)

    def _connect_first(self, now_ms: int) -> None:
        timeout_at_ms = self.body.booted_ms + BOOT_MS + CONNECT_TIMEOUT_MS
        if not self.connected and not self.wants_connection and now_ms < timeout_at_ms:
            self.sensing.show_searching()
            self.wants_connection = True
            self.due_ms = timeout_at_ms
        else:
            self.wants_connection = False
            self._begin_setup(now_ms)

    def _begin_setup(self, now_ms: int) -> None:
        """Go on with setup() after the attempt to connect (ROSHandle.ino:92-94, firmware.ino:114-140)."""
        self._phase = self._run_setup
        self.log(f"\x1b[94m[/{self.name}] {self.model.versions} | IP: {self._address}{self.world} \x1b[0m")
        # The first spin comes before anything is advertised; a request that is in by then meets no topics.
        first_spin_ms = now_ms + int(self.rng.randint(0, 3))
        self._setup = [
            (first_spin_ms, self._spin_before_advertising),
            (now_ms + IMU_LOG_MS, self._log_imu),
            (now_ms + WELCOME_MS, self._enter_loop),
        ]
        self.due_ms = max(first_spin_ms, now_ms + 1)

    def _run_setup(self, now_ms: int) -> None:
        while self._setup and self._setup[0][0] <= now_ms:
            self._setup.pop(0)[1](now_ms)
        if self._setup:
            self.due_ms = self._setup[0][0]

    def _spin_before_advertising(self, now_ms: int) -> None:
        if self.connected:
            self._spinning = True
            self._begin_reading()
            self._read_packets(now_ms)

    def _log_imu(self, now_ms: int) -> None:
        del now_ms
        self._advertised = True
        if self.model.is_plus:
            self.log(f"\x1b[92m[{self.name}] TOF sensor initialized!\x1b[0m")
        elif self._has_imu_hat:
            self.log(f"\x1b[92m[{self.name}] IMU hat detected!\x1b[0m")
        else:
            self.log(f"\x1b[91m[{self.name}] IMU is not working or not connected! Error: 1\x1b[0m")

    def _enter_loop(self, now_ms: int) -> None:
        self._phase = self._run_loop
        self._next_spin_ms = self._next_log_ms = now_ms
        self.sensing.begin(self.to_millis(now_ms))
        self._run_loop(now_ms)

    def to_millis(self, now_ms: int) -> int:
        """Return the robot's own count at now_ms, from power-on."""
        return now_ms - self.body.booted_ms

    def _run_loop(self, now_ms: int) -> None:
        """Run one pass of loop() (firmware.ino:160-190), or continue a spin that blocks it."""
        millis = self.to_millis(now_ms)
        if not self._spinning:
            if now_ms >= self._next_log_ms:
                self.log("\x1b[96m[/%s] Conected at time %d\x1b[0m" % (self.name, millis))
                self._next_log_ms = now_ms + (LOG_MS if self.configured else UNCONFIGURED_LOG_MS)
            if self.configured and not self._is_held:
                self._run_configured(millis)
                self._is_held = self._hold(now_ms)
                if self._is_held:
                    return
            # A controller that is due comes first, also after the loop was blocked, but only once in a pass.
            if now_ms >= self._next_spin_ms and (self._is_held or not self._is_controller_due(millis)):
                self._begin_spin(now_ms)
            self._is_held = False
        if self._spinning:
            self._read_packets(now_ms)
        if self._spinning or self._blocked_until_ms is not None:
            return
        self._send_answers(now_ms)
        self.due_ms = max(self._find_due(), now_ms + 1)

    def _find_due(self) -> int:
        due_ms = min(self._next_log_ms, self._next_spin_ms)
        if self.configured:
            own_due_ms = min(self.sensing.due_ms, self.sensing.distance_due_ms, self.motors.due_ms)
            due_ms = min(due_ms, self.body.booted_ms + own_due_ms)
        return min(due_ms, self._answers[0][0]) if self._answers else due_ms

    def _is_controller_due(self, millis: int) -> bool:
        return self.configured and millis >= self.motors.due_ms

    def _run_configured(self, millis: int) -> None:
        """Run sensors and controllers."""
        if millis >= self.sensing.due_ms:
            # Sending a cycle takes about a millisecond; a controller that is due waits for it.
            self.send(self.sensing.run_cycle(millis, self.clock.stamp(millis)))
        elif millis >= self.sensing.distance_due_ms:
            self.send(self.sensing.measure_distance(millis))
        elif self._is_controller_due(millis):
            self.motors.run(millis)

    # -- conversation --------------------------------------------------------------------------------------

    def _begin_spin(self, now_ms: int) -> None:
        """Begin NodeHandle::spinOnce(), which lasts until all packets of the window are handled."""
        self._spinning = True
        if self.configured and self.to_millis(now_ms) - self._last_answer_ms > TIME_LOST_MS:
            self._unconfigure()
        if self.connected:
            self._begin_reading()
        else:
            # Each attempt to read connects anew (ArduinoTcpHardware.h:99-108).
            self._pending.clear()
            self.wants_connection = True
            self.freeze(now_ms, CONNECT_TIMEOUT_MS)

    def _begin_reading(self) -> None:
        """Take the packets from the receive window."""
        if self._received:
            # A new reader each time: the firmware forgets a packet that is not complete after 20 ms
            # (SERIAL_MSG_TIMEOUT, node_handle.h:96), and looks again only after 51 or 101 ms.
            reader = packets.PacketReader(packets.MAX_PAYLOAD_LENGTH)
            self._pending.extend(reader.receive_bytes(bytes(self._received[:RECEIVE_WINDOW_LENGTH])))
            del self._received[:RECEIVE_WINDOW_LENGTH]

    def _read_packets(self, now_ms: int) -> None:
        """Handle packets until they have blocked the loop for a millisecond; the spin continues after that time."""
        millis = self.to_millis(now_ms)
        while self._pending:
            if not self._receive_packet(self._pending.popleft(), millis, now_ms):
                # After a request for topics spinOnce() returns; the others wait for the next one.
                break
            if self._hold(now_ms):
                return
        self._spinning = False
        self._next_spin_ms = now_ms + (SPIN_MS if self.configured else UNCONFIGURED_SPIN_MS)
        if self.configured and millis - self._last_request_ms > TIME_REQUEST_MS:
            self._request_time(millis)

    def _hold(self, now_ms: int) -> bool:
        """Return whether the loop continues later, at due_ms, because a call has taken a millisecond or more."""
        self._blocked_us += self.motors.motors.held_us
        self.motors.motors.held_us = 0
        blocked_ms, self._blocked_us = divmod(self._blocked_us, 1000)
        if blocked_ms:
            self.due_ms = now_ms + blocked_ms
        return blocked_ms > 0

    def _receive_packet(self, packet: packets.Packet, millis: int, now_ms: int) -> bool:
        """Handle one packet; return whether the firmware keeps reading."""
        topic_id = packet.topic_id
        if topic_id == packets.ID_PUBLISHER:
            self._answer_topics(millis)
            return False
        if len(packet.payload) > declarations.BUFFER_LENGTH:
            self.crash_reason = f"a payload of {len(packet.payload)} bytes for its buffer of 4096"
            return False
        if topic_id == packets.ID_TIME:
            self._receive_time(packet.payload, millis)
        elif topic_id == packets.ID_TX_STOP:
            self._unconfigure()
        elif packets.FIRST_TOPIC_ID <= topic_id < declarations.FIRST_SENT_ID:
            self._receive_command(packet, millis, now_ms)
        elif topic_id != packets.ID_PARAMETER_REQUEST:  # answers for parameters, which this firmware ignores
            self.crash_reason = "id %d, which is outside its table of subscribers" % topic_id
            return False
        return True

    def _receive_command(self, packet: packets.Packet, millis: int, now_ms: int) -> None:
        try:
            answer = self._commands.receive(packet, millis)
            self._blocked_us += self._commands.blocked_us
        except CommandError as error:
            self.warn(str(error))
            return
        # Without a configured link the callback runs, but its answer is not sent (node_handle.h:478).
        if answer is not None and self.configured:
            wait_ms = int(self.rng.randint(ANSWER_MS[0], ANSWER_MS[1] + 1)) + self.answer_delay_ms
            self._answers.append((max(self._arrived_at_ms + wait_ms, now_ms), answer))

    def _send_answers(self, now_ms: int) -> None:
        while self._answers and self._answers[0][0] <= now_ms:
            answer = self._answers.pop(0)[1]
            if self.configured:
                self.send(answer)

    def _answer_topics(self, millis: int) -> None:
        self._request_time(millis)
        if self._advertised and not self.zero_topics_next:
            self.send(self._declarations)
        self.zero_topics_next = False
        self.configured = True
        self._last_answer_ms = millis

    def _request_time(self, millis: int) -> None:
        self.send(_TIME_REQUEST)
        self._last_request_ms = millis

    def _receive_time(self, payload: bytes, millis: int) -> None:
        try:
            self.clock.receive_answer(payloads.decode_time(payload), self._last_request_ms)
        except payloads.PayloadError as error:
            self.warn(str(error))
            return
        self._last_answer_ms = millis

    def _unconfigure(self) -> None:
        """Stop streaming; loop() no longer calls the controllers, so a moving robot moves on."""
        self.configured = False
