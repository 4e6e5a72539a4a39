"""Models of the robot: what their firmware declares, and how encoders and bodies differ from the stock robot's. Pure.

Sources: HeRo+ (github.com/varunraveendra/hero_plus; firmware in varunraveendra/hero_common), whose firmware still
computes with the stock wheels; the older stock firmware whose binary is published beside v3.8. What is not named here
is as in the stock robot; HeRo+'s own law for its motors, too, is that of the stock robot here.
"""

from typing import Dict, List, NamedTuple, Optional, Tuple

from ..errors import OptionError
from ..robot_constants import BODY_RADIUS_M, TICK_M, TICKS_PER_TURN, WHEEL_DIAMETER_M, WHEEL_SEPARATION_M
from ..world.robot_errors import RobotErrors
from . import declarations
from .declarations import DECLARATIONS, Declaration


class RobotModel(NamedTuple):
    """Properties of a model of robots."""

    versions: str
    """In the line that it logs at boot."""
    declarations: Tuple[Declaration, ...] = DECLARATIONS
    encoder_md5: Optional[str] = None
    """None: the stock robot's."""
    tick_m: float = TICK_M
    """Travel per tick as the firmware computes it."""
    wheel_diameter_m: float = WHEEL_DIAMETER_M
    wheel_separation_m: float = WHEEL_SEPARATION_M
    radius_m: float = BODY_RADIUS_M
    measures_distance: bool = False
    """Whether it has the distance sensor, and no IMU."""

    def encode_declarations(self, name: str) -> bytes:
        """Return the packets with which the robot called name (hero_N) declares everything, in one burst."""
        own_ids = self.own_ids
        entries = [(kind, own_ids[stock_id], pattern, text) for kind, stock_id, pattern, text in self.declarations]
        return declarations.encode_entries(name, entries, self.encoder_md5)

    @property
    def own_ids(self) -> Dict[int, int]:
        """Ids of this model's topics by those of the stock robot's; both are given in call order."""
        kinds = {declarations.PUB: 125, declarations.ANS: 125, declarations.SUB: 100, declarations.REQ: 100}
        counts = {125: 0, 100: 0}
        own = {}
        for kind, stock_id, _, _ in self.declarations:
            first = kinds[kind]
            own[stock_id] = first + counts[first]
            counts[first] += 1
        return own


_NEWER_NAMES = ("ir_calibration", "laser_enable", "motors_parameters")

HERO = RobotModel("Firmware: v3.8 | Hardware: v2.5 | Config: v2.3")
MODELS: Dict[str, RobotModel] = {
    "hero": HERO,
    "v3.0": RobotModel(
        "Firmware: v3.0 | Hardware: v2.5",
        tuple(entry for entry in DECLARATIONS if not entry[2].endswith(_NEWER_NAMES)),
    ),
    "hero_plus": RobotModel(
        HERO.versions,
        tuple(
            (kind, topic_id, "/%s/distance", "std_msgs/Float32") if topic_id == declarations.ID_IMU else entry
            for entry in DECLARATIONS
            for kind, topic_id in [entry[:2]]
        ),
        encoder_md5="ec5c02e99365233af779a0f9f54cb0df",
        tick_m=TICK_M * TICKS_PER_TURN / 96.0,
        wheel_diameter_m=0.050,
        wheel_separation_m=0.065,
        radius_m=0.060,
        measures_distance=True,
    ),
}


def parse_models(texts: List[str], first_id: int, count: int) -> List[RobotModel]:
    """Return the model of each robot; texts: MODEL or MODEL,robot=ID, of which later ones win.

    Raises: OptionError that names what is wrong and what would do.
    """
    models = [HERO] * count
    for text in texts:
        name, _, robot = text.partition(",robot=")
        if name not in MODELS:
            raise OptionError("--model %s: must be one of %s, or that with ,robot=ID" % (text, ", ".join(MODELS)))
        rows = range(count)
        if robot:
            if not robot.isdecimal() or not 0 <= int(robot) - first_id < count:
                last_id = first_id + count - 1
                raise OptionError("--model %s: robot must be %d..%d, not %s" % (text, first_id, last_id, robot))
            rows = range(int(robot) - first_id, int(robot) - first_id + 1)
        for row in rows:
            models[row] = MODELS[name]
    return models


def build_body(model: RobotModel, errors: RobotErrors, row: int) -> None:
    """Give the body in a row of errors, which is drawn as a stock robot's, the wheels and the radius of its model."""
    if model is HERO:
        return
    errors.wheel_scale[row] *= model.wheel_diameter_m / WHEEL_DIAMETER_M
    errors.wheel_separation_m[row] *= model.wheel_separation_m / WHEEL_SEPARATION_M
    errors.radius_m[row] = model.radius_m
