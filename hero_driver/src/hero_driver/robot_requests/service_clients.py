"""Calls ROS services for robots. Blocks: it is called on workers."""

from typing import Any, Dict, Tuple

import rospy

from ..ros import message_types
from ..ros.message_types import MessageTypeError
from ..rosserial.payloads import TopicInfo


class ServiceClients:
    """The ROS services that robots have called."""

    def __init__(self, timeout_s: float) -> None:
        """timeout_s: how long a service that is not there yet is waited for."""
        self._timeout_s = timeout_s
        self._proxies: Dict[Tuple[str, str, Any], rospy.ServiceProxy] = {}

    def call(
        self, label: str, name: str, request_info: TopicInfo, answer_info: TopicInfo, request: bytes
    ) -> bytes:
        """Return what the ROS service called name answers to the robot called label. Raises: Exception of any kind."""
        service_class = message_types.find_service_class(
            request_info.message_type, request_info.md5sum, answer_info.md5sum
        )
        raw_class = message_types.make_raw_service(service_class)
        proxy = self._proxies.get((label, name, raw_class))
        if proxy is None:
            proxy = self._proxies[label, name, raw_class] = rospy.ServiceProxy(name, raw_class)
        try:
            proxy.wait_for_service(self._timeout_s)
        except rospy.ROSException as error:
            raise MessageTypeError("not available within %.1f s" % self._timeout_s) from error
        answer: bytes = proxy.call(raw_class._request_class(request)).data
        return answer

    def forget(self, label: str) -> None:
        """The robot called label is gone for good."""
        for key in [key for key in list(self._proxies) if key[0] == label]:
            del self._proxies[key]
