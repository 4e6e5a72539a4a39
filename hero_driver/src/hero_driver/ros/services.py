"""Services that a robot offers, as ROS services: one call at a time, with a time limit and clear errors.

A call carries no number on the wire: the answer is known by its topic and its order. So after a time-out
the service stays closed until the late answer came or as long again has passed; otherwise the late answer
would be taken for that of the next call.
"""

import threading
import time
from typing import Callable, Optional

import rospy

Send = Callable[[bytes], Optional[str]]
"""Sends a request; returns why it cannot be sent, None if it is on its way."""


class RobotService:
    """One service of one robot, over all its connections."""

    def __init__(self, name: str, service_type: str, timeout_s: float, send: Send) -> None:
        self.name = name
        self.service_type = service_type
        self._timeout_s = timeout_s
        self._send = send
        self._call_lock = threading.Lock()
        self._changed = threading.Condition()
        self._request = b""
        self._answer: Optional[bytes] = None
        self._failure: Optional[str] = None
        self._is_waiting = False
        self._late_until_s = 0.0

    def call(self, request: bytes) -> bytes:
        """Return the robot's answer to request. Raises: rospy.ServiceException with the reason of a failure."""
        deadline_s = time.monotonic() + self._timeout_s
        if not self._call_lock.acquire(timeout=self._timeout_s):
            raise rospy.ServiceException(
                "%s is busy: earlier calls took longer than %.1f s (~service_timeout_s)"
                % (self.name, self._timeout_s)
            )
        try:
            return self._call_alone(request, max(deadline_s, time.monotonic() + self._timeout_s / 2.0))
        finally:
            self._call_lock.release()

    def receive_answer(self, payload: bytes) -> Optional[bytes]:
        """Take the robot's answer; return the request that it answers, None if there was none."""
        with self._changed:
            if self._is_waiting:
                self._answer = payload
                self._changed.notify_all()
            elif self._late_until_s == 0.0:
                return None
            self._late_until_s = 0.0
            return self._request

    def fail(self, reason: str) -> None:
        """End a call that waits, because the robot left."""
        with self._changed:
            self._late_until_s = 0.0
            if self._is_waiting:
                self._failure = reason
                self._changed.notify_all()

    def _call_alone(self, request: bytes, deadline_s: float) -> bytes:
        with self._changed:
            if time.monotonic() < self._late_until_s:
                raise rospy.ServiceException(
                    "%s has not answered the call before this one yet; try again in %.1f s"
                    % (self.name, self._late_until_s - time.monotonic())
                )
            self._answer = self._failure = None
            self._request = request
            self._is_waiting = True
        try:
            refusal = self._send(request)
            if refusal is not None:
                raise rospy.ServiceException("%s cannot be called: %s" % (self.name, refusal))
            return self._wait(deadline_s)
        finally:
            with self._changed:
                self._is_waiting = False

    def _wait(self, deadline_s: float) -> bytes:
        with self._changed:
            while True:
                if self._answer is not None:
                    return self._answer
                if self._failure is not None:
                    raise rospy.ServiceException("%s was not answered: %s" % (self.name, self._failure))
                left_s = deadline_s - time.monotonic()
                if left_s <= 0.0:
                    self._late_until_s = time.monotonic() + self._timeout_s
                    raise rospy.ServiceException(
                        "%s was not answered within %.1f s (~service_timeout_s)"
                        % (self.name, self._timeout_s)
                    )
                self._changed.wait(left_s)
