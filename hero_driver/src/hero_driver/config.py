"""The node's private parameters: read once, checked, frozen; some are declared in the rooms that they concern.

docs/driver_parameters.md and config/hero_driver.yaml are generated from these declarations.
"""

import dataclasses
from dataclasses import dataclass
from typing import Any, Mapping

from hero_node.files import read_calibrations
from hero_node.parameters import check_parameters, choice, declare, find_declared, number, string, whole_number

from .commands.command_queue import CommandSettings
from .corrections.correction_settings import CorrectionSettings
from .fleet.admission import AdmissionLimits
from .rosserial.session import SessionLimits


@dataclass(frozen=True)
class DriverConfig(CommandSettings, CorrectionSettings, SessionLimits, AdmissionLimits):
    """All parameters of the driver."""

    host: str = declare(string("0.0.0.0", "address to listen on"))
    port: int = declare(whole_number(11411, 0, 65535, "", "TCP port to listen on; 0: any free port"))
    declare_timeout_s: float = declare(
        number(20.0, 2.0, 600.0, "s", "time for a robot to declare a topic that identifies it; then it is disconnected")
    )
    grace_s: float = declare(number(10.0, 0.0, 3600.0, "s", "time that topics and id of an absent robot are kept"))
    start_stopped: str = declare(
        choice(
            "as_before",
            ("as_before", "always", "never"),
            "whether robots are stopped when the driver starts;"
            " as_before: if they were when a driver of this name and master ended",
        )
    )
    report_period_s: float = declare(number(1.0, 0.1, 60.0, "s", "period of ~robots and /diagnostics"))


PARAMETERS = find_declared(DriverConfig)


def read_config(given: Mapping[str, Any]) -> DriverConfig:
    """Return the checked configuration in the given parameters (names without "~"). Raises: ProgramError."""
    config = DriverConfig(**check_parameters(PARAMETERS, given))
    calibrations = read_calibrations(config.calibration_folder)
    own_wheels = {name: kept for name, kept in calibrations.found.items() if "wheels_m" in kept.values}
    return dataclasses.replace(config, own_wheels=own_wheels, calibration_problems=calibrations.problems)
