"""The parameters that commands to a robot depend on. Pure."""

from dataclasses import dataclass

from hero_node.parameters import declare, flag, number


@dataclass(frozen=True)
class CommandSettings:
    """Permissions and time limits of commands."""

    allow_self_tuning: bool = declare(
        flag(
            False,
            "allow pid_calibration, with which a robot spins for up to a minute, or for ever without driver or Wi-Fi,"
            " and keeps no gains",
        )
    )
    orphan_stop_s: float = declare(
        number(0.25, 0.0, 10.0, "s", "delay before a robot is stopped when the program that drove it ends")
    )
    silent_stop_s: float = declare(
        number(
            0.5,
            0.0,
            10.0,
            "s",
            "silence, of at least four periods, after which the robot of a program that sent six commands is stopped;"
            " 0: never",
        )
    )
    service_timeout_s: float = declare(number(5.0, 0.1, 600.0, "s", "time for a robot to answer a service call"))
    command_max_age_s: float = declare(
        number(2.0, 0.1, 60.0, "s", "age at which a motion command that could not be sent is dropped; stops are kept")
    )
