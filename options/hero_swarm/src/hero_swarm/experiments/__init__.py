"""Turns a file that describes an experiment into its runs, intervals and plots."""
