"""Private parameters of one start of a program do not spoil the next one."""

import sys

import pytest

from hero_node.errors import ProgramError
from hero_node.ros import private_parameters


class Server:
    """A parameter server with what is below a node's name."""

    def __init__(self, monkeypatch, values):
        self.values = values
        monkeypatch.setattr(private_parameters.rospy, "get_param", lambda name, default: self.values or default)
        monkeypatch.setattr(private_parameters.rospy, "delete_param", lambda name: self.values.pop(name[1:]))


def test_what_the_command_line_gave_is_gone_at_the_end(monkeypatch):
    server = Server(monkeypatch, {"linear": 0.1, "launched": 1})
    monkeypatch.setattr(sys, "argv", ["walk", "_missing:=2", "_linear:=0.1", "__name:=walk_2", "/launched:=/other"])
    private_parameters.delete_own_parameters()
    assert server.values == {"launched": 1}


@pytest.mark.parametrize("error", [OSError(110, "no answer"), private_parameters.rospy.ROSException("no master")])
def test_a_master_that_does_not_answer_at_the_end_is_asked_once(monkeypatch, error):
    asked = []

    def delete(name):
        asked.append(name)
        raise error

    monkeypatch.setattr(private_parameters.rospy, "delete_param", delete)
    monkeypatch.setattr(sys, "argv", ["walk", "_linear:=0.1", "_angular:=2"])
    private_parameters.delete_own_parameters()
    assert asked == ["~linear"]


@pytest.mark.parametrize(("arguments", "has_remedy"), [([], True), (["_linear:=0.1"], False)])
def test_a_wrong_parameter_of_an_earlier_start_is_named_with_the_remedy(monkeypatch, arguments, has_remedy):
    Server(monkeypatch, {"linear": 0.1})
    monkeypatch.setattr(sys, "argv", ["walk", *arguments])
    with pytest.raises(ProgramError, match="unknown parameter ~linear") as refused:
        private_parameters.read_parameters({"linear_m_s": 0.1})
    assert ("rosparam delete /" in str(refused.value)) == has_remedy
