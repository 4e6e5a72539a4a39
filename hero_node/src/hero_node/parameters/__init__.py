"""Parameters of programs, declared with default and limits, and checks of numbers. Pure."""

from .declared import (
    MAX_COORDINATE_M,
    Parameter,
    check_parameters,
    choice,
    declare,
    explicit_ids_option,
    find_declared,
    flag,
    make_error,
    number,
    parse_explicit_ids,
    parse_poses,
    robot_ids,
    robot_ids_option,
    string,
    whole_number,
    within,
)
from .number_checks import check_finite, check_speed, is_number, is_whole_number
