"""Parameters are declared once: checked values, one line for wrong ones, and the documents' list."""

import argparse
import math

import pytest

from hero_node.errors import ProgramError
from hero_node.parameters.declared import (
    MAX_COORDINATE_M,
    MAX_ROBOTS_IN_RANGE,
    check_parameters,
    choice,
    explicit_ids_option,
    flag,
    number,
    parse_explicit_ids,
    parse_poses,
    parse_robot_ids,
    robot_ids,
    robot_ids_option,
    string,
    whole_number,
    within,
)

DECLARED = {
    "rate_hz": number(10.0, 1.0, 30.0, "Hz", "of updates"),
    "port": whole_number(8088, 0, 65535, text="TCP port"),
    "control": flag(False, "whether pages may drive"),
    "view": choice("orbit", ("orbit", "top"), "of the camera"),
    "frame": string("map", "where poses are"),
    "robots": robot_ids("0-2", "their ids"),
}


def test_missing_parameters_have_their_defaults():
    values = check_parameters(DECLARED, {"port": 80.0})
    assert values == {
        "rate_hz": 10.0, "port": 80, "control": False, "view": "orbit", "frame": "map", "robots": [0, 1, 2]
    }  # fmt: skip


@pytest.mark.parametrize(
    "name, value, allowed",
    [
        ("rate_hz", 31, "~rate_hz is 31, but must be a number from 1 to 30 Hz"),
        ("rate_hz", True, "~rate_hz is True"),
        ("rate_hz", float("nan"), "~rate_hz is nan"),
        ("port", 80.5, "~port is 80.5, but must be a whole number from 0 to 65535"),
        ("port", float("inf"), "~port is inf"),
        ("control", 1, "~control is 1, but must be true or false"),
        ("view", ["top"], "but must be one of: orbit, top"),
        ("frame", 3, "~frame is 3, but must be a text"),
        ("rate", 3, "unknown parameter ~rate; did you mean ~rate_hz"),
        ("a\nb", 3, "unknown parameter ~'a\\nb'; known are: control, frame, port"),
    ],
)
def test_a_wrong_value_is_one_line_with_what_is_allowed(name, value, allowed):
    with pytest.raises(ProgramError) as raised:
        check_parameters(DECLARED, {name: value})
    assert allowed in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize("low, high, unit", [(1.0, 30.0, ""), (-1.0, 1.0, "m")])
def test_limits_belong_to_what_is_allowed(low, high, unit):
    for make in (number, whole_number):
        check = make(low, low, high, unit).check
        assert (check("x", low), check("x", high)) == (low, high)
        for value in (low - 1, high + 1, "1", None, True):
            with pytest.raises(ProgramError, match="~x is .* from %g to %g( m)?$" % (low, high)):
                check("x", value)


def test_declared_values_without_a_check_are_taken_as_they_are():
    assert check_parameters({"x": None, "y": number(1.0, 0.0, 2.0)}, {"x": "any", "y": 2}) == {"x": "any", "y": 2.0}
    assert check_parameters({"x": 7}, {}) == {"x": 7}
    with pytest.raises(ProgramError, match="^unknown parameter ~zz0; known are: x$"):
        check_parameters({"x": 7}, {"zz%d" % number: 1 for number in range(9, -1, -1)})


@pytest.mark.parametrize(
    "value, ids",
    [
        ("all", None),
        (3, [3]),
        ("0", [0]),
        ([4, "2-3"], [4, 2, 3]),
        ((0, 1), [0, 1]),
        ("0 1,2", [0, 1, 2]),
        ("2-2", [2]),
        ("1-%d" % MAX_ROBOTS_IN_RANGE, list(range(1, MAX_ROBOTS_IN_RANGE + 1))),
    ],
)
def test_robots_are_given_in_many_ways(value, ids):
    assert parse_robot_ids("robots", value) == ids
    assert robot_ids_option(value) == ids


