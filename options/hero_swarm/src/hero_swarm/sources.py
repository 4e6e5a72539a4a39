"""Files of users that a run depends on: each is read once, so that what was hashed is what runs, in any process.

Python files, and the modules beside them that they import, are compiled from these contents: no .pyc, which may be
older than its file, is read or written.
"""

import errno
import importlib.abc
import importlib.machinery
import importlib.util
import os
import sys
import traceback
from types import ModuleType
from typing import Any, Callable, Container, Dict, Optional, Sequence

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


def load_file(what: str, path: str, sources: Sources) -> ModuleType:
    """Return the module of a user's file, loaded once; what: what it is for, for errors.

    Raises: ValueError if it is missing, or with file and line for whatever it raises.
    """
    read_content(what, path, sources)
    module: ModuleType = sources.load(path, lambda: load_user_module(path, sources))
    return module


def read_content(what: str, path: str, sources: Sources) -> bytes:
    """Return the content of a user's file. Raises: ValueError if it cannot be read; what: what it is for."""
    if not sources.find(path):
        raise ValueError(f"{what} {path}: no such file from {os.getcwd()}; give its whole path")
    try:
        return sources.read(path)
    except OSError as error:
        raise ValueError(f"{what} {path} cannot be read: {error.strerror}") from error


def load_user_module(path: str, sources: Sources) -> ModuleType:
    """Return the module of a file; modules beside it take the place of those that an earlier file had beside it.

    Raises: ValueError with file and line for whatever it raises. OSError.
    """
    path = os.path.abspath(path)
    sys.meta_path[:] = [finder for finder in sys.meta_path if not isinstance(finder, _BesideFinder)]
    for name, module in list(sys.modules.items()):
        if isinstance(getattr(getattr(module, "__spec__", None), "loader", None), _SourceLoader):
            del sys.modules[name]
    sys.meta_path.insert(0, _BesideFinder(os.path.dirname(path), sources))
    spec = importlib.util.spec_from_file_location("user_behavior", path, loader=_SourceLoader(path, sources.read(path)))
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        text = f"{_find_place(error, path, sources)}: {type(error).__name__}: {error}"
        raise ValueError(" ".join(text.split())) from error
    return module


def _find_place(error: BaseException, path: str, sources: Sources) -> str:
    """Return file and line of the user's code that raised an error."""
    if isinstance(error, SyntaxError) and error.filename and sources.has_read(error.filename):
        return "%s, line %d" % (error.filename, error.lineno or 0)
    lines = traceback.extract_tb(error.__traceback__)
    own = [line for line in lines if sources.has_read(line.filename)]
    return "%s, line %d" % (own[-1].filename, own[-1].lineno or 0) if own else path


class _SourceLoader(importlib.abc.Loader):
    """Loader of one module."""

    def __init__(self, path: str, content: bytes) -> None:
        self._path, self._content = path, content

    def exec_module(self, module: ModuleType) -> None:
        code = compile(self._content, self._path, "exec", dont_inherit=True)
        exec(code, module.__dict__)  # noqa: S102 - the user's own program


class _BesideFinder(importlib.abc.MetaPathFinder):
    """Finds modules beside a file, unless they are installed elsewhere, too, and the modules of their packages."""

    def __init__(self, folder: str, sources: Sources) -> None:
        self._folder, self._sources = folder, sources

    def find_spec(
        self, fullname: str, path: Optional[Sequence[Any]], target: Optional[ModuleType] = None
    ) -> Optional[importlib.machinery.ModuleSpec]:
        folder, _, name = fullname.rpartition(".")
        if not folder:
            base = self._folder
            elsewhere = importlib.machinery.PathFinder.find_spec(fullname, None)
            if elsewhere and elsewhere.origin and not elsewhere.origin.startswith(base + os.sep):
                return None
        elif isinstance(getattr(sys.modules[folder].__spec__, "loader", None), _SourceLoader):
            base = str(next(iter(path or ("",))))
        else:
            return None
        for file, package in ((os.path.join(name, "__init__.py"), [os.path.join(base, name)]), (name + ".py", None)):
            file = os.path.join(base, file)
            if self._sources.find(file):
                loader = _SourceLoader(file, self._sources.read(file))
                return importlib.util.spec_from_file_location(
                    fullname, file, loader=loader, submodule_search_locations=package
                )
            if os.path.isfile(file):
                raise ImportError(f"{file} is imported while it runs: import it at the top of the file")
        return None
