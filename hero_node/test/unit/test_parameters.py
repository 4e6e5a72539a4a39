"""Parameters are declared once: checked values, one line for wrong ones, and the documents' table."""

import pytest

from hero_node.errors import ProgramError
from hero_node.parameter_table import make_table
from hero_node.parameters import check_parameters, choice, flag, number, robot_ids, whole_number, words

DECLARED = {
    "rate_hz": number(10.0, 1.0, 30.0, "Hz", "of updates"),
    "port": whole_number(8088, 0, 65535),
    "control": flag(False, "whether pages may drive"),
    "view": choice("orbit", ("orbit", "top")),
    "frame": words("map", "where poses are"),
    "robots": robot_ids("0-2"),
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
        ("a\nb", 3, "known are: control, frame, port"),
    ],
)
def test_a_wrong_value_is_one_line_with_what_is_allowed(name, value, allowed):
    with pytest.raises(ProgramError) as raised:
        check_parameters(DECLARED, {name: value})
    assert allowed in str(raised.value) and "\n" not in str(raised.value)


def test_a_table_says_what_is_declared():
    lines = make_table(DECLARED)
    assert "| `~rate_hz` | `10.0` | 1.0 to 30.0 Hz | of updates |" in lines
    assert "| `~port` | `8088` | 0 to 65,535 |  |" in lines
    assert "| `~control` | `false` | true, false | whether pages may drive |" in lines
    assert "| `~view` | `orbit` | `orbit`, `top` |  |" in lines
