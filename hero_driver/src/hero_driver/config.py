"""The node's private parameters: read once, checked, frozen.

The rooms declare those that they depend on, DriverConfig the others. docs/driver_parameters.md and
config/hero_driver.yaml are generated from these declarations.
"""

import dataclasses
from dataclasses import dataclass
from typing import Any, Dict, Mapping, Optional, Tuple

from hero_node.errors import ProgramError
from hero_node.number_checks import is_whole_number
from hero_node.parameters import (
    Parameter,
    check_parameters,
    choice,
    declare,
    find_declared,
    make_error,
    number,
    whole_number,
    words,
)
from hero_node.yaml_text import read_calibrations

from .commands.command_settings import CommandSettings
from .corrections.correction_settings import CorrectionSettings, OwnWheels
from .corrections.robot_models import HERO_PLUS, STOCK
from .fleet.admission import AdmissionLimits
from .rosserial.session import SessionLimits
from .transport.link import Address

DEFAULT_PORT = 11411


def _read_robots(name: str, value: Any) -> Tuple[Address, ...]:
    allowed = "a list of {host: name or address, port: 1 to 65535}"
    if not isinstance(value, (list, tuple)):
        raise make_error(name, value, allowed)
    addresses = []
    for entry in value:
        if not isinstance(entry, dict) or not set(entry) <= {"host", "port"}:
            raise make_error(name, entry, allowed)
        host, port = entry.get("host"), entry.get("port", DEFAULT_PORT)
        if not isinstance(host, str) or not host or not is_whole_number(port, 1, 65535):
            raise make_error(name, entry, allowed)
        addresses.append(Address(host, port))
    if len(set(addresses)) != len(addresses):
        raise make_error(name, value, "a list that names no robot twice")
    return tuple(addresses)


@dataclass(frozen=True)
class DriverConfig(CommandSettings, CorrectionSettings, SessionLimits, AdmissionLimits):
    """All parameters of the driver."""

    host: str = declare(words("0.0.0.0", "address to listen on; empty: only connect to ~robots"))
    port: int = declare(whole_number(DEFAULT_PORT, 0, 65535, "", "TCP port to listen on; 0: any free port"))
    robots: Tuple[Address, ...] = declare(
        Parameter((), _read_robots, "robots that are TCP servers, to connect to: a list of {host, port}")
    )
    declare_timeout_s: float = declare(
        number(20.0, 2.0, 600.0, "s", "time for a robot to declare a topic that identifies it; then it is disconnected")
    )
    grace_s: float = declare(
        number(10.0, 0.0, 3600.0, "s", "time that a robot's topics and id are kept after it disconnects")
    )
    start_stopped: str = declare(
        choice(
            "as_before",
            ("as_before", "always", "never"),
            "whether robots are stopped when the driver starts;"
            " as_before: if they were when a driver of this name and master ended",
        )
    )
    transform_period_s: float = declare(
        number(0.01, 0.001, 1.0, "s", "period at which the transforms of all robots are published")
    )
    report_period_s: float = declare(number(1.0, 0.1, 60.0, "s", "period of ~robots and /diagnostics"))


PARAMETERS = find_declared(DriverConfig)

FORMER_STOP = "stopped"
"""Set by version 0.2 itself, to keep a stop: a running ROS master may still hold it. It has no effect."""


def read_config(given: Mapping[str, Any]) -> DriverConfig:
    """Return the checked configuration in the given parameters (names without "~").

    Raises: ProgramError, also for a calibration file that calibrate did not write.
    """
    given = {name: value for name, value in given.items() if name != FORMER_STOP}
    config = DriverConfig(**check_parameters(PARAMETERS, given))
    own_wheels = read_calibrations(config.calibration_folder, "wheels_m", _convert_wheels)
    if not config.host and not config.robots:
        raise ProgramError(
            "~host is empty and ~robots too: the driver would neither listen nor dial;"
            " give an address to listen on (0.0.0.0 for all) or robots to dial"
        )
    return dataclasses.replace(config, own_wheels=own_wheels)


def _convert_wheels(lengths: Any, content: Dict[str, Any]) -> OwnWheels:
    left_m, right_m, separation_m = wheels_m = [float(length) for length in lengths]
    if not all(0.01 <= length_m <= 1.0 for length_m in wheels_m):
        raise ValueError("wheels_m must be from 0.01 to 1 m")
    ticks_per_turn: Optional[float] = content.get("ticks_per_turn")
    if ticks_per_turn is not None and not float(ticks_per_turn) >= 1.0:
        raise ValueError("ticks_per_turn must be 1 or more")
    model = content.get("model", "")
    if model not in ("", STOCK, HERO_PLUS):
        raise ValueError(f"model must be {STOCK} or {HERO_PLUS}, not {model!r}")
    diameter_m, ratio = (left_m + right_m) / 2.0, right_m / left_m
    return OwnWheels(diameter_m, separation_m, ratio, ticks_per_turn and float(ticks_per_turn), model)
