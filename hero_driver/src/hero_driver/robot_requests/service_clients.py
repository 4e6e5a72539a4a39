"""Calls ROS services for robots. Blocks: it is called on workers."""

import rospy

from ..ros import message_types
from ..ros.message_types import MessageTypeError
from ..rosserial.payloads import TopicInfo


def call_service(
    name: str, request_info: TopicInfo, answer_info: TopicInfo, request: bytes, timeout_s: float
) -> bytes:
    """Return what the ROS service called name answers.

    timeout_s: how long a service that is not there yet is waited for. Raises: Exception of any kind.
    """
    service_class = message_types.find_service_class(
        request_info.message_type, request_info.md5sum, answer_info.md5sum
    )
    raw_class = message_types.make_raw_service(service_class)
    proxy = rospy.ServiceProxy(name, raw_class)
    try:
        proxy.wait_for_service(timeout_s)
    except rospy.ROSException as error:
        raise MessageTypeError("not available within %.1f s" % timeout_s) from error
    answer: bytes = proxy.call(raw_class._request_class(request)).data
    return answer
