# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of finished captures, so that the same footage is never captured twice. Its content:

- ``captures/<key>/report.json``, ``person1.npz``, …: a finished capture
- ``jobs/<name>/``: a capture that is being written; it is moved to ``captures`` when it is complete
- ``unfinished/<name>/``: what a capture that was cancelled or killed had found, see `unfinished`
- ``kernels/``: the machine code that was compiled here. Clearing keeps it, except for that of
    replaced versions
- ``times.json``: how long the stages of the last captures took, see `progress`. Clearing keeps it

Blender loads this when it starts, so that what only captures need is imported where it is used.
"""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

REPORT = "report.json"
# a folder of scope_addon/machine_code/code_folders.py, less its program
_VERSION = re.compile(r"(\w+-[0-9a-f]{8})-[0-9a-f]{12}")
_JOB = "job-"  # begins the name of a job's folder, before its owner


class CachedCapture(NamedTuple):
    """A finished capture on disk."""

    motions: list[Path]
    report: dict[str, Any]


class Cache:
    """A cache folder. Only files that the cache itself created are ever removed."""

    def __init__(self, root: Path) -> None:
        self.root = Path(root)

    @property
    def kernels(self) -> Path:
        """Folder where the worker's numba stores compiled code."""
        return self.root / "kernels"

    def find(self, key: str) -> CachedCapture | None:
        """Return the finished capture with this key; None if there is none."""
        import json

        from .messages import is_result

        folder = self.root / "captures" / key
        try:
            content = json.loads((folder / REPORT).read_text(encoding="utf-8"))
            motions = [folder / name for name in content["motions"]] if is_result(content) else []
            if not motions or not all(m.is_file() for m in motions):
                return None
        except (OSError, ValueError, RecursionError):
            return None
        with suppress(OSError):
            os.utime(folder)  # mark as used, so that it is pruned last
        return CachedCapture(motions, content["report"])

    def new_job_folder(self) -> Path:
        """Create an empty folder for the files of a worker, and remove abandoned ones.

        :raises OutputError: the cache folder cannot be written to.
        """
        import tempfile

        from ..processes import owner

        jobs = self.root / "jobs"
        try:
            jobs.mkdir(parents=True, exist_ok=True)
            self.kernels.mkdir(exist_ok=True)
            _remove_abandoned(jobs)
            return Path(tempfile.mkdtemp(prefix=f"{_JOB}{owner()}-", dir=jobs))
        except OSError as error:
            raise self._not_writable(error) from error

    def keep(
        self, job_folder: Path, key: str, motions: list[str], report: dict[str, Any]
    ) -> CachedCapture:
        """Move a job's folder to the finished captures.

        :param motions: names of the motion files in the folder.
        :raises OutputError: the cache folder cannot be written to.
        """
        import json
        import shutil

        target = self.root / "captures" / key
        try:
            content = json.dumps({"motions": motions, "report": report})
            (job_folder / REPORT).write_text(content, encoding="utf-8")
            target.parent.mkdir(parents=True, exist_ok=True)
            former = job_folder.with_name(f"{job_folder.name}.former")
            if target.exists():
                os.replace(target, former)
            try:
                os.replace(job_folder, target)
            except OSError:
                if former.exists():
                    os.replace(former, target)
                raise
            shutil.rmtree(former, ignore_errors=True)
        except OSError as error:
            raise self._not_writable(error) from error
        return CachedCapture([target / name for name in motions], report)

    def size(self) -> int:
        """Return in bytes what clearing frees: captures, finished or not, and code compiled by
        replaced versions.
        """
        return sum(_size(folder) for folder in self._owned())

    def clear(self) -> int:
        """Remove captures, finished or not, and replaced versions' code; return the number of bytes
        freed.

        Running jobs and the compiled code in use are kept.
        """
        import shutil

        before = self.size()
        for folder in self._owned():
            shutil.rmtree(folder, ignore_errors=True)
        return before - self.size()

    def prune(self, limit: int) -> None:
        """Remove the least recently used captures until the others fit into ``limit`` bytes."""
        import shutil

        total = 0
        for index, folder in enumerate(_by_time(self.root / "captures")):
            total += _size(folder)
            if index and total > limit:  # the newest is kept: it has just been captured
                shutil.rmtree(folder, ignore_errors=True)

    def _not_writable(self, error: OSError) -> Exception:
        from ..errors import OutputError

        reason = error.strerror or error
        return OutputError(
            f"cannot write to the cache folder {self.root}: {reason}; free some space or choose "
            "another folder in the "
            "preferences"
        )

    def _owned(self) -> list[Path]:
        return [self.root / "captures", self.root / "unfinished", *self._replaced_kernels()]

    def _replaced_kernels(self) -> list[Path]:
        """Return the folders of code that another version has replaced, or that numba's own cache
        had made.
        """
        newest: set[str] = set()
        replaced = []
        for path in _by_time(self.kernels):
            version = _VERSION.fullmatch(path.name)
            if version is None or version[1] in newest:
                replaced.append(path)
            else:
                newest.add(version[1])
        return [path for path in replaced if path.is_dir()]


def _remove_abandoned(jobs: Path) -> None:
    """Remove the folders of jobs whose Blender does not run any more."""
    import shutil

    from ..processes import is_abandoned

    for folder in _by_time(jobs):
        with suppress(OSError):  # another process has removed it
            if is_abandoned(folder, folder.name.removeprefix(_JOB)):
                shutil.rmtree(folder, ignore_errors=True)


def _by_time(folder: Path) -> list[Path]:
    """Return the content of a folder, what was changed last first, without concurrently removed
    entries.
    """
    times: dict[Path, float] = {}
    with suppress(OSError):
        for path in folder.iterdir():
            with suppress(OSError):
                times[path] = path.stat().st_mtime
    return sorted(times, key=times.__getitem__, reverse=True)


def _size(folder: Path) -> int:
    """Return the bytes of all files below a folder. One that is concurrently removed counts as
    empty.
    """
    total = 0
    for below, _, names in os.walk(folder):
        for name in names:
            with suppress(OSError):
                total += os.stat(os.path.join(below, name)).st_size
    return total
