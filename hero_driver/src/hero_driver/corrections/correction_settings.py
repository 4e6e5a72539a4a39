"""The parameters that corrections depend on, and the robots' calibrated wheels. Pure."""

from dataclasses import dataclass, field
from typing import Any, Mapping, NamedTuple, Optional, Tuple

from hero_node.files import HERO_PLUS, STOCK
from hero_node.parameters import Parameter, choice, declare, is_number, make_error, number, parse_explicit_ids, string

from ..robot_constants import TICKS_PER_TURN, WHEEL_DIAMETER_M, WHEEL_SEPARATION_M
from .robot_models import PLUS_ENCODER_MD5, PLUS_WHEELS
from .tick_odometry import WheelGeometry


def _read_diagonal(name: str, value: Any) -> Tuple[float, ...]:
    if not isinstance(value, (list, tuple)) or len(value) != 6 or not all(is_number(entry, low=0.0) for entry in value):
        raise make_error(name, value, "a list of 6 numbers that are not negative")
    return tuple(float(entry) for entry in value)


def _read_names(name: str, value: Any) -> Tuple[str, ...]:
    """Return the names of the robots with the ids in value."""
    ids = [] if value in ("", [], ()) else parse_explicit_ids(name, value)
    return tuple("hero_%d" % robot_id for robot_id in ids)


class OwnWheels(NamedTuple):
    """A robot's calibrated wheels."""

    diameter_m: float
    separation_m: float
    diameter_ratio: float
    ticks_per_turn: Optional[float] = None
    """None: as all of its model."""
    model: str = ""
    """Model of the robot that was calibrated; empty: not known."""


@dataclass(frozen=True)
class CorrectionSettings:
    """Source and accuracy of odometry, wheels, stamps."""

    odometry: str = declare(
        choice("ticks", ("ticks", "robot"), "source of odom: encoder ticks, or the robot's own estimate")
    )
    hero_plus: Tuple[str, ...] = declare(
        Parameter(
            (),
            _read_names,
            "ids of robots, such as 0 2 or 4-7, that are HeRo+ (96 ticks per turn, wheels of 50 mm, 65 mm apart)"
            " without the Encoder message that identifies them",
        )
    )
    wheel_diameter_m: float = declare(number(WHEEL_DIAMETER_M, 0.001, 1.0, "m", "diameter of a wheel, except HeRo+'s"))
    wheel_separation_m: float = declare(
        number(WHEEL_SEPARATION_M, 0.001, 1.0, "m", "distance between the wheels, except HeRo+'s")
    )
    ticks_per_turn: float = declare(
        number(TICKS_PER_TURN, 1.0, 1000000.0, "", "encoder ticks per revolution of a wheel, except HeRo+'s")
    )
    calibration_folder: str = declare(
        string(
            "~/hero_calibration",
            "folder of calibrate's files hero_N.yaml, whose wheels replace those above; empty: none",
        )
    )
    pose_covariance: Tuple[float, ...] = declare(
        Parameter(
            (1e-4, 1e-4, 1e-9, 1e-9, 1e-9, 1e-2),
            _read_diagonal,
            "diagonal of odom's pose covariance: x, y, z, roll, pitch, yaw",
            "m^2, rad^2",
        )
    )
    twist_covariance: Tuple[float, ...] = declare(
        Parameter(
            (1e-4, 1e-9, 1e-9, 1e-9, 1e-9, 1e-2),
            _read_diagonal,
            "diagonal of odom's twist covariance: x, y, z, roll, pitch, yaw",
            "m^2/s^2, rad^2/s^2",
        )
    )
    stamps: str = declare(
        choice("robot", ("robot", "arrival"), "clock of the stamps: the robot's, or time of arrival at the driver")
    )
    max_future_s: float = declare(
        number(0.05, 0.0, 10.0, "s", "stamps further in the future are replaced by the time of arrival")
    )
    max_age_s: float = declare(
        number(5.0, 0.1, 3600.0, "s", "stamps further in the past are replaced by the time of arrival")
    )
    own_wheels: Mapping[str, OwnWheels] = field(default_factory=dict)
    """Wheels of robots whose wheels were calibrated, by name, such as hero_3; from ~calibration_folder."""
    calibration_problems: Mapping[str, str] = field(default_factory=dict)
    """Reasons why calibration files are not used, for users, by the robot's name."""

    def find_model(self, namespace: str, encoder_md5: str) -> str:
        """Return the model of the robot in namespace, whose Encoder message has this md5."""
        is_plus = encoder_md5 == PLUS_ENCODER_MD5 or namespace.strip("/") in self.hero_plus
        return HERO_PLUS if is_plus else STOCK

    def find_geometry(self, namespace: str, model: str) -> WheelGeometry:
        """Return the wheels of the robot in namespace, which is of this model."""
        geometry, own = PLUS_WHEELS, self.own_wheels.get(namespace.strip("/"))
        if model == STOCK:
            geometry = WheelGeometry(self.wheel_diameter_m, self.wheel_separation_m, self.ticks_per_turn)
        if own is None or own.model not in ("", model):
            return geometry
        ticks_per_turn = own.ticks_per_turn or geometry.ticks_per_turn
        return WheelGeometry(own.diameter_m, own.separation_m, ticks_per_turn, own.diameter_ratio)
