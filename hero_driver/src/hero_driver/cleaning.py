"""What one robot sends -> what ROS programs should get: corrected odometry, proximity, stamps, own transforms.

Takes payloads and times of arrival, gives payloads to the sinks of their topics; knows no ROS and no socket.
Everything that is not named here passes through untouched.
"""

import collections
import functools
import itertools
from dataclasses import dataclass
from typing import Any, Callable, DefaultDict, Deque, Dict, Iterator, List, Protocol, Set, Tuple

from . import wire_messages
from .odometry import Pose, TickOdometry, WheelGeometry
from .stamps import NS_PER_S, StampFilter

TRANSFORMS = "/tf"
"""Name under which single transforms are returned; they are collected over all robots."""

STOCK_SCAN_TIME_S = 0.2
"""The robot scans at 5 Hz (RangeSensor rate 5); it leaves scan_time zero."""

OFFSET_SAMPLES = 64
"""Stamps over which the clock offset is a median: about two seconds of odometry."""

HELD_MAX = 8
"""Messages that may wait for the encoder reading of their own burst; a burst has two."""

BURST_NS = 10 * 10**6
"""Stamps of one burst lie closer together than this, those of two bursts are 34 ms apart."""

FRAMES_MAX = 32
"""Pairs of frames that one robot may use; stock robots have five."""


class Sink(Protocol):
    """Where the messages of one topic go."""

    @property
    def is_wanted(self) -> bool:
        """Whether somebody listens."""

    def publish(self, payload: bytes) -> None:
        """Send payload to everybody who listens."""


FindSink = Callable[[str], Sink]
AddTransform = Callable[[bytes], None]
Clean = Callable[[bytes, int], None]
"""Takes a payload and its arrival (ns)."""


_Held = Tuple[Callable[[Any, bytes], None], Any, bytes]
"""Odometry, or its transform, that waits for the encoder reading of its burst: what writes it, and its arguments."""


@dataclass(frozen=True)
class CleaningSettings:
    """The parameters that matter here, as in config.DriverConfig."""

    odometry: str
    geometry: WheelGeometry
    pose_covariance: Tuple[float, ...]
    twist_covariance: Tuple[float, ...]
    stamps: str
    max_future_s: float
    max_age_s: float


