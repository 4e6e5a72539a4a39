"""Imports libraries that not everyone needs."""

import importlib
import sys
from types import ModuleType

from .errors import RecordingError


def import_optional(module: str, requirement: str) -> ModuleType:
    """Import a module of the package requirement. Raises: RecordingError with the command that installs it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise RecordingError(
            "this needs the Python package %s (%s): %s -m pip install '%s'"
            % (requirement, error, sys.executable, requirement)
        ) from None
