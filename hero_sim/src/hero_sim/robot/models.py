"""Models of the robot: what their firmware declares, and how encoders and bodies differ from the stock robot's. Pure.

Sources: HeRo+ (github.com/varunraveendra/hero_plus; firmware in varunraveendra/hero_common), whose firmware still
computes with the stock wheels; the older stock firmware whose binary is published beside v3.8. What is not named here
is as in the stock robot; HeRo+'s own law for its motors, too, is that of the stock robot here.
"""

from typing import Dict, List, NamedTuple, Tuple

from hero_node import robot_constants
from hero_node.robot_constants import TICK_M, TICKS_PER_TURN
from hero_node.ros_messages import MD5SUMS, PLUS_ENCODER_MD5

from ..errors import OptionError
from ..key_values import parse_values
from ..world.robot_errors import RobotErrors
from .declarations import PUB, STOCK_TOPICS, Topic, assign_ids


class RobotModel(NamedTuple):
    """Properties of a model of robots."""

    versions: str
    """In the line that it logs at boot."""
    topics: Tuple[Topic, ...] = STOCK_TOPICS
    tick_m: float = TICK_M
    """Travel per tick as the firmware computes it."""
    dimensions: robot_constants.RobotModel = robot_constants.HERO
    is_plus: bool = False
    """HeRo+: it has the distance sensor and no IMU, and its Encoder says how far the counters are apart, too."""

    @property
    def sent_ids(self) -> Dict[str, int]:
        """Ids of what it sends, by the topics' keys."""
        return assign_ids(self.topics)[0]

    @property
    def received_ids(self) -> Dict[str, int]:
        """Ids of what it receives, by the topics' keys."""
        return assign_ids(self.topics)[1]


_NEWER_NAMES = ("ir_calibration", "laser_enable", "motors_parameters")
_PLUS_TOPICS = {
    "imu": Topic(PUB, "/%s/distance", "std_msgs/Float32", MD5SUMS["std_msgs/Float32"]),
    "encoder": Topic(PUB, "/%s/encoder", "hero_common/Encoder", PLUS_ENCODER_MD5),
}

HERO = RobotModel("Firmware: v3.8 | Hardware: v2.5 | Config: v2.3")
MODELS: Dict[str, RobotModel] = {
    "hero": HERO,
    "v3.0": RobotModel(
        "Firmware: v3.0 | Hardware: v2.5", tuple(topic for topic in STOCK_TOPICS if topic.key not in _NEWER_NAMES)
    ),
    "hero_plus": RobotModel(
        HERO.versions,
        tuple(_PLUS_TOPICS.get(topic.key, topic) for topic in STOCK_TOPICS),
        tick_m=TICK_M * TICKS_PER_TURN / 96.0,
        dimensions=robot_constants.MODELS["hero_plus"],
        is_plus=True,
    ),
}


def parse_models(texts: List[str], first_id: int, count: int) -> List[RobotModel]:
    """Return the model of each robot; texts: MODEL or MODEL,robot=ID, of which later ones win.

    Raises: OptionError that names what is wrong and what would do.
    """
    models = [HERO] * count
    for text in texts:
        name, _, tail = text.partition(",")
        if name not in MODELS:
            raise OptionError(f"--model {text}: must be one of {', '.join(MODELS)}, or that with ,robot=ID")
        robot_id = parse_values(f"--model {text}", tail, {"robot": (first_id, first_id + count - 1)}).get("robot")
        for row in range(count) if robot_id is None else [int(robot_id) - first_id]:
            models[row] = MODELS[name]
    return models


def build_body(model: RobotModel, errors: RobotErrors, row: int) -> None:
    """Give the body in a row of errors, which is drawn as a stock robot's, the wheels and the radius of its model."""
    if model is HERO:
        return
    stock = HERO.dimensions
    errors.wheel_scale[row] *= model.dimensions.wheel_diameter_m / stock.wheel_diameter_m
    errors.wheel_separation_m[row] *= model.dimensions.wheel_separation_m / stock.wheel_separation_m
    errors.radius_m[row] = model.dimensions.body_radius_m
