"""Differences between robots: drawn from a seed, or set to known values.

`KEY=VALUE,...[,robot=ID]` on the command line (--error); the README says what each key means. Pure. A robot's own
calibration is in its flash, not here.
"""

from typing import Callable, Collection, Dict, Iterable, List, NamedTuple

import numpy as np

from hero_node.files import read_file
from hero_node.robot_constants import BEAMS, BODY_RADIUS_M, WHEEL_SEPARATION_M

from ..errors import OptionError
from ..key_values import parse_values
from .body_loops import CREEP_M_S
from .range_sensors import ALPHA_COUNTS_M2, BETA_COUNTS

SERVO_CENTER_US = 1500.0
SERVO_DEAD_ZONE_US = 30.0
SERVO_FULL_M_S = 0.25
SERVO_FULL_US = 250.0
SERVO_GAIN_M_S_US = SERVO_FULL_M_S / (SERVO_FULL_US - SERVO_DEAD_ZONE_US)
"""A wheel rests for pulses within the dead zone around its center, and reaches the robot's published top speed
of 0.25 m/s at the 250 us to which the firmware limits itself. The dead zone is an assumption; with it and the
firmware's gains, one velocity command drives 0.13 to 0.17 m, as measured."""

SERVO_LAG_S = 0.08
"""Time constant of a servo with its wheel. Assumption; a stop then takes the 0.2 s of the stock robot."""

MAX_WHEEL_M_S = 0.28
"""Maximum speed of a servo without load (assumption)."""

MASS_KG = 0.156
"""As published."""

CASTER_FRICTION = 0.2


class Spread(NamedTuple):
    """A usual value, and between what most robots are."""

    usual: float
    low: float
    high: float

    def draw(self, normal: np.ndarray) -> np.ndarray:
        """Return values for standard normal numbers; none is beyond the ends."""
        ends = np.where(normal < 0.0, self.usual - self.low, self.high - self.usual)
        return np.minimum(np.maximum(self.usual + normal * ends / 2.0, self.low), self.high)


ROBOT_FRICTION = Spread(0.3, 0.15, 0.45)
WALL_FRICTION = Spread(0.3, 0.15, 0.5)
WHEEL_FRICTION = Spread(0.5, 0.4, 0.9)
WHEEL_LOAD = Spread(0.85, 0.8, 0.9)
"""Coefficients of a body on another one (plastic on plastic) and on walls and things, of a wheel (rubber) on the floor,
and the share of the weight that is on the wheels. Assumptions, from tables of materials; no robot was measured."""


class Kind(NamedTuple):
    """One sort of difference.

    Attributes:
        array: the attribute of RobotErrors that holds it.
        columns: which columns of it (a wheel, a sensor; all of them for a key that means all).
        least, most: what can be computed with.
    """

    array: str
    columns: slice
    least: float
    most: float


_LEFT, _RIGHT, _ALL = slice(0, 1), slice(1, 2), slice(None)

KINDS: Dict[str, Kind] = {
    "left_center_us": Kind("servo_center_us", _LEFT, 1000, 2000),
    "right_center_us": Kind("servo_center_us", _RIGHT, 1000, 2000),
    "dead_zone_us": Kind("dead_zone_us", _ALL, 0, 200),
    "left_gain": Kind("servo_gain", _LEFT, 0, 5),
    "right_gain": Kind("servo_gain", _RIGHT, 0, 5),
    "lag_s": Kind("servo_lag_s", _ALL, 0.001, 5),
    "left_wheel": Kind("wheel_scale", _LEFT, 0.5, 2),
    "right_wheel": Kind("wheel_scale", _RIGHT, 0.5, 2),
    "wheel_separation_m": Kind("wheel_separation_m", _ALL, 0.02, 0.2),
    "radius_m": Kind("radius_m", _ALL, 0.03, 0.2),
    "slip": Kind("slip", _ALL, 0, 0.5),
    "ripple_m_s": Kind("ripple_m_s", _ALL, 0, 0.1),
    "friction": Kind("friction", _ALL, 0, 2),
    "robot_friction": Kind("friction", slice(0, 1), 0, 2),
    "wall_friction": Kind("friction", slice(1, 2), 0, 2),
    "caster_friction": Kind("friction", slice(2, 3), 0, 2),
    "wheel_friction": Kind("wheel_friction", _ALL, 0.05, 5),
    "creep_m_s": Kind("creep_m_s", _ALL, 1e-4, 10),
    "wheel_load": Kind("wheel_load", _ALL, 0.1, 1),
    "mass_kg": Kind("mass_kg", _ALL, 0.02, 5),
    "alpha_counts_m2": Kind("alpha_counts_m2", _ALL, 0.01, 10),
    "beta_counts": Kind("beta_counts", _ALL, -20, 20),
}
for _index in range(BEAMS):
    KINDS["alpha%d_counts_m2" % _index] = Kind("alpha_counts_m2", slice(_index, _index + 1), 0.01, 10)


