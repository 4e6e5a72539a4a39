"""Turns a file that describes an experiment into its runs, intervals and plots."""

from .results import Results, load
