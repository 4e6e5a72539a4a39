"""Corrects the messages of one robot, from payloads to payloads; topics that are not in ROUTES pass unchanged.

HeRo+ (github.com/varunraveendra/hero_plus) has encoders on the wheels instead of the gears, and an Encoder message with
one field more, which tells it from stock robots: its firmware logs the version of the stock one.
"""

import collections
import functools
from typing import Callable, Deque, Dict, NamedTuple, Optional, Sequence, Tuple

from hero_node.files import HERO_PLUS, STOCK
from hero_node.robot_constants import SCAN_TIME_S
from hero_node.ros_messages import PLUS_ENCODER_MD5

from . import message_layouts
from .correction_settings import CorrectionSettings
from .odometry_corrections import OdometryCorrector, Sink
from .stamps import NS_PER_S, StampFilter
from .tick_odometry import WheelGeometry
from .transforms import AddTransform, TransformCorrector

TRANSFORMS = "/tf"
"""Name under which single transforms are returned; they are collected over all robots."""

OFFSET_MAX_S = 86400.0
"""A clock that is further off is shown as that far off: a robot may stamp what it likes."""

OFFSET_SAMPLES = 64
"""Stamps over which the clock offset is a median: about two seconds of odometry."""

Handler = Callable[[bytes, int], None]
"""Takes a payload and its arrival (ns)."""

TypedTopic = Tuple[str, str]
"""Name and type of a topic."""