class RobotErrors(NamedTuple):
    """The differences of all robots (N), each an array (N, columns); wheels are left, right.

    friction: of what slides: a robot's body on another robot's, on walls and things, and its caster on the floor.
    """

    servo_center_us: np.ndarray
    dead_zone_us: np.ndarray
    servo_gain: np.ndarray
    servo_lag_s: np.ndarray
    wheel_scale: np.ndarray
    wheel_separation_m: np.ndarray
    radius_m: np.ndarray
    slip: np.ndarray
    ripple_m_s: np.ndarray
    alpha_counts_m2: np.ndarray
    beta_counts: np.ndarray
    friction: np.ndarray
    wheel_friction: np.ndarray
    wheel_load: np.ndarray
    creep_m_s: np.ndarray
    mass_kg: np.ndarray


def _draw_normal(rng: np.random.RandomState, count: int) -> np.ndarray:
    """Return standard normal numbers, rounded: their last bits depend on the machine's logarithm."""
    return rng.standard_normal(count).astype(np.float32).astype(float)


def draw_errors(rngs: Iterable[np.random.RandomState], scale: float = 1.0) -> RobotErrors:
    """Return usual differences: one robot drawn from each of rngs; with scale 0 all are nominal.

    Sources: odometry off by 1.4 to 3.0 % of the path and alpha from 0.39 to 0.44 are published; that servos of
    one kind differ by some per cent and some microseconds is an assumption.
    """
    drawn = np.array([_draw_normal(rng, 6 + BEAMS + 4) for rng in rngs]) * scale
    on_robots, on_walls, on_floor, load = drawn[:, 6 + BEAMS :].T
    same = np.ones((len(drawn), 1))
    return RobotErrors(
        servo_center_us=SERVO_CENTER_US + np.rint(6.0 * drawn[:, 0:2]),
        dead_zone_us=same * SERVO_DEAD_ZONE_US,
        servo_gain=1.0 + 0.03 * drawn[:, 2:4],
        servo_lag_s=same * SERVO_LAG_S,
        wheel_scale=1.0 + 0.003 * drawn[:, 4:6],
        wheel_separation_m=same * WHEEL_SEPARATION_M,
        radius_m=same * BODY_RADIUS_M,
        slip=same * 0.02 * scale,
        ripple_m_s=same * 0.003 * scale,
        alpha_counts_m2=ALPHA_COUNTS_M2 * (1.0 + 0.02 * drawn[:, 6 : 6 + BEAMS]),
        beta_counts=same * BETA_COUNTS,
        friction=np.column_stack(
            (ROBOT_FRICTION.draw(on_robots), WALL_FRICTION.draw(on_walls), same * CASTER_FRICTION)
        ),
        wheel_friction=WHEEL_FRICTION.draw(on_floor)[:, None],
        wheel_load=WHEEL_LOAD.draw(load)[:, None],
        creep_m_s=same * CREEP_M_S,
        mass_kg=same * MASS_KG,
    )


def set_known(errors: RobotErrors, first_id: int, text: str) -> None:
    """Put text, `KEY=VALUE,...[,robot=ID]`, over what was drawn; without robot it holds for all.

    Raises: OptionError that names what is wrong and what would do.
    """
    limits = {key: (kind.least, kind.most) for key, kind in KINDS.items()}
    values = parse_values("--error " + text, text, {"robot": (first_id, first_id + len(errors.slip) - 1), **limits})
    rows = _ALL
    if "robot" in values:
        row = int(values.pop("robot")) - first_id
        rows = slice(row, row + 1)
    # A key for all sensors comes first, so that single ones can differ from it.
    for key in sorted(values, key=lambda key: KINDS[key].columns != _ALL):
        getattr(errors, KINDS[key].array)[rows, KINDS[key].columns] = values[key]


def read_known(path: str, ids: Collection[int], read: Callable[[str], bytes] = read_file) -> List[str]:
    """Return the lines of an error file, each a text for set_known(), that are of all robots or of these ids.

    read: how the file is read. Empty lines and those that begin with # are remarks.
    Raises: OptionError if the file cannot be read.
    """
    try:
        lines = [line.strip() for line in read(path).decode("utf-8").splitlines()]
    except (OSError, UnicodeDecodeError) as error:
        raise OptionError(f"errors {path} cannot be read: {getattr(error, 'strerror', None) or error}") from error
    own = {"robot=%d" % robot_id for robot_id in ids}
    given = [line for line in lines if line and not line.startswith("#")]
    return [line for line in given if all(part in own for part in line.split(",") if part.startswith("robot="))]


def describe_errors(errors: RobotErrors, first_id: int) -> List[str]:
    """Return all differences, a line for each robot, as --error takes it."""
    lines: List[str] = []
    for row in range(len(errors.slip)):
        columns = {key: getattr(errors, kind.array)[row, kind.columns] for key, kind in KINDS.items()}
        values = [f"{key}={values[0]:.6g}" for key, values in columns.items() if len(values) == 1]
        lines.append(",".join(["robot=%d" % (first_id + row), *values]))
    return lines
