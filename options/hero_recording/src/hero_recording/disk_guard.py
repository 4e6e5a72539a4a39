"""Decides from the free space of a disk whether a recording may start or continue. Writes no files."""

import os
import shutil
from typing import Optional

from .errors import RecordingError

MB = 10**6


def read_free_mb(folder: str) -> float:
    """Return what an ordinary user may still write there (10^6 bytes). Raises: OSError."""
    return shutil.disk_usage(folder).free / MB


def prepare_folder(folder: str, limit_mb: float) -> float:
    """Create a folder if it is missing, and return what is free there (MB).

    Raises: RecordingError if it cannot be written to, or less than the limit is free. OSError.
    """
    os.makedirs(folder, exist_ok=True)
    free_mb = read_free_mb(folder)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise RecordingError(f"{folder} is not writable; choose another folder")
    if free_mb < limit_mb:
        raise RecordingError(
            "only %.0f MB are free in %s and the limit is %.0f MB, so nothing is recorded; "
            "free some space, choose another folder, or lower min_free_mb" % (free_mb, folder, limit_mb)
        )
    return free_mb


def find_reason_to_stop(folder: str, limit_mb: float) -> Optional[str]:
    """Return why a recording in a folder has to stop now, as text; None if it may continue."""
    try:
        free_mb = read_free_mb(folder)
    except OSError as error:
        return f"{folder} no longer exists: {error.strerror}"
    if free_mb >= limit_mb:
        return None
    return f"only {free_mb:.0f} MB are left in {folder}, less than the limit of {limit_mb:.0f} MB (min_free_mb)"
