"""Corrects the messages of one robot: odometry from ticks, proximity from its scan, ranges, stamps, transforms.

Takes payloads and times of arrival, and publishes payloads. Topics that are not named here pass unchanged.
"""

import collections
import functools
import itertools
from typing import Any, Callable, DefaultDict, Deque, Iterator, List, Protocol, Set, Tuple

from hero_node import Pose, encode_pose
from hero_node.files import HERO_PLUS

from ..robot_constants import SCAN_TIME_S
from . import message_layouts
from .correction_settings import CorrectionSettings
from .robot_models import PLUS_ENCODER_MD5, describe_conflict
from .stamps import NS_PER_S, StampFilter
from .tick_odometry import TickOdometry
from .transforms import AddTransform, TransformCorrector
from .wheel_motion import WheelMotion

TRANSFORMS = "/tf"
"""Name under which single transforms are returned; they are collected over all robots."""

OFFSET_MAX_S = 86400.0
"""A clock that is further off is shown as that far off: a robot may stamp what it likes."""

OFFSET_SAMPLES = 64
"""Stamps over which the clock offset is a median: about two seconds of odometry."""

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


class _NoSink:
    """Sink of odometry before it is declared."""

    is_wanted = False

    def publish(self, payload: bytes) -> None:
        """Drop payload."""


Handler = Callable[[bytes, int], None]
"""Takes a payload and its arrival (ns)."""


_Waiting = Tuple[Callable[[Any, bytes], None], Any, bytes]
"""Odometry, or its transform, that waits for the encoder reading of its burst: what writes it, and its arguments."""


