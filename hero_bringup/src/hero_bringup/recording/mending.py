"""A recording that was cut off (FILE.bag.active) -> a bag that can be read.

rosbag writes the index of a bag when it closes it. What a crash or a power cut leaves has none, and perhaps half a
chunk at the end: the index is made anew, the half chunk (less than 1 MB) is cut off.
"""

import os

import rosbag
from rosbag.bag import ROSBagException

from .errors import RecordingError
from .progress import Progress

ACTIVE_SUFFIX = ".active"


def mend_bag(path: str, progress: Progress) -> str:
    """Make the index of the bag at path anew, take ".active" off its name, and return the new name.

    Raises: RecordingError if it is no bag, holds nothing, or a bag of that name exists.
    """
    target = path[: -len(ACTIVE_SUFFIX)] if path.endswith(ACTIVE_SUFFIX) else path
    if target != path and os.path.exists(target):
        raise RecordingError("%s: %s exists already; move one of them away" % (path, target))
    try:
        size = os.path.getsize(path)
        with rosbag.Bag(path, "a", allow_unindexed=True) as bag:
            progress.begin("mending " + os.path.basename(path), size)
            for position in bag.reindex():
                progress.reach(position)
            progress.end()
            count = bag.get_message_count()
    except OSError as error:
        raise RecordingError("%s cannot be mended: %s" % (path, error.strerror or error)) from error
    except (ROSBagException, ValueError, KeyError, IndexError) as error:
        raise RecordingError("%s cannot be mended: %s; is it a bag?" % (path, error)) from error
    if not count:
        raise RecordingError("%s holds no messages: nothing to mend; delete it" % path)
    if target != path:
        os.rename(path, target)
    return target
