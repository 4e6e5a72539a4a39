"""Program report: medians with intervals, comparisons and plots of an experiment's runs, as text, CSV, and a page."""

import argparse
import io
import os
from typing import Optional, Sequence

from hero_node.files import write_file

from .reporting.figures import draw_all, to_svg
from .reporting.report_page import draw_page
from .reporting.summary import build_report, describe, describe_method, format_summaries
from .results import load
from .results_folder import REAL, SIMULATED, ResultsFolder, read_results


def write_report(path: str) -> None:
    """Write table, summary, figures and page of the results in a folder, and print them. Raises: ExperimentError."""
    text, experiment, about = read_results(path)
    folder = ResultsFolder(path, experiment, about["code"])
    runs = folder.read_runs()
    folder.write_table(runs)
    kinds = [kind for kind in (SIMULATED, REAL) if any(run.kind == kind for run in runs)] or [SIMULATED]
    for kind in kinds:
        # Robots and the simulator are never mixed in one median.
        report = build_report(experiment, [run for run in runs if run.kind == kind])
        suffix = "" if kind == SIMULATED else "_robots"
        figures = draw_all(report, load(path, kind))
        page = draw_page(report, figures, text, about)
        write_file(os.path.join(path, f"summary{suffix}.csv"), format_summaries(report).encode())
        write_file(os.path.join(path, f"report{suffix}.html"), page.encode())
        folder_of_figures = os.path.join(path, "figures" + suffix)
        os.makedirs(folder_of_figures, exist_ok=True)
        for name, figure in figures.items():  # the same bytes for the same runs
            stem, content = os.path.join(folder_of_figures, name.replace(os.sep, "_")), io.BytesIO()
            figure.savefig(content, format="pdf", metadata={"CreationDate": None})
            write_file(stem + ".pdf", content.getvalue())
            write_file(stem + ".svg", to_svg(figure).encode())
        print(describe(report))
        print(describe_method(report, about))
        print(os.path.join(path, f"report{suffix}.html"))


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Run the program."""
    parser = argparse.ArgumentParser(prog="report", description="Medians, intervals and plots of an experiment.")
    parser.add_argument("folder", metavar="FOLDER", help="folder with the results of run")
    parser.add_argument("--series", metavar="FILE", help="write the metrics over time to a .csv or .parquet, too")
    options = parser.parse_args(arguments)
    write_report(options.folder)
    if options.series:
        load(options.folder).write_table(options.series)
        print(options.series)
