"""The parameters that commands to a robot depend on, as in config.DriverConfig. Pure."""

from typing import NamedTuple


class CommandSettings(NamedTuple):
    """Permissions and time limits of commands."""

    clamp: bool
    allow_self_tuning: bool
    orphan_stop_s: float
    silent_stop_s: float
    service_timeout_s: float
    command_max_age_s: float
    max_names: int
    """Topics and services of one robot over all its connections."""
