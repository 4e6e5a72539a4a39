"""What robots ask of ROS: parameters and services. Asked on the thread of the sockets, done on workers."""

from typing import Callable

from ..config import DriverConfig
from ..peer import Peer
from ..ros.log_relay import LogRelay
from ..ros.worker import Worker
from ..rosserial.errors import RosserialError
from ..rosserial.session import Topic, TopicKind
from .parameters import (
    EMPTY_ANSWER,
    ParameterAnswer,
    ParameterRefusedError,
    read_parameter,
    resolve_parameter,
)
from .service_clients import ServiceClients

REQUESTS_WAITING_MAX = 1000


class RobotRequests:
    """The workers that ask ROS for robots."""

    def __init__(
        self,
        config: DriverConfig,
        log: LogRelay,
        call_soon: Callable[[Callable[[], None]], None],
        complain: Callable[[Peer, str], None],
    ) -> None:
        """Take the loop's call_soon(); complain reports a robot's trouble."""
        self._may_leave = config.parameters_outside
        self._log = log
        self._call_soon = call_soon
        self._complain = complain
        self._parameters = Worker(
            "parameters",
            REQUESTS_WAITING_MAX,
            lambda error: log.log_throttled("error", "parameters", "parameters of robots: %s" % error),
        )
        self._services = ServiceClients(config, log)

    def close(self) -> None:
        """End the workers."""
        self._parameters.close()
        self._services.close()

    def forget(self, label: str) -> None:
        """The robot called label is gone for good."""
        self._services.forget(label)

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

        if not self._parameters.submit(read):
            self._complain(peer, "asks for too many parameters at once")

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
            self._complain(peer, "calls service %s, whose answers it did not declare" % name)
            return
        answer_id = answers[0].info.topic_id

        def send(payload: bytes) -> None:
            self._call_soon(lambda: send_message(peer, answer_id, payload))

        self._services.call(peer.label, name, topic.info, answers[0].info, request, send)

    def _send_parameter(self, peer: Peer, answer: ParameterAnswer) -> None:
        try:
            peer.link.send_packet(peer.session.encode_parameter_answer(*answer))
        except RosserialError as error:
            self._complain(peer, str(error))
