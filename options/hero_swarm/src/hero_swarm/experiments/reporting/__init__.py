"""Turns the runs of an experiment into statistics, plots and a page."""
