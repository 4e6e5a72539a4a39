"""Files of users that a run depends on: each is read once, so that what was hashed is what runs, in any process."""

import errno
import os
from typing import Any, Callable, Container, Dict

from hero_node.files import read_file


class Sources:
    """Contents of files. A copy in another process reads nothing from its disk.

    Attributes:
        loaded: what was made of the files, by names of the caller; not copied.
    """

    def __init__(self) -> None:
        """Begin without a file."""
        self.loaded: Dict[str, Any] = {}
        self._contents: Dict[str, bytes] = {}
        self._is_complete = False

    def __getstate__(self) -> Dict[str, Any]:
        return {**self.__dict__, "loaded": {}}

    def read(self, path: str) -> bytes:
        """Return the content of a file as it was when it was first read. Raises: OSError."""
        path = os.path.abspath(path)
        if path not in self._contents:
            if self._is_complete:
                raise OSError(errno.ENOENT, "it is needed now, but was not when the run began", path)
            self._contents[path] = read_file(path)
        return self._contents[path]

    def complete(self) -> None:
        """Read no further file: all that a run needs are known."""
        self._is_complete = True

    def find(self, path: str) -> bool:
        """Return whether there is such a file."""
        return self.has_read(path) or (not self._is_complete and os.path.isfile(path))

    def has_read(self, path: str) -> bool:
        """Return whether this file was read."""
        return os.path.abspath(path) in self._contents

    def list_contents(self, folder: str, others: Container[str]) -> Dict[str, bytes]:
        """Return all contents by their paths relative to folder, but those of other paths."""
        return {
            os.path.relpath(path, folder): content for path, content in self._contents.items() if path not in others
        }

    def load(self, name: str, make: Callable[[], Any]) -> Any:
        """Return what make() makes of the files, made once."""
        if name not in self.loaded:
            self.loaded[name] = make()
        return self.loaded[name]
