"""Services that a robot offers, as ROS services: one call at a time, with a time limit and clear errors.

An answer is known by topic and order only, so one at most is outstanding: after a timeout further calls fail at once,
until the late answer has come, the connection has ended, or LATE_ANSWER_S has passed, because a request or its answer
may be lost. Otherwise each answer would be taken for that of the next call. Thread of the sockets, but for call().
"""

import collections
import functools
import time
from typing import Callable, Deque, Optional, Tuple

import rospy

from ..transport.event_loop import EventLoop, NoAnswerError

Answer = Tuple[bytes, str]
"""The robot's answer, and empty text; or nothing, and why there is none."""

HANG_WAIT_S = 1.0
"""Grace after a call's time limit: the thread of the sockets hangs if it has not answered by then."""

LATE_ANSWER_S = 30.0
"""A later answer never comes: silent robots are disconnected after 6 s, others answer within 0.1 s."""


class _Call:
    def __init__(self, request: bytes, answer: Callable[[Answer], None], due_s: float) -> None:
        self.request = request
        self.answer = answer
        self.due_s = due_s

    def fail(self, reason: str) -> None:
        self.answer((b"", reason))


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
        self._send = send
        self._loop = loop
        self._waiting: Deque[_Call] = collections.deque()
        self._current: Optional[_Call] = None
        self._late_request: Optional[bytes] = None  # of the call that timed out, until its answer has come
        self._late_until_s = 0.0

    def call(self, request: bytes) -> bytes:
        """Return the robot's answer; on a thread of rospy's. Raises: rospy.ServiceException: why there is none."""
        limit_s = 1.5 * self._timeout_s + HANG_WAIT_S
        try:
            answer: Answer = self._loop.ask(functools.partial(self._begin, request), limit_s)
        except NoAnswerError as error:
            answer = (b"", f"was not answered: {error}")
        payload, failure = answer
        if failure:
            raise rospy.ServiceException(f"{self.name} {failure}")
        return payload

    def receive_answer(self, payload: bytes) -> Optional[bytes]:
        """Take the robot's answer; return the request that it answers, None if there was none."""
        call, self._current = self._current, None
        if call is None:
            request, self._late_request = self._late_request, None
            return request
        call.answer((payload, ""))
        self._send_next()
        return call.request

    def fail(self, reason: str) -> None:
        """End the call that is on its way, because the robot left."""
        self._late_request = None
        call, self._current = self._current, None
        if call is not None:
            call.fail(f"was not answered: {reason}")
            self._send_next()

    def _begin(self, request: bytes, answer: Callable[[Answer], None]) -> None:
        call = _Call(request, answer, time.monotonic() + self._timeout_s)
        self._waiting.append(call)
        self._loop.call_later(self._timeout_s, lambda: self._expire(call))
        self._send_next()

    def _send_next(self) -> None:
        while self._current is None and self._waiting:
            call = self._waiting.popleft()
            now_s = time.monotonic()
            if self._late_request is not None and now_s < self._late_until_s:
                call.fail(
                    "has not answered the call before this one yet; try again in %.0f s at most, or when the robot has"
                    " connected again" % (self._late_until_s - now_s)
                )
                continue
            # An answer may come before send_request() returns.
            self._current = call
            # A call that had to wait for its turn gets half of the time limit at least.
            call.due_s = max(call.due_s, now_s + self._timeout_s / 2.0)
            refusal = self._send(self, call.request)
            if refusal is not None:
                self._current = None
                call.fail(f"cannot be called: {refusal}")

    def _expire(self, call: _Call) -> None:
        limit = f"{self._timeout_s:.1f} s (~service_timeout_s)"
        if call in self._waiting:
            self._waiting.remove(call)
            call.fail(f"is busy: earlier calls took longer than {limit}")
        elif call is self._current:
            now_s = time.monotonic()
            if now_s < call.due_s:
                self._loop.call_later(call.due_s - now_s, lambda: self._expire(call))
                return
            self._current = None
            self._late_request = call.request
            self._late_until_s = now_s + max(self._timeout_s, LATE_ANSWER_S)
            call.fail(f"was not answered within {limit}")
            self._send_next()
