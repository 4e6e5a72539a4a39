"""Services that a robot offers, as ROS services: one call at a time, with a time limit and clear errors.

An answer is known by topic and order only, so one at most is outstanding: after a timeout further calls fail at once,
until the late answer has come, the connection has ended, or LATE_ANSWER_S has passed, because a request or its answer
may be lost. Otherwise each answer would be taken for that of the next call. Thread of the sockets, but for call().
"""

import functools
import threading
import time
from typing import Callable, Optional, Tuple

import rospy

from ..transport.event_loop import EventLoop, NoAnswerError

Answer = Tuple[bytes, str]
"""The robot's answer, and empty text; or nothing, and why there is none."""

HANG_WAIT_S = 1.0
"""Grace after a call's time limit: the thread of the sockets hangs if it has not answered by then."""

LATE_ANSWER_S = 30.0
"""A later answer never comes: silent robots are disconnected after 6 s, others answer within 0.1 s."""


class RobotService:
    """One service of one robot, over all its connections."""

    def __init__(
        self,
        name: str,
        service_type: str,
        timeout_s: float,
        send: Callable[["RobotService", bytes], Optional[str]],
        loop: EventLoop,
    ) -> None:
        """send(this service, request), on loop's thread, returns why a request cannot be sent, None if it is."""
        self.name = name
        self.service_type = service_type
        self._timeout_s = timeout_s
        self._limit = f"{timeout_s:.1f} s (~service_timeout_s)"
        self._send = send
        self._loop = loop
        self._turn = threading.Lock()  # of the callers
        self._request: Optional[bytes] = None  # until its answer has come, or can come no more
        self._answer: Optional[Callable[[Answer], None]] = None  # tells the caller, who may have given up
        self._lost_s = 0.0  # when an answer that has not come by then is lost

    def call(self, request: bytes) -> bytes:
        """Return the robot's answer; on a thread of rospy's. Raises: rospy.ServiceException: why there is none."""
        if not self._turn.acquire(timeout=self._timeout_s / 2.0):
            raise rospy.ServiceException(f"{self.name} is busy: earlier calls take longer than half of {self._limit}")
        try:
            answer: Answer = self._loop.ask(functools.partial(self._begin, request), self._timeout_s + HANG_WAIT_S)
        except NoAnswerError as error:
            answer = (b"", f"was not answered: {error}")
        finally:
            self._turn.release()
        payload, failure = answer
        if failure:
            raise rospy.ServiceException(f"{self.name} {failure}")
        return payload

    def receive_answer(self, payload: bytes) -> Optional[bytes]:
        """Take the robot's answer; return the request that it answers, None if there was none."""
        return self._end((payload, ""))

    def fail(self, reason: str) -> None:
        """End the call that is on its way, because the robot left."""
        self._end((b"", f"was not answered: {reason}"))

    def _end(self, outcome: Answer) -> Optional[bytes]:
        request, self._request = self._request, None
        answer, self._answer = self._answer, None
        if answer is not None:
            answer(outcome)
        return request

    def _begin(self, request: bytes, answer: Callable[[Answer], None]) -> None:
        now_s = time.monotonic()
        if self._request is not None and now_s < self._lost_s:
            text = "has not answered the call before this one yet; try again in %.0f s at most, or when the robot has"
            answer((b"", text % (self._lost_s - now_s) + " connected again"))
            return
        # An answer may come before send() returns.
        self._request, self._answer = request, answer
        self._lost_s = now_s + self._timeout_s + max(self._timeout_s, LATE_ANSWER_S)
        refusal = self._send(self, request)
        if refusal is not None:
            self._end((b"", f"cannot be called: {refusal}"))
        else:
            self._loop.call_later(self._timeout_s, lambda: self._expire(answer))

    def _expire(self, answer: Callable[[Answer], None]) -> None:
        if answer is self._answer:
            self._answer = None
            answer((b"", f"was not answered within {self._limit}"))
