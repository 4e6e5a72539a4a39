"""Services of a robot: one call at a time, each with an answer, a reason, or a time limit."""

import queue
from concurrent.futures import ThreadPoolExecutor

import pytest
import rospy

from hero_driver.ros import services
from hero_driver.ros.services import LATE_ANSWER_S, RobotService
from hero_driver.transport.event_loop import NoAnswerError

NAME = "/hero_0/set_odom"
TIMEOUT_S = 4.0


class Robot:
    """The robot's end, and the loop with a clock of its own: keeps requests and the answers that callers got."""

    def __init__(self, monkeypatch):
        self.requests = []
        self.answers = {}
        self.refusal = None
        self.now_s = 100.0
        self.timers = []
        monkeypatch.setattr(services.time, "monotonic", lambda: self.now_s)
        self.service = RobotService(NAME, "hero_msgs/SetOdom", TIMEOUT_S, lambda *sent: self.send_request(*sent), self)

    def send_request(self, service, request):
        self.requests.append(request)
        return self.refusal

    def ask(self, call, timeout_s):
        """Stand for EventLoop.ask() of a caller that is still waiting when this returns."""
        answers = []
        call(answers.append)
        return answers[0] if answers else (b"still waiting", "")

    def call_later(self, delay_s, call):
        self.timers.append((self.now_s + delay_s, call))

    def advance(self, delay_s):
        """Let delay_s pass; run the timers that are due."""
        self.now_s += delay_s
        due = [call for due_s, call in self.timers if due_s <= self.now_s]
        self.timers = [timer for timer in self.timers if timer[0] > self.now_s]
        for call in due:
            call()

    def call(self, request):
        """Begin a call; its answer, or its failure, will be in answers."""
        self.service._begin(request, lambda answer: self.answers.__setitem__(request, answer[0] or answer[1]))


@pytest.fixture
def robot(monkeypatch):
    return Robot(monkeypatch)


def test_a_call_returns_the_robots_answer(robot):
    robot.call(b"request")
    assert robot.requests == [b"request"]
    assert robot.answers == {}
    assert robot.service.receive_answer(b"answer") == b"request"
    assert robot.answers == {b"request": b"answer"}


def test_a_caller_gets_the_answer_that_came_while_the_request_was_sent(robot):
    robot.send_request = lambda service, request: service.receive_answer(b"quick") and None
    assert robot.service.call(b"request") == b"quick"


def test_a_second_call_is_sent_once_the_first_is_answered(robot):
    sent = queue.Queue()
    robot.send_request = lambda service, request: sent.put(request)

    def ask(call, timeout_s):
        answers = queue.Queue()
        call(answers.put)
        return answers.get()

    robot.ask = ask
    with ThreadPoolExecutor(2) as callers:
        first = callers.submit(robot.service.call, b"first")
        assert sent.get() == b"first"
        second = callers.submit(robot.service.call, b"second")
        robot.service.receive_answer(b"one")
        assert sent.get() == b"second"
        robot.service.receive_answer(b"two")
        assert (first.result(), second.result()) == (b"one", b"two")


def test_a_call_that_hung_with_the_loop_gets_no_answer_of_another(robot):
    robot.call(b"given up")
    robot.call(b"next")
    assert robot.answers[b"next"].startswith("has not answered the call before this one yet; try again in 34 s")
    assert robot.requests == [b"given up"]


def test_a_call_that_cannot_be_sent_fails_with_the_reason(robot):
    robot.refusal = "the robot is not connected"
    with pytest.raises(rospy.ServiceException, match="/hero_0/set_odom cannot be called: the robot is not connected"):
        robot.service.call(b"request")
    robot.refusal = None
    robot.call(b"again")
    robot.service.receive_answer(b"answer")
    assert robot.answers == {b"again": b"answer"}


def test_a_call_fails_where_the_loop_does_not_answer(robot):
    def hang(call, timeout_s):
        raise NoAnswerError("no answer within %g s" % timeout_s)

    robot.ask = hang
    for request in (b"request", b"again"):
        with pytest.raises(rospy.ServiceException, match="/hero_0/set_odom was not answered: no answer within 5 s"):
            robot.service.call(request)


