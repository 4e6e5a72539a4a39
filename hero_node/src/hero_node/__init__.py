"""Common parts of all nodes and programs of the suite. Only modules in `ros` import ROS."""

from .addresses import find_source_address, is_loopback
from .clock import Clock
from .command_line import WRONG_ARGUMENTS, call, find_line, print_error, run, run_named, say
from .connection_table import ConnectionTable
from .errors import HeroError, NodeError, ProgramError
from .geometry import (
    STOP,
    Pose,
    Velocity,
    clamp,
    find_frame,
    invert_pose,
    measure_distance,
    pose_of,
    transform_pose,
    wrap_angle,
    yaw_of,
)
from .optional import import_optional
from .processes import end_process, raise_file_limit
from .texts import list_names, make_printable, one_line, shorten, suggest
from .token_bucket import TokenBucket, TokenBuckets
