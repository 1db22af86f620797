# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth flips: limb bones that lead away from the camera where the true ones lead towards it, or
the reverse.

A bone from a to b is out of the image plane by the angle φ with sin φ = (b − a)·r / ‖b − a‖, where
r is the unit vector from the camera to the middle of the bone. Poses that differ by the sign of φ
alone project to nearly the same picture. A bone is flipped in a frame if φ and the true φ have
opposite signs and both are larger than 15°. A flip is a run of consecutive frames in which one bone
is flipped. It is brief if it lasts less than a second and both its ends are seen: in the frames
before and after it, the person was found and the bone was not flipped.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.axes import transform_points
from ...scope_addon.motion import Motion
from ...solver import Body
from ...solver.rotations import exp
from ..report import table

Points = NDArray[np.float64]
OUT_DEG = 15.0
BRIEF_S = 1.0
FITS = ("clip", "alone")  # the fit of the clip, and of every frame alone
CHAINS = (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
BONES = tuple(
    (f"{side}_{chain[k]}", f"{side}_{chain[k + 1]}")
    for side in ("left", "right")
    for chain in CHAINS
    for k in (0, 1)
)


class DepthFlips(NamedTuple):
    """Counts over the bones of one clip, or of several.

    ``brief``: flips that are brief. ``flipped``: pairs of bone and frame in which the bone is
    flipped, of ``out_of_plane`` in which the true bone is more than 15° out of the image plane.
    ``crossings``: bones whose true φ is above 15° in one frame and below −15° in another, with
    ``brief_of_crossings`` brief flips.
    """

    brief: int = 0
    flipped: int = 0
    out_of_plane: int = 0
    crossings: int = 0
    brief_of_crossings: int = 0

    @property
    def share(self) -> float:
        """Share of the bones out of the image plane that are flipped; NaN if there are none."""
        return self.flipped / self.out_of_plane if self.out_of_plane else np.nan


def total(counts: Iterable[DepthFlips]) -> DepthFlips:
    """Return the sums over clips."""
    return DepthFlips(*(sum(column) for column in zip(DepthFlips(), *counts, strict=True)))


def out_of_plane_deg(starts: Points, ends: Points) -> NDArray[np.float64]:
    """Return φ in degrees, (...); positive away from the camera. Points (..., 3) in the camera
    frame.
    """
    bone = ends - starts
    middle = (starts + ends) / 2
    sine = (bone * middle).sum(-1) / (
        np.linalg.norm(bone, axis=-1) * np.linalg.norm(middle, axis=-1)
    )
    degrees: NDArray[np.float64] = np.degrees(np.arcsin(np.clip(sine, -1, 1)))
    return degrees


def count_flips(
    captured_deg: NDArray[np.float64],
    true_deg: NDArray[np.float64],
    rows: NDArray[np.intp],
    rate: float,
) -> DepthFlips:
    """Count the flips of one person.

    :param captured_deg, true_deg: φ (n, B) of the bones in the frames in which the person was
        found.
    :param rows: (n,) numbers of these frames, ascending.
    :param rate: frames per second.
    """
    is_out = np.abs(true_deg) > OUT_DEG
    flipped = is_out & (np.abs(captured_deg) > OUT_DEG) & (captured_deg * true_deg < 0)
    crosses = (true_deg > OUT_DEG).any(axis=0) & (true_deg < -OUT_DEG).any(axis=0)
    brief = np.zeros(flipped.shape[1], int)
    for run in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(rows) != 1) + 1):
        changes = np.diff(flipped[run].astype(int), axis=0)
        for bone in range(len(brief)):
            begins, ends = (np.flatnonzero(changes[:, bone] == sign) for sign in (1, -1))
            ends = ends[ends > begins[0]] if len(begins) else ends[:0]
            brief[bone] += int((ends - begins[: len(ends)] < BRIEF_S * rate).sum())
    return DepthFlips(
        int(brief.sum()),
        int(flipped.sum()),
        int(is_out.sum()),
        int(crosses.sum()),
        int(brief[crosses].sum()),
    )


def depth_flips(body: Body, motion: Motion, true: dict[str, Points]) -> dict[str, DepthFlips]:
    """Count the flips of a captured motion in each of ``FITS``.

    :param true: (T, 3) of every limb joint by name, in the camera frame of each frame of the
        footage.
    """
    rows = np.flatnonzero(motion.valid & (motion.frames < len(true[BONES[0][0]])))
    frames = motion.frames[rows]
    rate = float(motion.mocap_framerate)
    true_deg = np.stack(
        [out_of_plane_deg(true[a][frames], true[b][frames]) for a, b in BONES], axis=1
    )
    at = [[body.joint_names.index(name) for name in bone] for bone in BONES]
    counts: dict[str, DepthFlips] = {}
    for name, joints in zip(
        FITS, (motion.joints_cam[rows].astype(float), _alone(body, motion, rows)), strict=True
    ):
        deg = np.stack([out_of_plane_deg(joints[:, a], joints[:, b]) for a, b in at], axis=1)
        counts[name] = count_flips(deg, true_deg, frames, rate)
    return counts


def flips_table(head: str, found: dict[str, DepthFlips]) -> str:
    """Return sums over clips as a Markdown table."""
    columns = (
        head,
        "brief flips",
        "of bones that cross the image plane",
        "flipped, % of bones out of the plane",
    )
    rows = [
        [name, n.brief, f"{n.brief_of_crossings}, in {n.crossings} bones", 100 * n.share]
        for name, n in found.items()
    ]
    return table(columns, rows)


def _alone(body: Body, motion: Motion, rows: NDArray[np.intp]) -> Points:
    """Return the joints (n, K+1, 3) of the frames fitted alone, in each frame's camera frame."""
    states = exp(motion.poses_raw[rows].reshape(len(rows), -1, 3).astype(float))
    joints = body.forward_kinematics(
        states, motion.trans_raw[rows].astype(float), motion.betas.astype(float)
    )[1]
    return transform_points(np.linalg.inv(motion.world_from_camera[rows]), joints)
