"""Options of the simulator: what they are unless they are given, and the numbers that they take."""

import re
import runpy
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from driver_side import parse_options

from hero_sim.build import build_simulator
from hero_sim.errors import OptionError
from hero_sim.key_values import parse_values
from hero_sim.link.tcp_link import TcpLink
from hero_sim.robot_constants import MAX_ID
from hero_sim.world.robot_errors import KINDS

README = Path(__file__).resolve().parents[2] / "README.md"

DEFAULTS = {
    "count": 1, "seed": 0, "arena": None, "wifi": "ideal", "seconds": None, "perfect": False, "model": [],
    "first_id": 0, "speed": 1.0, "quiet": False, "host": "127.0.0.1", "port": 11411, "fault": [], "imu_hat": False,
    "error": [], "errors": None, "print_errors": False, "ir": "calibrated", "motors": "calibrated",
    "servo_timing": "core2", "flash_dir": None,
}  # fmt: skip


def test_options_that_are_not_given_are_those_of_the_readme():
    assert vars(parse_options()) == DEFAULTS
    told = dict(re.findall(r"`--([a-z-]+)[^`]*` \(([\w.]+)\)", README.read_text(encoding="utf-8")))
    told = {name.replace("-", "_"): value for name, value in told.items()}
    assert {"count", "first_id", "seed", "speed", "host", "port", "wifi", "ir", "motors", "servo_timing"} <= set(told)
    for name, value in told.items():
        default = DEFAULTS[name] if name != "model" else "hero"
        assert type(default)(value) == default, name


@pytest.mark.parametrize(
    ("option", "within", "beyond"),
    [
        ("count", ("1", "1000"), ("0", "1001", "1.5")),
        ("first-id", ("0", str(MAX_ID)), ("-1", str(MAX_ID + 1))),
        ("seed", ("0", str(2**32 - 1)), ("-1", str(2**32))),
        ("speed", ("0.01", "100"), ("0.0099", "100.1", "nan")),
        ("port", ("1", "65535"), ("0", "65536")),
        ("seconds", ("0.001", "1e9"), ("0", "1.1e9")),
        ("ir", ("calibrated", "factory", "erased"), ("none",)),
        ("motors", ("calibrated", "factory"), ("erased",)),
        ("servo-timing", ("core2", "core3", "drawn"), ("core1",)),
    ],
)
def test_numbers_and_names_are_taken_up_to_their_ends(option, within, beyond, capsys):
    for value in within:
        taken = getattr(parse_options(f"--{option}={value}"), option.replace("-", "_"))
        assert taken == type(taken)(value)
    for value in beyond:
        with pytest.raises(SystemExit) as refused:
            parse_options(f"--{option}={value}")
        assert refused.value.code == 2 and f"--{option}" in capsys.readouterr().err


def test_ids_of_many_robots_end_with_the_last_one():
    assert parse_options("--count=3", f"--first-id={MAX_ID - 2}").first_id == MAX_ID - 2
    with pytest.raises(SystemExit):
        parse_options("--count=3", f"--first-id={MAX_ID - 1}")


def test_errors_of_robots_are_taken_up_to_their_ends():
    """Beyond, what is simulated would mean nothing; to renew the list, see kept_results."""
    limits = {key: (kind.least, kind.most) for key, kind in KINDS.items() if not key.startswith("alpha")}
    assert limits == {
        "left_center_us": (1000, 2000), "right_center_us": (1000, 2000), "dead_zone_us": (0, 200),
        "left_gain": (0, 5), "right_gain": (0, 5), "lag_s": (0.001, 5), "left_wheel": (0.5, 2),
        "right_wheel": (0.5, 2), "wheel_separation_m": (0.02, 0.2), "radius_m": (0.03, 0.2), "slip": (0, 0.5),
        "ripple_m_s": (0, 0.1), "friction": (0, 2), "robot_friction": (0, 2), "wall_friction": (0, 2),
        "caster_friction": (0, 2), "wheel_friction": (0.05, 5), "creep_m_s": (1e-4, 10), "wheel_load": (0.1, 1),
        "mass_kg": (0.02, 5), "beta_counts": (-20, 20),
    }  # fmt: skip
    assert {(KINDS[key].least, KINDS[key].most) for key in KINDS if key.startswith("alpha")} == {(0.01, 10)}


