"""The frame of a program: signals and other ends become one flag, which cuts its waits short."""

import os
import signal
import sys
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest

from hero_node.ros import program as program_module
from hero_node.ros.private_parameters import delete_own_parameters
from hero_node.ros.program import ENDING_SIGNALS, SHUTDOWN_WAIT_S, Program
from hero_node.ros.ros_node import start_ros_node

WAIT_S = 600.0
"""Longer than a test may take: what waits for it, waits for ever."""


class Ros:
    """What a program asks of ROS and of the system."""

    def __init__(self, monkeypatch):
        self.handlers, self.hooks, self.steps = {}, [], []
        self.start = create_autospec(start_ros_node)
        delete = create_autospec(delete_own_parameters, side_effect=lambda: self.steps.append("delete parameters"))
        monkeypatch.setattr(program_module.signal, "signal", self.handlers.__setitem__)
        monkeypatch.setattr(program_module, "start_ros_node", self.start)
        monkeypatch.setattr(program_module, "delete_own_parameters", delete)
        monkeypatch.setattr(program_module.rospy, "on_shutdown", self.hooks.append)
        monkeypatch.setattr(program_module.rospy, "signal_shutdown", self.shut_down)
        self.program = Program("walk", anonymous=True)
        self.waits_s = []
        self.program._finished = SimpleNamespace(set=lambda: self.steps.append("finished"), wait=self.waits_s.append)

    def shut_down(self, reason):
        assert reason
        self.steps.append("shut down")


@pytest.fixture(name="ros")
def make_ros(monkeypatch):
    return Ros(monkeypatch)


@pytest.mark.parametrize("number", ENDING_SIGNALS)
def test_each_signal_that_ends_a_program_cuts_its_waits_short(ros, number):
    program = ros.program
    ros.start.assert_called_once_with("walk", True)
    assert set(ros.handlers) == {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
    assert program.running and program.sleep(0.0) and program.end_signal is None
    ros.handlers[number](number, None)
    assert not program.running and program.end_signal == number
    assert not program.sleep(WAIT_S) and program.wait_readable([], WAIT_S) == []


def test_a_wait_that_has_begun_ends_with_the_program(ros, monkeypatch):
    select = program_module.select.select

    def end_meanwhile(*arguments):
        ros.program.end()
        return select(*arguments)

    monkeypatch.setattr(program_module.select, "select", end_meanwhile)
    assert not ros.program.sleep(WAIT_S)


def test_a_program_can_be_ended_again_and_again(ros):
    for _ in range(2**17):  # more than the pipe of wake-ups takes
        ros.program.end()
    assert not ros.program.running


def test_a_node_that_is_killed_waits_until_robots_are_stopped(ros):
    (hook,) = ros.hooks
    with ros.program as program:
        hook()
        assert not program.running and ros.waits_s == [SHUTDOWN_WAIT_S] and not ros.steps
    # In this order: the end of ROS waits for what is not finished.
    assert ros.steps == ["finished", "delete parameters", "shut down"]


def test_a_program_that_leaves_its_block_by_an_error_has_ended(ros):
    with pytest.raises(ZeroDivisionError), ros.program:
        raise ZeroDivisionError
    assert not ros.program.running and ros.steps == ["finished", "delete parameters", "shut down"]


@pytest.fixture(name="typed")
def make_stdin(monkeypatch):
    read_end, write_end = os.pipe()
    with open(read_end) as file:
        monkeypatch.setattr(sys, "stdin", file)
        yield write_end


def test_questions_are_answered_line_by_line(ros, typed, capsys):
    os.write(typed, b" Yes\nno\nhalf")
    os.close(typed)
    assert [ros.program.ask("sure? ") for _ in range(4)] == ["yes", "no", "half", None]
    assert capsys.readouterr().out == 4 * "sure? "


def test_a_question_ends_with_the_program_and_needs_a_terminal(ros, typed, monkeypatch):
    ros.program.end()
    os.write(typed, b"yes\n")
    assert ros.program.ask("sure? ") is None
    os.close(typed)
    monkeypatch.setattr(sys, "stdin", None)
    assert ros.program.ask("sure? ") is None
