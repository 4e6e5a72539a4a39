"""From the runs of an experiment to statistics, plots and a page."""
