"""A type of command line options (argparse) that plot and export share."""

import argparse
from typing import Callable, Collection, List


def list_of(known: Collection[str]) -> Callable[[str], List[str]]:
    """Return a type for names out of known, separated by commas."""

    def parse(text: str) -> List[str]:
        names = text.split(",")
        for name in names:
            if name not in known:
                raise argparse.ArgumentTypeError(f"{name!r}: known are {','.join(known)}")
        return names

    return parse
