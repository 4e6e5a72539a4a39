"""Whether the ROS master knows this node, and registering once more at one that was started again.

rospy registers a topic once; a master that ends takes all registrations with it, and connections that stand go on.
rospy tells what is registered only by its internals.
"""

import xmlrpc.client

import rospy
from rospy.impl.registration import get_service_manager, get_topic_manager

from ..errors import NodeError
from .master import LimitedTransport, ask_master

__all__ = ["is_registered", "register_again"]


def is_registered() -> bool:
    """Return whether the ROS master knows this node, and answers."""
    try:
        return bool(ask_master("lookupNode", rospy.get_name()))
    except NodeError:
        return False


def register_again() -> None:
    """Register all topics and services. Raises: NodeError."""
    uri = rospy.get_node_uri()
    topics, services = get_topic_manager(), get_service_manager()
    for topic, kind in topics.get_publications():
        ask_master("registerPublisher", topic, kind, uri)
    with xmlrpc.client.ServerProxy(uri, transport=LimitedTransport()) as own:
        for topic, kind in topics.get_subscriptions():
            # What the master tells a node when publishers come; rospy connects to those it lacks.
            own.publisherUpdate("/master", topic, ask_master("registerSubscriber", topic, kind, uri))
    for service, service_uri in services.get_services():
        ask_master("registerService", service, service_uri, uri)
