"""Identities of robots and the names that they may use: those within /hero_N. Pure."""

import re
from typing import NamedTuple, Optional

_ROBOT_NAME = re.compile(r"^/?(?P<name>[a-zA-Z][a-zA-Z0-9_]*?)_(?P<number>\d{1,6})/.")

HERO_PREFIX = "hero"

TF_TOPICS = frozenset(("/tf", "tf"))

ROS_TOPICS = frozenset(("/rosout", "/rosout_agg", "/diagnostics", "/diagnostics_agg", "/clock", "/tf_static"))
"""Topics about all of ROS: no device may publish on them."""

DRIVER_NAMES = frozenset(("robots", "stop", "stop_request", "stopped"))
"""Last parts of the names that drivers serve, by which programs find drivers, and stop robots."""

DRIVER_TYPES = frozenset(("hero_msgs/RobotArray", "hero_common/RobotArray"))
"""By this type programs find drivers."""

RESERVED = "only drivers and ROS itself may use this name or type"


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


def is_hero(identity: Identity) -> bool:
    """Return whether identity is a HeRo's."""
    return identify(identity.namespace + "/x") == identity


def resolve(topic_name: str, identity: Identity) -> Optional[str]:
    """Return the ROS name for what the HeRo identity calls topic_name, None if it may not use that name.

    The firmware sends hero_N/laser_enable without its slash (RangeSensor.ino:79); it means the same place.
    """
    if topic_name in TF_TOPICS:
        return "/tf"
    name = topic_name if topic_name.startswith("/") else "/" + topic_name
    return name if name.startswith(identity.namespace + "/") else None


class NameRules:
    """Resolves declared names, and refuses those that robots may not use.

    No robot may act as a driver: neither publish, serve nor call what drivers serve.
    """

    def __init__(self, policy: str, node: str) -> None:
        """Take ~namespace_policy, and the name of the driver's node."""
        self._allows_any = policy == "any"
        self._node = node

    def resolve(self, topic_name: str, identity: Identity) -> Optional[str]:
        """Return the ROS name of a topic or service, None if it lies outside of what identity may use."""
        name = resolve(topic_name, identity) if is_hero(identity) else None
        if name is None and self._allows_any:
            name = "/tf" if topic_name in TF_TOPICS else self._resolve_any(topic_name)
        return name

    def find_refusal(
        self, topic_name: str, message_type: str, is_published: bool, identity: Identity
    ) -> Optional[str]:
        """Return why identity may not declare a topic or service, None if it may."""
        name = self.resolve(topic_name, identity)
        if name is None:
            return "outside %s (~namespace_policy is robot)" % identity.namespace
        is_own = is_hero(identity) and name.startswith(identity.namespace + "/")
        if (
            message_type in DRIVER_TYPES
            or name == self._node
            or name.startswith(self._node + "/")
            or (is_published and name in ROS_TOPICS)
            or (not is_own and name.rpartition("/")[2] in DRIVER_NAMES)
        ):
            return RESERVED
        return None

    def _resolve_any(self, topic_name: str) -> str:
        """As ROS resolves what this node calls topic_name."""
        if topic_name.startswith("/"):
            return topic_name
        if topic_name.startswith("~"):
            return "%s/%s" % (self._node, topic_name[1:].lstrip("/"))
        return "%s/%s" % (self._node.rpartition("/")[0], topic_name)
