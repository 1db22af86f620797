# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights, robust scales and stages with which the solver fits a body to a track."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....solver import Body, Options, Stage, Weights

# Inverse variances: 5 px at a focal length of 1600 px (0.003 in normalized coordinates) for 2D keypoints, 0.35 m for
# the depth of 3D keypoints to which the lifter gives 0.1 m (its errors are correlated over all points), 2.6 degrees for
# directions, 0.5 rad for a joint about its rest state. Chosen on real clips with ground truth in 3D and on renders of
# recorded motion; changing any of them by 25 to 50 % hardly matters. 3D keypoints repeat the errors of the directions,
# so they weigh little: with weights of 25, 8, 2.5 and 0, real clips have errors of 75.2, 73.8, 73.1 and 72.4 mm; the
# sample clip has 1 mm more with 4. A sole in contact is within 1 cm of the floor: a larger weight suits real clips
# better, but renders with a wrong floor worse. The shape's counts once for every frame (`track_fit`): of a trunk 12 %
# longer than the mean, exact keypoints give a fifth with 10 and two fifths with 3; with 1, real clips get worse.
WEIGHTS = Weights(
    keypoints2d=1e5,
    keypoints3d=8.0,
    orientation_field=500.0,
    joint_prior=4.0,
    joint_limits=2000.0,
    floor=1e4,
    shape=3.0,
)
ROBUST = Options(robust_keypoints2d=0.01, robust_keypoints3d=0.1, robust_orientation_field=1.0)
# Joints that no pair of landmarks determines stay closer to rest.
_STIFF_JOINTS = {"spine": 5.0, "collar": 5.0, "foot": 5.0, "hand": 5.0, "neck": 3.0, "head": 3.0}


def cold_stages(weights: Weights) -> tuple[Stage, ...]:
    """Return the stages of a cold start: directions and priors first, then the image, then all at full weight."""
    return (
        Stage(
            replace(
                weights,
                orientation_field=4 * weights.orientation_field,
                keypoints2d=1e3,
                joint_prior=10 * weights.joint_prior,
                shape=100 * weights.shape,
            ),
            5e-2,
            10,
        ),
        Stage(
            replace(weights, keypoints2d=1e4, joint_prior=3 * weights.joint_prior, shape=10 * weights.shape), 1e-2, 10
        ),
        *warm_stages(weights),
    )


def warm_stages(weights: Weights) -> tuple[Stage, ...]:
    """Return the stages of a warm start, from the state of a nearby frame."""
    return (Stage(weights, 1e-4, 50),)


def joint_weights(body: Body) -> NDArray[np.float64]:
    """Return the (K,) relative weights of the joints in the joint prior."""
    weights = np.ones(body.K)
    for k, name in enumerate(body.joint_names[1:]):
        weights[k] = next((value for key, value in _STIFF_JOINTS.items() if key in name), 1.0)
    return weights
