"""Converts whole recordings into ROS 2 bags."""

import contextlib
import io
from pathlib import Path
from typing import Any

from hero_node import import_optional

from ..bags.bag_set import BagSet
from ..errors import RecordingError


def write_ros2(bags: BagSet, folder: str) -> int:
    """Convert every message to CDR, in a folder that `ros2 bag` reads; return the number of messages.

    Raises: RecordingError; ProgramError without the package rosbags.
    """
    requirement = "rosbags>=0.10"
    storage: Any = import_optional("rosbags.rosbag2", requirement)
    convert: Any = import_optional("rosbags.convert", requirement)
    if not hasattr(storage, "StoragePlugin"):
        raise RecordingError(f"this format needs {requirement}, which needs Python 3.10 or later")
    sources, target = [Path(path) for path in bags.paths], Path(folder)
    try:
        # It prints a line per type of message.
        with contextlib.redirect_stdout(io.StringIO()):
            convert.convert(sources, target, "mcap", 8, None, "none", None, None, (), (), (), ())
        with storage.Reader(target) as reader:
            return int(reader.message_count)
    except (convert.ConverterError, storage.ReaderError) as error:
        raise RecordingError(f"{', '.join(bags.paths)} cannot be converted: {error}") from error
