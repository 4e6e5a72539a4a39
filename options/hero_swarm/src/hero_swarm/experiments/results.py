"""Results of experiments as labelled arrays, for figures and tables of your own."""

import csv
import os
from typing import Any, Dict, List

import numpy as np

from hero_node import import_optional

from .computing.batch import SAMPLE_S, list_sources
from .errors import ExperimentError
from .results_folder import METRICS_ENDING, POSES_ENDING, SIMULATED, ResultsFolder, read_results


class Results:
    """The runs of an experiment of one kind, C cells with S seeds; nan where a run is missing or has ended.

    Attributes:
        cells, labels: the values that vary, by name, of each cell, and a text of them for legends.
        metrics: columns of runs.csv by their names (C, S).
        seeds, times_s: of all runs (S,), of series (T,).
        series: metrics over time by their names (C, S, T); none of robots.
        pose_times_s: of poses (P,); empty if the experiment records none.
    """

    def __init__(self, path: str, kind: str = SIMULATED) -> None:
        """Read a folder of run; kind: simulated or real. Raises: ExperimentError."""
        _, experiment, about = read_results(path)
        self._folder = ResultsFolder(path, experiment, about["code"])
        self._is_simulated = kind == SIMULATED
        self._robots = max(cell.settings["robots"] for cell in experiment.cells)
        self.cells: List[Dict[str, Any]] = [cell.varied for cell in experiment.cells]
        self.labels = [cell.label for cell in experiment.cells]
        self.seeds = np.array(experiment.seeds)
        shape = len(self.cells), len(self.seeds)
        columns = np.full((len(experiment.metrics), *shape), np.nan)
        for run in self._folder.read_runs():
            if run.kind == kind and not run.remark:
                columns[:, run.cell, run.seed - self.seeds[0]] = run.values
        self.metrics = dict(zip((metric.name for metric in experiment.metrics), columns))
        self.times_s = np.arange(int(experiment.time_s / SAMPLE_S + 1e-9) + 1) * SAMPLE_S
        names = list_sources(experiment)
        recorded = self._read(METRICS_ENDING, (len(self.times_s), len(names)))
        self.series = {name.rpartition(":")[2]: recorded[..., index] for index, name in enumerate(names)}
        count = int(experiment.time_s * experiment.record_hz + 1e-9) + 1 if experiment.record_hz else 0
        self.pose_times_s = np.arange(count) / (experiment.record_hz or 1.0)

    def _read(self, ending: str, shape: Any) -> np.ndarray:
        """Return what runs recorded in files that end so (C, S, *shape)."""
        values = np.full((len(self.cells), len(self.seeds), *shape), np.nan, dtype=np.float32)
        for cell in range(len(self.cells) if self._is_simulated else 0):
            for seed, own in self._folder.read_series(cell, ending).items():
                values[(cell, seed - self.seeds[0], *map(slice, own.shape))] = own
        return values

    def read_poses(self) -> np.ndarray:
        """Return recorded poses, x m, y m, yaw rad (C, S, P, N, 3); N: of the cell with most robots."""
        return self._read(POSES_ENDING, (len(self.pose_times_s), self._robots, 3))

    def find(self, **varied: Any) -> List[int]:
        """Return the cells with these values, as the file has them; of names with dots: find(**{"near.range_m": 1})."""
        return [row for row, cell in enumerate(self.cells) if all(cell.get(name) == varied[name] for name in varied)]

    def list_columns(self) -> Dict[str, List[Any]]:
        """Return the metrics over time as columns of a table: a row for each cell, seed and time."""
        cells, seeds, samples = len(self.cells), len(self.seeds), len(self.times_s)
        columns: Dict[str, List[Any]] = {}
        for name in self.cells[0]:
            values = [cell[name] for cell in self.cells]
            if len(set(map(type, values))) > 1:  # such as errors: [perfect, 0.5]: a column of Parquet has one type
                values = list(map(str, values))
            columns[name] = [value for value in values for _ in range(seeds * samples)]
        columns["seed"] = np.tile(np.repeat(self.seeds, samples), cells).tolist()
        columns["time_s"] = np.tile(self.times_s, cells * seeds).tolist()
        return {**columns, **{name: values.ravel().tolist() for name, values in self.series.items()}}

    def write_table(self, path: str) -> None:
        """Write list_columns() to a file that ends with .csv or .parquet. Raises: ExperimentError. OSError."""
        columns = self.list_columns()
        if path.endswith(".parquet"):
            arrow, parquet = (import_optional(name, "pyarrow") for name in ("pyarrow", "pyarrow.parquet"))
            parquet.write_table(arrow.table(columns), path)
        elif path.endswith(".csv"):
            with open(path, "w", encoding="utf-8", newline="") as file:
                csv.writer(file).writerows([list(columns), *zip(*columns.values())])
        else:
            raise ExperimentError(f"{os.path.basename(path)}: a table ends with .csv or .parquet")

    def to_xarray(self) -> Any:
        """Return the metrics over time as an xarray.Dataset with the dimensions cell, seed, time_s."""
        dimensions = ("cell", "seed", "time_s")
        values = {name: (dimensions, series) for name, series in self.series.items()}
        axes = dict(zip(dimensions, (self.labels, self.seeds, self.times_s)))
        return import_optional("xarray", "python3-xarray").Dataset(values, axes)


def load(path: str, kind: str = SIMULATED) -> Results:
    """Return the results in a folder of run; kind: simulated or real. Raises: ExperimentError."""
    return Results(path, kind)
