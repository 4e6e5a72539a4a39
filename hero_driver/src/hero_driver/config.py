"""The node's private parameters: read once, checked, frozen.

Each field of DriverConfig declares a parameter. From the declarations docs/driver_parameters.md and
config/hero_driver.yaml are generated.
"""

import dataclasses
import ipaddress
from dataclasses import dataclass
from typing import Any, Dict, Mapping, Optional, Tuple

from hero_node.errors import ProgramError
from hero_node.number_checks import is_number, is_whole_number
from hero_node.parameters import (
    Parameter,
    check_parameters,
    choice,
    flag,
    make_error,
    number,
    parse_robot_ids,
    whole_number,
    words,
)
from hero_node.yaml_text import read_calibrations

from .commands.command_settings import CommandSettings
from .corrections.robot_corrections import CorrectionSettings, OwnWheels
from .corrections.robot_models import HERO_PLUS, PLUS_WHEELS, STOCK
from .corrections.tick_odometry import WheelGeometry
from .fleet.admission import AdmissionLimits, Network
from .robot_constants import TICKS_PER_TURN, WHEEL_DIAMETER_M, WHEEL_SEPARATION_M
from .rosserial.session import SessionLimits
from .transport import Address

DEFAULT_PORT = 11411


def _read_robots(name: str, value: Any) -> Tuple[Address, ...]:
    allowed = "a list of {host: name or address, port: 1 to 65535}"
    if not isinstance(value, (list, tuple)):
        raise make_error(name, value, allowed)
    addresses = []
    for entry in value:
        if (
            not isinstance(entry, dict)
            or not set(entry) <= {"host", "port"}
            or not isinstance(entry.get("host"), str)
        ):
            raise make_error(name, entry, allowed)
        port = entry.get("port", DEFAULT_PORT)
        if not is_whole_number(port, 1, 65535) or not entry["host"]:
            raise make_error(name, entry, allowed)
        addresses.append(Address(entry["host"], port))
    if len(set(addresses)) != len(addresses):
        raise make_error(name, value, "a list that names no robot twice")
    return tuple(addresses)


def _read_networks(name: str, value: Any) -> Tuple[Network, ...]:
    allowed = "a list of networks such as 10.42.0.0/24"
    if not isinstance(value, (list, tuple)) or not all(isinstance(entry, str) for entry in value):
        raise make_error(name, value, allowed)
    networks = []
    for entry in value:
        try:
            networks.append(ipaddress.ip_network(entry))
        except ValueError as error:
            raise make_error(name, entry, "%s (%s)" % (allowed, error)) from error
    return tuple(networks)


def _read_diagonal(name: str, value: Any) -> Tuple[float, ...]:
    allowed = "a list of 6 numbers that are not negative"
    if not isinstance(value, (list, tuple)) or len(value) != 6:
        raise make_error(name, value, allowed)
    if not all(is_number(entry, low=0.0) for entry in value):
        raise make_error(name, value, allowed)
    return tuple(float(entry) for entry in value)


def _read_names(name: str, value: Any) -> Tuple[str, ...]:
    """Return the names of the robots with the ids in value."""
    ids = [] if value in ("", [], ()) else parse_robot_ids(name, value)
    if ids is None:
        raise make_error(name, value, 'ids such as "0 2" or "4-7"')
    return tuple("hero_%d" % robot_id for robot_id in ids)


def _declare(parameter: Parameter) -> Any:
    return dataclasses.field(default=parameter.default, metadata={"parameter": parameter})


