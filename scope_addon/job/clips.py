# SPDX-License-Identifier: GPL-3.0-or-later
"""The footage of a folder, and a name for the results of each clip that no other clip shares."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

from ..footage import FOOTAGE_SUFFIXES, VIDEO_SUFFIXES, is_sequence, pictures_in

OVERLAY = ".overlay"  # before the suffix of an overlay, which is not footage
_PERSON = re.compile(r"(.+)\.person[0-9]+")  # as person_paths names the results of one of several people


def find_clips(folder: Path, out: Path, *, recursive: bool, several_people: bool) -> dict[str, Path]:
    """Return the footage in ``folder`` by the name of its results, without suffix, in alphabetical order of the files.

    :param out: folder of the results, which are not footage.
    :param several_people: whether a clip may have a result for each of several people.
    """
    found = sorted(_footage_below(folder, out, recursive))
    stems = Counter(_stem(folder, path) for path in found)
    names = {}
    for path in found:
        relative = path.relative_to(folder)
        short = path.is_file() and stems[_stem(folder, path)] == 1
        names[path] = (relative.with_suffix("") if short else relative).as_posix()
    while full := _full_names_of_shared(folder, names, several_people):  # a full name may be another clip's short one
        names |= full
    return {name: path for path, name in names.items()}


def _full_names_of_shared(folder: Path, names: dict[Path, str], several_people: bool) -> dict[Path, str]:
    """Full names for clips whose short name is that of another clip, or of a result of one of its people."""
    folded = {path: name.casefold() for path, name in names.items()}
    counts = Counter(folded.values())
    full = {}
    for path, name in folded.items():
        person = _PERSON.fullmatch(name) if several_people else None
        if counts[name] > 1 or (person and person[1] in counts):
            full[path] = path.relative_to(folder).as_posix()
    return {path: name for path, name in full.items() if name != names[path]}


def _stem(folder: Path, path: Path) -> str:
    """Name that two clips must not share; case-insensitive, as many file systems are."""
    return path.relative_to(folder).with_suffix("").as_posix().casefold()


def _footage_below(folder: Path, out: Path, recursive: bool) -> list[Path]:
    found: list[Path] = []
    for path in folder.iterdir():
        suffix = path.suffix.lower()
        if path.name.startswith(".") or path == out or path.stem.endswith(OVERLAY):
            continue
        if path.is_dir():
            if _is_sequence_folder(path):
                found.append(path)
            elif recursive:
                found += _footage_below(path, out, recursive)
        # Opening a pipe would wait for a writer; a broken link is reported as a clip that fails.
        elif suffix in FOOTAGE_SUFFIXES and (path.is_file() or not path.exists()):
            found.append(path)
    return found


def _is_sequence_folder(folder: Path) -> bool:
    """Whether a folder contains one numbered sequence, and neither videos nor folders."""
    try:
        others = [p for p in folder.iterdir() if p.is_dir() or p.suffix.lower() in VIDEO_SUFFIXES]
        return is_sequence(pictures_in(folder)) and all(p.name.startswith(".") for p in others)
    except OSError:
        return False
