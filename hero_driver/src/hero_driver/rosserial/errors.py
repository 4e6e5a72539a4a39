"""The exceptions of the rosserial core: all of them are mistakes of ours, never of the peer.

What a peer does wrong is an event or a counter (see packets.PacketReader and session.Session); decoding
functions raise PayloadError so that the session can turn it into such an event.
"""


class RosserialError(Exception):
    """Base of everything that the rosserial core raises."""


class PacketTooLongError(RosserialError, ValueError):
    """A payload does not fit the length that a packet or the peer's buffer can hold."""


class TopicIdError(RosserialError, ValueError):
    """A topic id lies outside 0..65535, or this connection did not declare it."""


class PayloadError(RosserialError, ValueError):
    """Bytes are not a payload of the kind that they were read as."""
