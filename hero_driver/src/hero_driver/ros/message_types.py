"""Finds ROS message classes for declared types, checks their md5, and makes classes that carry raw bytes.

The firmware's hero_common is this suite's hero_msgs on the PC, its tf package tf2_msgs, with the same md5.
"""

import functools
import importlib.util
import os
from typing import Any

import genpy
import roslib.message

PACKAGE_ALIASES = {"hero_common": "hero_msgs"}
TYPE_ALIASES = {"tf/tfMessage": "tf2_msgs/TFMessage"}


class MessageTypeError(Exception):
    """A declared type cannot be used; the text says which, why and what to do."""


def apply_aliases(type_name: str) -> str:
    """Return the ROS type that replaces type_name on this side."""
    if type_name in TYPE_ALIASES:
        return TYPE_ALIASES[type_name]
    package, _, name = type_name.partition("/")
    return f"{PACKAGE_ALIASES.get(package, package)}/{name}"


class RawMessage(genpy.Message):
    """A message as its bytes; subclasses stand for one ROS type each and look like it from outside."""

    __slots__ = ["data"]
    _slot_types = ["uint8[]"]
    _has_header = False  # so that rospy leaves the sequence number to the bytes

    def __init__(self, data: bytes = b"") -> None:
        self.data = data

    def serialize(self, buff: Any) -> None:
        """Write the bytes to buff."""
        buff.write(self.data)

    def deserialize(self, data: bytes) -> "RawMessage":
        """Take the bytes as they are."""
        self.data = data
        return self


@functools.lru_cache(maxsize=None)
def make_raw_class(message_class: Any) -> Any:
    """Return the class that carries messages of message_class as bytes; the same one for every call."""
    fields = {name: getattr(message_class, name) for name in ("_type", "_md5sum", "_full_text")}
    return type("Raw" + message_class.__name__, (RawMessage,), {"__slots__": [], **fields})


@functools.lru_cache(maxsize=None)
def make_raw_service(service_class: Any) -> Any:
    """Return the service class that carries requests and answers of service_class as bytes."""
    fields = {
        "_type": service_class._type,
        "_md5sum": service_class._md5sum,
        "_request_class": make_raw_class(service_class._request_class),
        "_response_class": make_raw_class(service_class._response_class),
    }
    return type("Raw" + service_class.__name__, (object,), fields)


def find_message_class(type_name: str, md5sum: str) -> Any:
    """Return the class of the message type that a robot calls type_name; may read files. Raises: MessageTypeError."""
    ros_type = apply_aliases(type_name)
    message_class = _load(roslib.message.get_message_class, "msg", ros_type)
    _check_md5sum("type", type_name, ros_type, md5sum, message_class._md5sum)
    return message_class


def find_service_class(type_name: str, request_md5sum: str, response_md5sum: str) -> Any:
    """Return the class of a service type, declared by one md5 per half; may read files. Raises: MessageTypeError."""
    ros_type = apply_aliases(type_name)
    found = _load(roslib.message.get_service_class, "srv", ros_type)
    _check_md5sum("request of service type", type_name, ros_type, request_md5sum, found._request_class._md5sum)
    _check_md5sum("answer of service type", type_name, ros_type, response_md5sum, found._response_class._md5sum)
    return found


def _load(loader: Any, kind: str, ros_type: str) -> Any:
    package, _, name = ros_type.partition("/")
    if not _is_generated(package, kind, name):
        text = "type %s is not known here: install or build the package %s and source its workspace before the driver"
        raise MessageTypeError(text % (ros_type, package) + " starts")
    try:
        return loader(ros_type)
    except (ImportError, ValueError) as error:
        text = "type %s cannot be loaded (%s): build the package %s again and source its workspace"
        raise MessageTypeError(text % (ros_type, error, package)) from error


def _is_generated(package: str, kind: str, name: str) -> bool:
    """Return whether package has code for a type, without importing: peers must not choose which modules run here."""
    try:
        spec = importlib.util.find_spec(package)
    except ValueError:  # a module that was made without one
        return False
    places = [] if spec is None else spec.submodule_search_locations or []
    return any(os.path.isfile(os.path.join(place, kind, f"_{name}.py")) for place in places)


def _check_md5sum(what: str, type_name: str, ros_type: str, theirs: str, ours: str) -> None:
    if theirs != ours:
        text = "%s %s has md5 %s at the robot, but %s has %s here: build the version of package %s that fits the"
        text += " robot's firmware and source its workspace"
        raise MessageTypeError(text % (what, type_name, theirs, ros_type, ours, ros_type.partition("/")[0]))
