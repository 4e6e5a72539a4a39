"""Notices that the ROS master was started again, and registers everything with it once more.

rospy registers a topic once; a master that ends takes all registrations with it, and programs that start
afterwards find no robots. Connections that stand go on by themselves. Runs on its own thread, because the
master may hang.
"""

import threading
import xmlrpc.client
from typing import Any, Callable, Tuple

import rosgraph
import rospy

from hero_node.ros.master import LimitedTransport

from .rospy_internals import list_registrations

CHECK_INTERVAL_S = 2.0

SUCCESS = 1
"""First part of an answer of the master (ROS Master API)."""


class MasterWatch:
    """Looks every CHECK_INTERVAL_S whether the master still knows this node."""

    def __init__(self, sentinel: str, log: Callable[[str, str], None]) -> None:
        """sentinel: a service that this node always has."""
        self._sentinel = rospy.resolve_name(sentinel)
        self._log = log
        self._ended = threading.Event()
        self._is_away = False

    def open(self) -> None:
        """Begin to watch."""
        threading.Thread(target=self._run, name="master watch", daemon=True).start()

    def close(self) -> None:
        """End, as soon as the master answers; safe to call twice."""
        self._ended.set()

    def _run(self) -> None:
        while not self._ended.wait(CHECK_INTERVAL_S):
            try:
                self._look()
            except (OSError, xmlrpc.client.Error) as error:
                if not self._is_away and not self._ended.is_set():
                    self._is_away = True
                    self._log(
                        "error",
                        "the ROS master at %s does not answer (%s): existing connections keep working; programs that"
                        " start now find no robots" % (rosgraph.get_master_uri(), error),
                    )

    def _look(self) -> None:
        with xmlrpc.client.ServerProxy(rosgraph.get_master_uri(), transport=LimitedTransport()) as master:
            code, _, _ = master.lookupService(rospy.get_name(), self._sentinel)  # type: ignore[misc]
            if code == SUCCESS:
                if self._is_away:
                    self._log("info", "the ROS master answers again")
            elif not self._ended.is_set():
                topics, services = self._register(master)
                self._log(
                    "warn",
                    "the ROS master was started again: %d topics and %d services are registered again; restart"
                    " the programs that were there before" % (topics, services),
                )
        self._is_away = False

    def _register(self, master: Any) -> Tuple[int, int]:
        name, uri = rospy.get_name(), rospy.get_node_uri()
        publications, subscriptions, services = list_registrations()
        for topic, ros_type in publications:
            master.registerPublisher(name, topic, ros_type, uri)
        with xmlrpc.client.ServerProxy(uri, transport=LimitedTransport()) as own:
            for topic, ros_type in subscriptions:
                code, _, publishers = master.registerSubscriber(name, topic, ros_type, uri)
                if code == SUCCESS:
                    # What the master tells a node when publishers come; rospy connects to those it lacks.
                    own.publisherUpdate("/master", topic, publishers)
        # The sentinel comes last of all: what fails on the way is tried again.
        for service, service_uri in sorted(services, key=lambda entry: entry[0] == self._sentinel):
            master.registerService(name, service, service_uri, uri)
        return len(publications) + len(subscriptions), len(services)
