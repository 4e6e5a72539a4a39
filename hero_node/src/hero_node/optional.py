"""Imports libraries that not everyone needs."""

import importlib
import sys
from types import ModuleType

from .errors import ProgramError


def import_optional(module: str, package: str) -> ModuleType:
    """Import a module of a package of Debian (python3-...) or PyPI. Raises: ProgramError: how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        pip = f"{sys.executable} -m pip install '{package}'"
        command = "apt install " + package if package.startswith("python3-") else pip
        raise ProgramError(f"{module} is missing ({error}); install it: {command}") from None
