# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the clips in a folder, and give the results of each clip a unique name."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

from ...footage import FOOTAGE_SUFFIXES, VIDEO_SUFFIXES, is_sequence, pictures_in

OVERLAY = ".overlay"  # precedes the suffix of an overlay, which is not footage
# as person_paths names the results of one of several people
_PERSON = re.compile(r"(.+)\.person[0-9]+")


def find_clips(
    folder: Path, out: Path, *, recursive: bool, several_people: bool, views: bool = False
) -> dict[str, Path]:
    """Return the clips in ``folder`` by the name of their results, without suffix, in alphabetical
    order of the files.

    :param out: output folder, whose files are not footage.
    :param recursive: include subfolders.
    :param several_people: whether a clip may have one result per person.
    :param views: whether the videos of a subfolder are views of one take, which is a clip then.
    """
    found = sorted(_footage_below(folder, out, recursive, views))
    stems = Counter(_stem(folder, path) for path in found)
    names = {}
    for path in found:
        relative = path.relative_to(folder)
        short = path.is_file() and stems[_stem(folder, path)] == 1
        names[path] = (relative.with_suffix("") if short else relative).as_posix()
    # a full name may be another clip's short one
    while full := _full_names_of_shared(folder, names, several_people):
        names |= full
    return {name: path for path, name in names.items()}


def _full_names_of_shared(
    folder: Path, names: dict[Path, str], several_people: bool
) -> dict[Path, str]:
    """Return full names for clips whose short name is also used by another clip, or by one person's
    result of it.
    """
    folded = {path: name.casefold() for path, name in names.items()}
    counts = Counter(folded.values())
    full = {}
    for path, name in folded.items():
        person = _PERSON.fullmatch(name) if several_people else None
        if counts[name] > 1 or (person and person[1] in counts):
            full[path] = path.relative_to(folder).as_posix()
    return {path: name for path, name in full.items() if name != names[path]}


def _stem(folder: Path, path: Path) -> str:
    """Return the name that must be unique among clips; case-insensitive, as many file systems
    are.
    """
    return path.relative_to(folder).with_suffix("").as_posix().casefold()


def _footage_below(
    folder: Path, out: Path, recursive: bool, views: bool, above: tuple[Path, ...] = ()
) -> list[Path]:
    """Return the videos, pictures and picture sequences in a folder.

    :param above: the folders that lead to it, to which links are not followed: that would never
        end.
    """
    above = (*above, folder.resolve())
    found: list[Path] = []
    for path in folder.iterdir():
        suffix = path.suffix.lower()
        if path.name.startswith(".") or path == out or path.stem.endswith(OVERLAY):
            continue
        if path.is_dir():
            videos = videos_of_take(path) if views else []
            if _is_sequence_folder(path) or len(videos) > 1:
                found.append(path)
            elif recursive and path.resolve() not in above:
                found += _footage_below(path, out, recursive, views, above)
            else:
                found += videos
        # Pipes are skipped, because opening one would block; a broken link is kept, to be reported
        # as a failed clip.
        elif suffix in FOOTAGE_SUFFIXES and (path.is_file() or not path.exists()):
            found.append(path)
    return found


def videos_of_take(folder: Path) -> list[Path]:
    """Return the videos in a folder, in alphabetical order; none if it cannot be read."""
    try:
        return sorted(
            path
            for path in folder.iterdir()
            if path.suffix.lower() in VIDEO_SUFFIXES
            and not path.name.startswith(".")
            and not path.stem.endswith(OVERLAY)
            and path.is_file()
        )
    except OSError:
        return []


def _is_sequence_folder(folder: Path) -> bool:
    """Return whether a folder contains one numbered sequence, and neither videos nor subfolders."""
    try:
        others = [p for p in folder.iterdir() if p.is_dir() or p.suffix.lower() in VIDEO_SUFFIXES]
        return is_sequence(pictures_in(folder)) and all(p.name.startswith(".") for p in others)
    except OSError:
        return False
