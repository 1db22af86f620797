# SPDX-License-Identifier: GPL-3.0-or-later
"""The record that a process of a batch leaves beside its clip's results when they are complete.

A batch that is killed before it has written its report does not know what its processes have
finished. The record has the clip's key in its name, and the process's report with the files' sizes
and SHA-256, so that files which something else has written since do not count. The batch
removes the record once its report contains the clip.
"""

from __future__ import annotations

import glob
import hashlib
import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..atomic_write import complete_file
from ..errors import OutputError
from ..temporary import remove

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
        content = content_of(Path(), report["outputs"])
        with complete_file(file) as temporary:
            record = {"report": report, "content": content}
            # With escapes for bytes of names that are not UTF-8, which only this program reads.
            temporary.write_text(json.dumps(record), encoding="utf-8")


def read_finished(file: Path, out: Path) -> dict[str, Any] | None:
    """Return the report of a process whose results are still as it has left them; None if there is
    no such record.

    :param out: output folder, in which the results have to be.
    """
    try:
        if not file.is_file() or file.stat().st_size > _LARGEST_BYTES:
            return None
        found = json.loads(file.read_text(encoding="utf-8"))
        report = found["report"]
        outputs = report["outputs"]
        is_here = bool(outputs) and all(Path(path).is_relative_to(out) for path in outputs)
        is_same = is_here and has_content(Path(), outputs, found["content"])
        return dict(report) if is_same and isinstance(report["warnings"], list) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def remove_finished(out: Path, name: str) -> None:
    """Remove the records of a clip, of whatever key. This reads the whole folder; for one key,
    remove its file.
    """
    target = out / name
    with suppress(OSError):
        for path in target.parent.glob(
            f".{glob.escape(target.name)}.finished-{'[0-9a-f]' * _KEY}.json"
        ):
            remove(path)


def content_of(folder: Path, names: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Return the ``sha256`` and ``bytes`` of each file in a folder, by its name.

    :raises OSError: a file cannot be read.
    """
    content = {}
    for name in names:
        file = folder / name
        content[name] = {"sha256": file_hash(file), "bytes": file.stat().st_size}
    return content


def has_content(
    folder: Path, names: Sequence[str], content: object, sizes_alone: bool = False
) -> bool:
    """Return whether the files in a folder are those that `content_of` described.

    :param content: as `content_of` returned it, or whatever a damaged record has in its place.
    :param sizes_alone: do not compare the SHA-256.
    :raises OSError: a file cannot be read, or its name cannot be one.
    """
    if not isinstance(content, dict) or sorted(content) != sorted(names):
        return False
    for name in names:
        described = content[name]
        if not isinstance(described, dict):
            return False
        file = folder / name
        if not file.is_file() or file.stat().st_size != described.get("bytes"):
            return False
        if not sizes_alone and file_hash(file) != described.get("sha256"):
            return False
    return True


def file_hash(file: Path) -> str:
    """Return the SHA-256 of a file's content.

    :raises OSError: it cannot be read.
    """
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
