# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parts of the pipeline take part, so that an experiment can leave one out and see what it is worth."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ....solver import Weights
from ...errors import UsageError


@dataclass(frozen=True)
class Ablation:
    """All parts by default. Of ``lifter`` and ``world_landmarks``, the two sources of depth, one has to stay."""

    lifter: bool = True  # else the landmark network's own world landmarks stand in for it
    world_landmarks: bool = True  # as input of the lifter
    keypoint_offsets: bool = True  # keypoints where the networks see them on a body, instead of at its joints
    keypoints3d: bool = True
    orientation_field: bool = True
    joint_prior: bool = True
    left_right: bool = True  # repair of left and right
    keypoint_jumps: bool = True  # repair of keypoints that leap away for a few frames
    second_pass: bool = True  # the fit again with the distance that floor and feet tell
    balance: bool = True  # in it, weight over feet that stand
    floor: bool = True  # in it, feet that stand on the floor
    contact: bool = True  # feet held on the floor at the end

    def __post_init__(self) -> None:
        """Refuse to leave out all depth."""
        if not (self.lifter or self.world_landmarks):
            raise UsageError("lifter and world_landmarks cannot both be left out: nothing else tells depth")

    def weights(self, weights: Weights) -> Weights:
        """The solver's weights, zero for what is left out."""
        return replace(
            weights,
            keypoints3d=weights.keypoints3d * self.keypoints3d,
            orientation_field=weights.orientation_field * self.orientation_field,
            joint_prior=weights.joint_prior * self.joint_prior,
            floor=weights.floor * self.floor,
        )


NO_ABLATION = Ablation()
