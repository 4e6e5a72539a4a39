"""Parameters of programs, declared with default and limits, and checks of numbers. Pure."""

from .declared import (
    MAX_COORDINATE_M,
    Parameter,
    check_parameters,
    choice,
    declare,
    find_declared,
    flag,
    given_ids_option,
    make_error,
    number,
    parse_given_ids,
    parse_poses,
    robot_ids,
    robot_ids_option,
    whole_number,
    within,
    words,
)
from .number_checks import check_finite, check_speed, is_number, is_whole_number
