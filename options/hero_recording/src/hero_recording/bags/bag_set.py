"""Reads the messages of bag files in order of time; a file that cannot be read is refused in one line."""

import os
from typing import Callable, Dict, List, Sequence, Tuple

from tqdm import tqdm

from ..errors import RecordingError, explain_bag_errors
from .topics import Message

try:
    from .ros_reader import Reader
except ImportError:  # a PC without ROS
    from .plain_reader import Reader  # type: ignore[assignment]

ACTIVE_SUFFIX = ".active"
"""Suffix of a file that is being written, or was not closed."""


class BagSet:
    """The files of one recording, sorted by time. Only one is open at a time: an open bag holds its index in memory.

    Attributes:
        paths: the files, in order.
        topics: every topic and its type.
        start_s, end_s: times of the first and the last message, since 1970.
    """

    def __init__(self, paths: Sequence[str]) -> None:
        """Read the header of every file. Raises: RecordingError."""
        self.topics: Dict[str, str] = {}
        self._counts: Dict[str, Dict[str, int]] = {}
        spans: List[Tuple[float, float, str]] = []
        for path in {os.path.realpath(path): path for path in paths}.values():
            with open_bag(path, skip_index=True) as bag, explain_bag_errors(f"{path} cannot be read"):
                topics = bag.list_topics()
                self._counts[path] = {topic: count for topic, (_, count) in topics.items()}
                if not any(self._counts[path].values()):
                    continue  # rosbag opens the next file of a split before anything arrives for it
                self.topics.update({topic: message_type for topic, (message_type, _) in topics.items()})
                spans.append((*bag.find_span(), path))
        if not spans:
            raise RecordingError(f"{', '.join(paths)}: no messages in it")
        self.paths = [path for _, _, path in sorted(spans)]
        self.start_s = min(start_s for start_s, _, _ in spans)
        self.end_s = max(end_s for _, end_s, _ in spans)

    def read(self, is_wanted: Callable[[str, str], bool], receive: Callable[[Message], None]) -> None:
        """Pass every message whose topic and type is_wanted() accepts to receive. Raises: RecordingError."""
        wanted = [topic for topic, message_type in self.topics.items() if is_wanted(topic, message_type)]
        for path in self.paths if wanted else ():
            total = sum(self._counts[path].get(topic, 0) for topic in wanted)
            # receive() fails as well where a message definition in the bag is damaged.
            with open_bag(path) as bag, explain_bag_errors(f"{path} cannot be read"):
                # disable=None: no bar in a log.
                for message in tqdm(
                    bag.read(wanted), os.path.basename(path), total, unit=" messages", leave=False, disable=None
                ):
                    receive(message)

    def describe_topics(self) -> str:
        """Return some of the topics for an error message."""
        return ", ".join(sorted(self.topics)[:8]) or "none"


def open_bag(path: str, skip_index: bool = False) -> Reader:
    """Open a bag for reading. Raises: RecordingError with the remedy."""
    repair = f"if it was cut off, repair it: rosrun hero_recording record --repair {path}"
    if path.endswith(ACTIVE_SUFFIX):
        raise RecordingError(f"{path} is still being written; {repair}")
    if os.path.isdir(path):
        raise RecordingError(f"{path} is a folder; name the bags in it: {os.path.join(path, '*.bag')}")
    if os.path.exists(path) and not os.path.isfile(path):  # opening a pipe would wait for its writer
        raise RecordingError(f"{path} is a pipe, device or socket; name a bag")
    try:
        with explain_bag_errors(f"{path} cannot be read"):
            return Reader(path, skip_index)
    except RecordingError as error:
        if type(error.__cause__).__name__ in Reader.unindexed:
            raise RecordingError(f"{path} has no index, or a damaged one; {repair}") from error
        raise
