"""The parameter ~robots of this package's programs: ids that are given, because nothing here looks for robots."""

from typing import Any, List

from hero_node.errors import ProgramError
from hero_node.parameters import Parameter, parse_robot_ids


def check_given(name: str, value: Any) -> List[int]:
    """Return the ids in value. Raises: ProgramError for "all", and as parse_robot_ids()."""
    ids = parse_robot_ids(name, value)
    if ids is None:
        raise ProgramError('~%s is "all", but must be ids such as "0 1 2" or "0-3"' % name)
    return ids


def given_robots() -> Parameter:
    """Declare the ids of the robots, by default 0."""
    return Parameter("0", check_given)
