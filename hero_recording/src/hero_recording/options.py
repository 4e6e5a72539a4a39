"""Types of command line options (argparse) that several programs share."""

import argparse
from typing import Callable, Collection, List, Optional

from hero_client.errors import ProgramError
from hero_client.parameters import parse_robot_ids


def robot_ids(text: str) -> Optional[List[int]]:
    """Return the ids in text, None for "all". Raises: argparse.ArgumentTypeError."""
    try:
        return parse_robot_ids("robots", text)
    except ProgramError as error:
        raise argparse.ArgumentTypeError(str(error).replace("~robots", "it")) from error


def list_of(known: Collection[str]) -> Callable[[str], List[str]]:
    """Return a type for names out of known, separated by commas."""

    def parse(text: str) -> List[str]:
        names = text.split(",")
        for name in names:
            if name not in known:
                raise argparse.ArgumentTypeError("%r: known are %s" % (name, ",".join(known)))
        return names

    return parse
