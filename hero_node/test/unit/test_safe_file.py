"""Files that survive power cuts, full disks and other writers."""

import errno
import os
import threading
from unittest import mock

import pytest

from hero_node.files import safe_file
from hero_node.files.safe_file import hold_file, lock_file, read_file, replace_file, write_file


def fail_to_sync(fd):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_new_file_is_on_the_disk_before_it_takes_the_name(tmp_path, monkeypatch):
    path = str(tmp_path / "a.yaml")
    steps, sizes = [], []

    def note_sync(fd):
        steps.append(os.readlink("/proc/self/fd/%d" % fd))
        sizes.append(os.fstat(fd).st_size)

    monkeypatch.setattr(os, "fsync", note_sync)
    replace = os.replace
    monkeypatch.setattr(os, "replace", lambda old, new: (steps.append((old, new)), replace(old, new)))
    write_file(path, b"new")
    new = steps[0]
    assert os.path.dirname(new) == str(tmp_path) and new != path
    assert steps == [new, (new, path), str(tmp_path)] and sizes[0] == len(b"new")


def test_a_full_disk_leaves_the_old_file_and_nothing_beside_it(tmp_path, monkeypatch):
    path = tmp_path / "a.yaml"
    path.write_bytes(b"old")
    monkeypatch.setattr(os, "fsync", fail_to_sync)
    with pytest.raises(OSError, match="No space left"):
        write_file(str(path), b"new")
    assert path.read_bytes() == b"old" and os.listdir(str(tmp_path)) == ["a.yaml"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_whatever_ends_a_writer_leaves_the_old_file(tmp_path, error):
    path = tmp_path / "a.yaml"
    path.write_bytes(b"old")
    with pytest.raises(error), replace_file(str(path)) as file:
        file.write(b"half of the n")
        raise error
    assert path.read_bytes() == b"old" and os.listdir(str(tmp_path)) == ["a.yaml"]


def test_a_symbolic_link_stays_and_its_target_is_replaced(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    target, link = tmp_path / "elsewhere" / "real.yaml", tmp_path / "link.yaml"
    target.write_bytes(b"old")
    link.symlink_to(target)
    write_file(str(link), b"new")
    assert link.is_symlink() and target.read_bytes() == b"new"


def test_a_replaced_file_keeps_its_mode_and_owner(tmp_path, monkeypatch):
    path = tmp_path / "a.yaml"
    path.write_bytes(b"old")
    path.chmod(0o640)
    owners = []
    monkeypatch.setattr(os, "chown", lambda fd, *owner: owners.append((os.readlink(f"/proc/self/fd/{fd}"), *owner)))
    write_file(str(path), b"new")
    assert path.stat().st_mode & 0o777 == 0o640
    ((new, *owner),) = owners
    assert new.startswith(str(path) + ".") and owner == [path.stat().st_uid, path.stat().st_gid]


def test_a_file_of_another_user_keeps_its_mode_though_not_its_owner(tmp_path, monkeypatch):
    path = tmp_path / "token"
    path.write_bytes(b"old")
    path.chmod(0o600)

    def refuse(fd, user, group):
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "chown", refuse)
    write_file(str(path), b"new")
    assert path.read_bytes() == b"new" and path.stat().st_mode & 0o777 == 0o600


def test_a_device_is_written_and_not_replaced(tmp_path):
    pipe = str(tmp_path / "pipe")
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_file(pipe, b"new")
    assert os.read(reader, 10) == b"new"
    os.close(reader)


def test_writers_at_the_same_time_leave_one_whole_file(tmp_path):
    path = tmp_path / "a.yaml"
    with replace_file(str(path)) as first:
        first.write(b"first" * 1000)
        write_file(str(path), b"second")
        assert path.read_bytes() == b"second"
    assert path.read_bytes() == b"first" * 1000


def test_no_change_is_lost_when_several_change_a_file(tmp_path):
    path = tmp_path / "count"
    path.write_bytes(b"0")

    def count():
        for _ in range(30):
            with lock_file(str(path)):
                write_file(str(path), b"%d" % (int(path.read_bytes()) + 1))

    threads = [threading.Thread(target=count) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert path.read_bytes() == b"90"


def test_a_lock_that_is_never_released_ends_in_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(safe_file, "LOCK_TIMEOUT_S", 0.0)
    path = str(tmp_path / "a.yaml")
    with lock_file(path), pytest.raises(OSError, match="another program has it locked"), lock_file(path):
        pass


def test_what_fails_under_a_lock_releases_it(tmp_path, monkeypatch):
    monkeypatch.setattr(safe_file, "LOCK_TIMEOUT_S", 0.0)
    path = str(tmp_path / "a.yaml")
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt), lock_file(path):
            raise KeyboardInterrupt


def test_a_file_system_without_locks_is_no_obstacle(tmp_path, monkeypatch):
    def refuse(fd, operation):
        raise OSError(errno.EBADF, "Bad file descriptor")

    monkeypatch.setattr(safe_file.fcntl, "flock", refuse)
    with lock_file(str(tmp_path / "a.yaml")):
        write_file(str(tmp_path / "a.yaml"), b"new")
    assert (tmp_path / "a.yaml").read_bytes() == b"new"


def test_a_file_is_read_whole_and_what_is_none_is_refused_at_once(tmp_path, monkeypatch):
    path, pipe = tmp_path / "a.yaml", tmp_path / "pipe"
    path.write_bytes(b"1234\xff")
    assert read_file(str(path)) == b"1234\xff"
    os.mkfifo(str(pipe))
    for name, words in (
        (str(pipe), "pipe, device or socket"), ("/dev/zero", "pipe, device or socket"),
        (str(tmp_path), "Is a directory"), ("a\0b", "NUL character"), (str(tmp_path / "none"), "No such file"),
    ):  # fmt: skip
        opened = len(os.listdir("/proc/self/fd"))
        with pytest.raises(OSError, match=words) as refused:
            read_file(name)
        assert refused.value.filename == name and len(os.listdir("/proc/self/fd")) == opened
    monkeypatch.setattr(safe_file, "MAX_FILE_BYTES", 4)
    with pytest.raises(OSError, match="more than 4 bytes"):
        read_file(str(path))


def test_a_full_disk_is_named_with_the_file(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", fail_to_sync)
    with pytest.raises(OSError, match="No space left on device: '%s/a'" % tmp_path):
        write_file(str(tmp_path / "a"), b"new")


def test_where_a_file_system_has_no_locks_programs_are_told(tmp_path, monkeypatch):
    with hold_file(str(tmp_path / "lock")) as is_held:
        assert is_held

    def fail(*arguments):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(safe_file.fcntl, "flock", fail)
    with hold_file(str(tmp_path / "lock")) as is_held:
        assert not is_held


def test_no_program_waits_for_a_lock_in_the_kernel(tmp_path, monkeypatch):
    flock = mock.create_autospec(safe_file.fcntl.flock)
    monkeypatch.setattr(safe_file.fcntl, "flock", flock)
    with lock_file(str(tmp_path / "a")), hold_file(str(tmp_path / "b"), is_shared=True), hold_file(str(tmp_path / "c")):
        kinds = [call[0][1] for call in flock.call_args_list]
    exclusive, shared = safe_file.fcntl.LOCK_EX | safe_file.fcntl.LOCK_NB, safe_file.fcntl.LOCK_SH
    assert kinds == [exclusive, shared | safe_file.fcntl.LOCK_NB, exclusive]


def test_a_file_is_held_by_one_program_or_by_those_that_share_it(tmp_path):
    path = str(tmp_path / "lock")
    with hold_file(path, is_shared=True), hold_file(path, is_shared=True) as is_held:
        assert is_held
        with pytest.raises(BlockingIOError), hold_file(path):
            pass
    with hold_file(path):
        for is_shared in (False, True):
            with pytest.raises(BlockingIOError), hold_file(path, is_shared):
                pass
