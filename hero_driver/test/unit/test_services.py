"""Services of a robot: one call at a time, each with an answer, a reason, or a time limit."""

import threading

import pytest
import rospy

from hero_driver.ros.services import RobotService

NAME = "/hero_0/set_odom"
LONG_S = 60.0
SHORT_S = 0.05
"""A time-out that tests wait for."""

DEADLINE_S = 20.0
"""After this a test that waits for another thread has failed."""


class Robot:
    """The robot's end: keeps requests; tells when one came."""

    def __init__(self, timeout_s, refusal=None):
        self.requests = []
        self.refusal = refusal
        self.came = threading.Semaphore(0)
        self.service = RobotService(NAME, "hero_msgs/SetOdom", timeout_s, self.send)

    def send(self, request):
        self.requests.append(request)
        self.came.release()
        return self.refusal

    def wait_for_request(self):
        assert self.came.acquire(timeout=DEADLINE_S)


class Call(threading.Thread):
    """A call on a thread of its own."""

    def __init__(self, service, request):
        super().__init__(daemon=True)
        self._service = service
        self._request = request
        self.answer = None
        self.error = None
        self.start()

    def run(self):
        try:
            self.answer = self._service.call(self._request)
        except rospy.ServiceException as error:
            self.error = str(error)

    def finish(self):
        self.join(DEADLINE_S)
        assert not self.is_alive()
        return self


def test_a_call_returns_the_robots_answer():
    robot = Robot(LONG_S)
    call = Call(robot.service, b"request")
    robot.wait_for_request()
    assert robot.service.receive_answer(b"answer") == b"request"
    assert call.finish().answer == b"answer"
    assert robot.requests == [b"request"]


def test_an_answer_may_come_before_the_caller_waits_for_it():
    service = RobotService(NAME, "hero_msgs/SetOdom", LONG_S, lambda request: service.receive_answer(b"quick") and None)
    assert service.call(b"request") == b"quick"


def test_calls_follow_one_another_and_each_gets_its_own_answer():
    robot = Robot(LONG_S)
    for number in range(5):
        call = Call(robot.service, b"request %d" % number)
        robot.wait_for_request()
        assert robot.service.receive_answer(b"answer %d" % number) == b"request %d" % number
        assert call.finish().answer == b"answer %d" % number


def test_a_second_call_waits_and_is_not_sent_before_the_first_is_answered():
    robot = Robot(LONG_S)
    first = Call(robot.service, b"first")
    robot.wait_for_request()
    second = Call(robot.service, b"second")
    assert robot.requests == [b"first"]
    robot.service.receive_answer(b"one")
    assert first.finish().answer == b"one"
    robot.wait_for_request()
    assert robot.requests == [b"first", b"second"]
    robot.service.receive_answer(b"two")
    assert second.finish().answer == b"two"


def test_many_callers_all_get_the_answer_to_their_own_request():
    robot = Robot(LONG_S)
    calls = {b"%d" % number: Call(robot.service, b"%d" % number) for number in range(20)}
    for _ in calls:
        robot.wait_for_request()
        robot.service.receive_answer(b"answer to " + robot.requests[-1])
        calls[robot.requests[-1]].finish()
    assert {request: call.answer for request, call in calls.items()} == {
        request: b"answer to " + request for request in calls
    }


def test_a_call_that_cannot_be_sent_fails_with_the_reason():
    robot = Robot(LONG_S, refusal="the robot is not connected")
    with pytest.raises(rospy.ServiceException, match="/hero_0/set_odom cannot be called: the robot is not connected"):
        robot.service.call(b"request")
    robot.refusal = None
    call = Call(robot.service, b"again")
    for _ in range(2):
        robot.wait_for_request()
    robot.service.receive_answer(b"answer")
    assert call.finish().answer == b"answer"


def test_a_sender_that_raises_does_not_block_the_service():
    def send(request):
        if request == b"bad":
            raise ValueError("no")
        service.receive_answer(b"answer")

    service = RobotService(NAME, "hero_msgs/SetOdom", LONG_S, send)
    with pytest.raises(ValueError, match="no"):
        service.call(b"bad")
    assert service.call(b"good") == b"answer"


def test_a_robot_that_leaves_ends_the_call_that_waits():
    robot = Robot(LONG_S)
    call = Call(robot.service, b"request")
    robot.wait_for_request()
    robot.service.fail("silent for 6.1 s")
    assert call.finish().error == "/hero_0/set_odom was not answered: silent for 6.1 s"
    # The robot is back.
    call = Call(robot.service, b"again")
    robot.wait_for_request()
    robot.service.receive_answer(b"answer")
    assert call.finish().answer == b"answer"


def test_a_robot_that_leaves_between_calls_does_not_fail_the_next_one():
    robot = Robot(LONG_S)
    robot.service.fail("gone")
    call = Call(robot.service, b"request")
    robot.wait_for_request()
    robot.service.receive_answer(b"answer")
    assert call.finish().answer == b"answer"


def test_a_call_without_an_answer_ends_with_the_name_of_the_parameter():
    robot = Robot(SHORT_S)
    with pytest.raises(rospy.ServiceException, match=r"was not answered within 0.1 s \(~service_timeout_s\)"):
        robot.service.call(b"request")


def test_a_late_answer_is_not_taken_for_that_of_the_next_call():
    robot = Robot(SHORT_S)
    with pytest.raises(rospy.ServiceException, match="not answered within"):
        robot.service.call(b"first")
    # The answer of the first call is still on its way; the service is closed for as long again.
    robot.service._timeout_s = LONG_S
    robot.service._late_until_s += LONG_S
    with pytest.raises(rospy.ServiceException, match="has not answered the call before this one yet; try again in"):
        robot.service.call(b"second")
    assert robot.requests == [b"first"]
    assert robot.service.receive_answer(b"late") == b"first"
    call = Call(robot.service, b"third")
    for _ in range(2):
        robot.wait_for_request()
    assert robot.service.receive_answer(b"answer") == b"third"
    assert call.finish().answer == b"answer"


def test_a_new_connection_ends_the_wait_for_a_late_answer():
    robot = Robot(SHORT_S)
    with pytest.raises(rospy.ServiceException):
        robot.service.call(b"first")
    robot.service.fail("the robot left")
    assert robot.service.receive_answer(b"of nobody") is None
    robot.service._timeout_s = LONG_S
    call = Call(robot.service, b"second")
    for _ in range(2):
        robot.wait_for_request()
    robot.service.receive_answer(b"answer")
    assert call.finish().answer == b"answer"


def test_an_answer_that_nobody_asked_for_is_ignored():
    robot = Robot(LONG_S)
    assert robot.service.receive_answer(b"unasked") is None
    call = Call(robot.service, b"request")
    robot.wait_for_request()
    robot.service.receive_answer(b"answer")
    assert call.finish().answer == b"answer"
    assert robot.service.receive_answer(b"unasked") is None


def test_callers_that_wait_too_long_for_their_turn_are_told_that_the_service_is_busy():
    entered, leave = threading.Event(), threading.Event()

    def send(request):
        entered.set()
        leave.wait(DEADLINE_S)
        return "enough"

    service = RobotService(NAME, "hero_msgs/SetOdom", SHORT_S, send)
    first = Call(service, b"first")
    assert entered.wait(DEADLINE_S)
    with pytest.raises(rospy.ServiceException, match="is busy: earlier calls took longer than"):
        service.call(b"second")
    leave.set()
    assert "enough" in first.finish().error
