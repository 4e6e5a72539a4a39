"""Reads a bag without ROS, with the package rosbags from PyPI."""

from contextlib import ExitStack
from pathlib import Path
from typing import Any, Dict, Iterator, List, Sequence, Tuple

from hero_node import import_optional

from .topics import Message, RawMessage


class Reader(ExitStack):
    """One open bag, with the interface of ros_reader's."""

    unindexed = ("ReaderError", "AnyReaderError")

    def __init__(self, path: str, skip_index: bool = False) -> None:
        """Open the file; the index is always read. Raises: ProgramError without rosbags; whatever rosbags raises."""
        super().__init__()
        del skip_index
        self._bag: Any = import_optional("rosbags.highlevel", "rosbags").AnyReader([Path(path)])
        self._bag.open()
        self.callback(self._bag.close)

    def list_topics(self) -> Dict[str, Tuple[str, int]]:
        """Return the type of every topic, and the number of its messages."""
        counts: Dict[str, Tuple[str, int]] = {}
        for connection in self._bag.connections:
            _, before = counts.get(connection.topic, ("", 0))
            counts[connection.topic] = _name_in_ros1(connection.msgtype), before + connection.msgcount
        return counts

    def find_span(self) -> Tuple[float, float]:
        """Return the times of the first and the last message, seconds since 1970."""
        # Its end_time lies behind the last message.
        return self._bag.start_time / 1e9, (self._bag.end_time - 1) / 1e9

    def read(self, topics: Sequence[str]) -> Iterator[Message]:
        """Yield messages in order of time."""
        for connection, time_ns, content in self._bag.messages(self._choose(topics)):
            message = self._bag.deserialize(content, connection.msgtype)
            yield Message(connection.topic, _name_in_ros1(connection.msgtype), message, time_ns / 1e9)

    def read_raw(self, topics: Sequence[str]) -> Iterator[RawMessage]:
        """Yield messages in order of time, without decoding them."""
        headers = {connection.id: _make_header(connection) for connection in self._bag.connections}
        for connection, time_ns, content in self._bag.messages(self._choose(topics)):
            yield RawMessage(connection.topic, headers[connection.id], bytes(content), time_ns)

    def _choose(self, topics: Sequence[str]) -> List[Any]:
        return [connection for connection in self._bag.connections if connection.topic in topics]


def _name_in_ros1(message_type: str) -> str:
    return message_type.replace("/msg/", "/")


def _make_header(connection: Any) -> Dict[str, str]:
    definition = getattr(connection.msgdef, "data", connection.msgdef)  # a text in its versions for Python 3.8 and 3.9
    header = {"type": _name_in_ros1(connection.msgtype), "md5sum": connection.digest, "message_definition": definition}
    if connection.ext.callerid:
        header["callerid"] = connection.ext.callerid
    if connection.ext.latching:
        header["latching"] = "1"
    return header