class MessageCleaner:
    """The data of one robot; one per robot, kept over its reconnects.

    Attributes:
        odometry: the robot's tick odometry.
        refused: messages that could not be used.
        foreign_frames: transforms of frames that are not the robot's own, by name, for the report.
    """

    def __init__(
        self, namespace: str, settings: CleaningSettings, find_sink: FindSink, add_transform: AddTransform
    ) -> None:
        """Clean the data of the robot in namespace.

        find_sink(name) gives the sink of a topic that was chosen or derived; add_transform takes the bytes of
        one geometry_msgs/TransformStamped, whichever robot's.
        """
        self._find_sink = find_sink
        self._add_transform = add_transform
        self._namespace = namespace
        self._frame_prefix = namespace.lstrip("/").encode() + b"/"
        self._stamps = StampFilter(settings.stamps == "arrival", settings.max_future_s, settings.max_age_s)
        self._writer = wire_messages.OdometryWriter(settings.pose_covariance, settings.twist_covariance)
        self._uses_ticks = settings.odometry == "ticks"
        self._offsets_ns: Deque[int] = collections.deque(maxlen=OFFSET_SAMPLES)
        self._last_ns = self._stamps.last_ns
        self._seqs: DefaultDict[str, Iterator[int]] = collections.defaultdict(itertools.count)
        self._own_frames: Set[bytes] = set()
        self._known_foreign: Set[bytes] = set()
        self._passed_start = b""  # of the last transform whose stamp passed
        self._passed_ns = 0  # that stamp, 0 if none of this burst has passed yet
        self.odometry = TickOdometry(settings.geometry)
        self.refused = 0
        self.foreign_frames: Set[str] = set()
        self._packed_pose = self._pack_pose()
        self._uses_estimate = False
        self._odom_name = namespace + "/odom"
        self._odom_seqs = self._seqs[self._odom_name]
        self._odom_frames = wire_messages.join_frames(
            self._frame_prefix + b"odom", self._frame_prefix + b"base_link"
        )
        self._raw_name = namespace + "/odom_raw"
        self._proximity_name = namespace + "/proximity"
        self._odom_sink: Sink
        self._raw_sink: Sink
        self._has_encoder = False
        self._is_first_reading = True
        self._max_age_ns = int(settings.max_age_s * NS_PER_S)
        self._encoder_follows = True
        self._encoder_stamp_ns = -BURST_NS
        self._odom_stamp_ns = -BURST_NS
        self._held: List[_Held] = []

    def restart(self, rebooted: bool) -> None:
        """A new connection begins; after a reboot the robot's counters begin anew too."""
        self._has_encoder = self._uses_estimate = False
        self._is_first_reading = True
        self._encoder_stamp_ns = self._odom_stamp_ns = -BURST_NS
        self._encoder_follows = True
        self._held = []
        if rebooted:
            self.note_reboot()

    def note_reboot(self) -> None:
        """The robot's counters begin anew; the pose stays."""
        self.odometry.expect_reset()

    def set_pose(self, pose: Pose) -> None:
        """The robot's odometry was set, which zeroes its counters."""
        self.odometry.set_pose(pose)
        self._packed_pose = self._pack_pose()

    @property
    def clock_offset_s(self) -> float:
        """Median of stamp minus arrival; 0 while nothing came. Positive: the robot's clock is ahead."""
        if not self._offsets_ns:
            return 0.0
        return sorted(self._offsets_ns)[len(self._offsets_ns) // 2] / NS_PER_S

    @property
    def corrected_stamps(self) -> int:
        """Stamps that were replaced so far."""
        return self._stamps.corrected

    def find_derived(self, name: str, message_type: str) -> Dict[str, str]:
        """Return the topics, with types, that exist besides the one called name."""
        if name == self._odom_name and message_type == "nav_msgs/Odometry":
            return {self._raw_name: message_type}
        if name == self._namespace + "/laser" and message_type == "sensor_msgs/LaserScan":
            return {self._proximity_name: message_type}
        return {}

    def choose(self, name: str, message_type: str) -> Clean:
        """Return what takes the payloads of the topic called name."""
        if name == TRANSFORMS and message_type == "tf2_msgs/TFMessage":
            return self._clean_transforms
        sink = self._find_sink(name)
        if name == self._odom_name and message_type == "nav_msgs/Odometry":
            self._odom_sink, self._raw_sink = sink, self._find_sink(self._raw_name)
            return self._clean_odometry
        if name == self._namespace + "/encoder" and message_type == "hero_msgs/Encoder":
            self._has_encoder = self._uses_ticks
            self._uses_estimate = self._has_encoder and self.odometry.has_reading
            return functools.partial(self._clean_encoder, name, sink)
        if name == self._namespace + "/laser" and message_type == "sensor_msgs/LaserScan":
            return functools.partial(self._clean_laser, sink, self._find_sink(self._proximity_name))
        if name == self._namespace + "/imu" and message_type == "sensor_msgs/Imu":
            return functools.partial(self._clean_stamped, name, sink)
        return lambda payload, _: sink.publish(payload)

    def _clean_stamped(self, name: str, sink: Sink, payload: bytes, arrival_ns: int) -> None:
        stamp_ns = wire_messages.read_stamp_ns(payload)
        if stamp_ns is None:
            self.refused += 1
            return
        stamp_ns = self._stamps.correct(name, stamp_ns, arrival_ns)
        sink.publish(wire_messages.restamp(payload, next(self._seqs[name]), stamp_ns))

    def _clean_laser(self, sink: Sink, proximity_sink: Sink, payload: bytes, arrival_ns: int) -> None:
        stamp_ns = wire_messages.read_stamp_ns(payload)
        if stamp_ns is None:
            self.refused += 1
            return
        sink.publish(payload)
        if not proximity_sink.is_wanted:
            return
        name = self._proximity_name
        stamp_ns = self._stamps.correct(name, stamp_ns, arrival_ns)
        proximity = wire_messages.make_proximity(payload, next(self._seqs[name]), stamp_ns, STOCK_SCAN_TIME_S)
        if proximity is None:
            self.refused += 1
        else:
            proximity_sink.publish(proximity)

    # Odometry. In one burst the robot sends odom, tf and then the encoder reading that belongs to them, so
    # odom and its transform wait for the reading. Where none follows, because it was lost or because another
    # firmware has another order, nothing waits for longer than until the next odom.

    def _clean_odometry(self, payload: bytes, arrival_ns: int) -> None:
        stamp_ns = wire_messages.read_stamp_ns(payload)
        if stamp_ns is None:
            self.refused += 1
            return
        self._offsets_ns.append(stamp_ns - arrival_ns)
        self._passed_ns = 0  # another burst
        self._raw_sink.publish(payload)
        if self._has_encoder:
            if self._held:
                self._release()
                self._encoder_follows = False
            self._odom_stamp_ns = stamp_ns
            if self._encoder_follows and abs(stamp_ns - self._encoder_stamp_ns) > BURST_NS:
                corrected_ns = self._stamps.correct(self._odom_name, stamp_ns, arrival_ns)
                self._held.append((self._write_odometry, corrected_ns, payload))
                return
        self._write_odometry(self._stamps.correct(self._odom_name, stamp_ns, arrival_ns), payload)

    def _clean_encoder(self, name: str, sink: Sink, payload: bytes, arrival_ns: int) -> None:
        reading = wire_messages.read_encoder(payload)
        if reading is None:
            self.refused += 1
            return
        stamp_ns, left_ticks, right_ticks = reading
        self._encoder_stamp_ns = stamp_ns
        self._encoder_follows = abs(stamp_ns - self._odom_stamp_ns) <= BURST_NS
        if self._is_first_reading:
            # The boot line may have gone down another connection, which never said who it was.
            self._is_first_reading = False
            counts_from_boot = abs(arrival_ns - stamp_ns) > self._max_age_ns
            if counts_from_boot or self.odometry.looks_reset(left_ticks, right_ticks):
                self.note_reboot()
        if self.odometry.integrate(left_ticks, right_ticks, stamp_ns / NS_PER_S):
            # One pose goes out twice, as odometry and as a transform.
            self._packed_pose = self._pack_pose()
        self._uses_estimate = self._has_encoder and self.odometry.has_reading
        if sink.is_wanted:
            self._clean_stamped(name, sink, payload, arrival_ns)
        if self._held:
            self._release()

    def _release(self) -> None:
        held, self._held = self._held, []
        for write, start, data in held:
            write(start, data)

    def _pack_pose(self) -> bytes:
        return wire_messages.pack_pose(self.odometry.x_m, self.odometry.y_m, self.odometry.yaw_rad)

    def _write_odometry(self, stamp_ns: int, payload: bytes) -> None:
        odometry = self.odometry
        estimate = (
            (self._packed_pose, odometry.linear_m_s, odometry.turn_rad_s) if self._uses_estimate else None
        )
        written = self._writer.rewrite(payload, next(self._odom_seqs), stamp_ns, estimate)
        if written is None:
            self.refused += 1
        else:
            self._odom_sink.publish(written)

    def _write_odom_transform(self, head: bytes, tail: bytes) -> None:
        self._add_transform(head + (self._packed_pose if self._uses_estimate else tail))

    def _clean_transforms(self, payload: bytes, arrival_ns: int) -> None:
        # Stock robots send one transform in a message, of frames that were seen before.
        frames = payload[wire_messages.TRANSFORM_FRAMES]
        last_ns = self._last_ns.get(frames)
        if last_ns is None:
            self._clean_unknown_transforms(payload, arrival_ns)
            return
        # All transforms of a burst have one stamp: what passes for the first passes for the others too.
        if (
            last_ns < self._passed_ns
            and payload[wire_messages.TRANSFORM_START] == self._passed_start
            and frames != self._odom_frames
        ):
            self._last_ns[frames] = self._passed_ns
            self._add_transform(payload[wire_messages.TRANSFORM])
            return
        count, _, secs, nsecs = wire_messages.read_transforms_start(payload)
        if count != 1:
            self._clean_unknown_transforms(payload, arrival_ns)
            return
        stamp_ns = secs * NS_PER_S + nsecs
        corrected_ns = self._stamps.correct(frames, stamp_ns, arrival_ns)
        if corrected_ns == stamp_ns and nsecs < NS_PER_S:
            self._passed_start, self._passed_ns = payload[wire_messages.TRANSFORM_START], stamp_ns
            head = payload[wire_messages.TRANSFORM_HEAD]
        else:
            head = wire_messages.pack_transform_head(corrected_ns, frames)
        self._pass_transform(frames, head, payload[wire_messages.TRANSFORM_TAIL])

    def _clean_unknown_transforms(self, payload: bytes, arrival_ns: int) -> None:
        transforms = wire_messages.read_transforms(payload)
        if transforms is None:
            self.refused += 1
            return
        for stamp_ns, frames, tail in transforms:
            if frames in self._own_frames or self._admit_frames(frames):
                corrected_ns = self._stamps.correct(frames, stamp_ns, arrival_ns)
                self._pass_transform(frames, wire_messages.pack_transform_head(corrected_ns, frames), tail)

    def _pass_transform(self, frames: bytes, head: bytes, tail: bytes) -> None:
        if frames != self._odom_frames or not self._has_encoder:
            self._add_transform(head + tail)
        elif not self._held:
            self._write_odom_transform(head, tail)
        elif len(self._held) < HELD_MAX:
            self._held.append((self._write_odom_transform, head, tail))
        else:
            self.refused += 1

    def _admit_frames(self, frames: bytes) -> bool:
        """Return whether the robot may send a pair of frames that is not known as its own."""
        if frames in self._known_foreign:
            self.refused += 1
            return False
        parent, child = wire_messages.split_frames(frames)
        prefix = self._frame_prefix
        if (
            not parent.startswith(prefix)
            or not child.startswith(prefix)
            or len(self._own_frames) >= FRAMES_MAX
        ):
            self.refused += 1
            if len(self._known_foreign) < FRAMES_MAX:
                self._known_foreign.add(frames)
                self.foreign_frames.add(
                    "%s -> %s" % (ascii(parent.decode("latin-1")), ascii(child.decode("latin-1")))
                )
            return False
        self._own_frames.add(frames)
        return True


def split_transforms(payload: bytes) -> List[bytes]:
    """Return the transforms of a device that is no HeRo as they are; none if payload is no TFMessage."""
    transforms = wire_messages.read_transforms(payload) or []
    return [
        wire_messages.pack_transform_head(stamp_ns, frames) + tail for stamp_ns, frames, tail in transforms
    ]
