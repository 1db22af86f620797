# SPDX-License-Identifier: GPL-3.0-or-later
"""Temporary files and folders, and the only code that removes anything from a disk.

Beside a temporary file or folder lies an empty file, on which the process that made it holds a lock
of the system. However that process ends, the system releases the lock; so what is not locked is
abandoned, and whoever comes next removes it. Names of computers, numbers of processes and times do
not say that: containers share names and numbers, and clocks differ.

Where a file system has no locks, or gives a file a new number each time it is asked, nothing is
taken for abandoned. Blender loads this when it starts, so that what only removing needs is imported
where it is used.
"""

from __future__ import annotations

import errno
import os
import re
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

# Of what is temporary, which a suffix or the rest of a draft's name may follow.
_NAME = re.compile(r".*scope-[0-9a-f]{16}", re.DOTALL)
_LOCK_NAME = re.compile(rf"(?P<name>{_NAME.pattern})-lock", re.DOTALL)
_LOCK_MODE = 0o600
_READ_WRITE = os.O_RDWR | getattr(os, "O_BINARY", 0)
_UNTRUSTED = _READ_WRITE | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
# By which Blender and Python find the system's temporary folder.
TEMPORARY_VARIABLES = ("TMPDIR", "TEMP", "TMP")
# Names that `claim` tries, where others take them for abandoned: the last one is used in any case.
_MOST_NAMES = 20
_locks: dict[Path, int] = {}  # open files, by the names that this process holds


def claim(folder: Path, start: str = "", suffix: str = "") -> Path:
    """Return a name in a folder for a file or folder that is removed by `discard`, or, if this
    process does not get that far, by the next process that claims a name there.

    :param folder: exists.
    :param start: of the name.
    :param suffix: of the name.
    :raises OSError: the folder cannot be written to.
    """
    remove_abandoned(folder)
    for left in reversed(range(_MOST_NAMES)):
        name = f"{start}scope-{os.urandom(8).hex()}"
        lock = folder / f"{name}-lock"
        handle = os.open(lock, _READ_WRITE | os.O_CREAT | os.O_EXCL, _LOCK_MODE)
        # Before it was locked, another process may have taken it for abandoned, and removed it.
        # Nobody else makes a file of this name.
        is_held = _try_lock(handle) is not False and os.path.lexists(lock)
        if is_held or not left:
            path = folder / f"{name}{suffix}"
            _locks[path] = handle
            return path
        _remove_lock(lock, handle)
    raise AssertionError("the last name is used")


def discard(path: Path) -> None:
    """Remove a temporary file or folder, the drafts of libraries beside it, and its lock.

    Blender adds ``@`` to the name of a .blend file, and USD replaces the suffix by random letters.

    :param path: as `claim` gave it, to this process or to one that has ended; another name is
        removed alone.
    """
    found = _NAME.match(path.name)
    if found is None:
        remove(path)
        return
    _remove_all(path.parent, found[0], _locks.pop(path, None))


def discard_all() -> None:
    """Remove what this process has not discarded yet, before it exits without cleaning up."""
    for path in list(_locks):
        discard(path)


def remove_abandoned(folder: Path) -> None:
    """Remove the temporary files and folders in a folder whose processes have ended."""
    with suppress(OSError):
        for name in os.listdir(folder):
            found = _LOCK_NAME.fullmatch(name)
            if found is None:
                continue
            handle = _open_if_free(folder / name)
            if handle is not None:
                _remove_all(folder, found["name"], handle)


@contextmanager
def temporary_folder(kind: str, parent: Path | None = None) -> Iterator[Path]:
    """Make a folder, with access for nobody else, and remove it when the block ends.

    :param kind: begins its name.
    :param parent: folder in which it lies; None: the system's temporary folder.
    :raises OSError: it cannot be made.
    """
    folder = new_folder(kind, parent)
    try:
        yield folder
    finally:
        discard(folder)


def new_folder(kind: str, parent: Path | None = None) -> Path:
    """Make a folder, with access for nobody else, which lasts until `discard`.

    :raises OSError: it cannot be made.
    """
    folder = claim(parent or system_folder(), f"{kind}-")
    try:
        folder.mkdir(mode=0o700)
    except BaseException:
        discard(folder)
        raise
    return folder


def system_folder() -> Path:
    """Return the system's temporary folder; `tempfile.gettempdir` would try it with a file, which a
    kill leaves.
    """
    for variable in TEMPORARY_VARIABLES:
        chosen = os.environ.get(variable)
        if chosen and os.path.isdir(chosen):
            return Path(chosen)
    return Path("/tmp")


def hold(lock: Path) -> bool:
    """Lock a file, which is made if it does not exist, until this process ends or `release`.

    It survives a power cut, because what it protects is otherwise found without it.

    :return: False if another process holds it, or it is no file of this user's own.
    :raises OSError: the file cannot be made, or the file system has no locks, or no owners.
    """
    is_new = False
    with suppress(FileExistsError):
        os.close(os.open(lock, _READ_WRITE | os.O_CREAT | os.O_EXCL, _LOCK_MODE))
        is_new = True
    try:
        handle = _open_if_free(lock)
    except OSError:
        if is_new:
            remove(lock)
        raise
    if handle is None:
        # Some file systems of networks and of user space give a new file to another user, whose
        # locks say nothing.
        if is_new and _is_of_another_user(lock):
            remove(lock)
            raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))
        return False
    _locks[lock] = handle
    sync_folder(lock.parent)
    return True


