"""The limit of open files, of which every connection takes one. Pure but for the limit."""

import resource
import sys


def raise_file_limit() -> int:
    """Raise the limit of open files to what needs no privileges; return it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != hard:
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    return sys.maxsize if hard == resource.RLIM_INFINITY else hard
