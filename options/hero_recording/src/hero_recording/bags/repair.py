"""Repairs a recording that was cut off (FILE.bag.active), with rosbag's own reindexing.

rosbag writes the index of a bag when it closes it; a crash or a power cut leaves none, and usually an unfinished chunk
at the end. Reindexing cuts off everything from the first chunk that cannot be read.
"""

import os
import shutil
from contextlib import suppress

import rosbag
from tqdm import tqdm

from ..errors import RecordingError, explain_bag_errors
from .bag_set import ACTIVE_SUFFIX

ORIGINAL_SUFFIX = ".orig"
"""Suffix of the file as it was, which stays beside the repaired one."""


def repair_bag(path: str) -> str:
    """Reindex a copy of the bag at path, named without ".active", and return the result as a line of text.

    The file itself is kept as FILE.bag.orig. Raises: RecordingError if it is no bag, holds no readable message, or a
    file of one of these names exists; path then is left as it is.
    """
    target = path[: -len(ACTIVE_SUFFIX)] if path.endswith(ACTIVE_SUFFIX) else path
    original = target + ORIGINAL_SUFFIX
    for name in {target, original} - {path}:
        if os.path.exists(name):
            raise RecordingError(f"{path}: {name} exists already; move one of them away")
    with explain_bag_errors(f"{path} cannot be repaired"):
        os.rename(path, original)
        try:
            shutil.copyfile(original, target)
            with rosbag.Bag(target, "a", allow_unindexed=True) as bag:
                for _ in tqdm(bag.reindex(), os.path.basename(path), unit=" chunks", leave=False, disable=None):
                    pass
                if not bag.get_message_count():
                    raise RecordingError(f"{path} holds no messages that can be read: it is left as it is")
        except BaseException:
            with suppress(FileNotFoundError):
                os.remove(target)
            os.rename(original, path)
            raise
    return f"repaired {target}; {original} is the file as it was"
