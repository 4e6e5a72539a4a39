"""From a file that describes an experiment to its runs, intervals and plots."""
