# SPDX-License-Identifier: GPL-3.0-or-later
"""A fitted track as a motion in the first frame's camera axes: gaps filled, smoothed, with its joints and supports."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....solver.body import Body
from ...kinematics.contact_points import FOOT_PARTS, SOLES, support_points, with_supports
from ...kinematics.frame_blocks import by_blocks
from ...kinematics.single_precision import compact
from ...kinematics.smoothing import fill_gaps, fill_rotation_gaps, smooth_root, smooth_rotations
from ...kinematics.standing import resting_probability
from ..fitting.track_fit import FittedTrack
from ..tracking.scene_cuts import SCENE_GAP_S
from ..tracking.track import Track
from .camera_path import CameraPath

# From here on a foot is seen, if badly; behind something it has 0.1 and more, beside the picture less than 0.01.
SEEN_CONFIDENCE = 0.1
LEAST_CONTACT = 1e-9
LONGEST_STEP_S, LONGEST_STEP = 1.0, 1.5  # between two frames of one scene; in usual steps, where these are long


@dataclass(frozen=True)
class PlacedTrack:
    """T frames without gaps, smoothed if so asked, in the first frame's camera axes, metres."""

    body: Body  # with supports for these betas
    betas: np.ndarray  # (P,)
    times: np.ndarray  # (T,) seconds
    valid: np.ndarray  # (T,) bool: measured, not filled in
    rotations: np.ndarray  # (T, K+1, 3, 3); part 0 R_camera_root, the others relative to their parents
    root: np.ndarray  # (T, 3) the pelvis
    joints: np.ndarray  # (T, K+1, 3)
    supports: np.ndarray  # (T, 6, 3) soles and palms
    supports_seen: np.ndarray  # (T, 6) 0..1
    center: np.ndarray  # (T, 3) of the camera

    @property
    def soles(self) -> np.ndarray:
        """(T, 4, 3) of the supports."""
        return self.supports[:, : len(SOLES)]

    def place(self, rotations: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Joints (T, K+1, 3) and supports (T, 6, 3) of another motion of this body, camera frame."""
        return _place(self.body, self.betas, rotations, root)

    def stands_at(self, contact: np.ndarray) -> np.ndarray:
        """(T, 3) the middle of the supports, weighted by ``contact`` (T, 6); of the soles where nothing stands."""
        weight = contact.copy()
        weight[:, : len(SOLES)] += LEAST_CONTACT
        share = weight / weight.sum(axis=1, keepdims=True)
        return (share[..., None] * self.supports).sum(axis=1)

    def contact(self, up: np.ndarray) -> np.ndarray:
        """(T, 6) probability that each support stands, as far as it is seen: imagined feet hold nobody.

        Nothing stands from one scene into the next, or over a pause much longer than from frame to frame.
        """
        contact = resting_probability(self.supports, up, self.times, self.center)
        contact *= self.supports_seen * self.valid[:, None]
        steps = np.diff(self.times)
        if len(steps):
            longest = max(LONGEST_STEP_S, LONGEST_STEP * float(np.median(steps)))
            contact[1:][steps > min(longest, SCENE_GAP_S)] = 0.0
        return contact


def place_track(
    body: Body, track: Track, fitted: FittedTrack, smoothing: bool, path: CameraPath | None = None
) -> PlacedTrack:
    """What a world is found from and a motion assembled from, computed once for a fit.

    :param fitted: in each frame's camera; path: where that was (None: on a stand).
    """
    path = path or CameraPath.on_a_stand(len(track))
    times, valid, betas = track.times, fitted.valid, fitted.betas
    rotations, root = raw_motion(track, fitted, path)
    if smoothing:
        rotations = smooth_rotations(rotations, times)
        root = path.center + smooth_root(root - path.center, times)
    supported = with_supports(body, betas)
    joints, supports = _place(supported, betas, rotations, root)
    parts = [body.joint_names.index(name) for name in (*FOOT_PARTS, "left_wrist", "right_wrist")]
    seen = np.clip(fitted.joint_confidence[:, parts] / SEEN_CONFIDENCE, 0.0, 1.0)
    return compact(PlacedTrack(supported, betas, times, valid, rotations, root, joints, supports, seen, path.center))


def raw_motion(track: Track, fitted: FittedTrack, path: CameraPath) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (T, K+1, 3, 3) and pelvis (T, 3) as fitted, gaps filled, in the first frame's camera axes."""
    fitted = path.to_first(fitted)
    rotations = fill_rotation_gaps(fitted.rotations, fitted.valid, track.times)
    return rotations, fill_gaps(fitted.t_camera_root, fitted.valid, track.times)


def _place(
    supported: Body, betas: np.ndarray, rotations: np.ndarray, root: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    at_rest = supported.rest_joints(betas)[0]

    def place(rotations: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        R, t = supported.forward_kinematics(rotations, root - at_rest, betas)
        return t.astype(np.float32), support_points(supported, R, t).astype(np.float32)

    joints, supports = by_blocks(place, rotations, root)
    return joints, supports
