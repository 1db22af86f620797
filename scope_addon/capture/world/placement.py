# SPDX-License-Identifier: GPL-3.0-or-later
"""A fitted track as a motion in the first frame's camera axes: without gaps, smoothed, with contact
points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....solver import rotations
from ....solver.body import Body
from ...arrays import BoolArray, Float32Array, Float64Array, FloatArray
from ...kinematics.contact_points import (
    FOOT_PARTS,
    SOLES,
    contact_point_positions,
    with_contact_points,
)
from ...kinematics.frame_blocks import by_blocks, to_single_precision
from ...kinematics.smoothing import fill_gaps, fill_rotation_gaps, smooth_root, smooth_rotations
from ...kinematics.standing import resting_probability
from ...scene_gaps import SCENE_GAP_S
from ..fitting.frame_sequence import FittedTrack
from ..tracking.track import Track
from .camera_path import CameraPath

# Confidence from which on a foot counts as visible: an occluded foot has 0.1 and more, one outside
# the image less than 0.01.
VISIBLE_CONFIDENCE = 0.1
MIN_SOLE_WEIGHT = 1e-9
# The longest time between two frames of one scene; the second in units of the median step.
MAX_STEP_S = 1.0
MAX_STEP = 1.5


@dataclass(frozen=True)
class PlacedTrack:
    """T frames without gaps, smoothed on request, in the first frame's camera axes, metres."""

    body: Body  # with the contact points of these betas
    betas: FloatArray  # (P,)
    times: Float64Array  # (T,) seconds
    valid: BoolArray  # (T,) measured, not filled in
    # (T, K+1, 3, 3); part 0 R_camera_root, the others relative to their parents
    rotations: FloatArray
    root: FloatArray  # (T, 3) the pelvis
    joints: FloatArray  # (T, K+1, 3)
    contact_points: FloatArray  # (T, 6, 3) sole points and palms
    contact_points_visible: FloatArray  # (T, 6) 0..1
    center: FloatArray  # (T, 3) of the camera
    uneven_ground: bool = False  # both feet may rest at any height
    # (T,) frames in which nothing rests, because strides contradict the path; None: none
    contradicts: BoolArray | None = None

    @property
    def soles(self) -> FloatArray:
        """The (T, 4, 3) contact points of the soles."""
        return self.contact_points[:, : len(SOLES)]

    def contact_center(self, contact: FloatArray) -> FloatArray:
        """Return the (T, 3) mean of the contact points weighted by ``contact`` (T, 6); of the soles
        if all are 0.
        """
        weight = contact.copy()
        weight[:, : len(SOLES)] += MIN_SOLE_WEIGHT
        share = weight / weight.sum(axis=1, keepdims=True)
        return (share[..., None] * self.contact_points).sum(axis=1)

    def contact(self, up: FloatArray) -> FloatArray:
        """Return the (T, 6) probability that each contact point rests on something, 0 for those
        that are not visible.

        Contacts end at scene cuts, and at pauses much longer than the usual time between frames.

        :param up: (3,) unit vector.
        """
        contact = resting_probability(
            self.contact_points, up, self.times, self.center, self.uneven_ground
        )
        contact *= self.contact_points_visible * self.valid[:, None]
        if self.contradicts is not None:
            contact[self.contradicts] = 0.0
        steps = np.diff(self.times)
        if len(steps):
            longest = max(MAX_STEP_S, MAX_STEP * float(np.median(steps)))
            contact[1:][steps > min(longest, SCENE_GAP_S)] = 0.0
        return contact


