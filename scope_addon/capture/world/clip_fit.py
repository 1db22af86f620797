# SPDX-License-Identifier: GPL-3.0-or-later
"""The finished motion of a track: all frames of a clip fitted at once, coupled by the acceleration
of joints and root.

    minimize  Σ_f E_f(x_f) + ½ ∫ w ρ(|a|²) dt + ½ ∫ w_c p |v|² dt   over the poses x_f of all frames

with the terms E_f of single frames, their shape fixed, accelerations a, and velocities v of the
soles and palms that rest with probability p (`solver.fit_motion`). A keypoint that jumps for one
frame loses against its neighbours, a limb that is hidden for some frames moves on smoothly, feet
that stand stay where they are (in a second fit, at the place that the first one found), and no
filter follows. Long clips are fitted in windows of consecutive frames. Where two windows overlap,
their motions are blended.

A fit ends in the nearest minimum. Where a limb points far towards the camera or away from it, the
mirrored limb (`kinematics.mirrored_limbs`) often has a minimum of its own, and the pose that the
frames were started from, which the lifting network could not tell from the other, may be the worse
one. For as long as a bone keeps to one side, it is therefore mirrored and fitted again, first in
some frames alone (`search_limbs`). If it stays on the other side and costs no more there, the
frames around are fitted together from both poses, and the cheaper one is kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver import Body, MotionFit, MotionPrior, State
from ...arrays import BoolArray, Float64Array, FloatArray, IndexArray, unit_vectors
from ...clock import Progress
from ...kinematics.body_surface import BodySurface
from ...kinematics.mirrored_limbs import LIMBS, bone_depths, mirrored_limb, runs_of_one_sign
from ...kinematics.smoothing import interpolate_rotations
from ...scene_gaps import usual_step_s
from ..fitting.frame_sequence import LONGEST_COAST_S, FittedTrack, rotations_of
from ..fitting.prepared_track import PreparedTrack
from ..fitting.weights import motion_priors
from .camera_path import CameraPath
from .clip_window import ClipWindow

# The unknowns of a window, whose equations take some 120 MB: 480 frames of a body of 24 parts.
WINDOW_UNKNOWNS = 36_000
# The unknowns that two windows share: they differ by 2 to 4 mm where one has 1 s more to its end.
OVERLAP = 4_800
LONGEST_STEP = 2.5  # between two frames that are fitted together, in units of the median step
# Factors of the standard deviations, see `joint_sigma`.
ALONG = 15.5
ACROSS = 11.5
_RATE_HZ = 60.0
_EXPONENT = 0.3
SURFACE_ROUNDS = 2  # at most, as what comes out of one part of the body may enter the next
_MIN_HZ = 10.0  # acceleration hardly couples frames that are further apart


def fit_clip(
    prepared: PreparedTrack, start: FittedTrack, path: CameraPath, progress: Progress
) -> FittedTrack:
    """Fit all frames of a track together, between longer gaps.

    :param start: the states to start from, and the shape, in each frame's camera.
    :param progress: called with the stage's name, the frames done and the total; it may raise to
        cancel.
    :return: the states in each frame's camera; those of invalid frames are as given.
    """
    clip = _Clip(prepared, start, path, progress)
    for run in frames_between_gaps(start.valid, prepared.track.times):
        for window in overlapping_slices(
            len(run), _frames_of(prepared, WINDOW_UNKNOWNS), _frames_of(prepared, OVERLAP)
        ):
            clip.fit(run[window])
    return clip.fitted()


class _Clip:
    """A track on its way to its motion, in the first frame's axes."""

    def __init__(
        self, prepared: PreparedTrack, start: FittedTrack, path: CameraPath, progress: Progress
    ) -> None:
        self._prepared = prepared
        self._path = path
        self._progress = progress
        first = path.to_first(start)
        self._motion = replace(
            first, rotations=first.rotations.copy(), t_camera_root=first.t_camera_root.copy()
        )
        self._surface = BodySurface(prepared.body, np.asarray(start.betas, float))
        self._done = np.zeros(len(start.valid), bool)
        self._sigma = np.full((*first.rotations.shape[:2], 2), np.nan, np.float32)

    def fit(self, frames: IndexArray) -> None:
        """Fit one window; frames that an earlier one has fitted are blended from that one's motion
        to this one's.
        """
        self._progress("solving the clip", int(self._done.sum()), len(self._done))
        body = self._prepared.body
        times = self._prepared.track.times[frames]
        every = slice(0, len(frames))
        quadratic, robust = motion_priors(body, times)
        window = ClipWindow.of(self._prepared, self._path, frames, self._motion.betas)
        found = window.fit(every, [self._motion.state(k) for k in frames], quadratic)
        # Several cameras tell the two poses apart.
        alone = not self._prepared.others
        better = search_limbs(body, window, found, quadratic) if alone else None
        if better is not None:
            found = window.fit(every, better, quadratic)
        resting = window.with_resting_places(found)
        outside, entered = resting.with_body_surface(found, self._surface)
        for _ in range(SURFACE_ROUNDS):
            if not entered:
                break
            found = outside.fit(every, found.states, robust)
            outside, entered = resting.with_body_surface(found, self._surface)
        self._keep(frames, outside.fit(every, found.states, robust, covariance=True))

    def fitted(self) -> FittedTrack:
        """Return the states in each frame's camera."""
        return replace(self._path.to_frames(self._motion), joint_sigma_m=self._sigma)

    def _keep(self, frames: IndexArray, found: MotionFit) -> None:
        motion = self._motion
        rotations = np.array([rotations_of(state) for state in found.states])
        root = np.array([state.t_camera_root for state in found.states])
        both = int(self._done[frames].sum())
        share = (np.arange(both) + 1.0) / (both + 1.0)
        earlier = motion.rotations[frames[:both]].astype(float)
        rotations[:both] = interpolate_rotations(earlier, rotations[:both], share[:, None])
        root[:both] = (
            motion.t_camera_root[frames[:both]] * (1 - share[:, None])
            + root[:both] * share[:, None]
        )
        motion.rotations[frames] = rotations
        motion.t_camera_root[frames] = root
        self._sigma[frames] = self._blended_sigma(frames, found, share)
        self._done[frames] = True

    def _blended_sigma(
        self, frames: IndexArray, found: MotionFit, share: Float64Array
    ) -> Float64Array:
        """Return the deviations of a window's frames, the first blended by `share` with those of an
        earlier window.
        """
        assert found.joint_covariance is not None
        assert found.covariance_from_root is not None
        joints = found.t_world_part - self._path.center[frames, None]
        times = self._prepared.track.times[frames]
        sigma = joint_sigma(found.joint_covariance[:, 0], found.covariance_from_root, joints, times)
        earlier = self._sigma[frames[: len(share)]]
        w = share[:, None, None]
        sigma[: len(share)] = (1.0 - w) * earlier + w * sigma[: len(share)]
        return sigma


