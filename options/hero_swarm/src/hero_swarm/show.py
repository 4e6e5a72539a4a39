"""Program show: replays one run of an experiment in RViz and on the monitor's map, or writes it to a file.

A run is computed again: seed and code give the same bytes, and nothing has to have been recorded.
"""

import argparse
import sys
from collections import deque
from typing import Optional, Sequence

from hero_node.parameters import within

from .experiments.computing import set_up
from .experiments.computing.batch import load_checked
from .experiments.errors import ExperimentError
from .experiments.results_folder import read_results


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="show", description="Replay one run of an experiment.")
    parser.add_argument("folder", metavar="FOLDER", help="the results of run")
    parser.add_argument("--seed", type=int, help="of the run (the first one)")
    parser.add_argument("--cell", type=int, default=1, metavar="K", help="number of the cell, from 1 (1)")
    parser.add_argument("--speed", type=within(0.01, 100.0), default=1.0, help="simulated seconds per second (1)")
    instead = parser.add_mutually_exclusive_group()
    instead.add_argument("--video", metavar="FILE", help="write an animated .gif instead, without ROS")
    instead.add_argument("--bag", metavar="FILE", help="write a bag instead, without ROS")
    return parser.parse_args(arguments)


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Replay the run that options name. Raises: ExperimentError."""
    options = parse_options(arguments)
    _, experiment, about = read_results(options.folder)
    if not 1 <= options.cell <= len(experiment.cells):
        known = "; ".join("%d: %s" % item for item in enumerate((cell.label for cell in experiment.cells), 1))
        raise ExperimentError("--cell %d: must be one of %s" % (options.cell, known))
    cell = experiment.cells[options.cell - 1]
    seed = experiment.seeds[0] if options.seed is None else options.seed
    if seed not in experiment.seeds:
        raise ExperimentError(f"--seed {seed}: there are seeds {experiment.seeds[0]} to {experiment.seeds[-1]}")
    code, trial = load_checked(experiment), set_up(experiment, cell).build_trial([seed])
    if about["code"] != code:
        print(f"note: results are of other code ({about['code']}): this run may differ from theirs", file=sys.stderr)
    print("%s, seed %d, %g s" % (cell.label, seed, experiment.time_s))
    if options.video:
        from .video import write_video

        write_video(trial, experiment.time_s, options.speed, options.video)
        print(options.video)
    elif options.bag:
        from hero_recording.step_recorder import StepRecorder

        with StepRecorder(trial.rows, range(trial.poses.shape[1]), options.bag):
            deque(trial.run(experiment.time_s), maxlen=0)
        print(options.bag)
    else:
        from .ros.replay import replay

        replay(trial, experiment.time_s, options.speed)