def place_track(
    body: Body,
    track: Track,
    fitted: FittedTrack,
    smoothing: bool,
    path: CameraPath | None = None,
    uneven_ground: bool = False,
    contradicts: BoolArray | None = None,
) -> PlacedTrack:
    """Compute once what the world is estimated from and the motion is assembled from.

    :param fitted: in each frame's camera.
    :param path: of the camera; None: it is static.
    :param contradicts: (T,) frames in which nothing rests, see `contradicting_strides`.
    """
    path = path or CameraPath.static(len(track))
    times = track.times
    valid = fitted.valid
    betas = fitted.betas
    rotations, root = without_gaps(track, fitted, path)
    if smoothing:
        rotations = smooth_rotations(rotations, times)
        root = path.center + smooth_root(root - path.center, times)
    body_with_contacts = with_contact_points(body, betas)
    joints, contact_points = joints_and_contact_points(body_with_contacts, betas, rotations, root)
    parts = [body.joint_names.index(name) for name in (*FOOT_PARTS, "left_wrist", "right_wrist")]
    visible = np.clip(fitted.joint_confidence[:, parts] / VISIBLE_CONFIDENCE, 0.0, 1.0)
    return to_single_precision(
        PlacedTrack(
            body_with_contacts,
            betas,
            times,
            valid,
            rotations,
            root,
            joints,
            contact_points,
            visible,
            path.center,
            uneven_ground,
            contradicts,
        )
    )


def without_gaps(
    track: Track, fitted: FittedTrack, path: CameraPath
) -> tuple[FloatArray, FloatArray]:
    """Return rotations (T, K+1, 3, 3) and pelvis (T, 3) as fitted, without gaps, in the first
    frame's camera axes.
    """
    fitted = path.to_first(fitted)
    rotations = fill_rotation_gaps(fitted.rotations, fitted.valid, track.times)
    return rotations, fill_gaps(fitted.t_camera_root, fitted.valid, track.times)


def joints_and_contact_points(
    body_with_contacts: Body, betas: FloatArray, rotations: FloatArray, root: FloatArray
) -> tuple[Float32Array, Float32Array]:
    """Return joints (T, K+1, 3) and contact points (T, 6, 3) of a motion, in its axes."""
    pelvis_at_rest = body_with_contacts.rest_joints(betas)[0]

    def place(rotations: FloatArray, root: FloatArray) -> tuple[Float32Array, Float32Array]:
        R, t = body_with_contacts.forward_kinematics(rotations, root - pelvis_at_rest, betas)
        return t.astype(np.float32), contact_point_positions(body_with_contacts, R, t).astype(
            np.float32
        )

    joints, contact_points = by_blocks(place, rotations, root)
    return joints, contact_points


@dataclass(frozen=True)
class RawMotion:
    """The motion of which every frame was fitted alone, as it is kept until the world is known.

    T frames without gaps, in the first frame's camera axes, metres and radians. An hour of rotation
    matrices takes 93 MB, as rotation vectors a third of that. The world turns the root alone, so
    the other joints have the rotation vectors of the motion file from the start.
    """

    R_first_root: FloatArray  # (T, 3, 3)
    t_first_root: FloatArray  # (T, 3) the pelvis
    joints: Float32Array  # (T, K, 3) rotation vectors relative to the parent
    joint_confidence: FloatArray  # (T, K+1) 0..1
    joint_sigma_m: FloatArray | None  # (T, K+1, 2), as in `FittedTrack`
    height_sigma_m: float

    @classmethod
    def of(cls, track: Track, fitted: FittedTrack, path: CameraPath) -> RawMotion:
        """Return the motion of a fit in each frame's camera."""
        matrices, t_first_root = without_gaps(track, fitted, path)
        return cls(
            matrices[:, 0].copy(),
            t_first_root,
            rotation_vectors_of_joints(matrices),
            fitted.joint_confidence,
            fitted.joint_sigma_m,
            fitted.height_sigma_m,
        )


def rotation_vectors_of_joints(matrices: FloatArray) -> Float32Array:
    """Return (T, K, 3) for rotations (T, K+1, 3, 3) without the root's, in single precision as in
    the motion file.
    """
    (vectors,) = by_blocks(lambda some: (rotations.log(some[:, 1:]).astype(np.float32),), matrices)
    return vectors
