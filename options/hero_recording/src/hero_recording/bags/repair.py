"""Repairs a recording that was cut off (FILE.bag.active), with rosbag's own reindexing.

rosbag writes the index of a bag when it closes it; a crash or a power cut leaves none, and usually an unfinished chunk
at the end. Reindexing cuts off everything from the first chunk that cannot be read. Where that is more than the
unfinished chunk, a copy of the file is kept.
"""

import io
import mmap
import os
import shutil
from typing import Optional

import rosbag
from tqdm import tqdm

from ..errors import RecordingError, explain_bag_errors
from .bag_set import ACTIVE_SUFFIX

CHUNK_MARK = b"\4\0\0\0op=\5"
"""In the header of each chunk (wiki.ros.org/Bags/Format/2.0)."""


def repair_bag(path: str) -> str:
    """Reindex the bag at path, take ".active" off its name, and return the result as a line of text.

    Raises: RecordingError if it is no bag, holds no readable message, or a bag of that name exists.
    """
    target = path[: -len(ACTIVE_SUFFIX)] if path.endswith(ACTIVE_SUFFIX) else path
    if target != path and os.path.exists(target):
        raise RecordingError(f"{path}: {target} exists already; move one of them away")
    result = "repaired " + target
    with explain_bag_errors(f"{path} cannot be repaired"):
        damage = _find_damage(path)
        if damage is not None and _has_chunks_after(path, damage):
            shutil.copyfile(path, target + ".damaged")
            result += f"; messages after the damage in its middle are only in {target}.damaged"
        with rosbag.Bag(path, "a", allow_unindexed=True) as bag:
            for _ in bag.reindex():
                pass
    if target != path:
        os.rename(path, target)
    return result


def _find_damage(path: str) -> Optional[int]:
    """Return the position of the first chunk that cannot be read, None without one; the file is only read."""
    damage = None
    with rosbag.Bag(path, "r", allow_unindexed=True) as bag:
        try:
            for position in tqdm(bag.reindex(), os.path.basename(path), unit=" chunks", leave=False, disable=None):
                damage = position
            damage = None
        except io.UnsupportedOperation:
            pass  # reindex() tried to cut off the end, at the last position, of a file that is open for reading
        if not bag.get_message_count():
            raise RecordingError(f"{path} holds no messages that can be read: it is left as it is")
    return damage


def _has_chunks_after(path: str, damage: int) -> bool:
    """Return whether the chunk at damage is followed by another: then it is not just the one being written."""
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        first = content.find(CHUNK_MARK, damage)
        return first >= 0 and content.find(CHUNK_MARK, first + 1) >= 0
