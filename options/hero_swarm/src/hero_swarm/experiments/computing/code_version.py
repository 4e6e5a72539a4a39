"""Which code computes an experiment: results of two versions must never be mixed. Pure but for reading files."""

import hashlib
import os
import platform
import subprocess
import sys
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Dict, Mapping

import numpy as np

from ..errors import ExperimentError

PACKAGES = ("hero_client", "hero_driver", "hero_node", "hero_sim", "hero_swarm")
"""All whose modules a simulated run may use."""

_SUFFIXES = (".py", ".yaml")
"""Modules and arenas."""


def hash_code(own: Mapping[str, bytes]) -> str:
    """Return a digest of all sources that a run may use; own: contents of the user's files, by name."""
    return _digest(dict(sorted(own.items())), hash_suite())


@lru_cache(maxsize=None)
def hash_suite() -> str:
    """Return a digest of the suite's sources, as they were when this process asked first."""
    return _digest(list_suite())


def _digest(contents: Mapping[str, bytes], begin: str = "") -> str:
    digest = hashlib.sha256(begin.encode())
    for name, content in contents.items():
        digest.update(f"{name} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()[:16]


def list_suite() -> Dict[str, bytes]:
    """Return the suite's sources on the disk that a run may use, by package and path, in a fixed order."""
    contents: Dict[str, bytes] = {}
    for package in PACKAGES:
        folders = map(Path, import_module(package).__path__)
        # In a devel space of catkin, the first folder holds but an __init__.py that leads to the second one.
        folder = next(folder for folder in folders if {path.name for path in folder.glob("*.py")} > {"__init__.py"})
        for path in sorted(folder.rglob("*")):
            own = path.relative_to(folder)
            if path.suffix in _SUFFIXES and not {"__pycache__", "published"}.intersection(own.parts):
                contents[f"{package}/{own}"] = path.read_bytes()
    return contents


def check_suite(suite: str) -> None:
    """Check that this process has the sources of the suite with this digest, and that they are still on the disk.

    Raises: ExperimentError.
    """
    for own in (hash_suite(), _digest(list_suite())):  # what it imports later comes from the disk
        if own != suite:
            text = "%s has other code of the suite (%s, not %s) than this run began with: update it and start again"
            raise ExperimentError(text % (platform.node(), own, suite))


def describe_machine() -> Dict[str, str]:
    """Return what a reader of the results may want to know of the machine and the versions; no result depends on it."""
    # With "-dirty" if the sources differ from it.
    command = ["git", "-C", str(Path(__file__).resolve().parent), "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        commit = subprocess.check_output(command, stderr=subprocess.DEVNULL, timeout=10.0).decode().strip()
    except (OSError, subprocess.SubprocessError):
        commit = "unknown"  # outside a checkout
    return {
        "commit": commit,
        "machine": "%s, %d cores" % (platform.platform(), os.cpu_count() or 0),
        "numpy": np.__version__,
        "python": sys.version.split()[0],
    }
