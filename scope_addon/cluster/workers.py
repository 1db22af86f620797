# SPDX-License-Identifier: GPL-3.0-or-later
"""The connection to a Dask scheduler, whose address or file the user gives, and what is known of
its workers: the table and the log in the batch's report.
"""

from __future__ import annotations

import logging
import re
import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from distributed import Client

from ...solver.errors import InputError
from ..errors import ClusterError, UsageError
from ..footage import display_text
from ..job.clip_task import Entry
from ..json_file import read_json_object

# states of a worker
CHECKED = "being checked"
READY = "ready"
REFUSED = "refused"
LOST = "left"
_ADDRESS = re.compile(r"(tcp|tls|ws|wss)://[^/\s]+")
_TIMEOUT_S = 15.0


@dataclass
class WorkerRecord:
    """One worker: its state, and what it has done."""

    worker: str  # address
    host: str = ""
    threads: int = 0
    state: str = CHECKED
    clips: int = 0
    failed: int = 0
    attempts_lost: int = 0
    windows: int = 0
    frames: int = 0
    busy_s: float = 0.0
    running: int = 0

    def row(self) -> dict[str, Any]:
        """Return the row of the report's table, whose columns are the fields."""
        row = asdict(self)
        del row["running"]
        rate = round(self.frames / self.busy_s, 1) if self.busy_s else 0.0
        return row | {"busy_s": round(self.busy_s, 1), "frames_per_s": rate}


class Workers:
    """The workers that have been seen, by address.

    :param say: called with messages for the user.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._start = time.monotonic()
        self.records: dict[str, WorkerRecord] = {}
        self.log: list[dict[str, Any]] = []

    def event(self, address: str, text: str, *, tell: bool = False) -> None:
        """Add a line to the log, without passwords of addresses, and tell the user if it matters to
        them.
        """
        text = display_text(text)
        self.log.append(
            {"second": round(time.monotonic() - self._start, 1), "worker": address, "event": text}
        )
        if tell:
            self._say(f"worker {address}: {text}")

    def new(self, addresses: Iterable[str]) -> list[str]:
        """Record workers that have joined, and return their addresses."""
        known = {address for address, record in self.records.items() if record.state != LOST}
        joined = sorted(set(addresses) - known)
        for address in joined:
            self.records.setdefault(address, WorkerRecord(address)).state = CHECKED
        return joined

    def gone(self, addresses: Iterable[str]) -> list[str]:
        """Record workers that have left, and return their addresses."""
        present = set(addresses)
        left = [
            a for a, record in self.records.items() if record.state != LOST and a not in present
        ]
        for address in left:
            self.records[address].state = LOST
            self.event(address, "left the cluster")
        return left

    def checked(self, address: str, found: dict[str, Any]) -> None:
        """Record the result of a worker's check."""
        record = self.records[address]
        problem = found.get("problem")
        record.host, record.threads = (
            str(found.get("host", record.host)),
            int(found.get("threads", record.threads)),
        )
        record.state = REFUSED if problem else READY
        self.event(address, f"gets no clips: {problem}" if problem else "ready", tell=bool(problem))

    def free(self, jobs: int) -> WorkerRecord | None:
        """Return the ready worker with the fewest clips, if it may have another one, for which it
        needs a thread.
        """
        ready = [
            r
            for r in self.records.values()
            if r.state == READY and r.running < min(jobs, r.threads)
        ]
        return min(ready, key=lambda record: record.running, default=None)

    def all_refused(self) -> bool:
        """Return whether there are workers, and none of them can capture."""
        states = {record.state for record in self.records.values()} - {LOST}
        return states == {REFUSED}

    def slots(self, jobs: int) -> int:
        """Return how many clips the ready workers can have at a time."""
        return sum(min(jobs, r.threads) for r in self.records.values() if r.state == READY)

    def observed(self, address: str, windows: int, entry: Entry) -> None:
        """Count a part of a clip."""
        record = self.records[address]
        record.windows += windows
        record.busy_s += entry.get("seconds", 0.0)
        record.frames += int(entry.get("report", {}).get("frames", 0))

    def finished(self, address: str, entry: Entry, observed_before: int = 0) -> None:
        """Count a clip.

        :param observed_before: frames of it that were counted as parts.
        """
        record = self.records[address]
        record.clips += 1
        record.failed += entry["status"] == "failed"
        if entry["status"] != "skipped":  # whose seconds are those of an earlier batch
            record.busy_s += entry.get("seconds", 0.0)
        if entry["status"] == "done":
            record.frames += max(0, int(entry["report"].get("frames", 0)) - observed_before)

    def report(self) -> dict[str, Any]:
        """Return the table, the throughput of the whole cluster, and the log."""
        seconds = time.monotonic() - self._start
        frames = sum(record.frames for record in self.records.values())
        throughput = {
            "seconds": round(seconds, 1),
            "frames": frames,
            "frames_per_s": round(frames / max(seconds, 1e-3), 1),
        }
        return {
            "throughput": throughput,
            "workers": [record.row() for record in self.records.values()],
            "log": list(self.log),
        }


def connect(scheduler: str) -> Client:
    """Connect to a scheduler; certificates for ``tls://`` come from Dask's own configuration.

    :param scheduler: its address, such as ``tcp://HOST:8786``, or the path of a scheduler file.
    :raises UsageError: it is neither.
    :raises InputError: the scheduler file cannot be read, or is something else.
    :raises ClusterError: the scheduler does not answer.
    """
    address = scheduler if _ADDRESS.fullmatch(scheduler) else _address_in_file(scheduler)
    # what goes wrong is reported by its consequences
    logging.getLogger("distributed").setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings(action="ignore"):  # of other versions of packages on workers
            return Client(address, timeout=_TIMEOUT_S, set_as_default=False, name="scope-batch")
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        cause = " ".join(str(error.__cause__ or error).split())
        raise ClusterError(
            f"the Dask scheduler {scheduler} cannot be reached ({cause[:200]}); start it, or check "
            "its address"
        ) from error


def _address_in_file(scheduler: str) -> str:
    """Return the address in a scheduler file."""
    path = Path(scheduler)
    if not path.exists() or path.is_dir():
        raise UsageError(
            "--scheduler must be an address such as tcp://HOST:8786 or the path of a scheduler "
            f"file, not {scheduler!r}"
        )
    content = read_json_object(
        path, InputError, "scheduler file", "give the one that Dask has written"
    )
    address = content.get("address")
    if not isinstance(address, str) or not _ADDRESS.fullmatch(address):
        raise InputError(
            f"{path} is not a scheduler file: it has no address; give the one that Dask has written"
        )
    return address
