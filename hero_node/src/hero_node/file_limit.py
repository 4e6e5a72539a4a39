"""The limit of open files, of which every connection takes one. Pure but for the limit."""

import resource
import sys

__all__ = ["raise_file_limit"]


def raise_file_limit() -> int:
    """Let this process open as many files as it may without privileges; return how many."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != hard:
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    return sys.maxsize if hard == resource.RLIM_INFINITY else hard
