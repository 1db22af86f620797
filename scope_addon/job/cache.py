# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of finished captures, so that the same footage is never captured twice. Its content:

- ``captures/<key>/report.json``, ``person1.npz``, …: a finished capture
- ``jobs/<name>/``: a capture that is being written; it is moved to ``captures`` when it is complete
- ``unfinished/<name>/``: what a capture that was cancelled or killed had found, see `unfinished`
- ``recordings/``: of live captures, while they run. Clearing keeps it, and a kill leaves it
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

from ..content import newest_first
from ..temporary import (
    discard,
    new_folder,
    own_entries,
    remove,
    remove_abandoned,
    sync_folder,
)

REPORT = "report.json"
# a folder of scope_addon/machine_code/code_folders.py, less its program
_VERSION = re.compile(r"\w+-[0-9a-f]{8}-[0-9a-f]{12}")
# What is ours in a folder that the user chooses, and that may have others of these names.
_KEY = re.compile("[0-9a-f]{32}")


def cache_of(job_folder: Path) -> Path | None:
    """Return the cache folder that a job's folder lies in; None if it lies elsewhere, as in
    tests.
    """
    return job_folder.parents[1] if job_folder.parent.name == "jobs" else None


def recordings_of(job_folder: Path) -> Path:
    """Return the folder for the recording of a live capture while it runs."""
    from ..live.unfinished import RECORDINGS

    return (cache_of(job_folder) or job_folder) / RECORDINGS


class CachedCapture(NamedTuple):
    """A finished capture on disk."""

    motions: list[Path]
    report: dict[str, Any]


class Cache:
    """A cache folder. Only what the cache itself has made is ever removed: the user may choose a
    folder that has others of these names, or links to other folders.
    """

    def __init__(self, root: Path) -> None:
        self.root = Path(root)

    @property
    def kernels(self) -> Path:
        """Folder where the worker's numba stores compiled code."""
        return self.root / "kernels"

    def find(self, key: str) -> CachedCapture | None:
        """Return the finished capture with this key, and remove what killed processes have left
        in the cache; None if there is none.
        """
        import json

        from .finished_clip import has_content
        from .process import is_result

        folder = self.root / "captures" / key
        if not (folder / REPORT).is_file():  # opening a pipe would wait for a writer
            return None
        try:
            found = json.loads((folder / REPORT).read_text(encoding="utf-8"))
            if not is_result(found):
                return None
            if not has_content(folder, found["motions"], found.get("content")):
                return None
        except (OSError, ValueError, RecursionError):
            return None
        with suppress(OSError):
            os.utime(folder)  # mark as used, so that it is pruned last
        # Nobody else may come to write here.
        for each in (self.root, self.root / "jobs"):
            remove_abandoned(each)
        return CachedCapture([folder / name for name in found["motions"]], found["report"])

    def recordings(self) -> list[Path]:
        """Return the growing files of recordings here and where they are written if the disk of
        this folder is full; the newest first in each.
        """
        from ..live.unfinished import RECORDINGS, other_places, recordings_in

        own = self.root / RECORDINGS
        return [path for folder in (own, *other_places(own)) for path in recordings_in(folder)]

    def unfinished_recordings(self) -> list[Path]:
        """Return those of `recordings` whose process has ended."""
        from ..live.unfinished import is_unfinished

        return [path for path in self.recordings() if is_unfinished(path)]

    def new_job_folder(self) -> Path:
        """Create an empty folder for the files of a worker, and remove abandoned ones.

        :raises OutputError: the cache folder cannot be written to.
        """
        jobs = self.root / "jobs"
        try:
            jobs.mkdir(parents=True, exist_ok=True)
            self.kernels.mkdir(exist_ok=True)
            folder = new_folder("job", jobs)
            # The lock's name first: a power cut may leave the files in the folder, which are synced
            # alone, and nobody would remove them.
            sync_folder(jobs)
            return folder
        except OSError as error:
            raise self._not_writable(error) from error

    def keep(
        self, job_folder: Path, key: str, motions: list[str], report: dict[str, Any]
    ) -> CachedCapture:
        """Move a job's folder to the finished captures.

        :param motions: names of the motion files in the folder.
        :raises OutputError: the cache folder cannot be written to, or a motion file not be read.
        """
        import json

        from ..atomic_write import atomic_path, replace_durably
        from .finished_clip import content_of

        target = self.root / "captures" / key
        try:
            content = content_of(job_folder, motions)
            text = json.dumps({"motions": motions, "content": content, "report": report})
            with atomic_path(job_folder / REPORT) as temporary:
                temporary.write_text(text, encoding="utf-8")
            target.parent.mkdir(parents=True, exist_ok=True)
            # Its name begins with the job's, so that it is removed with the job.
            former = job_folder.with_name(f"{job_folder.name}.former")
            if target.exists():
                os.replace(target, former)
            try:
                replace_durably(job_folder, target)
            except OSError:
                if former.exists():
                    os.replace(former, target)
                raise
            discard(job_folder)
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
        before = self.size()
        for folder in self._owned():
            remove(folder)
        return before - self.size()

    def prune(self, limit: int) -> None:
        """Remove the least recently used captures until the others fit into ``limit`` bytes."""
        total = 0
        for index, folder in enumerate(newest_first(own_entries(self.root / "captures", _KEY))):
            total += _size(folder)
            if index and total > limit:  # the newest is kept: it has just been captured
                remove(folder)

    def _not_writable(self, error: OSError) -> Exception:
        from ..errors import OutputError

        reason = error.strerror or error
        return OutputError(
            f"cannot write to the cache folder {self.root}: {reason}; free some space or choose "
            "another folder in the preferences"
        )

    def _owned(self) -> list[Path]:
        from .unfinished import unfinished_captures

        captures = own_entries(self.root / "captures", _KEY)
        return [*captures, *unfinished_captures(self.root), *self._replaced_kernels()]

    def _replaced_kernels(self) -> list[Path]:
        """Return the folders of code that another version has replaced."""
        newest: set[str] = set()
        replaced = []
        for path in newest_first(own_entries(self.kernels, _VERSION)):
            area = path.name.rpartition("-")[0]
            if area in newest:
                replaced.append(path)
            newest.add(area)
        return replaced


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
