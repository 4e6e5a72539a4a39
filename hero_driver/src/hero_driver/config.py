"""The node's private parameters: read once, checked, frozen.

The rooms declare those that they depend on, DriverConfig the others. docs/driver_parameters.md and
config/hero_driver.yaml are generated from these declarations.
"""

import dataclasses
from dataclasses import dataclass
from typing import Any, Mapping, Tuple

from hero_node import ProgramError
from hero_node.files import KeptCalibration, read_calibrations
from hero_node.parameters import (
    Parameter,
    check_parameters,
    choice,
    declare,
    find_declared,
    is_whole_number,
    make_error,
    number,
    string,
    whole_number,
)

from .commands.command_settings import CommandSettings
from .corrections.correction_settings import CorrectionSettings, OwnWheels
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

    host: str = declare(string("0.0.0.0", "address to listen on; empty: only connect to ~robots"))
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
    """Return the checked configuration in the given parameters (names without "~"). Raises: ProgramError."""
    given = {name: value for name, value in given.items() if name != FORMER_STOP}
    config = DriverConfig(**check_parameters(PARAMETERS, given))
    if not config.host and not config.robots:
        raise ProgramError(
            "~host is empty and ~robots too: the driver would neither listen nor dial;"
            " give an address to listen on (0.0.0.0 for all) or robots to dial"
        )
    calibrations = read_calibrations(config.calibration_folder)
    own_wheels = {name: _take_wheels(kept) for name, kept in calibrations.found.items() if "wheels_m" in kept.values}
    return dataclasses.replace(config, own_wheels=own_wheels, calibration_problems=calibrations.problems)


def _take_wheels(kept: KeptCalibration) -> OwnWheels:
    left_m, right_m, separation_m = kept.values["wheels_m"]
    ticks_per_turn, model = kept.others.get("ticks_per_turn"), kept.others.get("model", "")
    return OwnWheels((left_m + right_m) / 2.0, separation_m, right_m / left_m, ticks_per_turn, model)
