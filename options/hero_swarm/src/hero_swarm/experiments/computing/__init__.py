"""Computes the runs of cells: their setups, batches of runs, and the workers that compute batches."""

from .cell_setup import CellSetup, set_up