class RobotCorrections:
    """The data of one robot; one per robot, kept over its reconnects.

    Attributes:
        model: of the robot, one of robot_models.
        odometry: the robot's tick odometry.
        stamps: the filter of all its stamps.
        transforms: the robot's transforms.
        wheels: whether its wheels turn.
    """

    def __init__(self, namespace: str, settings: CorrectionSettings, add_transform: AddTransform) -> None:
        """Correct the messages of the robot in namespace; add_transform takes the transforms of all robots."""
        self._add_transform = add_transform
        self._namespace = namespace
        self.stamps = StampFilter(settings.stamps == "arrival", settings.max_future_s, settings.max_age_s)
        self._writer = message_layouts.OdometryWriter(settings.pose_covariance, settings.twist_covariance)
        self._uses_ticks = settings.odometry == "ticks"
        self._offsets_ns: Deque[int] = collections.deque(maxlen=OFFSET_SAMPLES)
        self._seqs: DefaultDict[str, Iterator[int]] = collections.defaultdict(itertools.count)
        self.wheels = WheelMotion()
        self._settings = settings
        self.model = settings.find_model(namespace, "")
        self._models: Deque[str] = collections.deque(maxlen=2)  # by the newest Encoder declarations
        self._encoder_md5 = ""
        self._declared: Set[str] = set()
        self.odometry = TickOdometry(settings.find_geometry(namespace, self.model))
        self.transforms = TransformCorrector(namespace, self.stamps, self._add_possible, self._take_odom_transform)
        self._refused = 0
        self._problem = ""
        self._packed_pose = self._pack_pose()
        self._uses_estimate = False
        self._odom_name = namespace + "/odom"
        self._odom_seqs = self._seqs[self._odom_name]
        self._proximity_name = namespace + "/proximity"
        self._odom_sink: Sink = _NoSink()
        self._has_encoder = False
        self._hears_encoder = False
        self._is_first_reading = True
        self._max_age_ns = int(settings.max_age_s * NS_PER_S)
        self._encoder_follows = True
        self._encoder_stamp_ns = -BURST_NS
        self._odom_stamp_ns = -BURST_NS
        self._waiting: List[_Waiting] = []

    def restart(self, rebooted: bool, wheels: WheelMotion) -> None:
        """A new connection begins; after a reboot the robot's counters begin anew too.

        wheels is told of the encoder's readings, or of odometry where there is no encoder.
        """
        self.wheels = wheels
        self._has_encoder = self._uses_estimate = self._hears_encoder = False
        self._encoder_md5 = ""
        self._declared.clear()
        self._is_first_reading = True
        self._encoder_stamp_ns = self._odom_stamp_ns = -BURST_NS
        self._encoder_follows = True
        self._waiting = []
        if rebooted:
            self.note_reboot()

    def note_reboot(self) -> None:
        """The robot's counters begin anew; the pose stays."""
        self.odometry.expect_reset()
        self.wheels.forget_ticks()

    def restart_odometry(self) -> None:
        """The robot boots in another world: its odometry begins at zero."""
        self.set_pose(Pose(0.0, 0.0, 0.0))
        self.note_reboot()

    def set_pose(self, pose: Pose) -> None:
        """The robot's odometry was set, which zeroes its counters."""
        self.odometry.set_pose(pose)
        self.wheels.forget_ticks()
        self._packed_pose = self._pack_pose()

    @property
    def clock_offset_s(self) -> float:
        """Median of stamp minus arrival; 0 while nothing came. Positive: the robot's clock is ahead."""
        if not self._offsets_ns:
            return 0.0
        offset_s = sorted(self._offsets_ns)[len(self._offsets_ns) // 2] / NS_PER_S
        return max(-OFFSET_MAX_S, min(OFFSET_MAX_S, offset_s))

    @property
    def refused(self) -> int:
        """Messages and transforms that could not be used."""
        return self._refused + self.transforms.refused

    @property
    def calibration_problem(self) -> str:
        """Reason why the robot's calibration file is not used, for users; empty: none."""
        problem = self._settings.calibration_problems.get(self._namespace.strip("/"), "")
        return problem and f"not calibrated: {problem}, then restart the driver"

    def take_problem(self) -> str:
        """Return what was wrong with a message since the last call, with a remedy, for users; empty: nothing."""
        problem, self._problem = self._problem or self.odometry.fault, ""
        self.odometry.fault = ""
        return problem

    def _refuse(self, topic: str, what: str) -> None:
        self._refused += 1
        self._problem = f"{topic} refused, it cannot be true ({what}): reboot the robot, or flash its firmware"

    def note_encoder(self, md5sum: str) -> None:
        """The robot declares an Encoder message of this md5, which tells its model."""
        model = self._settings.find_model(self._namespace, md5sum)
        self._models.append(model)
        self._encoder_md5 = md5sum
        if model != self.model:
            self.model = model
            self.odometry.change_wheels(self._settings.find_geometry(self._namespace, model))

    def find_conflict(self, name: str) -> str:
        """The robot declares the topic called name; return what contradicts its model, for users; empty: nothing."""
        self._declared.add(name[len(self._namespace) :])
        if not self._encoder_md5:
            return ""
        own = self._settings.own_wheels.get(self._namespace.strip("/"))
        is_listed = self.model == HERO_PLUS and self._encoder_md5 != PLUS_ENCODER_MD5
        calibrated_model = "" if own is None else own.model
        return describe_conflict(self.model, self._models[0], calibrated_model, is_listed, self._declared)

    def handler_for(self, name: str, message_type: str, sink_for: Callable[[str, str], Sink]) -> Handler:
        """Return what takes the payloads of the topic called name.

        sink_for(name, type) returns the sink of a topic. It is asked for this topic and for the one derived from it, if
        there is one; not for TRANSFORMS.
        """
        if name == TRANSFORMS and message_type == "tf2_msgs/TFMessage":
            return self.transforms.correct
        sink = sink_for(name, message_type)
        if name == self._odom_name and message_type == "nav_msgs/Odometry":
            self._odom_sink = sink
            return functools.partial(self._correct_odometry, sink_for(self._namespace + "/odom_raw", message_type))
        if name == self._namespace + "/encoder" and message_type == "hero_msgs/Encoder":
            self._hears_encoder = True
            self._has_encoder = self._uses_ticks
            self._uses_estimate = self._has_encoder and self.odometry.has_reading
            return functools.partial(self._correct_encoder, name, sink)
        if name == self._namespace + "/laser" and message_type == "sensor_msgs/LaserScan":
            return functools.partial(self._correct_laser, sink, sink_for(self._proximity_name, message_type))
        if name == self._namespace + "/distance" and message_type == "std_msgs/Float32":
            return functools.partial(self._add_range, sink, sink_for(self._namespace + "/range", "sensor_msgs/Range"))
        if name == self._namespace + "/imu" and message_type == "sensor_msgs/Imu":
            return functools.partial(self._correct_stamped, name, sink)
        return lambda payload, _: sink.publish(payload)

    def _correct_stamped(self, name: str, sink: Sink, payload: bytes, arrival_ns: int) -> None:
        stamp_ns = message_layouts.read_stamp_ns(payload)
        if stamp_ns is None:
            self._refuse(name[len(self._namespace) + 1 :], f"{len(payload)} bytes")
            return
        stamp_ns = self.stamps.correct(name, stamp_ns, arrival_ns)
        sink.publish(message_layouts.restamp(payload, next(self._seqs[name]), stamp_ns))

    def _correct_laser(self, sink: Sink, proximity_sink: Sink, payload: bytes, arrival_ns: int) -> None:
        stamp_ns = message_layouts.read_stamp_ns(payload)
        if stamp_ns is None:
            self._refused += 1
            return
        sink.publish(payload)
        if not proximity_sink.is_wanted:
            return
        name = self._proximity_name
        stamp_ns = self.stamps.correct(name, stamp_ns, arrival_ns)
        proximity = message_layouts.make_proximity(payload, next(self._seqs[name]), stamp_ns, SCAN_TIME_S)
        if proximity is None:
            self._refused += 1
        else:
            proximity_sink.publish(proximity)

    def _add_range(self, sink: Sink, range_sink: Sink, payload: bytes, arrival_ns: int) -> None:
        sink.publish(payload)
        if not range_sink.is_wanted:
            return
        # The sensor is on the hat, whose place the robot sends on /tf.
        frame_id = self._namespace.strip("/") + "/hat_link"
        message = message_layouts.make_range(payload, next(self._seqs["range"]), arrival_ns, frame_id)
        if message is None:
            self._refused += 1
        else:
            range_sink.publish(message)

    # Odometry. In one burst the robot sends odom, tf and then the encoder reading that belongs to them, so
    # odom and its transform wait for the reading. Where none follows, because it was lost or because another
    # firmware has another order, nothing waits for longer than until the next odom.

    def _correct_odometry(self, raw_sink: Sink, payload: bytes, arrival_ns: int) -> None:
        stamp_ns = message_layouts.read_stamp_ns(payload)
        if stamp_ns is None:
            self._refuse("odom", message_layouts.describe_odometry(payload))
            return
        self._offsets_ns.append(stamp_ns - arrival_ns)
        raw_sink.publish(payload)
        if not self._hears_encoder:
            velocity = message_layouts.read_odometry_velocity(payload)
            if velocity is not None:
                self.wheels.read_velocity(*velocity)
        corrected_ns = self.stamps.correct(self._odom_name, stamp_ns, arrival_ns)
        if self._has_encoder:
            if self._waiting:
                self._release()
                self._encoder_follows = False
            self._odom_stamp_ns = stamp_ns
            if self._encoder_follows and abs(stamp_ns - self._encoder_stamp_ns) > BURST_NS:
                self._waiting.append((self._write_odometry, corrected_ns, payload))
                return
        self._write_odometry(corrected_ns, payload)

    def _correct_encoder(self, name: str, sink: Sink, payload: bytes, arrival_ns: int) -> None:
        reading = message_layouts.read_encoder(payload)
        if reading is None:
            self._refuse("encoder", f"{len(payload)} bytes")
            return
        stamp_ns, left_ticks, right_ticks = reading
        self.wheels.read_ticks(left_ticks, right_ticks)
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
            self._correct_stamped(name, sink, payload, arrival_ns)
        if self._waiting:
            self._release()

    def _release(self) -> None:
        waiting, self._waiting = self._waiting, []
        for write, start, data in waiting:
            write(start, data)

    def _pack_pose(self) -> bytes:
        return encode_pose(self.odometry.x_m, self.odometry.y_m, self.odometry.yaw_rad)

    def _write_odometry(self, stamp_ns: int, payload: bytes) -> None:
        odometry = self.odometry
        estimate = (self._packed_pose, odometry.linear_m_s, odometry.angular_rad_s) if self._uses_estimate else None
        written = self._writer.rewrite(payload, next(self._odom_seqs), stamp_ns, estimate)
        if written is None:
            self._refuse("odom", message_layouts.describe_odometry(payload))
        else:
            self._odom_sink.publish(written)

    def _take_odom_transform(self, head: bytes, tail: bytes) -> None:
        if not self._waiting:
            self._write_odom_transform(head, tail)
        elif len(self._waiting) < WAITING_MAX:
            self._waiting.append((self._write_odom_transform, head, tail))
        else:
            self._refused += 1

    def _write_odom_transform(self, head: bytes, tail: bytes) -> None:
        if self._uses_estimate:
            self._add_transform(head + self._packed_pose)
        else:
            self._add_possible(head + tail)

    def _add_possible(self, transform: bytes) -> None:
        fault = message_layouts.find_transform_fault(transform)
        if fault:
            self._refuse("tf", fault)
        else:
            self._add_transform(transform)
