# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of an archive of motions: to unpack and read all of them takes a quarter of a minute."""

from __future__ import annotations

import tarfile
from pathlib import Path, PurePosixPath


def beginning(path: Path, last: str) -> dict[str, str]:
    """The text of every file of a .tar.xz up to one of them, by its path inside."""
    texts: dict[str, str] = {}
    with tarfile.open(path, "r|xz") as archive:
        for member in archive:
            stream = archive.extractfile(member) if member.isfile() else None
            if stream is not None:
                name = str(PurePosixPath(member.name))
                texts[name] = stream.read().decode()
                if name == last:
                    return texts
    raise AssertionError(f"{path} has no {last}")