@pytest.mark.parametrize(
    "value, reason",
    [
        ("", "is empty"),
        ([], "is empty"),
        (-1, "holds -1"),
        ("1-%d" % (MAX_ROBOTS_IN_RANGE + 1), "holds '1-1001'"),
        ("3-2", "holds '3-2'"),
        ("1-", "holds '1-'"),
        ("-1", "holds '-1'"),
        ("x", "holds 'x'"),
        (True, "holds True"),
        (1.5, "holds 1.5"),
        ("0-2 1", "names robot 1 more than once"),
    ],
)
def test_what_are_no_ids_of_robots_is_named(value, reason):
    with pytest.raises(ProgramError) as raised:
        parse_robot_ids("robots", value)
    assert str(raised.value).startswith("~robots " + reason)
    with pytest.raises(argparse.ArgumentTypeError, match="^it "):
        robot_ids_option(value)


@pytest.mark.parametrize("value", ["all", "1 x", "", "3-1"])
def test_robots_that_nothing_looks_for_must_be_given_by_their_ids(value):
    with pytest.raises(ProgramError, match="~robots"):
        parse_explicit_ids("robots", value)
    with pytest.raises(argparse.ArgumentTypeError, match="^it "):
        explicit_ids_option(value)
    assert parse_explicit_ids("robots", "0 2-3") == explicit_ids_option("0 2-3") == [0, 2, 3]


def test_numbers_of_options_lie_within_their_limits():
    assert [within(1, 5, int)(text) for text in ("1", "5")] == [1, 5]
    assert [within(0.5, 2.5)(text) for text in ("0.5", "2.5", "1")] == [0.5, 2.5, 1.0]
    for text in ("0", "6", "2.0", "x", ""):
        with pytest.raises(argparse.ArgumentTypeError, match="^%s must be a whole number from 1 to 5$" % text):
            within(1, 5, int)(text)
    for text in ("0.4", "2.6", "nan", "inf", "x"):
        with pytest.raises(argparse.ArgumentTypeError, match="^%s must be a number from 0.5 to 2.5$" % text):
            within(0.5, 2.5)(text)


def test_poses_belong_to_robots_in_their_order():
    far = "%g -%g" % (MAX_COORDINATE_M, MAX_COORDINATE_M)
    poses = parse_poses("poses", "0 0.5; 0.3 -1 90;%s;" % far, [4, 2, 0])
    assert poses == {
        4: (0.0, 0.5, None), 2: (0.3, -1.0, math.pi / 2.0), 0: (MAX_COORDINATE_M, -MAX_COORDINATE_M, None)
    }  # fmt: skip
    assert list(poses) == [4, 2, 0]
    assert parse_poses("poses", " ; ", None) == {}


@pytest.mark.parametrize(
    "text, ids, reason",
    [
        ("0 0", None, "has 1 poses for all robots"),
        ("0 0; 1 1", [3], "has 2 poses for 1 robots"),
        ("0 0", [], "has 1 poses for 0 robots"),
        ("0", [3], "holds '0'"),
        ("0 0 0 0", [3], "holds '0 0 0 0'"),
        ("0 x", [3], "holds '0 x'"),
        ("0 nan", [3], "holds '0 nan'"),
        ("0 1e7", [3], "holds '0 1e7'"),
    ],
)
def test_what_are_no_poses_is_named_with_the_remedy(text, ids, reason):
    with pytest.raises(ProgramError) as raised:
        parse_poses("poses", text, ids)
    assert str(raised.value).startswith("~poses %s" % reason)
    assert 'must hold "x y" or "x y heading"' in str(raised.value)


def test_a_range_of_ids_holds_a_thousand_at_most():
    assert len(parse_robot_ids("robots", "1-1000")) == 1000
    with pytest.raises(ProgramError, match="~robots holds '0-1000'"):
        parse_robot_ids("robots", "0-1000")
