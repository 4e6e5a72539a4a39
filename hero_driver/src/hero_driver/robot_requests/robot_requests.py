"""What robots ask of ROS: parameters and services. Each robot that asks has a worker, because ROS may block."""

from typing import Callable, Dict

from ..config import DriverConfig
from ..peer import Peer
from ..ros.log_relay import LogRelay
from ..ros.worker import Worker
from ..rosserial.errors import RosserialError
from ..rosserial.session import Topic, TopicKind
from ..transport import Call
from .parameters import (
    EMPTY_ANSWER,
    ParameterAnswer,
    ParameterRefusedError,
    read_parameter,
    resolve_parameter,
)
from .service_clients import call_service

REQUESTS_WAITING_MAX = 20
"""Of one robot: it waits for an answer before it asks again."""


class RobotRequests:
    """The workers that ask ROS for robots."""

    def __init__(
        self,
        config: DriverConfig,
        log: LogRelay,
        call_soon: Callable[[Call], None],
        warn_robot: Callable[[Peer, str], None],
    ) -> None:
        """Take the loop's call_soon(); warn_robot reports a robot's trouble."""
        self._may_leave = config.namespace_policy == "any"
        self._log = log
        self._call_soon = call_soon
        self._warn_robot = warn_robot
        self._workers: Dict[str, Worker] = {}  # of the robots that have asked for anything
        self._service_timeout_s = config.service_timeout_s

    def close(self) -> None:
        """End the workers."""
        for worker in self._workers.values():
            worker.close()

    def forget(self, label: str) -> None:
        """End the worker of the robot called label, once its call is over: the robot is gone for good."""
        worker = self._workers.pop(label, None)
        if worker is not None:
            worker.end()

    def answer_parameter(self, peer: Peer, name: str) -> None:
        """Send a robot the parameter that it calls name, or empty lists with the reason in the log."""
        if peer.bridge is None:
            return
        namespace = peer.bridge.identity.namespace

        def read() -> None:
            try:
                answer = read_parameter(resolve_parameter(name, namespace, self._may_leave))
            except ParameterRefusedError as error:
                text = "%s: %s" % (peer.label, error)
                key = "parameter %s %s" % (namespace, name[:100])
                self._log.log_throttled("warn", key, text, peer.label, peer.link.address.host)
                answer = EMPTY_ANSWER
            self._call_soon(lambda: self._send_parameter(peer, answer))

        self._submit(peer, read)

    def call_service(
        self,
        peer: Peer,
        topic: Topic,
        name: str,
        request: bytes,
        send_message: Callable[[Peer, int, bytes], None],
    ) -> None:
        """Call the ROS service called name for a robot, whose request came on topic."""
        answers = [
            other
            for other in peer.session.topics.values()
            if other.kind is TopicKind.CLIENT_ANSWERS and other.info.name == topic.info.name
        ]
        if not answers:
            self._warn_robot(peer, "calls service %s, whose answers it did not declare" % name)
            return
        answer_id = answers[0].info.topic_id

        def call() -> None:
            try:
                payload = call_service(name, topic.info, answers[0].info, request, self._service_timeout_s)
            except Exception as error:  # noqa: BLE001 - the protocol has no error answer, so the robot gets nothing
                text = "%s: call of service %s failed: %s" % (peer.label, name, error)
                self._log.log_throttled("error", peer.label + name, text)
            else:
                self._call_soon(lambda: send_message(peer, answer_id, payload))

        self._submit(peer, call)

    def _submit(self, peer: Peer, call: Call) -> None:
        label = peer.label
        if label not in self._workers:
            self._workers[label] = Worker(
                "requests of " + label,
                REQUESTS_WAITING_MAX,
                lambda error: self._log.log_throttled("error", "requests", "%s: a request failed: %s" % (label, error)),
            )
        if not self._workers[label].submit(call):
            self._warn_robot(peer, "asks for too much at once: %d requests wait" % REQUESTS_WAITING_MAX)

    def _send_parameter(self, peer: Peer, answer: ParameterAnswer) -> None:
        try:
            peer.link.send_packet(peer.session.encode_parameter_answer(*answer))
        except RosserialError as error:
            self._warn_robot(peer, str(error))
