"""The commands to one robot: checked, shaped to what the firmware accepts, queued; and the progress of a stop. Pure."""

from .velocity_shaper import COMMAND_INTERVAL_S, STOP_REPEATS
