"""Behaviors of swarms as array functions, their metrics, and the programs that run them."""

from .behavior import Behavior
