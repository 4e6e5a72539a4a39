"""Values of programs: poses, readings, colors, errors, times. Pure."""

from hero_node.robot_constants import (
    BODY_RADIUS_M,
    HERO,
    MAX_ANGULAR_RAD_S,
    MAX_LINEAR_M_S,
    MAX_WHEEL_M_S,
    MIN_RANGE_M,
    MODELS,
    WHEEL_SEPARATION_M,
    RobotModel,
)

from .background_motion import SEND_TIME_S, BackgroundMotion, FullWait, Steps
from .errors import FrameError, RobotNotReadyError, StaleDataError
from .object_sensing import (
    NO_OBJECTS,
    OBJECT,
    ROBOT,
    Objects,
    ObjectsInSight,
    PlacedObjects,
    Sight,
    sense_objects,
    sense_sight,
)
from .readings import FRESH_S, MAX_POSITION_M, Obstacle, finite, front_first, is_blind, is_plausible, read_pose
from .robot_link import MAP, RobotLink
from .robot_states import STATES, STOP_STATES, describe_counts, describe_gone, describe_stop_origin, name_state
from .sensing import Binary, Neighbor, Neighborhood, Neighbors, list_neighbors, sense_binary, sense_neighbors
from .stamped_history import StampedHistory, interpolate_pose
from .wheel_paths import follow_wheels
