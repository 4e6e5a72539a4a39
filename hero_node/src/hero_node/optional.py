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
        pip = "%s -m pip install '%s'" % (sys.executable, package)
        command = "apt install " + package if package.startswith("python3-") else pip
        raise ProgramError("%s is missing (%s); install it: %s" % (module, error, command)) from None
