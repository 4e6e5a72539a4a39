"""What is a number."""

import resource
import sys

import numpy as np
import pytest

from hero_node import processes
from hero_node.parameters.number_checks import check_finite, check_speed, is_number, is_whole_number

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("value", [True, "1", None, NAN, INF, -INF, 10**400, [1]])
def test_what_is_no_finite_number(value):
    assert not is_number(value) and not is_whole_number(value)


def test_limits_belong_to_the_range():
    assert is_number(0.5) and is_number(1, 1, 2) and is_number(2, 1, 2) and not is_number(2.1, 1, 2)
    assert is_whole_number(1, 1, 2) and not is_whole_number(1.0) and not is_whole_number(3, 1, 2)
    assert is_whole_number(-3) and is_number(-3) and is_whole_number(10**300) and not is_whole_number(0, 1)


def test_goals_and_speeds_are_finite_numbers_also_of_numpy():
    check_finite("x", 1, -2.5, np.float32(3.0))
    for wrong in (NAN, INF, "1", None, 1j, 10**400, np.array([0.5])):
        with pytest.raises(ValueError, match="x must be finite numbers, not 0.5, "):
            check_finite("x", 0.5, wrong)
    check_speed(-3.0, 0.1)
    for distance, speed in ((0.1, 0.0), (0.1, -0.1), (0.1, NAN), (0.1, INF), (NAN, 0.1), (INF, 0.1), ("1", 0.1)):
        with pytest.raises(ValueError, match="distance or angle must be finite, the speed positive"):
            check_speed(distance, speed)


def test_the_limit_of_files_is_raised_to_what_needs_no_privileges(monkeypatch):
    calls = []
    monkeypatch.setattr(processes.resource, "setrlimit", lambda *arguments: calls.append(arguments))
    for limits, expected in (((1024, 4096), 4096), ((4096, 4096), 4096), ((1024, resource.RLIM_INFINITY), sys.maxsize)):
        monkeypatch.setattr(processes.resource, "getrlimit", lambda kind, limits=limits: limits)
        assert processes.raise_file_limit() == expected
    hard = [(resource.RLIMIT_NOFILE, (limit, limit)) for limit in (4096, resource.RLIM_INFINITY)]
    assert calls == hard
