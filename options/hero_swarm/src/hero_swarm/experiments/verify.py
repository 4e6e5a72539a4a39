"""Program verify: computes the table of a pack again, by the sources in it, and compares the bytes.

Like run, it executes the programs that the experiment names: verify packs of people whom you trust only.
"""

import argparse
import os
import subprocess
import sys
import tarfile
import tempfile
from typing import Optional, Sequence

from .errors import ExperimentError
from .pack import EXPERIMENT, FILES, RUNS, SUITE


def unpack(path: str, folder: str) -> None:
    """Write the files of a pack into a folder. Raises: ExperimentError for what is no pack."""
    try:
        with tarfile.open(path, "r:gz") as pack:
            for member in pack:
                target = os.path.normpath(os.path.join(folder, member.name))
                content = pack.extractfile(member) if member.isfile() and target.startswith(folder + os.sep) else None
                if content is None:
                    raise ExperimentError(f"{path}: {member.name!r} is no file inside of the pack")
                os.makedirs(os.path.dirname(target), exist_ok=True)
                with open(target, "wb") as file:
                    file.write(content.read())
    except (OSError, EOFError, tarfile.TarError) as error:
        raise ExperimentError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from error
    if not all(os.path.isfile(os.path.join(folder, name)) for name in (EXPERIMENT, RUNS)):
        raise ExperimentError(f"{path}: no pack of an experiment: make one with pack")


def _read(*names: str) -> str:
    with open(os.path.join(*names), encoding="utf-8", newline="") as file:
        return file.read()


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Compute the table, and compare. Raises: ExperimentError if it differs."""
    parser = argparse.ArgumentParser(prog="verify", description="Compute the table of a pack again, and compare it.")
    parser.add_argument("file", metavar="PACK.tar.gz", help="a file of pack")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="worker processes (%(default)s)")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as created:
        folder = os.path.realpath(created)
        unpack(options.file, folder)
        suite = os.path.join(folder, SUITE)
        paths = [suite, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1"}
        file, out = os.path.join(folder, FILES, _read(folder, EXPERIMENT)), os.path.join(folder, "out")
        command = [sys.executable, "-m", "hero_swarm", "run", file, "--out", out, "--jobs", str(options.jobs)]
        if subprocess.run(command, env=environment, cwd=suite, stdout=subprocess.DEVNULL, check=False).returncode:
            raise ExperimentError(f"{options.file}: its runs cannot be computed here")
        wanted, computed = (_read(where, RUNS).splitlines() for where in (folder, out))
    if wanted != computed:
        other = [number for number, pair in enumerate(zip(wanted, computed), 1) if pair[0] != pair[1]]
        text = "%s: runs.csv differs in %d of %d lines, first in line %d"
        raise ExperimentError(text % (options.file, len(other), len(wanted), min(other, default=len(computed) + 1)))
    print(f"{options.file}: the same bytes in all {len(wanted) - 1} runs")
