"""A recording that was cut off (FILE.bag.active) -> a bag that can be read.

rosbag writes the index of a bag when it closes it. What a crash or a power cut leaves has none, and perhaps half a
chunk at the end: the index is made anew, the half chunk (less than 1 MB) is cut off. rosbag cuts off all that follows
the first chunk that it cannot read; where that is more than half a chunk, a copy of the file is kept.
"""

import io
import mmap
import os
import shutil
from typing import NamedTuple, Optional

import rosbag

from .errors import RecordingError, name_damage
from .progress import Progress

ACTIVE_SUFFIX = ".active"
DAMAGED_SUFFIX = ".damaged"

CHUNK_MARK = b"\4\0\0\0op=\5"
"""In the header of each chunk (wiki.ros.org/Bags/Format/2.0)."""


class MendedBag(NamedTuple):
    """A bag that can be read again, and the copy of what it was, None where nothing but half a chunk was cut off."""

    path: str
    copy: Optional[str]

    def __str__(self) -> str:
        """Return it in words."""
        return self.path + (
            "" if self.copy is None else "; what follows the damage in its middle is only in " + self.copy
        )


def mend_bag(path: str, progress: Progress) -> MendedBag:
    """Make the index of the bag at path anew, and take ".active" off its name.

    Raises: RecordingError if it is no bag, holds nothing, or a bag of that name exists.
    """
    target = path[: -len(ACTIVE_SUFFIX)] if path.endswith(ACTIVE_SUFFIX) else path
    if target != path and os.path.exists(target):
        raise RecordingError("%s: %s exists already; move one of them away" % (path, target))
    with name_damage("%s cannot be mended" % path):
        damage, copy = _find_damage(path, progress), None
        if damage is not None and _holds_chunks_behind(path, damage):
            copy = target + DAMAGED_SUFFIX
            shutil.copyfile(path, copy)
        with rosbag.Bag(path, "a", allow_unindexed=True) as bag:
            for _ in bag.reindex():
                pass
    if target != path:
        os.rename(path, target)
    return MendedBag(target, copy)


def _find_damage(path: str, progress: Progress) -> Optional[int]:
    """Return the position from which on a bag cannot be read; None if all of it can. Changes nothing."""
    position = None
    with rosbag.Bag(path, "r", allow_unindexed=True) as bag:
        progress.begin("reading " + os.path.basename(path), os.path.getsize(path))
        try:
            for position in bag.reindex():
                progress.reach(position)
        except io.UnsupportedOperation:  # it would cut off the rest, but the file is open to read only
            damage = position
        else:
            damage = None
        finally:
            progress.end()
        if not bag.get_message_count():
            raise RecordingError("%s holds no messages that can be read: it is left as it is" % path)
    return damage


def _holds_chunks_behind(path: str, damage: int) -> bool:
    """Whether more follows than the one chunk that was being written at the end."""
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        first = content.find(CHUNK_MARK, damage)
        return first >= 0 and content.find(CHUNK_MARK, first + 1) >= 0