def release(lock: Path) -> None:
    """Release and remove a lock that `hold` has taken."""
    _remove_lock(lock, _locks.pop(lock, None))


def is_abandoned(lock: Path) -> bool:
    """Return whether a lock that `hold` has taken is there, and its process has ended."""
    with suppress(OSError):
        handle = _open_if_free(lock)
        if handle is not None:
            os.close(handle)
            return True
    return False


def is_held(lock: Path) -> bool:
    """Return whether a lock that `hold` has taken is there, and its process has not ended."""
    return lock.exists() and not is_abandoned(lock)


def sync_folder(folder: Path) -> None:
    """Wait until a folder's names are on the disk, where the system can: Windows opens no folder,
    and some network file systems refuse.
    """
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def remove(path: Path) -> None:
    """Remove a file, a link, or a folder with its content. What a link leads to stays, and so does
    what the system refuses to remove.
    """
    import shutil

    with suppress(OSError):
        if stat.S_ISDIR(path.lstat().st_mode):
            # By handles of folders, where the system has them: a folder that somebody replaces by a
            # link meanwhile is not followed.
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()


def remove_if_empty(folder: Path) -> None:
    """Remove a folder, no link, if nothing is in it."""
    with suppress(OSError):
        folder.rmdir()


def own_entries(folder: Path, own_name: re.Pattern[str]) -> list[Path]:
    """Return the folders, no links, in a folder, itself no link, that are the user's own and have a
    name of ours; empty if the folder cannot be read.
    """
    found = []
    with suppress(OSError):
        if not stat.S_ISDIR(folder.lstat().st_mode):
            return []
        for name in os.listdir(folder):
            if own_name.fullmatch(name) is None:
                continue
            with suppress(OSError):  # another process has removed it
                status = (folder / name).lstat()
                if stat.S_ISDIR(status.st_mode) and _is_own(status):
                    found.append(folder / name)
    return found


def _remove_all(folder: Path, name: str, handle: int | None) -> None:
    """Remove what has this name, with whatever suffix, and its lock as the last.

    Where something stays, as in a network the folder of a file that is still open, so does the
    lock, free, and whoever comes next tries again.

    :param handle: open file that holds the lock; None: no process does.
    """
    lock = folder / f"{name}-lock"
    is_empty = True
    with suppress(OSError):
        for found in os.listdir(folder):
            if found.startswith(name) and found != lock.name:
                remove(folder / found)
                is_empty = is_empty and not os.path.lexists(folder / found)
    if is_empty:
        _remove_lock(lock, handle)
    elif handle is not None:
        os.close(handle)


def _remove_lock(lock: Path, handle: int | None) -> None:
    """Remove a lock.

    :param handle: open file that holds it; None: no process does.
    """
    if os.name == "nt" and handle is not None:  # where an open file cannot be removed
        os.close(handle)
    with suppress(OSError):
        lock.unlink()
    if os.name != "nt" and handle is not None:
        os.close(handle)


def _open_if_free(lock: Path) -> int | None:
    """Open and lock a file; None if a process holds it, or it is not what `claim` makes.

    :raises OSError: the file system has no locks.
    """
    try:
        if not _is_lock(lock.lstat()):  # opening a device may do something
            return None
        handle = os.open(lock, _UNTRUSTED)
    except OSError:
        return None
    is_locked = False
    try:
        is_locked = _is_lock(os.fstat(handle)) and _is_locked_by_us(lock, handle)
    finally:
        if not is_locked:
            os.close(handle)
    return handle if is_locked else None


def _is_lock(status: os.stat_result) -> bool:
    return stat.S_ISREG(status.st_mode) and status.st_size == 0 and _is_own(status)


def _is_of_another_user(path: Path) -> bool:
    try:
        return not _is_own(path.lstat())
    except OSError:  # another process has removed it
        return False


def _is_own(status: os.stat_result) -> bool:
    """Return whether a file is this user's; Windows reports no owner."""
    return not hasattr(os, "geteuid") or status.st_uid == os.geteuid()


def _is_locked_by_us(lock: Path, handle: int) -> bool:
    """Lock an open file, and return whether this process has the lock of that name now.

    :raises OSError: the file system has no locks.
    """
    is_free = _try_lock(handle)
    if is_free is None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))
    try:
        return is_free and os.path.samestat(lock.lstat(), os.fstat(handle))
    except OSError:  # another process has removed it
        return False


def _try_lock(handle: int) -> bool | None:
    """Lock an open file for this process; False if another one holds it, None if the file system
    has no locks.
    """
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except PermissionError:  # so Windows says that it is held, and others that they lock nothing
        return False if sys.platform == "win32" else None
    except OSError:
        return None
    return True
