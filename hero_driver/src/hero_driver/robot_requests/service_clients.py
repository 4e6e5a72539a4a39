"""Services that robots call: their requests -> ROS services -> answers, each robot's on a thread of its own.

The protocol has no error answer: a call that fails is logged, and the robot gets nothing.
"""

from typing import Any, Callable, Dict

import rospy

from ..config import DriverConfig
from ..ros import message_types
from ..ros.log_relay import LogRelay
from ..ros.message_types import MessageTypeError
from ..ros.worker import Worker
from ..rosserial.payloads import TopicInfo

CALLS_WAITING_MAX = 20


class ServiceClients:
    """The threads on which ROS services are called, one per robot that calls any."""

    def __init__(self, config: DriverConfig, log: LogRelay) -> None:
        self._wait_s = config.service_timeout_s
        self._log = log
        self._workers: Dict[str, Worker] = {}
        self._proxies: Dict[Any, rospy.ServiceProxy] = {}

    def call(
        self,
        label: str,
        name: str,
        request_info: TopicInfo,
        answer_info: TopicInfo,
        request: bytes,
        send: Callable[[bytes], None],
    ) -> None:
        """Call the ROS service called name for the robot called label; send(answer) is called if it answers."""
        worker = self._workers.get(label)
        if worker is None:
            worker = self._workers[label] = Worker(
                "service client " + label,
                CALLS_WAITING_MAX,
                lambda error: self._log.log_throttled(
                    "error", label + name, "%s: call of service %s failed: %s" % (label, name, error)
                ),
            )
        if not worker.submit(lambda: send(self._call(label, name, request_info, answer_info, request))):
            self._log.log_throttled("error", label + "calls", "%s: too many service calls wait" % label)

    def forget(self, label: str) -> None:
        """End the thread of the robot called label, once its call is over."""
        worker = self._workers.pop(label, None)
        if worker is not None:
            worker.end()
            for key in [key for key in list(self._proxies) if key[0] == label]:
                del self._proxies[key]

    def close(self) -> None:
        """End all threads."""
        for worker in self._workers.values():
            worker.close()

    def _call(
        self, label: str, name: str, request_info: TopicInfo, answer_info: TopicInfo, request: bytes
    ) -> bytes:
        service_class = message_types.find_service_class(
            request_info.message_type, request_info.md5sum, answer_info.md5sum
        )
        raw_class = message_types.make_raw_service(service_class)
        proxy = self._proxies.get((label, name, raw_class))
        if proxy is None:
            proxy = self._proxies[label, name, raw_class] = rospy.ServiceProxy(name, raw_class)
        try:
            proxy.wait_for_service(self._wait_s)
        except rospy.ROSException as error:
            raise MessageTypeError("not available within %.1f s" % self._wait_s) from error
        answer: bytes = proxy.call(raw_class._request_class(request)).data
        return answer
