"""Who a robot is and which names it may use: namespace /hero_N, and nothing outside of it. Pure."""

import re
from typing import NamedTuple, Optional

_ROBOT_NAME = re.compile(r"^/?(?P<name>[a-zA-Z][a-zA-Z0-9_]*?)_(?P<number>\d{1,6})/.")

HERO_PREFIX = "hero"

TF_TOPICS = frozenset(("/tf", "tf"))


class Identity(NamedTuple):
    """Which robot a connection belongs to."""

    namespace: str  # e.g. "/hero_3"; for other devices any namespace or a made-up one
    number: int  # 3; -1 where the namespace has none


def identify(topic_name: str) -> Optional[Identity]:
    """Return the HeRo that a topic name belongs to, None if it belongs to none."""
    match = _ROBOT_NAME.match(topic_name)
    if match is None or match["name"] != HERO_PREFIX:
        return None
    number = int(match["number"])
    if str(number) != match["number"]:
        return None
    return Identity("/%s_%d" % (HERO_PREFIX, number), number)


def identify_any(topic_name: str, host: str) -> Identity:
    """Return an identity for a device that is no HeRo: its namespace if that has a number, else a made-up one.

    The made-up one has the address and the first name that the device declares, so that the same device is
    known again and two behind one address are told apart.
    """
    match = _ROBOT_NAME.match(topic_name)
    if match is not None:
        return Identity("/%s_%s" % (match["name"], match["number"]), int(match["number"]))
    return Identity("/device_" + re.sub(r"[^a-zA-Z0-9]+", "_", "%s_%s" % (host, topic_name)), -1)


def resolve(topic_name: str, identity: Identity) -> Optional[str]:
    """Return the ROS name for what the HeRo identity calls topic_name, None if it may not use that name.

    The firmware sends hero_N/laser_enable without its slash (RangeSensor.ino:79); it means the same place.
    """
    if topic_name in TF_TOPICS:
        return "/tf"
    name = topic_name if topic_name.startswith("/") else "/" + topic_name
    return name if name.startswith(identity.namespace + "/") else None
