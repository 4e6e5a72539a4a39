"""Notices that the ROS master was started again, and registers everything with it once more, by rospy's internals.

Programs that start after that would not find this node; open connections are not affected.
"""

import threading
import xmlrpc.client
from typing import Any, Callable, Tuple

import rospy
from rospy.impl.registration import get_service_manager, get_topic_manager

from ..errors import NodeError
from .master import LimitedTransport, MasterRefusalError, ask_master

SENTINEL = "~get_loggers"
"""A service that rospy registers when a node starts, and not again: what the node registers later does not tell."""

WATCH_PERIOD_S = 2.0
"""Time between two looks at the master."""


class MasterWatch:
    """The ROS master as look() finds it; is_lost: it did not answer, or lacks registrations."""

    def __init__(self) -> None:
        self.is_lost = False

    def start(
        self,
        has_ended: threading.Event,
        tell: Callable[[str], None],
        tell_loss: Callable[[str], None] = lambda _: None,
        period_s: float = WATCH_PERIOD_S,
    ) -> None:
        """Look on a thread of its own every period_s, until has_ended is set.

        tell: takes what was registered; tell_loss: that the master was lost, once until it is back; both for users.
        """

        def watch() -> None:
            while not has_ended.wait(period_s):
                was_lost = self.is_lost
                try:
                    news = self.look()
                except (NodeError, OSError, xmlrpc.client.Error) as error:
                    if not was_lost and not has_ended.is_set() and not rospy.is_shutdown():
                        tell_loss(f"{error}: existing connections keep working")
                else:
                    if news:
                        tell(news)

        threading.Thread(target=watch, name="master watch", daemon=True).start()

    def look(self) -> str:
        """Ask the master, and register with one that was started again; return what was registered, for users.

        Registering is repeated by the next look() until it has succeeded as a whole. A node that ends takes its
        registrations back itself: it is never registered again.
        Raises: NodeError, OSError or xmlrpc.client.Error if the master or this node does not answer in time.
        """
        was_restarted = False
        try:
            ask_master("lookupService", rospy.resolve_name(SENTINEL))
        except MasterRefusalError:
            was_restarted = True
        except NodeError:
            self.is_lost = True
            raise
        if rospy.is_shutdown() or not (was_restarted or self.is_lost):
            return ""
        self.is_lost = True
        counts = _register_again()
        self.is_lost = False
        if was_restarted:
            text = "the ROS master was started again: %d topics and %d services are registered again; restart"
            return text % counts + " the programs that were there before"
        return "the ROS master answers again; %d topics and %d services are registered again" % counts


def _register_again() -> Tuple[int, int]:
    uri = rospy.get_node_uri()
    publications, subscriptions = get_topic_manager().get_publications(), get_topic_manager().get_subscriptions()
    services = get_service_manager().get_services()

    def register(method: str, name: str, value: str) -> Any:
        if rospy.is_shutdown():
            raise NodeError("this node ends while it is registered again")
        return ask_master(method, name, value, uri)

    for topic, kind in publications:
        register("registerPublisher", topic, kind)
    with xmlrpc.client.ServerProxy(uri, transport=LimitedTransport()) as own:
        for topic, kind in subscriptions:
            # What the master tells a node when publishers come; rospy connects to those it lacks.
            own.publisherUpdate("/master", topic, register("registerSubscriber", topic, kind))
    for service, service_uri in services:
        register("registerService", service, service_uri)
    return len(publications) + len(subscriptions), len(services)
