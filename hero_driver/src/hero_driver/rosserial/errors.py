"""The exceptions of the rosserial core: mistakes of ours. What a peer does wrong is an event or a counter."""


class RosserialError(ValueError):
    """Something cannot be encoded, or must not be sent to this peer; the text says why."""


class PayloadError(RosserialError):
    """Bytes are not a payload of the kind that they were read as."""
