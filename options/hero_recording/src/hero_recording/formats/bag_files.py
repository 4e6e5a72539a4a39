"""Copies whole recordings into the bags of other tools: MCAP with ROS 1 messages, and ROS 2 bags."""

import contextlib
import io
from pathlib import Path
from typing import Any, Dict, Tuple

from hero_node import import_optional

from ..bags.bag_set import BagSet
from ..bags.topics import RawMessage
from ..errors import RecordingError, explain_write_errors


def write_mcap(bags: BagSet, path: str) -> int:
    """Copy every message, as recorded, into an MCAP file of profile ros1; return the number of messages.

    Source: https://mcap.dev/spec/registry. Raises: RecordingError; ProgramError without the package mcap.
    """
    writers = import_optional("mcap.writer", "mcap")
    count = 0
    schemas: Dict[Tuple[str, str], int] = {}
    channels: Dict[Tuple[Tuple[str, str], ...], int] = {}

    def find_channel(message: RawMessage) -> int:
        header = message.header
        # The connections of a topic's publishers are channels of their own; those of all files of a split are the same.
        key = (("topic", message.topic), *sorted(header.items()))
        if key not in channels:
            schema = header["type"], header["md5sum"]
            if schema not in schemas:
                definition = header["message_definition"].encode()
                schemas[schema] = writer.register_schema(header["type"], "ros1msg", definition)
            metadata = {name: header[name] for name in ("callerid", "latching", "md5sum") if name in header}
            channels[key] = writer.register_channel(message.topic, "ros1", schemas[schema], metadata)
        return channels[key]

    def receive(message: RawMessage) -> None:
        nonlocal count
        # Here too, where bags names a file that cannot be read.
        with explain_write_errors(path):
            writer.add_message(find_channel(message), message.time_ns, message.content, message.time_ns)
        count += 1

    with explain_write_errors(path), open(path, "wb") as file:
        # The library writes an offset of every index, also of attachments and metadata, of which there are none.
        writer = writers.Writer(file, index_types=writers.IndexType.CHUNK | writers.IndexType.MESSAGE)
        writer.start(profile="ros1", library="hero_recording")
        bags.read_raw(receive)
        writer.finish()
    return count


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
