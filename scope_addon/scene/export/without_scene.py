# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing the files that follow from motions alone. Free of bpy."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ...motion import Motion
from .joint_angles import write_angles
from .output_paths import person_paths
from .trc import write_trc

if TYPE_CHECKING:
    from ....solver.body import Body


def write_without_scene(
    path: Path, motions: Sequence[Motion], bodies: Sequence[Body]
) -> list[Path]:
    """Write motions in a format of `WITHOUT_SCENE`, one file for each person.

    :param bodies: that the motions were fitted with.
    :return: the files written.
    :raises OutputError: when a file cannot be written.
    """
    targets = person_paths(path, len(motions))
    for target, motion, body in zip(targets, motions, bodies, strict=True):
        suffix = path.suffix.lower()
        if suffix == ".trc":
            write_trc(target, motion, body)
        elif suffix in (".mot", ".csv"):
            write_angles(target, motion, body)
        else:
            motion.save(target)
    return targets