class RobotCorrections:
    """The data of one robot, kept over its reconnects.

    Attributes:
        refused: messages and transforms that could not be used.
        model: by its newest Encoder declaration; STOCK before that.
    """

    def __init__(self, namespace: str, settings: CorrectionSettings, add_transform: AddTransform) -> None:
        """Correct the messages of the robot in namespace; add_transform takes the transforms of all robots."""
        self._namespace = namespace
        self._settings = settings
        self._offsets_ns: Deque[int] = collections.deque(maxlen=OFFSET_SAMPLES)
        self.refused = 0
        self._problem = ""
        self.model = STOCK
        self._has_encoder = False
        self.stamps = StampFilter()
        self.odometry = OdometryCorrector(settings, self._find_wheels(), self.stamps, add_transform, self._refuse)
        self.transforms = TransformCorrector(
            namespace, self.stamps, add_transform, self.odometry.receive_transform, self._refuse
        )

    @property
    def clock_offset_s(self) -> float:
        """Median of stamp minus arrival; 0 while nothing came. Positive: the robot's clock is ahead."""
        if not self._offsets_ns:
            return 0.0
        offset_s = sorted(self._offsets_ns)[len(self._offsets_ns) // 2] / NS_PER_S
        return max(-OFFSET_MAX_S, min(OFFSET_MAX_S, offset_s))

    @property
    def calibration_problem(self) -> str:
        """Reason why the robot's calibration file is not used, for users; empty: none."""
        problem = self._settings.calibration_problems.get(self._namespace.strip("/"), "")
        return problem and f"not calibrated: {problem}, then restart the driver"

    def take_problem(self) -> str:
        """Return what was wrong with a message since the last call, with a remedy, for users; empty: nothing."""
        ticks = self.odometry.ticks
        problem, self._problem, ticks.fault = self._problem or ticks.fault, "", ""
        return problem

    def _refuse(self, topic: str, what: str) -> None:
        self.refused += 1
        if what:
            self._problem = f"{topic} refused, it cannot be true ({what}): reboot the robot, or flash its firmware"

    def note_encoder(self, md5sum: str) -> str:
        """The robot declares an Encoder message of this md5; return what contradicts its model, for users, or ""."""
        former, self.model = self.model, HERO_PLUS if md5sum == PLUS_ENCODER_MD5 else STOCK
        had_encoder, self._has_encoder = self._has_encoder, True
        self.odometry.ticks.change_wheels(self._find_wheels())
        if had_encoder and former != self.model:
            text = "it was a %s and is a %s now, by whose wheels its odometry goes on: two robots need two ids"
            return text % (former, self.model)
        own = self._settings.own_wheels.get(self._namespace.strip("/"))
        calibrated = "" if own is None else own.others.get("model", "")
        if calibrated in ("", self.model):
            return ""
        text = "it is a %s, but its calibration file says %s, whose wheels are not used: calibrate it again"
        return text % (self.model, calibrated)

    def _find_wheels(self) -> WheelGeometry:
        return self._settings.find_geometry(self._namespace.strip("/"), self.model)

    def list_outputs(self, name: str, message_type: str) -> Sequence[TypedTopic]:
        """Return the topics that the messages of the topic called name become; none for TRANSFORMS."""
        if name == TRANSFORMS:
            return ()
        derived = self._find_route(name, message_type).derived
        return ((name, message_type), *((self._namespace + suffix, its_type) for suffix, its_type in derived))

    def handler_for(self, name: str, message_type: str, sinks: Sequence[Sink]) -> Handler:
        """Return what takes the payloads of the topic called name; sinks: of list_outputs()."""
        if name == TRANSFORMS:
            return self.transforms.correct
        correct = self._find_route(name, message_type).correct
        if correct is RobotCorrections._correct_encoder:
            self.odometry.expect_readings()
        return functools.partial(correct, self, name, *sinks)

    def _find_route(self, name: str, message_type: str) -> "Route":
        return ROUTES.get((name[len(self._namespace) :], message_type), UNCHANGED)

    def _correct_stamped(self, name: str, sink: Sink, payload: bytes, arrival_ns: int) -> None:
        stamp_ns = message_layouts.read_stamp_ns(payload)
        if stamp_ns is None:
            self._refuse(name[len(self._namespace) + 1 :], f"{len(payload)} bytes")
            return
        self._restamp(name, sink, payload, stamp_ns, arrival_ns)

    def _restamp(self, name: str, sink: Sink, payload: bytes, stamp_ns: int, arrival_ns: int) -> None:
        stamp_ns = self.stamps.correct(name, stamp_ns, arrival_ns)
        sink.publish(message_layouts.restamp(payload, self.stamps.count(name), stamp_ns))

    def _correct_laser(self, name: str, sink: Sink, proximity_sink: Sink, payload: bytes, arrival_ns: int) -> None:
        stamp_ns = message_layouts.read_stamp_ns(payload)
        if stamp_ns is None:
            self._refuse(name, "")
            return
        sink.publish(payload)
        if proximity_sink.is_wanted:
            stamp_ns = self.stamps.correct(name, stamp_ns, arrival_ns)
            count = self.stamps.count(name)
            self._publish_derived(proximity_sink, message_layouts.make_proximity(payload, count, stamp_ns, SCAN_TIME_S))

    def _add_range(self, name: str, sink: Sink, range_sink: Sink, payload: bytes, arrival_ns: int) -> None:
        sink.publish(payload)
        if range_sink.is_wanted:
            # The sensor is on the hat, whose place the robot sends on /tf.
            frame_id = self._namespace.strip("/") + "/hat_link"
            count = self.stamps.count(name)
            self._publish_derived(range_sink, message_layouts.make_range(payload, count, arrival_ns, frame_id))

    def _publish_derived(self, sink: Sink, message: Optional[bytes]) -> None:
        if message is None:
            self._refuse("", "")
        else:
            sink.publish(message)

    def _correct_odometry(self, name: str, sink: Sink, raw_sink: Sink, payload: bytes, arrival_ns: int) -> None:
        stamp_ns = message_layouts.read_stamp_ns(payload)
        if stamp_ns is None:
            self._refuse("odom", message_layouts.describe_odometry(payload))
            return
        self._offsets_ns.append(stamp_ns - arrival_ns)
        raw_sink.publish(payload)
        self.odometry.receive_odometry(name, sink, payload, stamp_ns, arrival_ns)

    def _correct_encoder(self, name: str, sink: Sink, payload: bytes, arrival_ns: int) -> None:
        stamp_ns = self.odometry.receive_encoder(payload, arrival_ns)
        if stamp_ns is not None and sink.is_wanted:
            self._restamp(name, sink, payload, stamp_ns, arrival_ns)


class Route(NamedTuple):
    """Way of the messages of a topic, and the topics that are derived from them, below the robot's namespace."""

    correct: Callable[..., None]
    derived: Tuple[TypedTopic, ...] = ()


UNCHANGED = Route(lambda corrections, name, sink, payload, arrival_ns: sink.publish(payload))

ROUTES: Dict[TypedTopic, Route] = {
    ("/odom", "nav_msgs/Odometry"): Route(RobotCorrections._correct_odometry, (("/odom_raw", "nav_msgs/Odometry"),)),
    ("/encoder", "hero_msgs/Encoder"): Route(RobotCorrections._correct_encoder),
    ("/laser", "sensor_msgs/LaserScan"): Route(
        RobotCorrections._correct_laser, (("/proximity", "sensor_msgs/LaserScan"),)
    ),
    ("/distance", "std_msgs/Float32"): Route(RobotCorrections._add_range, (("/range", "sensor_msgs/Range"),)),
    ("/imu", "sensor_msgs/Imu"): Route(RobotCorrections._correct_stamped),
}
"""By topic below the robot's namespace, and its type."""
