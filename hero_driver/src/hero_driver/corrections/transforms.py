"""Keeps the transforms of a robot's own frames and corrects their stamps: tf2_msgs/TFMessage in, single ones out."""

import re
from typing import Callable, Dict, Set

from hero_node.ros_messages import encode_text

from . import message_layouts
from .message_layouts import TRANSFORM, TRANSFORM_FRAMES, TRANSFORM_HEAD, TRANSFORM_START, TRANSFORM_TAIL
from .stamps import NS_PER_S, StampFilter

FRAMES_MAX = 32
"""Pairs of frames that one robot may use; stock robots have five."""

FRAME_NAME_LENGTH_MAX = 128
"""Length limit of a frame's name, bytes; stock robots' have below 40."""

FRAME_NAME_SHOWN = 60
"""Characters of a refused frame's name that reports show, of up to 4 kB."""

_FRAME_NAME = re.compile(rb"[A-Za-z0-9_/.-]+")

AddTransform = Callable[[bytes], None]
"""Takes the bytes of one geometry_msgs/TransformStamped."""

Refuse = Callable[[str, str], None]
"""Takes a topic whose message cannot be used, and what cannot be true of it, for users; empty: nothing to be said."""

TakeOdomTransform = Callable[[bytes, bytes], None]
"""Takes the transform from odom to base_link in two parts: seq, stamp and frames; translation and rotation."""


class TransformCorrector:
    """The transforms of one robot, kept over its reconnects; foreign_frames: refused ones, for the report."""

    def __init__(
        self,
        namespace: str,
        stamps: StampFilter,
        add_transform: AddTransform,
        take_odom_transform: TakeOdomTransform,
        refuse: Refuse,
    ) -> None:
        """Correct the transforms of the robot in namespace; take_odom_transform() takes the one of its odometry."""
        self.foreign_frames: Set[str] = set()
        self._stamps = stamps
        self._add_transform = add_transform
        self._take_odom_transform = take_odom_transform
        self._refuse = refuse
        prefix = namespace.lstrip("/") + "/"
        self._frame_prefix = prefix.encode()
        self._odom_frames = encode_text(prefix + "odom") + encode_text(prefix + "base_link")
        self._last_ns = stamps.last_ns
        self._passed_start = b""  # of the message whose stamp passed last
        self._passed_ns = self._passed_arrival_ns = 0
        self._own_frames: Set[bytes] = set()
        self._possible: Dict[bytes, bytes] = {}  # the newest tail that can be true, by frames

    def correct(self, payload: bytes, arrival_ns: int) -> None:
        """Take a tf2_msgs/TFMessage that came at arrival_ns; pass on its transforms, stamps corrected, or refuse it."""
        # Stock robots send one transform in a message, of frames that were seen before.
        frames = payload[TRANSFORM_FRAMES]
        last_ns = self._last_ns.get(frames)
        if last_ns is None:
            self._correct_unknown(payload, arrival_ns)
            return
        start = payload[TRANSFORM_START]
        if start == self._passed_start and arrival_ns == self._passed_arrival_ns and last_ns < self._passed_ns:
            # The transforms of a burst have one stamp, which was right for the first of them.
            self._last_ns[frames] = self._passed_ns
        else:
            count, _, secs, nsecs = message_layouts.read_transforms_start(payload)
            if count != 1:
                self._correct_unknown(payload, arrival_ns)
                return
            stamp_ns = secs * NS_PER_S + nsecs
            corrected_ns = self._stamps.correct(frames, stamp_ns, arrival_ns)
            if corrected_ns != stamp_ns or nsecs >= NS_PER_S:
                head = message_layouts.pack_transform_head(corrected_ns, frames)
                self._pass_on(frames, head, payload[TRANSFORM_TAIL])
                return
            self._passed_start, self._passed_ns, self._passed_arrival_ns = start, stamp_ns, arrival_ns
        if frames == self._odom_frames:
            self._take_odom_transform(payload[TRANSFORM_HEAD], payload[TRANSFORM_TAIL])
        elif self._possible.get(frames) == payload[TRANSFORM_TAIL]:
            # Most links of a robot never move, nor do its wheels at rest.
            self._add_transform(payload[TRANSFORM])
        else:
            self._add_possible(frames, payload[TRANSFORM], payload[TRANSFORM_TAIL])

    def _correct_unknown(self, payload: bytes, arrival_ns: int) -> None:
        transforms = message_layouts.read_transforms(payload)
        if transforms is None:
            self._refuse("tf", "")
            return
        for stamp_ns, frames, tail in transforms:
            if frames in self._own_frames or self._admit_frames(frames):
                corrected_ns = self._stamps.correct(frames, stamp_ns, arrival_ns)
                self._pass_on(frames, message_layouts.pack_transform_head(corrected_ns, frames), tail)

    def _pass_on(self, frames: bytes, head: bytes, tail: bytes) -> None:
        if frames == self._odom_frames:
            self._take_odom_transform(head, tail)
        else:
            self._add_possible(frames, head + tail, tail)

    def _add_possible(self, frames: bytes, transform: bytes, tail: bytes) -> None:
        fault = message_layouts.find_transform_fault(tail)
        if fault:
            self._refuse("tf", fault)
        else:
            self._possible[frames] = tail
            self._add_transform(transform)

    def _admit_frames(self, frames: bytes) -> bool:
        """Return whether the robot may send a pair of frames that is not known as its own."""
        parent, child = message_layouts.split_frames(frames)
        if self._is_own(parent) and self._is_own(child) and len(self._own_frames) < FRAMES_MAX:
            self._own_frames.add(frames)
            return True
        self._refuse("tf", "")
        if len(self.foreign_frames) < FRAMES_MAX:
            self.foreign_frames.add(f"{_show_name(parent)} -> {_show_name(child)}")
        return False

    def _is_own(self, name: bytes) -> bool:
        """Return whether a frame is the robot's own, with a name that every listener of /tf can read."""
        return (
            name.startswith(self._frame_prefix)
            and len(name) <= FRAME_NAME_LENGTH_MAX
            and _FRAME_NAME.fullmatch(name) is not None
        )


def _show_name(name: bytes) -> str:
    return ascii(name[:FRAME_NAME_SHOWN].decode("latin-1"))
