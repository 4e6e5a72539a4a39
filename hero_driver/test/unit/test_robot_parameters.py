"""Parameters for robots: which names they may read, and which values fit them."""

import xmlrpc.client

import pytest
import rosgraph
import rospy
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.robot_requests.parameters import (
    EMPTY_ANSWER,
    ParameterRefusedError,
    convert_parameter,
    read_parameter,
    resolve_parameter,
)

ROBOT = "/hero_1"


@pytest.mark.parametrize(
    "name, full_name",
    [
        ("~gain", "/hero_1/gain"),
        ("~/gain", "/hero_1/gain"),
        ("~motors/left", "/hero_1/motors/left"),
        ("gain", "/hero_1/gain"),
        ("motors/left", "/hero_1/motors/left"),
        ("/hero_1/gain", "/hero_1/gain"),
    ],
)
@pytest.mark.parametrize("may_leave", [False, True])
def test_names_are_below_the_robots_own_namespace(name, full_name, may_leave):
    assert resolve_parameter(name, ROBOT, may_leave) == full_name


@pytest.mark.parametrize("name", ["/gain", "/hero_2/gain", "/hero_10/gain", "/hero_1", "/", "/run_id"])
def test_other_names_are_refused_unless_that_is_allowed(name):
    with pytest.raises(ParameterRefusedError, match="outside /hero_1"):
        resolve_parameter(name, ROBOT, False)
    assert resolve_parameter(name, ROBOT, True) == name


@given(name=st.text(max_size=30))
def test_any_name_is_below_the_namespace_or_refused_in_one_line(name):
    try:
        assert resolve_parameter(name, ROBOT, False).startswith(ROBOT + "/")
    except ParameterRefusedError as error:
        assert str(error).isprintable()


@pytest.mark.parametrize(
    "value, answer",
    [
        (7, ([7], [], [])),
        (True, ([1], [], [])),
        (False, ([0], [], [])),
        (0.5, ([], [0.5], [])),
        ("text", ([], [], ["text"])),
        ("", ([], [], [""])),
        ([1, 2, 3], ([1, 2, 3], [], [])),
        ([True, False, 2], ([1, 0, 2], [], [])),
        ([1, 2.5], ([], [1.0, 2.5], [])),
        (["a", "b"], ([], [], ["a", "b"])),
        ([], ([], [], [])),
    ],
)
def test_numbers_texts_and_lists_of_one_of_them_fit(value, answer):
    converted = convert_parameter(value)
    assert converted == answer
    assert all(type(number) is int for number in converted.ints)
    assert all(type(number) is float for number in converted.floats)


@pytest.mark.parametrize("value", [None, {}, {"a": 1}, [1, "a"], [True, 0.5], [[1]], [None], ["a", 1.0]])
def test_everything_else_does_not_fit(value):
    assert convert_parameter(value) is None


def test_an_answer_about_nothing_is_three_empty_lists():
    assert EMPTY_ANSWER == ([], [], [])


@pytest.mark.parametrize(
    "error",
    [
        ConnectionRefusedError("nobody there"),
        rosgraph.MasterException("nobody there"),
        xmlrpc.client.Fault(1, "nobody there"),
        rospy.ROSException("nobody there"),
    ],
)
def test_a_parameter_that_cannot_be_asked_for_is_refused_by_name(monkeypatch, error):
    def fail(name, default):
        raise error

    monkeypatch.setattr(rospy, "get_param", fail)
    with pytest.raises(ParameterRefusedError, match="/hero_1/gain' cannot be read: .*nobody there"):
        read_parameter("/hero_1/gain")
