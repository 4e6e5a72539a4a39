"""Free space on a disk -> whether a recording may begin or go on. Reads the file system, writes nothing."""

import os
import shutil
from typing import Callable, Optional

from .errors import RecordingError

MB = 10**6


def read_free_mb(folder: str) -> float:
    """Return what an ordinary user may still write there (10^6 bytes). Raises: OSError."""
    return shutil.disk_usage(folder).free / MB


class DiskGuard:
    """Watches the free space of one folder.

    Attributes:
        folder: where the recording goes.
        limit_mb: recording ends when less than this is free.
    """

    def __init__(
        self, folder: str, limit_mb: float, read_free: Callable[[str], float] = read_free_mb
    ) -> None:
        """Watch folder, which may not exist yet; read_free stands for the file system."""
        self.folder = folder
        self.limit_mb = limit_mb
        self._read_free = read_free

    def prepare(self) -> float:
        """Make the folder and return what is free there (MB).

        Raises: RecordingError if it cannot be made or written to, or too little is free.
        """
        try:
            os.makedirs(self.folder, exist_ok=True)
        except OSError as error:
            raise RecordingError(
                "%s cannot be made: %s; choose another folder" % (self.folder, error.strerror)
            ) from error
        if not os.access(self.folder, os.W_OK | os.X_OK):
            raise RecordingError("%s is not writable; choose another folder" % self.folder)
        try:
            free_mb = self._read_free(self.folder)
        except OSError as error:
            raise RecordingError(
                "%s cannot be read: %s; choose another folder" % (self.folder, error.strerror)
            ) from error
        if free_mb < self.limit_mb:
            raise RecordingError(
                "only %.0f MB are free in %s and the limit is %.0f MB, so nothing is recorded; "
                "free some space, choose another folder, or lower min_free_mb"
                % (free_mb, self.folder, self.limit_mb)
            )
        return free_mb

    def read_free_above_limit_mb(self) -> Optional[float]:
        """Return what may still be recorded (MB), None if the folder is gone."""
        try:
            return max(0.0, self._read_free(self.folder) - self.limit_mb)
        except OSError:
            return None

    def find_reason_to_end(self) -> Optional[str]:
        """Return why the recording has to end now, in words; None if it may go on."""
        try:
            free_mb = self._read_free(self.folder)
        except OSError as error:
            return "%s is gone: %s" % (self.folder, error.strerror)
        if free_mb >= self.limit_mb:
            return None
        return "only %.0f MB are left in %s, less than the limit of %.0f MB (min_free_mb)" % (
            free_mb,
            self.folder,
            self.limit_mb,
        )
