"""What is a number."""

import pytest

from hero_node.number_checks import is_number, is_whole_number

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("value", [True, "1", None, NAN, INF, -INF, 10**400, [1]])
def test_what_is_no_finite_number(value):
    assert not is_number(value) and not is_whole_number(value)


def test_limits_belong_to_the_range():
    assert is_number(0.5) and is_number(1, 1, 2) and is_number(2, 1, 2) and not is_number(2.1, 1, 2)
    assert is_whole_number(1, 1, 2) and not is_whole_number(1.0) and not is_whole_number(3, 1, 2)
