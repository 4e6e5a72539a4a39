"""Documents list what programs declare."""

from hero_node.parameters import choice, flag, number, robot_ids, string, whole_number
from hero_test.checks.parameter_list import make_list

DECLARED = {
    "rate_hz": number(10.0, 1.0, 30.0, "Hz", "of updates"),
    "port": whole_number(8088, 0, 65535, text="TCP port"),
    "control": flag(False, "whether pages may drive"),
    "view": choice("orbit", ("orbit", "top"), "of the camera"),
    "frame": string("map", "where poses are"),
    "robots": robot_ids("0-2", "their ids"),
}


def test_a_list_says_what_is_declared():
    assert make_list(DECLARED) == [
        "- `~rate_hz` (`10.0`, 1.0 to 30.0 Hz): of updates",
        "- `~port` (`8088`, 0 to 65,535): TCP port",
        "- `~control` (`false`): whether pages may drive",
        "- `~view` (`orbit`, `top`): of the camera",
        "- `~frame` (`map`): where poses are",
        "- `~robots` (`0-2`): their ids",
    ]
    assert make_list({"mean": string("x", "many words " * 20)})[0].splitlines()[1].startswith("  ")
