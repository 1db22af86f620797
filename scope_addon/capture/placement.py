# SPDX-License-Identifier: GPL-3.0-or-later
"""A fitted track as a motion in the first frame's camera axes: gaps filled, smoothed, with its joints and soles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.body import Body
from .camera_path import CameraPath
from .compact import compact
from .fitting import FittedTrack
from .frame_blocks import by_blocks
from .grounding import standing_probability
from .scene_cuts import BETWEEN_SCENES_S
from .smoothing import fill_gaps, fill_rotation_gaps, smooth_root, smooth_rotations
from .soles import FOOT_PARTS, sole_points, with_soles
from .track import Track

# From here on a foot is seen, if badly; behind something it has 0.1 and more, beside the picture less than 0.01.
SEEN_CONFIDENCE = 0.1
LEAST_CONTACT = 1e-9
LONGEST_STEP_S, LONGEST_STEP = 1.0, 1.5  # between two frames of one scene; in usual steps, where these are long


@dataclass(frozen=True)
class PlacedTrack:
    """T frames without gaps, smoothed if so asked, in the first frame's camera axes, metres."""

    body: Body  # with soles for these betas
    betas: np.ndarray  # (P,)
    times: np.ndarray  # (T,) seconds
    valid: np.ndarray  # (T,) bool: measured, not filled in
    rotations: np.ndarray  # (T, K+1, 3, 3); part 0 R_camera_root, the others relative to their parents
    root: np.ndarray  # (T, 3) the pelvis
    joints: np.ndarray  # (T, K+1, 3)
    soles: np.ndarray  # (T, 4, 3)
    soles_seen: np.ndarray  # (T, 4) 0..1
    center: np.ndarray  # (T, 3) of the camera

    def place(self, rotations: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Joints (T, K+1, 3) and soles (T, 4, 3) of another motion of this body, camera frame."""
        return _place(self.body, self.betas, rotations, root)

    def stands_at(self, contact: np.ndarray) -> np.ndarray:
        """(T, 3) the middle of the soles, weighted by ``contact`` (T, 4); of all alike where none stands."""
        weight = contact + LEAST_CONTACT
        share = weight / weight.sum(axis=1, keepdims=True)
        return (share[..., None] * self.soles).sum(axis=1)

    def contact(self, up: np.ndarray) -> np.ndarray:
        """(T, 4) probability that each sole stands, as far as it is seen: imagined feet hold nobody.

        Nothing stands from one scene into the next, or over a pause much longer than from frame to frame.
        """
        contact = standing_probability(self.soles, up, self.times, self.center)
        contact *= self.soles_seen * self.valid[:, None]
        steps = np.diff(self.times)
        if len(steps):
            longest = max(LONGEST_STEP_S, LONGEST_STEP * float(np.median(steps)))
            contact[1:][steps > min(longest, BETWEEN_SCENES_S)] = 0.0
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
    soled = with_soles(body, betas)
    joints, soles = _place(soled, betas, rotations, root)
    feet = [body.joint_names.index(name) for name in FOOT_PARTS]
    seen = np.clip(fitted.joint_confidence[:, feet] / SEEN_CONFIDENCE, 0.0, 1.0)
    return compact(PlacedTrack(soled, betas, times, valid, rotations, root, joints, soles, seen, path.center))


def raw_motion(track: Track, fitted: FittedTrack, path: CameraPath) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (T, K+1, 3, 3) and pelvis (T, 3) as fitted, gaps filled, in the first frame's camera axes."""
    fitted = path.to_first(fitted)
    rotations = fill_rotation_gaps(fitted.rotations, fitted.valid, track.times)
    return rotations, fill_gaps(fitted.t_camera_root, fitted.valid, track.times)


def _place(
    soled: Body, betas: np.ndarray, rotations: np.ndarray, root: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    at_rest = soled.rest_joints(betas)[0]

    def place(rotations: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        R, t = soled.forward_kinematics(rotations, root - at_rest, betas)
        return t.astype(np.float32), sole_points(soled, R, t).astype(np.float32)

    joints, soles = by_blocks(place, rotations, root)
    return joints, soles