def frames_between_gaps(valid: BoolArray, times: Float64Array) -> Iterator[IndexArray]:
    """Yield the valid frames between gaps in which too much can happen for acceleration to tell it.

    :param valid: (T,).
    :param times: (T,) seconds.
    """
    frames = np.flatnonzero(valid)
    if len(frames):
        longest_s = max(LONGEST_COAST_S, LONGEST_STEP * usual_step_s(times))
        gaps = np.diff(times[frames]) > longest_s
        yield from np.split(frames, np.flatnonzero(gaps) + 1)


def overlapping_slices(count: int, most: int, overlap: int) -> list[slice]:
    """Divide ``count`` frames into as few slices of at most ``most`` as overlap by ``overlap``, all
    of one length.
    """
    if count <= most:
        return [slice(0, count)]
    number = int(np.ceil((count - overlap) / (most - overlap)))
    length = int(np.ceil((count + (number - 1) * overlap) / number))
    starts = np.linspace(0, count - length, number).astype(int)
    return [slice(int(start), int(start) + length) for start in starts]


def _frames_of(prepared: PreparedTrack, unknowns: int) -> int:
    return unknowns // (3 * (prepared.body.K + 2))


def joint_sigma(
    pelvis: Float64Array, from_pelvis: Float64Array, joints: FloatArray, times: Float64Array
) -> Float64Array:
    """Return the (T, K+1, 2) standard deviations along the line of sight and across it, per axis,
    metres.

    That of the pelvis is relative to the camera, those of the others relative to the pelvis. The
    covariance is that of independent errors, but networks' errors in neighbouring frames and
    keypoints are alike, and their mean is not zero. Positions are off by a multiple, which differs
    little from person to person and from joint to joint, and grows less with the frame rate than
    smoothing lowers the covariance:

        σ = c s (rate / 60 Hz)^0.3,   s of the covariance,
        c = 15.5 along the line of sight and 11.5 across it

    Fitted to the twelve limb joints of real clips and renders with ground truth
    (benchmarks/notebook/clip.md).

    :param pelvis: (T, 3, 3) covariance of its position for independent errors, metres².
    :param from_pelvis: (T, K+1, 3, 3) of the joints' positions relative to it; row 0 is not used.
    :param joints: (T, K+1, 3) relative to the camera's centre, in the axes of the covariances.
    :param times: (T,) seconds.
    """
    covariance = from_pelvis.copy()
    covariance[:, 0] = pelvis
    sight = unit_vectors(joints)
    along = np.einsum("tki,tkij,tkj->tk", sight, covariance, sight)
    across = 0.5 * (np.trace(covariance, axis1=-2, axis2=-1) - along)
    rate = 1.0 / usual_step_s(times, alone=1.0 / _MIN_HZ)
    inflation = (max(rate, _MIN_HZ) / _RATE_HZ) ** _EXPONENT
    variance = np.maximum(np.stack([along, across], axis=-1), 0.0)
    return inflation * np.sqrt(variance) * [ALONG, ACROSS]


