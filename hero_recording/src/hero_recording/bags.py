"""Bag files -> their messages in the order of time, or one line that says why a file cannot be read."""

import os
from typing import Any, Callable, Dict, List, NamedTuple, Sequence, Tuple

import rosbag
from rosbag.bag import ROSBagUnindexedException

from .errors import RecordingError, name_damage
from .mending import ACTIVE_SUFFIX
from .progress import Progress

PROGRESS_STEP = 2000
"""Messages between two looks at the progress bar."""


class Message(NamedTuple):
    """A message as it was recorded."""

    topic: str
    type: str
    content: Any
    time_s: float
    """When the recorder got it, since 1970."""


Choose = Callable[[str, str], bool]
"""Tells from topic and type whether a message is wanted."""


class BagSet:
    """The files of one recording, sorted by time. Only one is open at a time: an open one holds its index in memory.

    Attributes:
        paths: the files, in order.
        topics: every topic and its type.
        start_s, end_s: times of the first and the last message, since 1970.
    """

    def __init__(self, paths: Sequence[str], progress: Progress) -> None:
        """Look at every file. Raises: RecordingError."""
        self._progress = progress
        self.topics: Dict[str, str] = {}
        self._counts: Dict[str, Dict[str, int]] = {}
        spans: List[Tuple[float, float, str]] = []
        for path in {os.path.realpath(path): path for path in paths}.values():
            with open_bag(path, skip_index=True) as bag, name_damage("%s cannot be read" % path):
                topics = bag.get_type_and_topic_info().topics
                self._counts[path] = {topic: info.message_count for topic, info in topics.items()}
                if not any(self._counts[path].values()):
                    continue  # rosbag begins the next file of a split before anything comes for it
                self.topics.update({topic: info.msg_type for topic, info in topics.items()})
                spans.append((bag.get_start_time(), bag.get_end_time(), path))
        if not spans:
            raise RecordingError("%s: no messages in it" % ", ".join(paths))
        self.paths = [path for _, _, path in sorted(spans)]
        self.start_s = min(start_s for start_s, _, _ in spans)
        self.end_s = max(end_s for _, end_s, _ in spans)

    def read(self, choose: Choose, receive: Callable[[Message], None]) -> None:
        """Give receive the messages whose topic and type choose takes. Raises: RecordingError."""
        wanted = [topic for topic, message_type in self.topics.items() if choose(topic, message_type)]
        if not wanted:
            return
        for number, path in enumerate(self.paths, 1):
            title = os.path.basename(path)
            if len(self.paths) > 1:
                title = "%d of %d, %s" % (number, len(self.paths), title)
            with open_bag(path) as bag:
                counts = self._counts[path]
                self._progress.begin(title, sum(counts.get(topic, 0) for topic in wanted))
                try:
                    # What receives the messages fails as well where a definition in the bag is damaged.
                    with name_damage("%s cannot be read" % path):
                        for count, (topic, content, time) in enumerate(bag.read_messages(wanted)):
                            if count % PROGRESS_STEP == 0:
                                self._progress.reach(count)
                            receive(Message(topic, content._type, content, time.to_sec()))
                finally:
                    self._progress.end()


def open_bag(path: str, skip_index: bool = False) -> rosbag.Bag:
    """Open a bag to read. Raises: RecordingError with the remedy."""
    mend = "if it was cut off, mend it: rosrun hero_recording record --mend %s" % path
    if path.endswith(ACTIVE_SUFFIX):
        raise RecordingError("%s is still being written; %s" % (path, mend))
    if os.path.isdir(path):
        raise RecordingError("%s is a folder; name the bags in it: %s" % (path, os.path.join(path, "*.bag")))
    try:
        with name_damage("%s cannot be read" % path):
            return rosbag.Bag(path, "r", skip_index=skip_index)
    except RecordingError as error:
        if isinstance(error.__cause__, ROSBagUnindexedException):
            raise RecordingError("%s has no index, or a damaged one; %s" % (path, mend)) from error
        raise
