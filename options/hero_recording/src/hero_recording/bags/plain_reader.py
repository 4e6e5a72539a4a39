"""Reads a bag without ROS, with the package rosbags from PyPI."""

from contextlib import ExitStack
from pathlib import Path
from typing import Any, Dict, Iterator, Sequence, Tuple

from hero_node import import_optional

from .topics import Message


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
        chosen = [connection for connection in self._bag.connections if connection.topic in topics]
        for connection, time_ns, content in self._bag.messages(chosen):
            message = self._bag.deserialize(content, connection.msgtype)
            yield Message(connection.topic, _name_in_ros1(connection.msgtype), message, time_ns / 1e9)


def _name_in_ros1(message_type: str) -> str:
    return message_type.replace("/msg/", "/")
