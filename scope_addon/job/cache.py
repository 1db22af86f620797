# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder where finished captures are kept, so that the same footage is never captured twice.

    ROOT/captures/<key>/report.json, person1.npz, …    finished, complete
    ROOT/jobs/<name>/                                  being written; moved to captures/ when complete
    ROOT/kernels/                                      numba's machine code
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

REPORT = "report.json"
_ABANDONED_S = 24 * 3600.0  # a job folder this old belongs to nobody


@dataclass(frozen=True)
class CachedCapture:
    """A finished capture on disk."""

    motions: list[Path]
    report: dict


class Cache:
    """One cache folder. Only files that the cache itself made are ever removed."""

    def __init__(self, root: Path) -> None:
        self.root = Path(root)

    @property
    def kernels(self) -> Path:
        """Where the worker's numba keeps compiled code."""
        return self.root / "kernels"

    @property
    def has_kernels(self) -> bool:
        """Whether a capture has compiled the solver here before."""
        return any(file.suffix == ".nbi" for file in _files(self.kernels))

    def find(self, key: str) -> CachedCapture | None:
        """A finished capture, or None."""
        folder = self.root / "captures" / key
        try:
            content = json.loads((folder / REPORT).read_text(encoding="utf-8"))
            motions = [folder / Path(name).name for name in content["motions"]]
            report = content["report"]
        except (OSError, ValueError, KeyError, TypeError):
            return None
        if not motions or not all(m.is_file() for m in motions):
            return None
        with suppress(OSError):
            os.utime(folder)  # used now: the last to be pruned
        return CachedCapture(motions, report)

    def new_job_folder(self) -> Path:
        """An empty folder for a worker to write in.

        :raises OutputError: the cache folder cannot be written to.
        """
        jobs = self.root / "jobs"
        try:
            jobs.mkdir(parents=True, exist_ok=True)
            self.kernels.mkdir(exist_ok=True)
            for folder, used in _by_time(jobs):
                if time.time() - used > _ABANDONED_S:
                    shutil.rmtree(folder, ignore_errors=True)
            return Path(tempfile.mkdtemp(prefix="job-", dir=jobs))
        except OSError as error:
            raise self._not_writable(error) from error

    def keep(self, job_folder: Path, key: str, motions: list[str], report: dict) -> CachedCapture:
        """Turn a job's folder into a finished capture.

        :raises OutputError: the folder cannot be written to.
        """
        target = self.root / "captures" / key
        try:
            content = json.dumps({"motions": motions, "report": report})
            (job_folder / REPORT).write_text(content, encoding="utf-8")
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.rmtree(target, ignore_errors=True)
            os.replace(job_folder, target)
        except OSError as error:
            raise self._not_writable(error) from error
        return CachedCapture([target / name for name in motions], report)

    def size(self) -> int:
        """Bytes of finished captures and compiled code."""
        return sum(_size(folder) for folder in self._owned())

    def clear(self) -> int:
        """Remove finished captures and compiled code; returns the bytes freed. Running jobs are left alone."""
        before = self.size()
        for folder in self._owned():
            shutil.rmtree(folder, ignore_errors=True)
        return before - self.size()

    def prune(self, limit: int) -> None:
        """Remove the captures that were used longest ago until all of them fit into ``limit`` bytes."""
        total = 0
        for index, (folder, _) in enumerate(_by_time(self.root / "captures")):
            total += _size(folder)
            if index and total > limit:  # the newest stays: it was captured just now
                shutil.rmtree(folder, ignore_errors=True)

    def _not_writable(self, error: OSError) -> Exception:
        from ..errors import OutputError  # here: it loads numba, and the preferences need only the rest

        reason = error.strerror or error
        return OutputError(
            f"cannot write in the cache folder {self.root}: {reason}; free some space, or choose another folder in the "
            "preferences"
        )

    def _owned(self) -> list[Path]:
        return [self.root / "captures", self.kernels]


def _by_time(folder: Path) -> list[tuple[Path, float]]:
    """What is in a folder and when it was used, the newest first; without what another process removes meanwhile."""
    found = []
    with suppress(OSError):
        for path in folder.iterdir():
            with suppress(OSError):
                found.append((path, path.stat().st_mtime))
    return sorted(found, key=lambda entry: entry[1], reverse=True)


def _files(folder: Path) -> Iterator[Path]:
    """Every file below a folder. Folders that another process removes meanwhile count as empty."""
    for below, _, names in os.walk(folder):
        for name in names:
            yield Path(below, name)


def _size(folder: Path) -> int:
    total = 0
    for path in _files(folder):
        with suppress(OSError):  # removed meanwhile
            total += path.stat().st_size
    return total
