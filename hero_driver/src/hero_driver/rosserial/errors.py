"""The exceptions of the rosserial core: all of them are mistakes of ours, never of the peer.

What a peer does wrong is an event or a counter (see packets.PacketReader and session.Session); decoding
functions raise PayloadError so that the session can turn it into such an event.
"""


class RosserialError(ValueError):
    """Something cannot be encoded, or must not be sent to this peer; the text says why."""


class PayloadError(RosserialError):
    """Bytes are not a payload of the kind that they were read as."""