# A bone is mirrored while it is deeper, if it gets so deep.
SHALLOW_M = 0.03
DEEP_M = 0.1
_MIN_CHANGE_M = 0.1  # by which a limb that has a minimum of its own differs
# The cost that the mirrored limb may add to frames alone, in the mean and to one.
_MAX_COST = 5.0
_MAX_COST_OF_ONE = 30.0
_MIN_GAIN = 10.0  # of cost, over the frames that are fitted together
_LONGEST_S = 2.0  # of a bone on one side; longer trials cost much, and none has found a better pose
_SAMPLES = 5  # further frames of a run that are tried alone
_MARGIN = 8  # frames before and after
_STEPS = 8  # of a trial, after which a better pose costs less already
# Whether the upper and the lower bone of a limb are mirrored.
_BONES = (True, False), (False, True), (True, True)


def search_limbs(
    body: Body, window: ClipWindow, found: MotionFit, prior: MotionPrior
) -> list[State] | None:
    """Return the states of a better motion to start from, or None if none was found.

    :param found: the fit of all frames of the window.
    :param prior: what couples the frames that are fitted again.
    """
    motion = found
    times = window.times
    for names in LIMBS:
        first, second, last = (body.joint_names.index(name) for name in names)
        limb = first, second, last
        for upper, lower in _BONES:
            start, end = (first, second) if upper else (second, last)
            joints = motion.t_world_part
            depths = bone_depths(joints[:, start], joints[:, end], window.center)
            for rows in runs_of_one_sign(depths, SHALLOW_M, DEEP_M):
                if times[rows.stop - 1] - times[rows.start] > _LONGEST_S:
                    continue
                other = _mirrored(body, motion, window.center, rows, limb, upper, lower)
                if _may_be_better(window, motion.states, other, limb, _some_deep(depths, rows)):
                    motion = _better(window, motion, rows, other, prior)
    return None if motion is found else motion.states


def _mirrored(
    body: Body,
    motion: MotionFit,
    center: Float64Array,
    rows: slice,
    limb: tuple[int, int, int],
    upper: bool,
    lower: bool,
) -> list[State]:
    """Return the states of all frames, with the limb mirrored in those of ``rows``."""
    R = motion.R_world_part[rows]
    joints = motion.t_world_part[rows]
    turned = mirrored_limb(body.parents, R, joints, center[rows], limb, upper, lower)
    states = list(motion.states)
    for row, pair in zip(range(rows.start, rows.stop), turned, strict=True):
        Omega = np.array(states[row].Omega)
        Omega[[limb[0] - 1, limb[1] - 1]] = pair
        states[row] = replace(states[row], Omega=Omega)
    return states


def _some_deep(depths: Float64Array, rows: slice) -> list[int]:
    """Return some frames of a run in which the bone is deep, the deepest first."""
    deep = rows.start + np.flatnonzero(np.abs(depths[rows]) > DEEP_M)
    some = np.linspace(0, len(deep) - 1, _SAMPLES).astype(int)
    return [int(k) for k in (deep[np.abs(depths[deep]).argmax()], *deep[some])]


def _may_be_better(
    window: ClipWindow,
    states: list[State],
    other: list[State],
    limb: tuple[int, int, int],
    rows: list[int],
) -> bool:
    """Whether the first of some frames, alone, keeps to the mirrored limb, and all cost hardly more
    with it.
    """
    added: list[float] = []
    ends = list(limb[1:])
    for row in rows:
        now = window.fit_alone(row, states[row])
        then = window.fit_alone(row, other[row])
        change: NDArray[Any] = np.linalg.norm(
            then.t_camera_part[ends] - now.t_camera_part[ends], axis=1
        )
        added.append(float(then.cost - now.cost))
        if added[0] > _MAX_COST or not (len(added) > 1 or change.max() > _MIN_CHANGE_M):
            return False
    return float(np.mean(added)) < _MAX_COST and max(added) < _MAX_COST_OF_ONE


def _better(
    window: ClipWindow, motion: MotionFit, rows: slice, other: list[State], prior: MotionPrior
) -> MotionFit:
    """Return the motion with the mirrored limb of ``other`` if the frames around cost less with it,
    or as it is.
    """
    around = slice(max(rows.start - _MARGIN, 0), min(rows.stop + _MARGIN, len(other)))
    now = window.fit(around, motion.states[around], prior, steps=_STEPS)
    then = window.fit(around, other[around], prior, steps=_STEPS)
    if not now.cost - then.cost > _MIN_GAIN:
        return motion
    states = list(motion.states)
    R = motion.R_world_part.copy()
    joints = motion.t_world_part.copy()
    states[around] = then.states
    R[around] = then.R_world_part
    joints[around] = then.t_world_part
    return replace(motion, states=states, R_world_part=R, t_world_part=joints)