@dataclass(frozen=True)
class DriverConfig:
    """All parameters of the driver."""

    host: str = _declare(words("0.0.0.0", "address to listen on; empty: only connect to ~robots"))
    port: int = _declare(whole_number(DEFAULT_PORT, 0, 65535, "", "TCP port to listen on; 0: any free port"))
    robots: Tuple[Address, ...] = _declare(
        Parameter((), _read_robots, "robots that are TCP servers, to connect to: a list of {host, port}")
    )
    allow: Tuple[Network, ...] = _declare(
        Parameter((), _read_networks, "networks (CIDR) that robots may connect from; empty: all")
    )
    max_connections: int = _declare(whole_number(400, 1, 5000, "", "connections in total"))
    max_connections_per_address: int = _declare(whole_number(400, 1, 5000, "", "connections per address"))
    max_unidentified: int = _declare(
        whole_number(200, 1, 5000, "", "connections that have not identified themselves")
    )
    max_topics: int = _declare(whole_number(64, 1, 1000, "", "topic ids that one robot may declare"))
    max_payload_length: int = _declare(
        whole_number(4096, 64, 65535, "bytes", "longest payload of a packet from a robot")
    )
    max_packets_per_s: int = _declare(
        whole_number(5000, 10, 1000000, "1/s", "packets per robot; stock robots send 211")
    )
    max_bytes_per_s: int = _declare(
        whole_number(2000000, 1000, 100000000, "bytes/s", "bytes per robot; stock robots send 44051")
    )
    declare_timeout_s: float = _declare(
        number(
            20.0,
            2.0,
            600.0,
            "s",
            "time for a robot to declare a topic that identifies it; then it is disconnected",
        )
    )
    silence_timeout_s: float = _declare(
        number(6.0, 3.0, 600.0, "s", "silence after which a connection is closed")
    )
    grace_s: float = _declare(
        number(10.0, 0.0, 3600.0, "s", "time that a robot's topics and id are kept after it disconnects")
    )
    service_timeout_s: float = _declare(
        number(5.0, 0.1, 600.0, "s", "time for a robot to answer a service call")
    )
    clamp: bool = _declare(flag(False, "limit velocities to those of the firmware (0.20 m/s, 8.0 rad/s)"))
    command_max_age_s: float = _declare(
        number(
            2.0,
            0.1,
            60.0,
            "s",
            "age at which a motion command that could not be sent is dropped; stops are kept",
        )
    )
    orphan_stop_s: float = _declare(
        number(0.25, 0.0, 10.0, "s", "delay before a robot is stopped when the program that drove it ends")
    )
    silent_stop_s: float = _declare(
        number(
            0.5,
            0.0,
            10.0,
            "s",
            "silence, of at least four periods, after which the robot of a program that sent at least six commands is"
            " stopped; 0: never",
        )
    )
    allow_self_tuning: bool = _declare(
        flag(
            False,
            "allow pid_calibration: the robot spins for up to a minute and keeps no gains; without driver or Wi-Fi it"
            " never stops",
        )
    )
    start_stopped: str = _declare(
        choice(
            "as_before",
            ("as_before", "always", "never"),
            "whether robots are stopped when the driver starts;"
            " as_before: if they were when a driver of this name ended",
        )
    )
    odometry: str = _declare(
        choice("ticks", ("ticks", "robot"), "source of odom: encoder ticks, or the robot's own estimate")
    )
    hero_plus: Tuple[str, ...] = _declare(
        Parameter(
            (),
            _read_names,
            "ids of robots, such as 0 2 or 4-7, that are HeRo+ (96 ticks per turn, wheels of 50 mm, 65 mm apart)"
            " without the Encoder message that identifies them",
        )
    )
    wheel_diameter_m: float = _declare(
        number(WHEEL_DIAMETER_M, 0.001, 1.0, "m", "diameter of a wheel, except HeRo+'s")
    )
    wheel_separation_m: float = _declare(
        number(WHEEL_SEPARATION_M, 0.001, 1.0, "m", "distance between the wheels, except HeRo+'s")
    )
    ticks_per_turn: float = _declare(
        number(TICKS_PER_TURN, 1.0, 1000000.0, "", "encoder ticks per revolution of a wheel, except HeRo+'s")
    )
    calibration_folder: str = _declare(
        words(
            "~/hero_calibration",
            "folder of calibrate's files hero_N.yaml, whose wheels replace those above; empty: none",
        )
    )
    pose_covariance: Tuple[float, ...] = _declare(
        Parameter(
            (1e-4, 1e-4, 1e-9, 1e-9, 1e-9, 1e-2),
            _read_diagonal,
            "diagonal of odom's pose covariance: x, y, z, roll, pitch, yaw",
            "m^2, rad^2",
        )
    )
    twist_covariance: Tuple[float, ...] = _declare(
        Parameter(
            (1e-4, 1e-9, 1e-9, 1e-9, 1e-9, 1e-2),
            _read_diagonal,
            "diagonal of odom's twist covariance: x, y, z, roll, pitch, yaw",
            "m^2/s^2, rad^2/s^2",
        )
    )
    stamps: str = _declare(
        choice(
            "robot",
            ("robot", "arrival"),
            "clock of the stamps: the robot's, or time of arrival at the driver",
        )
    )
    max_future_s: float = _declare(
        number(0.05, 0.0, 10.0, "s", "stamps further in the future are replaced by the time of arrival")
    )
    max_age_s: float = _declare(
        number(5.0, 0.1, 3600.0, "s", "stamps further in the past are replaced by the time of arrival")
    )
    transform_period_s: float = _declare(
        number(0.01, 0.001, 1.0, "s", "period at which the transforms of all robots are published")
    )
    report_period_s: float = _declare(number(1.0, 0.1, 60.0, "s", "period of ~robots and /diagnostics"))

    @property
    def session_limits(self) -> SessionLimits:
        """Limits of one session."""
        return SessionLimits(
            max_payload_length=self.max_payload_length,
            max_topics=self.max_topics,
            silence_timeout_s=self.silence_timeout_s,
        )

    @property
    def admission_limits(self) -> AdmissionLimits:
        """Limits on connections."""
        return AdmissionLimits(
            self.allow,
            self.max_connections,
            self.max_connections_per_address,
            self.max_unidentified,
            self.max_packets_per_s,
            self.max_bytes_per_s,
        )

    def read_own_wheels(self) -> Dict[str, OwnWheels]:
        """Return the wheels of calibrated robots. Raises: ProgramError for a file that is none of calibrate's."""
        return read_calibrations(self.calibration_folder, "wheels_m", _convert_wheels)

    @property
    def correction_settings(self) -> CorrectionSettings:
        """Settings of corrections."""
        return CorrectionSettings(
            self.odometry,
            {STOCK: self.wheel_geometry, HERO_PLUS: PLUS_WHEELS},
            self.pose_covariance,
            self.twist_covariance,
            self.stamps,
            self.max_future_s,
            self.max_age_s,
            self.read_own_wheels(),
            frozenset(self.hero_plus),
        )

    @property
    def command_settings(self) -> CommandSettings:
        """Settings of commands."""
        return CommandSettings(
            self.clamp,
            self.allow_self_tuning,
            self.orphan_stop_s,
            self.silent_stop_s,
            self.service_timeout_s,
            self.command_max_age_s,
            max_names=2 * self.max_topics,
        )

    @property
    def wheel_geometry(self) -> WheelGeometry:
        """Converts ticks of stock robots into meters."""
        return WheelGeometry(self.wheel_diameter_m, self.wheel_separation_m, self.ticks_per_turn)