def test_values_are_taken_with_spaces_and_at_both_ends():
    assert parse_values("option", "a = 1, b=-2.5,,a=3", {"a": (0, 3), "b": (-2.5, 1)}) == {"a": 3.0, "b": -2.5}
    for text, told in (("a=3.5", "a must be 0..3, not 3.5"), ("b=-2.6", "b must be -2.5..1, not -2.6")):
        with pytest.raises(OptionError, match="^option: " + re.escape(told)):
            parse_values("option", text, {"a": (0, 3), "b": (-2.5, 1)})


def test_robots_that_start_are_named_with_the_driver_that_they_seek(monkeypatch):
    closed = []
    monkeypatch.setattr(TcpLink, "close_all", lambda own: closed.append(len(own.own_addresses)))
    for arguments, who in ((("--first-id=4",), "hero_4"), (("--first-id=4", "--count=3"), "hero_4 .. hero_6")):
        lines = []
        build_simulator(parse_options("--port=9", *arguments), lines.append)
        assert lines == [f"{who}: connecting to 127.0.0.1:9"] and closed == []
    with pytest.raises(OSError, match="Not a directory"):
        build_simulator(parse_options("--port=9", "--count=2", f"--flash-dir={__file__}/flash"), print)
    assert closed == [2], "no connection is left open"


def test_the_infrared_and_the_servos_of_a_flash_are_as_asked(tmp_path):
    def build(*arguments):
        errors = "--error=alpha_counts_m2=0.4,left_center_us=1511.4"
        simulator, _ = build_simulator(parse_options("--port=9", errors, *arguments), lambda line: None)
        simulator.link.close_all()
        flash = simulator.swarm.robots[-1].flash
        return flash.ir_calibration_counts_m2, flash.motor_centers_us

    constants, centers_us = build("--perfect")
    assert constants == pytest.approx([0.4 - 0.93 * 0.01] * 8) and centers_us == [1511.0, 1500.0]
    constants, centers_us = build("--ir=factory", "--motors=factory")
    assert constants == [0.5] * 8 and centers_us == [1500.0] * 2
    assert np.isnan(build("--ir=erased")[0]).tolist() == [True] * 8
    (tmp_path / "hero_8.json").write_text("{}")
    with pytest.raises(OptionError, match=r"flash file .*hero_8\.json"):
        build("--count=2", "--first-id=7", f"--flash-dir={tmp_path}")


@pytest.mark.filterwarnings("ignore:.*found in sys.modules")
@pytest.mark.parametrize("module", ["hero_sim", "hero_sim.in_process"])
def test_modules_run_as_programs_end_with_their_status(monkeypatch, capsys, module):
    monkeypatch.setattr(sys, "argv", [module, "--no-such-option"])
    handler = signal.getsignal(signal.SIGINT)
    try:
        with pytest.raises(SystemExit) as ended:
            runpy.run_module(module, run_name="__main__")
        assert ended.value.code == 2 and "usage: " in capsys.readouterr().err
        assert (signal.getsignal(signal.SIGINT) == signal.SIG_DFL) == (module == "hero_sim"), "Ctrl-C while it loads"
        monkeypatch.setitem(sys.modules, "hero_sim.main", None)
        with pytest.raises(SystemExit, match="^hero_sim: hero_sim.main is missing; install python3-numpy"):
            runpy.run_module("hero_sim", run_name="__main__")
    finally:
        signal.signal(signal.SIGINT, handler)
