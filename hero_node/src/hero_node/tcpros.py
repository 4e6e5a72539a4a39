"""Messages in a TCPROS stream, each behind its length. Pure."""

from typing import Iterator, Tuple, Union

from .ros_messages import LENGTH


class TooLongError(ValueError):
    """A length that no message has: the other end does not speak TCPROS."""


def find_messages(data: Union[bytes, bytearray], length_max: int) -> Iterator[Tuple[int, int]]:
    """Yield the start and end of each complete message. Raises: TooLongError behind the messages before it."""
    end, data_length, prefix_length = 0, len(data), LENGTH.size
    while data_length - end >= prefix_length:
        length: int = LENGTH.unpack_from(data, end)[0]
        if length > length_max:
            raise TooLongError("a message of %d bytes; at most %d are accepted" % (length, length_max))
        start = end + prefix_length
        end = start + length
        if end > data_length:
            return
        yield start, end
