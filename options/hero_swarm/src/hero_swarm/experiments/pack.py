"""Program pack: all that is needed to compute the table of an experiment again, in one file; verify reads it.

experiment         path in files of the experiment's file
runs.csv           the simulated runs
about.json         versions, commit, machine
files/...          the experiment's file and all that it reads
suite/...          the suite's sources that computed them
"""

import argparse
import io
import os
import tarfile
from typing import Dict, Optional, Sequence

from hero_node.files import name_file, read_file

from .computing.batch import load_checked
from .computing.code_version import list_suite
from .errors import ExperimentError
from .results_folder import ABOUT, SIMULATED, ResultsFolder, format_table, read_results

EXPERIMENT, RUNS, FILES, SUITE = "experiment", "runs.csv", "files", "suite"


def collect(path: str) -> Dict[str, bytes]:
    """Return the files of the pack by their names. Raises: ExperimentError if the results cannot be computed again."""
    text, experiment, about = read_results(path)
    code = load_checked(experiment)
    folder = ResultsFolder(path, experiment, about["code"])
    runs = [run for run in folder.read_runs() if run.kind == SIMULATED]
    if about["code"] != code:
        text = "%s: computed by other code (%s, now %s): pack it with that code, or start over with run --fresh"
        raise ExperimentError(text % (path, about["code"], code))
    if folder.list_missing(runs):
        raise ExperimentError(f"{path}: {len(folder.list_missing(runs))} runs are missing: compute them with run")
    inputs = experiment.sources.list_contents(os.path.abspath(experiment.folder), ())
    above = max((name.count("../") for name in inputs), default=0)  # files may lie beside the experiment's folder
    parts = os.path.abspath(experiment.folder).split(os.sep)
    own = os.path.join(*parts[len(parts) - above :], "") if above else ""
    named = {os.path.normpath(os.path.join(FILES, own, name)): content for name, content in inputs.items()}
    name = own + os.path.basename(os.path.abspath(path)) + ".yaml"
    return {
        EXPERIMENT: name.encode(),
        RUNS: format_table(experiment, runs).encode(),
        ABOUT: read_file(os.path.join(path, ABOUT)),
        os.path.join(FILES, name): text.encode(),
        **named,
        **{os.path.join(SUITE, source): content for source, content in list_suite().items()},
    }


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Write the pack. Raises: ExperimentError."""
    parser = argparse.ArgumentParser(prog="pack", description="Pack an experiment with its table and all its files.")
    parser.add_argument("folder", metavar="FOLDER", help="folder with the results of run")
    parser.add_argument("--out", metavar="FILE", help="of the pack (FOLDER.tar.gz)")
    options = parser.parse_args(arguments)
    contents = collect(options.folder)
    out = options.out or os.path.normpath(options.folder) + ".tar.gz"
    with name_file(out), tarfile.open(out, "w:gz") as pack:
        for name, content in sorted(contents.items()):
            member = tarfile.TarInfo(name)
            member.size = len(content)
            pack.addfile(member, io.BytesIO(content))
    print(f"{out}: {len(contents)} files; on any machine: rosrun hero_swarm verify {os.path.basename(out)}")
