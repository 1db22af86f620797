# SPDX-License-Identifier: GPL-3.0-or-later
"""The record that a process of a batch leaves beside its clip's results when they are complete.

A batch that is killed before it has written its report does not know what its processes have
finished. The record has the clip's key in its name, and the process's report with the sizes and
times of the files, so that files which something else has written since do not count. The batch
removes the record once its report contains the clip.
"""

from __future__ import annotations

import glob
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from ...atomic_write import atomic_path
from ...errors import OutputError
from ...footage import json_text

FINISHED_FILE = "--finished-file"  # option that only a batch passes to its processes
_KEY = 16  # characters of a clip's key in the name
_LARGEST_BYTES = 1 << 24


def finished_file(out: Path, name: str, key: str) -> Path:
    """Return the record's path.

    :param out: output folder.
    :param name: of the clip's results below it, without suffix.
    :param key: of the clip.
    """
    target = out / name
    return target.with_name(f".{target.name}.finished-{key[:_KEY]}.json")


def write_finished(file: Path, report: dict[str, Any]) -> None:
    """Write the record of complete results; without one, the clip is only captured again.

    :param report: of the process, with its ``outputs``.
    """
    with suppress(OSError, OutputError):
        stamps = [_stamp(Path(path)) for path in report["outputs"]]
        with atomic_path(file) as temporary:
            temporary.write_text(json_text({"report": report, "stamps": stamps}), encoding="utf-8")


def read_finished(file: Path, out: Path) -> dict[str, Any] | None:
    """Return the report of a process whose results are still as it has left them; None if there is
    no such record.

    :param out: output folder, in which the results have to be.
    """
    try:
        if file.stat().st_size > _LARGEST_BYTES:
            return None
        found = json.loads(file.read_text(encoding="utf-8"))
        report = found["report"]
        outputs = report["outputs"]
        is_here = bool(outputs) and all(Path(path).is_relative_to(out) for path in outputs)
        is_same = is_here and found["stamps"] == [_stamp(Path(path)) for path in outputs]
        return dict(report) if is_same and isinstance(report["warnings"], list) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def remove_finished(out: Path, name: str) -> None:
    """Remove the records of a clip, of whatever key. This reads the whole folder; for one key,
    unlink its file.
    """
    target = out / name
    with suppress(OSError):
        for path in target.parent.glob(
            f".{glob.escape(target.name)}.finished-{'[0-9a-f]' * _KEY}.json"
        ):
            path.unlink(missing_ok=True)


def _stamp(path: Path) -> list[int]:
    status = path.stat()
    return [status.st_size, status.st_mtime_ns]
