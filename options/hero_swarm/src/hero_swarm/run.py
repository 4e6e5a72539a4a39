"""Program run: an experiment in the simulator, or with --robots on robots."""

from typing import Optional, Sequence

from .experiments.runner import open_folder, parse_options, run_experiment


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Run the program."""
    options = parse_options(arguments)
    if options.robots is None:
        print(run_experiment(options))
        return
    from .ros.robot_runs import run_on_robots  # the simulator needs no ROS

    with open_folder(options) as (experiment, folder, runs):
        print(run_on_robots(experiment, folder, runs, options))
