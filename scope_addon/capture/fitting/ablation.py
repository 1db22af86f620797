# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of the pipeline that an experiment can leave out, to measure what each contributes."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ....solver import Weights
from ...errors import UsageError
from .stature import FIXED


@dataclass(frozen=True)
class Ablation:
    """Which parts run; all by default. At least one source of depth is needed: ``lifter`` or
    ``world_landmarks``.

    :raises UsageError: both sources of depth are left out.
    """

    lifter: bool = True  # False: the landmark network's world landmarks replace its output
    world_landmarks: bool = True  # as input of the lifter
    # False: keypoints lie at the body's joints, not where the networks place them
    keypoint_offsets: bool = True
    keypoints3d: bool = True
    orientation_field: bool = True
    joint_prior: bool = True
    shape: bool = True  # False: everybody has the mean shape
    outline: bool = True  # in the shape: the body's silhouette against person masks
    # False: proportions move an unknown stature as far as they do in the population
    stature: bool = True
    left_right: bool = True  # repair of left-right swaps and limb swaps
    keypoint_jumps: bool = True  # repair of keypoint jumps
    stance: bool = True  # distance and lean that follow from floor, feet and balance
    balance: bool = True  # in the stance: the zero moment point lies between the contact points
    floor: bool = True  # in the stance: feet in contact lie on the floor
    body_surface: bool = True  # forearms and hands stay outside trunk, legs and head
    contact: bool = True  # feet in contact stay in place, and none goes below the floor
    limb_search: bool = True  # limbs are tried on both sides of the image plane

    def __post_init__(self) -> None:
        """Require a source of depth."""
        if not (self.lifter or self.world_landmarks):
            raise UsageError(
                "lifter and world_landmarks cannot both be left out: nothing else provides depth"
            )

    def weights(self, weights: Weights) -> Weights:
        """Return the solver's weights with zeros for the terms that are left out."""
        return replace(
            weights,
            keypoints3d=weights.keypoints3d * self.keypoints3d,
            orientation_field=weights.orientation_field * self.orientation_field,
            joint_prior=weights.joint_prior * self.joint_prior,
            shape=weights.shape if self.shape else FIXED,
        )


NO_ABLATION = Ablation()