def _convert_wheels(lengths: Any, content: Dict[str, Any]) -> OwnWheels:
    left_m, right_m, separation_m = wheels_m = [float(length) for length in lengths]
    if not all(0.01 <= length_m <= 1.0 for length_m in wheels_m):
        raise ValueError("wheels_m must be from 0.01 to 1 m")
    ticks_per_turn: Optional[float] = content.get("ticks_per_turn")
    if ticks_per_turn is not None and not float(ticks_per_turn) >= 1.0:
        raise ValueError("ticks_per_turn must be 1 or more")
    model = content.get("model", "")
    if model not in ("", STOCK, HERO_PLUS):
        raise ValueError("model must be %s or %s, not %r" % (STOCK, HERO_PLUS, model))
    diameter_m, ratio = (left_m + right_m) / 2.0, right_m / left_m
    return OwnWheels(diameter_m, separation_m, ratio, ticks_per_turn and float(ticks_per_turn), model)


PARAMETERS: Dict[str, Parameter] = {
    field.name: field.metadata["parameter"] for field in dataclasses.fields(DriverConfig)
}


FORMER_STOP = "stopped"
"""Set by version 0.2 itself, to keep a stop: a running ROS master may still hold it. It has no effect."""


def read_config(given: Mapping[str, Any]) -> DriverConfig:
    """Return the checked configuration in the given parameters (names without "~").

    Raises: ProgramError.
    """
    given = {name: value for name, value in given.items() if name != FORMER_STOP}
    config = DriverConfig(**check_parameters(PARAMETERS, given))
    if not config.host and not config.robots:
        raise ProgramError(
            "~host is empty and ~robots too: the driver would neither listen nor dial;"
            " give an address to listen on (0.0.0.0 for all) or robots to dial"
        )
    config.read_own_wheels()  # refused before anything starts
    return config
