"""The parameters that corrections depend on, and the robots' calibrated wheels. Pure."""

from dataclasses import dataclass, field
from typing import Any, Mapping, Tuple

from hero_node.files import STOCK, KeptCalibration
from hero_node.parameters import Parameter, declare, is_number, make_error, number, string
from hero_node.robot_constants import TICKS_PER_TURN, WHEEL_DIAMETER_M, WHEEL_SEPARATION_M

from .tick_odometry import PLUS_WHEELS, WheelGeometry


def _read_diagonal(name: str, value: Any) -> Tuple[float, ...]:
    if not isinstance(value, (list, tuple)) or len(value) != 6 or not all(is_number(entry, low=0.0) for entry in value):
        raise make_error(name, value, "a list of 6 numbers that are not negative")
    return tuple(float(entry) for entry in value)


def _declare_diagonal(what: str, unit: str, *default: float) -> Any:
    text = f"diagonal of odom's {what} covariance: x, y, z, roll, pitch, yaw"
    return declare(Parameter(default, _read_diagonal, text, unit))


@dataclass(frozen=True)
class CorrectionSettings:
    """Wheels, and accuracy of odometry."""

    wheel_diameter_m: float = declare(number(WHEEL_DIAMETER_M, 0.001, 1.0, "m", "diameter of a wheel, except HeRo+'s"))
    wheel_separation_m: float = declare(number(WHEEL_SEPARATION_M, 0.001, 1.0, "m", "wheel separation, except HeRo+'s"))
    ticks_per_turn: float = declare(number(TICKS_PER_TURN, 1.0, 1e6, "", "encoder ticks per turn, except HeRo+'s"))
    calibration_folder: str = declare(
        string("~/hero_calibration", "folder of calibrate's hero_N.yaml, whose wheels replace those above; empty: none")
    )
    pose_covariance: Tuple[float, ...] = _declare_diagonal("pose", "m^2, rad^2", 1e-4, 1e-4, 1e-9, 1e-9, 1e-9, 1e-2)
    twist_covariance: Tuple[float, ...] = _declare_diagonal(
        "twist", "m^2/s^2, rad^2/s^2", 1e-4, 1e-9, 1e-9, 1e-9, 1e-9, 1e-2
    )
    own_wheels: Mapping[str, KeptCalibration] = field(default_factory=dict)
    """Wheels of robots whose wheels were calibrated, by name, such as hero_3; from ~calibration_folder."""
    calibration_problems: Mapping[str, str] = field(default_factory=dict)
    """Reasons why calibration files are not used, for users, by the robot's name."""

    def find_geometry(self, name: str, model: str) -> WheelGeometry:
        """Return the wheels of the robot called name (hero_3), which is of this model."""
        geometry, own = PLUS_WHEELS, self.own_wheels.get(name)
        if model == STOCK:
            geometry = WheelGeometry(self.wheel_diameter_m, self.wheel_separation_m, self.ticks_per_turn)
        if own is None or own.others.get("model", "") not in ("", model):
            return geometry
        left_m, right_m, separation_m = own.values["wheels_m"]
        ticks_per_turn = own.others.get("ticks_per_turn") or geometry.ticks_per_turn
        return WheelGeometry((left_m + right_m) / 2.0, separation_m, ticks_per_turn, right_m / left_m)
