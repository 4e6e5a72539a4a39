"""Corrects the odometry of one robot: odom and its transform from wheel ticks, in the order of the robot's bursts.

In one burst the robot sends odom, tf and then the encoder reading that belongs to them, so odom and its transform wait
for the reading. Where none follows, because it was lost or because another firmware has another order, nothing waits
for longer than until the next odom. Pure.
"""

from typing import Any, Callable, List, Optional, Protocol, Tuple

from hero_node import Pose
from hero_node.ros_messages import encode_pose

from . import message_layouts
from .correction_settings import CorrectionSettings
from .stamps import MAX_AGE_NS, NS_PER_S, StampFilter
from .tick_odometry import TickOdometry, WheelGeometry
from .transforms import AddTransform, Refuse
from .wheel_motion import WheelMotion

WAITING_MAX = 8
"""Messages that may wait for the encoder reading of their own burst; a burst has two."""

BURST_NS = 10 * 10**6
"""Stamps of one burst lie closer together than this, those of two bursts are 34 ms apart."""


class Sink(Protocol):
    """Receiver of the messages of one topic."""

    @property
    def is_wanted(self) -> bool:
        """Return whether there are subscribers."""

    def publish(self, payload: bytes) -> None:
        """Send payload to all subscribers."""


class OdometryCorrector:
    """The odometry of one robot, kept over its reconnects: `ticks`, its tick odometry, and `wheels`, their motion."""

    def __init__(
        self,
        settings: CorrectionSettings,
        geometry: WheelGeometry,
        stamps: StampFilter,
        add_transform: AddTransform,
        refuse: Refuse,
    ) -> None:
        """Correct by settings, with wheels of this geometry.

        stamps correct the times of all of the robot's messages; add_transform() takes the transform from odom to
        base_link, refuse() what cannot be used.
        """
        self.ticks = TickOdometry(geometry)
        self._stamps = stamps
        self._add_transform = add_transform
        self._refuse = refuse
        self._writer = message_layouts.OdometryWriter(settings.pose_covariance, settings.twist_covariance)
        self._packed_pose = self._pack_pose()
        self.restart(False, WheelMotion())

    def restart(self, rebooted: bool, wheels: WheelMotion) -> None:
        """Begin a new connection, after a reboot with counters that begin anew; wheels are told of all its readings."""
        self.wheels = wheels
        self._is_read: Optional[bool] = None  # the encoder, on this connection; None before it is declared
        self._encoder_stamp_ns = self._odom_stamp_ns = -BURST_NS
        self._reading_follows = True  # in a burst, behind odom
        self._waiting: List[Tuple[Callable[..., None], Tuple[Any, ...]]] = []  # what writes messages, its arguments
        if rebooted:
            self.note_reboot()

    def note_reboot(self) -> None:
        """The robot's counters begin anew; the pose stays."""
        self.ticks.expect_reset()
        self.wheels.forget_ticks()

    def start_at_zero(self) -> None:
        """The robot boots in another world: its odometry begins at zero."""
        self.set_pose(Pose(0.0, 0.0, 0.0))
        self.note_reboot()

    def set_pose(self, pose: Pose) -> None:
        """The robot's odometry was set, which zeroes its counters."""
        self.ticks.set_pose(pose)
        self.wheels.forget_ticks()
        self._packed_pose = self._pack_pose()

    def expect_readings(self) -> None:
        """The robot has declared its encoder."""
        self._is_read = False

    def receive_odometry(self, name: str, sink: Sink, payload: bytes, stamp_ns: int, arrival_ns: int) -> None:
        """Take the robot's own odometry, which begins with a header of this stamp; sink takes the corrected one."""
        corrected_ns = self._stamps.correct(name, stamp_ns, arrival_ns)
        if self._is_read is None:
            velocity = message_layouts.read_odometry_velocity(payload)
            if velocity is not None:
                self.wheels.read_velocity(*velocity)
        else:
            if self._waiting:
                self._release()
                self._reading_follows = False
            self._odom_stamp_ns = stamp_ns
            if self._reading_follows and abs(stamp_ns - self._encoder_stamp_ns) > BURST_NS:
                self._waiting.append((self._write_odometry, (name, sink, corrected_ns, payload)))
                return
        self._write_odometry(name, sink, corrected_ns, payload)

    def receive_transform(self, head: bytes, tail: bytes) -> None:
        """Take the robot's own transform from odom to base_link, in two parts: see TakeOdomTransform."""
        if not self._waiting:
            self._write_transform(head, tail)
        elif len(self._waiting) < WAITING_MAX:
            self._waiting.append((self._write_transform, (head, tail)))
        else:
            self._refuse("tf", "")

    def receive_encoder(self, payload: bytes, arrival_ns: int) -> Optional[int]:
        """Take a reading of the encoder; return its stamp (ns), None if it is none."""
        reading = message_layouts.read_encoder(payload)
        if reading is None:
            self._refuse("encoder", f"{len(payload)} bytes")
            return None
        stamp_ns, left_ticks, right_ticks = reading
        self.wheels.read_ticks(left_ticks, right_ticks)
        self._encoder_stamp_ns = stamp_ns
        self._reading_follows = abs(stamp_ns - self._odom_stamp_ns) <= BURST_NS
        if not self._is_read:
            # The boot line may have gone down another connection, which never said who it was.
            counts_from_boot = abs(arrival_ns - stamp_ns) > MAX_AGE_NS
            if counts_from_boot or self.ticks.looks_reset(left_ticks, right_ticks):
                self.note_reboot()
        self._is_read = True
        if self.ticks.integrate(left_ticks, right_ticks, stamp_ns / NS_PER_S):
            # One pose goes out twice, as odometry and as a transform.
            self._packed_pose = self._pack_pose()
        if self._waiting:
            self._release()
        return stamp_ns

    def _release(self) -> None:
        waiting, self._waiting = self._waiting, []
        for write, arguments in waiting:
            write(*arguments)

    def _pack_pose(self) -> bytes:
        return encode_pose(self.ticks.x_m, self.ticks.y_m, self.ticks.yaw_rad)

    def _write_odometry(self, name: str, sink: Sink, stamp_ns: int, payload: bytes) -> None:
        ticks, estimate = self.ticks, None
        if ticks.has_reading and self._is_read is not None:
            estimate = self._packed_pose, ticks.linear_m_s, ticks.angular_rad_s
        written = self._writer.rewrite(payload, self._stamps.count(name), stamp_ns, estimate)
        if written is None:
            self._refuse("odom", message_layouts.describe_odometry(payload))
        else:
            sink.publish(written)

    def _write_transform(self, head: bytes, tail: bytes) -> None:
        if self.ticks.has_reading and self._is_read is not None:
            self._add_transform(head + self._packed_pose)
            return
        fault = message_layouts.find_transform_fault(tail)
        if fault:
            self._refuse("tf", fault)
        else:
            self._add_transform(head + tail)
