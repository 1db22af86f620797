# SPDX-License-Identifier: GPL-3.0-or-later
"""One recorded motion.

Coordinate frame of all sources, for world and segments: right-handed, metres, y up; at zero pose
the person stands upright facing +z with +x to the left, and every segment's axes are the world's. A
segment carries the name of the joint it turns about (the thigh is ``left_hip``), so ``positions[t,
j]`` is the origin of segment j and ``orientations[t, j]`` takes its coordinates to the world. Names
that end in ``_end`` are tips: they have the orientation of the segment whose tip they are. The
floor is near y = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...solver.errors import ShapeError


@dataclass(frozen=True)
class Take:
    """A motion as named joints, y up, metres. Sources give the joints that they have, under common
    names.
    """

    name: str
    subject: str  # the performer; takes of one subject have the same bone lengths
    fps: float
    joint_names: tuple[str, ...]
    positions: NDArray[np.float64]  # (T, J, 3) metres, world, y up
    source: str  # cmu_asf_amc, cmu_expmap, deepmimic or the name of a set
    mirrored: bool = False  # the mirror image of another take in the same source
    orientations: NDArray[np.float64] | None = None  # (T, J, 3, 3) R_world_segment

    def __post_init__(self) -> None:
        """Check the shapes against each other.

        :raises ShapeError: when they do not match.
        """
        shape = (len(self.positions), len(self.joint_names), 3)
        if self.positions.shape != shape:
            raise ShapeError(
                f"{self.name}: positions must have shape {shape}, but got {self.positions.shape}"
            )
        if self.orientations is not None and self.orientations.shape != (*shape, 3):
            raise ShapeError(
                f"{self.name}: orientations must be {(*shape, 3)}, but got "
                f"{self.orientations.shape}"
            )

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def seconds(self) -> float:
        """Return the length of the take."""
        return len(self) / self.fps

    def joint(self, name: str) -> NDArray[np.float64]:
        """Return positions (T, 3) of one joint, metres."""
        return self.positions[:, self.index(name)]

    def index(self, name: str) -> int:
        """Return the column of a joint.

        :raises ShapeError: when the take has no such joint.
        """
        if name not in self.joint_names:
            raise ShapeError(
                f"{self.name} has no joint '{name}'; it has {', '.join(self.joint_names)}"
            )
        return self.joint_names.index(name)

    def resampled(self, fps: float) -> Take:
        """Return the take at about ``fps``: every n-th frame, n = round(own rate / fps)."""
        step = max(1, round(self.fps / fps))
        R = None if self.orientations is None else self.orientations[::step]
        return replace(self, fps=self.fps / step, positions=self.positions[::step], orientations=R)
