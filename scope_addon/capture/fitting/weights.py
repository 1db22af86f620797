# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights, robust scales and stages with which the solver fits a body to a track."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....solver import Body, MotionPrior, Options, Stage, Weights
from ...arrays import Float64Array
from ...scene_gaps import usual_step_s

# Inverse variances: 5 px at a focal length of 1600 px (0.003 in normalized coordinates) for 2D
# keypoints, 0.35 m for the depth of 3D keypoints to which the lifter gives 0.1 m (its errors are
# correlated over all points), 2.6 degrees for directions, 0.5 rad for a joint about its rest state.
# Chosen on real clips with ground truth in 3D and on renders of recorded motion; changing any of
# them by 25 to 50 % hardly matters. 3D keypoints repeat the errors of the directions, so they weigh
# little: with weights of 25, 8, 2.5 and 0, real clips have errors of 75.2, 73.8, 73.1 and 72.4 mm;
# the sample clip has 1 mm more with 4. A sole in contact is within 1 cm of the floor: a larger
# weight suits real clips better, but renders with a wrong floor worse. The shape's counts once for
# every frame (`track_fit`): of a trunk 12 % longer than the mean, exact keypoints give a fifth with
# 10 and two fifths with 3; with 1, real clips get worse.
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
# Where all frames of a clip are fitted together, neighbours in time constrain each keypoint too:
# the image may weigh more, and the lifted directions, whose errors last for many frames, less. Feet
# that rest stay on the floor by this weight alone; with ten times as much, renders whose floor is
# wrong have errors larger by 4 mm.
_CLIP_KEYPOINTS2D = 2.0
_CLIP_DIRECTIONS = 0.7
_CLIP_FLOOR = 3.0
# 1/m²; with 1e5, feet still drift by 0.7 cm in the sample, with 1e6 other errors grow
_RESTING_PLACE = 5e5
# Typical accelerations, rad/s², and of the root's position, m/s²: the root mean square at 30 frames
# per second of each performer, or of each recording whose performer has no name, of all 149
# recordings, and the median of these. One weight for all joints would tell a fast crouch by a trunk
# that arches, because four joints of the spine share its rotation.
_USUAL = {
    "hip": 35.0,
    "knee": 41.0,
    "ankle": 56.0,
    "foot": 107.0,
    "spine1": 19.0,
    "spine2": 11.3,
    "spine3": 12.9,
}
_USUAL |= {
    "neck": 20.0,
    "head": 10.2,
    "collar": 9.6,
    "shoulder": 33.0,
    "elbow": 24.5,
    "wrist": 30.0,
    "hand": 11.8,
}
_USUAL_ROOT = 20.3
_USUAL_ROOT_POSITION = 3.8
# Of the weights of legs: they move gently most of the time and suddenly now and then. With 1, the
# trunk still arched by 20 degrees in a crouch that takes a seventh of a second, now by 8; with
# less, legs jitter.
_LEGS = 0.5
# Of accelerations in these units, at 60 frames per second. A network's errors in neighbouring
# frames are alike, so more frames say less than their number: weights that mean the same at any
# rate smooth a jump at 10 frames per second away.
_ACCELERATION = 2400.0
_LANDING = 3.0  # typical accelerations from which on a landing or a hit is likelier than noise
_CONTACT = 5e4  # of the velocity of points that rest, s/m²
_RATE_HZ = 60.0
CLIP_STEPS = 50  # at most, of a fit of all frames of a clip together
# Joints that no pair of landmarks determines stay closer to rest.
_STIFF_JOINTS = {"spine": 5.0, "collar": 5.0, "foot": 5.0, "hand": 5.0, "neck": 3.0, "head": 3.0}


def cold_stages(weights: Weights) -> tuple[Stage, ...]:
    """Return the stages of a cold start: directions and priors first, then the image, then all at
    full weight.
    """
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
            replace(
                weights,
                keypoints2d=1e4,
                joint_prior=3 * weights.joint_prior,
                shape=10 * weights.shape,
            ),
            1e-2,
            10,
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
        foot_contact=_RESTING_PLACE,
    )


def clip_stages(weights: Weights, steps: int = CLIP_STEPS) -> tuple[Stage, ...]:
    """Return the stages of a fit of all frames of a clip together, of at most so many steps.

    A tenth of the tolerance takes twice the steps, and changes errors on Pose2Sim and the sample
    clip by 0.1 mm.
    """
    return (Stage(clip_weights(weights), 1e-3, steps),)


def motion_priors(body: Body, times: Float64Array) -> tuple[MotionPrior, MotionPrior]:
    """Return the weights of what couples frames, for a first and a second fit: the second lets go
    of hard landings.

    If the first were robust as well, noise would pass for landings: from frame to frame it
    accelerates more than bodies do. Weights of acceleration grow with the square of the frame rate
    up to 60 Hz; beyond, with the rate, as the number of measurements does.

    :param times: (T,) seconds.
    """
    rate = 1.0 / (_RATE_HZ * usual_step_s(times, alone=1.0 / _RATE_HZ))
    scale = _ACCELERATION * min(rate * rate, rate)
    names = body.joint_names[1:]
    of_fingers = _USUAL["hand"]
    usual = np.array(
        [next((_USUAL[end] for end in _USUAL if name.endswith(end)), of_fingers) for name in names]
    )
    share = np.array([_LEGS if name.endswith(("hip", "knee", "ankle")) else 1.0 for name in names])
    quadratic = MotionPrior(
        joints=scale * share / usual**2,
        root_rotation=scale / _USUAL_ROOT**2,
        root_position=scale / _USUAL_ROOT_POSITION**2,
        robust_joints=np.inf,
        robust_root_rotation=np.inf,
        robust_root_position=np.inf,
        contact=_CONTACT,
        pose_memory=0.0,  # the weights of the priors were chosen with every frame counting
    )
    return quadratic, replace(
        quadratic,
        robust_joints=(_LANDING * usual) ** 2,
        robust_root_rotation=(_LANDING * _USUAL_ROOT) ** 2,
        robust_root_position=(_LANDING * _USUAL_ROOT_POSITION) ** 2,
    )


def joint_weights(body: Body) -> Float64Array:
    """Return the (K,) relative weights of the joints in the joint prior."""
    weights = np.ones(body.K)
    for k, name in enumerate(body.joint_names[1:]):
        weights[k] = next((value for key, value in _STIFF_JOINTS.items() if key in name), 1.0)
    return weights
