"""Which code computes an experiment: results of two versions must never be mixed. Pure but for reading files."""

import hashlib
import os
import platform
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any, Dict

import numpy as np

PACKAGES = ("hero_client", "hero_driver", "hero_node", "hero_sim", "hero_swarm")
"""All whose modules a simulated run may use."""


def hash_code(behavior: str) -> str:
    """Return a digest of all source files that a run of behavior may use.

    behavior: as in the file of an experiment; of FILE.py:Class the file counts, too.
    """
    digest = hashlib.sha256()
    for package in PACKAGES:
        folder = Path(str(import_module(package).__file__)).parent
        sources = (path for path in folder.rglob("*.py") if "__pycache__" not in path.parts)
        for path in sorted(sources):
            _add_file(digest, "%s/%s" % (package, path.relative_to(folder)), path)
    file = behavior.partition(":")[0]
    if file.endswith(".py"):
        _add_file(digest, "behavior", Path(file))
    return digest.hexdigest()[:16]


def _add_file(digest: Any, name: str, path: Path) -> None:
    content = path.read_bytes()
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
    command = ["git", "-C", str(Path(__file__).resolve().parent), "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        return subprocess.check_output(command, stderr=subprocess.DEVNULL, timeout=10.0).decode().strip()
    except (OSError, subprocess.SubprocessError):
        return "unknown"
