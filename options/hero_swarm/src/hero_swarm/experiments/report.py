"""Program report: medians with intervals, comparisons and plots of an experiment's runs, as text, CSV, and a page."""

import argparse
import os
from typing import Dict, Optional, Sequence

import numpy as np

from hero_node.files import write_file

from .batch import METRICS_ENDING, SAMPLE_S, list_sources
from .experiment_file import Experiment
from .reporting.report_page import OverTime, draw_page
from .reporting.summary import build_report, describe, format_summaries
from .results_folder import REAL, SIMULATED, ResultsFolder
from .runner import read_results


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="report", description="Medians, intervals and plots of an experiment.")
    parser.add_argument("folder", metavar="FOLDER", help="folder with the results of run")
    return parser.parse_args(arguments)


def write_report(path: str) -> None:
    """Write table, summary and page of the results in a folder, and print them. Raises: ExperimentError."""
    text, experiment, about = read_results(path)
    folder = ResultsFolder(path, experiment, about["code"])
    runs = folder.read_runs()
    folder.write_table(runs)
    kinds = [kind for kind in (SIMULATED, REAL) if any(run.kind == kind for run in runs)] or [SIMULATED]
    for kind in kinds:
        # Robots and the simulator are never mixed in one median.
        report = build_report(experiment, [run for run in runs if run.kind == kind])
        suffix = "" if kind == SIMULATED else "_robots"
        over_time = _read_over_time(folder, experiment) if kind == SIMULATED else {}
        page = draw_page(report, over_time, text, about)
        write_file(os.path.join(path, f"summary{suffix}.csv"), format_summaries(report).encode())
        write_file(os.path.join(path, f"report{suffix}.html"), page.encode())
        print(describe(report))
        print(os.path.join(path, f"report{suffix}.html"))


def _read_over_time(folder: ResultsFolder, experiment: Experiment) -> Dict[str, OverTime]:
    """Return the course of each metric that was sampled, for the cells that have runs."""
    cells = {cell: folder.read_series(cell, METRICS_ENDING) for cell in range(len(experiment.cells))}
    recorded = {cell: np.stack(list(runs.values()), axis=1) for cell, runs in cells.items() if runs}
    if not recorded:
        return {}
    times_s = SAMPLE_S * np.arange(len(next(iter(recorded.values()))))
    return {
        name: (times_s, {cell: samples[..., index] for cell, samples in recorded.items()})
        for index, name in enumerate(list_sources(experiment))
    }


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Run the program."""
    write_report(parse_options(arguments).folder)
