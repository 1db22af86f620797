# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights, robust scales and stages with which the solver fits a body to a track."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....solver import Body, MotionPrior, Options, Stage, Weights

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
# Where all frames of a clip are fitted together, each keypoint is also told by its neighbours in time: the image may
# weigh more, and the lifted directions, whose errors last for many frames, less. Feet that rest stay on the floor by
# this weight alone; with ten times as much, renders whose floor is wrong have errors larger by 4 mm.
_CLIP_KEYPOINTS2D, _CLIP_DIRECTIONS, _CLIP_FLOOR = 2.0, 0.7, 3.0
# Of joints and root, s³/rad² and s³/m², at 60 frames per second. A network's errors in neighbouring frames are alike,
# so more frames say less than their number: weights that mean the same at any rate smooth a jump at 10 frames per
# second away. Robust only against what no body does: 630 rad/s² and 126 m/s². Velocity of points that rest: s/m².
_MOTION = MotionPrior(4.0, 4.0, 120.0, 4e5, 4e5, 1.6e4, contact=5e4)
_RATE_HZ = 60.0
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


def clip_weights(weights: Weights) -> Weights:
    """Return the weights of the measurements where the frames of a clip are fitted together."""
    return replace(
        weights,
        keypoints2d=_CLIP_KEYPOINTS2D * weights.keypoints2d,
        orientation_field=_CLIP_DIRECTIONS * weights.orientation_field,
        floor=_CLIP_FLOOR * weights.floor,
    )


def motion_prior(times: NDArray[np.float64]) -> MotionPrior:
    """Return the weights of what couples frames: acceleration's with the square of the frame rate up to 60 Hz.

    Beyond, they grow with the rate, as the number of measurements does.

    :param times: (T,) seconds.
    """
    if len(times) < 2:
        return _MOTION
    rate, p = 1.0 / (_RATE_HZ * float(np.median(np.diff(times)))), _MOTION
    scale = min(rate * rate, rate)
    joints = scale * np.asarray(p.joints)
    return replace(p, joints=joints, root_rotation=scale * p.root_rotation, root_position=scale * p.root_position)


def joint_weights(body: Body) -> NDArray[np.float64]:
    """Return the (K,) relative weights of the joints in the joint prior."""
    weights = np.ones(body.K)
    for k, name in enumerate(body.joint_names[1:]):
        weights[k] = next((value for key, value in _STIFF_JOINTS.items() if key in name), 1.0)
    return weights