def test_a_robot_that_leaves_ends_the_call_that_waits(robot):
    robot.call(b"request")
    robot.service.fail("silent for 6.1 s")
    assert robot.answers == {b"request": "was not answered: silent for 6.1 s"}
    robot.call(b"again")
    robot.service.receive_answer(b"answer")
    assert robot.answers[b"again"] == b"answer"


def test_a_robot_that_leaves_between_calls_does_not_fail_the_next_one(robot):
    robot.service.fail("gone")
    robot.call(b"request")
    robot.service.receive_answer(b"answer")
    assert robot.answers == {b"request": b"answer"}


def test_a_call_without_an_answer_ends_with_the_name_of_the_parameter(robot):
    robot.call(b"request")
    robot.advance(TIMEOUT_S)
    assert robot.answers == {b"request": "was not answered within 4.0 s (~service_timeout_s)"}


def test_a_late_answer_is_not_taken_for_that_of_the_next_call(robot):
    robot.call(b"first")
    robot.advance(TIMEOUT_S)
    robot.call(b"second")
    assert robot.answers[b"second"].startswith("has not answered the call before this one yet; try again in 30 s")
    assert robot.requests == [b"first"]
    assert robot.service.receive_answer(b"late") == b"first"
    robot.call(b"third")
    assert robot.service.receive_answer(b"answer") == b"third"
    assert robot.answers[b"third"] == b"answer"


@pytest.mark.parametrize("delay_s", [0.5, 1.1, 2.5, 5.0])
def test_of_a_robot_that_answers_late_no_call_gets_the_answer_of_another(robot, delay_s):
    """delay_s: in units of the time limit."""
    on_their_way = []

    def send_request(service, request):
        on_their_way.append((robot.now_s + delay_s * TIMEOUT_S, request))

    robot.send_request = send_request
    for number in range(500):
        robot.call(b"%d" % number)
        robot.advance(0.1 * TIMEOUT_S)
        while on_their_way and on_their_way[0][0] <= robot.now_s:
            robot.service.receive_answer(b"answer " + on_their_way.pop(0)[1])
    answered = {request: answer for request, answer in robot.answers.items() if isinstance(answer, bytes)}
    assert bool(answered) == (delay_s < 1.0)
    assert all(answer == b"answer " + request for request, answer in answered.items())


def test_a_lost_answer_closes_the_service_for_30_s_and_not_for_ever(robot):
    robot.call(b"first")
    robot.advance(TIMEOUT_S)
    robot.advance(0.99 * LATE_ANSWER_S)
    robot.call(b"second")
    assert robot.requests == [b"first"]
    robot.advance(0.01 * LATE_ANSWER_S)
    for request in (b"third", b"fourth"):
        robot.call(request)
        robot.service.receive_answer(b"answer of " + request)
        assert robot.answers[request] == b"answer of " + request


def test_a_robot_that_never_answers_is_asked_again_and_again(robot):
    for number in range(1, 4):
        robot.call(b"%d" % number)
        robot.advance(TIMEOUT_S)
        robot.advance(LATE_ANSWER_S)
        assert len(robot.requests) == number


def test_a_new_connection_ends_the_wait_for_a_late_answer(robot):
    robot.call(b"first")
    robot.advance(TIMEOUT_S)
    robot.service.fail("the robot left")
    assert robot.service.receive_answer(b"of nobody") is None
    robot.call(b"second")
    robot.service.receive_answer(b"answer")
    assert robot.answers[b"second"] == b"answer"


def test_an_unrequested_answer_is_ignored(robot):
    assert robot.service.receive_answer(b"unasked") is None
    robot.call(b"request")
    robot.service.receive_answer(b"answer")
    assert robot.answers == {b"request": b"answer"}
    assert robot.service.receive_answer(b"unasked") is None


def test_a_caller_whose_turn_does_not_come_is_told_that_it_is_busy(robot):
    service = RobotService(NAME, "hero_msgs/SetOdom", 0.01, robot.send_request, robot)
    with service._turn, pytest.raises(rospy.ServiceException, match="/hero_0/set_odom is busy"):
        service.call(b"request")
    assert robot.requests == []
