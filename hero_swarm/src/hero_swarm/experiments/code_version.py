"""Which code computes an experiment: results of two versions must never be mixed. Pure but for reading files."""

import hashlib
import os
import platform
import subprocess
import sys
from importlib import import_module
from typing import Any, Dict, List

import numpy as np

PACKAGES = ("hero_client", "hero_driver", "hero_node", "hero_sim", "hero_swarm")
"""All whose modules a simulated run may use."""


def hash_code(behavior: str) -> str:
    """Return a digest of all source files that a run of behavior may use.

    behavior: as in the file of an experiment; of FILE.py:Class the file counts, too.
    """
    digest = hashlib.sha256()
    for package in PACKAGES:
        folder = os.path.dirname(str(import_module(package).__file__))
        for path in _list_sources(folder):
            _add_file(digest, "%s/%s" % (package, os.path.relpath(path, folder)), path)
    file = behavior.partition(":")[0]
    if file.endswith(".py"):
        _add_file(digest, "behavior", file)
    return digest.hexdigest()[:16]


def _list_sources(folder: str) -> List[str]:
    """Return the paths of the modules below folder, in an order that does not depend on the file system."""
    paths: List[str] = []
    for place, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if name != "__pycache__")
        paths.extend(os.path.join(place, name) for name in sorted(files) if name.endswith(".py"))
    return paths


def _add_file(digest: Any, name: str, path: str) -> None:
    with open(path, "rb") as file:
        content = file.read()
    digest.update(("%s %d\n" % (name, len(content))).encode())
    digest.update(content)


def describe_machine() -> Dict[str, str]:
    """Return what a reader of the results may want to know of the machine and the versions; no result depends on it."""
    return {
        "commit": _find_commit(),
        "machine": "%s, %d cores" % (platform.platform(), os.cpu_count() or 0),
        "numpy": np.__version__,
        "python": sys.version.split()[0],
    }


def _find_commit() -> str:
    """Return the commit of the sources, with "-dirty" if they differ from it; "unknown" outside a checkout."""
    command = [
        "git",
        "-C",
        os.path.dirname(os.path.realpath(__file__)),
        "describe",
        "--always",
        "--dirty",
        "--abbrev=12",
    ]
    try:
        result = subprocess.run(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, timeout=10.0, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return result.stdout.decode().strip()
