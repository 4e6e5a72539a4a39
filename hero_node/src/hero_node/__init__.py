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
from .ros_messages import (
    COVARIANCE_FORM,
    ENCODER_FORM,
    HEADER,
    LENGTH,
    MD5SUMS,
    PLUS_ENCODER_MD5,
    POSE_FORM,
    SCAN_FORM,
    TWIST_FORM,
    TooLongError,
    encode_header,
    encode_list,
    encode_odometry,
    encode_pose,
    encode_scan,
    encode_text,
    encode_transforms,
    encode_turn_scan,
    encode_twist,
    find_messages,
)
from .texts import list_names, make_printable, one_line, shorten, suggest
from .token_bucket import TokenBucket, TokenBuckets
