"""Files that are replaced as a whole (rename(2)), so that they survive a power cut, a full disk and other writers."""

import errno
import fcntl
import os
import secrets
import stat
import time
from contextlib import contextmanager, suppress
from typing import IO, Iterator

MAX_FILE_BYTES = 2**26
"""Files that people write or draw, such as images of maps, are smaller."""

NEW_ENDING = ".new"
"""Ending of files that replace others once they are whole, and of what a killed program left behind."""

LOCK_TIMEOUT_S = 10.0
"""Writers hold a lock for milliseconds; one that is suspended meanwhile must not block the others for ever."""

RETRY_S = 0.02

NO_LOCKS = (errno.EBADF, errno.EINVAL, errno.ENOLCK, errno.ENOTSUP)
"""flock(2) of a folder on file systems without such locks, such as NFS: files are replaced as a whole there, too."""


def read_file(path: str) -> bytes:
    """Return the content of a file that a user names; a pipe would wait for its writer, a device has no end.

    Raises: OSError, also for what is no regular file, or has more than MAX_FILE_BYTES.
    """
    if "\0" in path:
        raise OSError(errno.EINVAL, "its name holds a NUL character", path)
    # With O_NONBLOCK opening a pipe does not wait; regular files are read as without.
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "it is a pipe, device or socket, not a file", path)
        content = file.read(MAX_FILE_BYTES + 1)
    if len(content) > MAX_FILE_BYTES:
        raise OSError(errno.EFBIG, "it has more than %d bytes" % MAX_FILE_BYTES, path)
    return content


@contextmanager
def lock_file(path: str) -> Iterator[None]:
    """Keep other programs and threads that lock this file out, from reading it until it is replaced.

    Its folder is locked, which must exist: within this context no other file of it can be locked. Raises: OSError.
    """
    folder = os.open(os.path.dirname(os.path.realpath(path)), os.O_RDONLY)
    try:
        deadline_s = time.monotonic() + LOCK_TIMEOUT_S
        while True:
            try:
                _lock(folder, fcntl.LOCK_EX)
                break
            except BlockingIOError:
                if time.monotonic() > deadline_s:
                    raise OSError(errno.EBUSY, "another program has it locked", path) from None
                time.sleep(RETRY_S)
        yield
    finally:
        os.close(folder)


@contextmanager
def hold_file(path: str, is_shared: bool = False) -> Iterator[bool]:
    """Hold the file at path, which is made if it is missing, for this program alone, or with others that share it.

    True: no other program holds it; False: the file system has no locks. Raises: OSError, BlockingIOError if held.
    """
    with open(path, "ab") as file:  # NFS locks only files that are open for writing
        yield _lock(file.fileno(), fcntl.LOCK_SH if is_shared else fcntl.LOCK_EX)


def _lock(descriptor: int, kind: int) -> bool:
    """Lock an open file or folder; return False without locks. Raises: OSError, BlockingIOError if it is locked."""
    try:
        fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        return False
    return True


@contextmanager
def name_file(path: str) -> Iterator[None]:
    """Name the file in an OSError that does not, as that of a full disk, or names what was to replace the file."""
    try:
        yield
    except OSError as error:
        if error.filename is None or str(error.filename).endswith(NEW_ENDING):
            error.filename = path
        raise


@contextmanager
def replace_file(path: str) -> Iterator[IO[bytes]]:
    """Give a new file to write, which replaces the one at path at the end of the context, unless that raises.

    Symbolic links stay, and mode and owner of what they point to. What is no regular file, such as /dev/stdout, is
    written as it is. Raises: OSError; the file at path is then the old one, and nothing lies beside it.
    """
    path = os.path.realpath(path)
    old = os.stat(path) if os.path.exists(path) else None
    if old is not None and not stat.S_ISREG(old.st_mode):
        with open(path, "wb") as device:
            yield device
        return
    new = make_new_name(path)
    try:
        with name_file(path), open(new, "xb") as file:
            if old is not None:
                with suppress(PermissionError):
                    os.chmod(file.fileno(), stat.S_IMODE(old.st_mode))
                    os.chown(file.fileno(), old.st_uid, old.st_gid)
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(new, path)
    finally:
        with suppress(FileNotFoundError):
            os.remove(new)
    folder = os.open(os.path.dirname(path), os.O_RDONLY)
    try:
        os.fsync(folder)  # the name itself
    finally:
        os.close(folder)


def make_new_name(path: str) -> str:
    """Return a name beside path, for what will replace it, that no other writer takes."""
    return f"{path}.{secrets.token_hex(4)}{NEW_ENDING}"


def write_file(path: str, content: bytes) -> None:
    """Replace the file at path by one with this content. Raises: OSError, as replace_file()."""
    with replace_file(path) as file:
        file.write(content)
