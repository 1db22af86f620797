# SPDX-License-Identifier: GPL-3.0-or-later
"""The parent's side of a live capture: the newest pose, messages, and commands."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Float64Array
from ..options.live import MAX_PEOPLE
from .process import (
    CAPTURE_FIELDS,
    LONGEST_LINE,
    START_SCRIPT,
    WorkerProcess,
    is_figure,
    is_number,
    is_text,
    unreadable,
)
from .request import RECORD, STOP, LiveRequest

PRESENCES = ("seen", "held", "lost")
_POSE = re.compile(rb'\{"event": "pose", "person": (\d),')
_FARTHEST_M = 1e4
_LARGEST_BETA = 1e3
_UNIT_TOLERANCE = 0.01  # of a quaternion's length, which is rounded


@dataclass(frozen=True)
class ShownPose:
    """A pose as it came from the capture."""

    person: int  # 0 for the first
    frame: int
    presence: str  # one of `PRESENCES`
    # (K+1, 4) w, x, y, z: the pelvis relative to the world, the others to their parents
    rotations: Float64Array
    pelvis: Float64Array  # (3,) metres, world
    betas: Float64Array  # (P,)


class LiveProcess(WorkerProcess):
    """A live capture. Call ``poll`` and ``newest_poses`` regularly; ``close`` ends it at once."""

    fields = {
        "progress": CAPTURE_FIELDS["progress"],
        "status": {
            "presence": lambda value: value in PRESENCES,
            "rate": is_figure,
            "latency_ms": is_figure,
            "recorded_s": is_figure,
        },
        "notice": {"text": is_text},
        "ended": {},
        "result": CAPTURE_FIELDS["result"],
    }

    def __init__(
        self,
        request: LiveRequest,
        job_folder: Path,
        kernels: Path | None,
        python: Sequence[str],
        script: Path = START_SCRIPT,
    ) -> None:
        """Start the capture; see `WorkerProcess`.

        :raises SetupError: the process cannot be started.
        """
        self._newest: dict[int, bytes] = {}  # by person
        super().__init__(request, job_folder, kernels, python, script)

    def record(self) -> None:
        """Have the poses kept from now on."""
        self._send_line(RECORD)

    def stop(self) -> None:
        """Have the source closed, and the recording sent as a result."""
        self._send_line(STOP)

    def newest_poses(self, joints: int, coefficients: int) -> list[ShownPose]:
        """Return the newest pose of each person since the last call; older ones are never seen.

        :param joints: K+1 of the body.
        :param coefficients: P of the body.
        :raises WorkerFailedError: it cannot be used.
        """
        # Taken out one by one: the reading thread may be about to store a pose in this dictionary.
        found = [
            parse_pose(self._newest.pop(person), joints, coefficients)
            for person in sorted(self._newest)
        ]
        return [pose for pose in found if pose is not None]

    def _keep(self, line: bytes) -> None:
        if (person := _POSE.match(line)) is not None and int(person[1]) < MAX_PEOPLE:
            self._newest[int(person[1])] = line
        else:
            super()._keep(line)


def parse_pose(line: bytes, joints: int, coefficients: int) -> ShownPose | None:
    """Read the message of a pose; None before somebody was seen.

    :raises WorkerFailedError: it cannot be used.
    """
    if len(line) > LONGEST_LINE:
        raise unreadable(f"a line of more than {LONGEST_LINE >> 20} MB")
    try:
        message: dict[str, Any] = json.loads(line)
        if "rotations" not in message:
            return None
        rotations = np.array(message["rotations"], float)
        pelvis = np.array(message["positions"][0], float)
        betas = np.array(message["betas"], float)
        person = message["person"]
        frame = message["frame"]
        presence = message["presence"]
    except (ValueError, TypeError, KeyError, IndexError, OverflowError, RecursionError) as error:
        raise unreadable("a pose that is none") from error
    if rotations.shape != (joints, 4) or pelvis.shape != (3,) or betas.shape != (coefficients,):
        raise unreadable("a pose of another body")
    lengths = np.linalg.norm(rotations, axis=1)
    is_usable = (
        (np.abs(lengths - 1) < _UNIT_TOLERANCE).all()
        and (np.abs(pelvis) < _FARTHEST_M).all()
        and (np.abs(betas) < _LARGEST_BETA).all()
        and is_number(person)
        and is_number(frame)
        and presence in PRESENCES
    )
    if not is_usable:  # NaN included
        raise unreadable("a pose that no body can have")
    return ShownPose(person, frame, presence, rotations / lengths[:, None], pelvis, betas)
