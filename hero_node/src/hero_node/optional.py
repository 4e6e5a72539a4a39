"""Imports libraries that not everyone needs."""

import importlib
import os
import sys
import sysconfig
from types import ModuleType

from .errors import ProgramError


def import_optional(module: str, package: str) -> ModuleType:
    """Import a module of a package of Debian (python3-...) or PyPI. Raises: ProgramError: how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        # Debian's own Python refuses pip from version 12 on.
        is_managed = os.path.exists(os.path.join(sysconfig.get_path("stdlib"), "EXTERNALLY-MANAGED"))
        command = f"{sys.executable} -m pip install '{package}'"
        if package.startswith("python3-"):
            command = "apt install " + package
        elif sys.prefix == sys.base_prefix and is_managed:
            command = f"{sys.executable} -m venv --system-site-packages ~/hero_venv && ~/hero_venv/bin/pip install"
            command += f" '{package}', and start it with ~/hero_venv/bin/python3"
        raise ProgramError(f"{module} is missing ({error}); install it: {command}") from None
