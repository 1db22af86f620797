# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of a track, fitted one after another with the clip's shape.

A limb bent towards the camera looks in the image like one bent away from it. A warm start from the
previous frame stays with one of the two poses, however certain the lifting network becomes of the
other. When a fit contradicts the lifted directions, the frame is therefore fitted again with the
stages of a cold start. If this lowers the cost, the previous frames are refitted backwards from
there, for as long as the refit of a frame costs less than was gained.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....solver import Fit, Measurements, Options, State, Status, fit_tree, make_tree
from ....solver.tree import with_fixed_shape
from ...arrays import BoolArray, Float64Array, FloatArray
from ..perception.hand_landmarks import SIDES
from .hand_measurements import smooth_fingers
from .prepared_track import OtherView, PreparedTrack
from .weights import ROBUST, WEIGHTS, cold_stages, warm_stages

LONGEST_COAST_S = 0.5  # the last pose says little about a person who has not been seen for longer
_SAME_POSE_RAD = np.radians(10.0)  # by which no joint differs between two poses


@dataclass
class FittedTrack:
    """Body states of T frames in the camera frame; rows that are not ``valid`` repeat the last
    valid state.
    """

    rotations: FloatArray  # (T, K+1, 3, 3); row 0 R_camera_root, the others Ω
    t_camera_root: FloatArray  # (T, 3) the pelvis, metres
    betas: FloatArray  # (P,)
    valid: BoolArray  # (T,)
    joint_confidence: FloatArray  # (T, K+1) 0..1
    iterations: float  # mean per frame
    # (T, K+1, 2) of `joint_sigma`, NaN where not valid
    joint_sigma_m: FloatArray | None = None
    height_sigma_m: float = float("nan")  # standard deviation of the stature of `betas`

    def state(self, k: int) -> State:
        """Return the state in frame ``k``."""
        rotations = self.rotations[k]
        return State(rotations[0], self.t_camera_root[k], rotations[1:], self.betas)

    def with_fingers_at_rest(self, prepared: PreparedTrack) -> FittedTrack:
        """Return the motion of the whole body; fingers that were not fitted are at rest.

        To the wrist's deviation, theirs adds what wrist and fingers may rotate under the joint
        prior alone.
        """
        own = prepared.body
        whole = prepared.whole_body
        if own is whole:
            return self
        at = [whole.joint_names.index(name) for name in own.joint_names]
        T = len(self.valid)
        parts = whole.K + 1
        rotations = np.tile(np.eye(3, dtype=self.rotations.dtype), (T, parts, 1, 1))
        rotations[:, at] = self.rotations
        confidence = np.zeros((T, parts))
        confidence[:, at] = self.joint_confidence
        sigma = None
        if self.joint_sigma_m is not None:
            sigma = np.empty((T, parts, 2), self.joint_sigma_m.dtype)
            sigma[:, at] = self.joint_sigma_m
            for part in sorted(set(range(parts)) - set(at)):
                wrist = part
                variance = 0.0
                while wrist not in at:
                    wrist = int(whole.parents[wrist])
                    # A rotation moves a point along two of three axes.
                    reach_m = np.linalg.norm(whole.J_template[part] - whole.J_template[wrist])
                    variance += 2.0 / 3.0 * float(reach_m) ** 2 / WEIGHTS.joint_prior
                sigma[:, part] = np.hypot(sigma[:, wrist], np.sqrt(variance))
        return replace(self, rotations=rotations, joint_confidence=confidence, joint_sigma_m=sigma)


class FrameSequence:
    """Fits frames one after another; a frame without a fit repeats the last one.

    :param betas: (P,) shape of the person, the same in all frames.
    """

    def __init__(self, prepared: PreparedTrack, betas: FloatArray) -> None:
        T = len(prepared.track)
        body = prepared.body
        self._prepared = prepared
        self._betas = betas
        self._tree = with_fixed_shape(make_tree(body), betas)
        self._priors = replace(prepared.priors, shape_mean=None, shape_information=None)
        self._cold, self._warm = (
            replace(ROBUST, stages=stages(prepared.weights))
            for stages in (cold_stages, warm_stages)
        )
        # The fingers of hands that are not seen are smoothed before they are stored in single
        # precision.
        precision = np.float32 if prepared.hands is None else np.float64
        self._rotations: FloatArray = np.tile(np.eye(3).astype(precision), (T, body.K + 1, 1, 1))
        self._root = np.zeros((T, 3))
        self._valid = np.zeros(T, bool)
        self._cost = np.zeros(T)
        self._iterations = 0
        self._last: Fit | None = None
        self._last_s = -np.inf

    def fit_next(self, k: int) -> None:
        """Fit frame ``k`` from the previous frame, or from a cold start if that is too long ago.

        If a cold start improves on the warm one, refit the frames before it as well.
        """
        gain = self._fit(
            k, self._last.state if self._last is not None and self._is_continued(k) else None
        )
        if gain > 0.0 and self._last is not None:
            self._refit_backwards(k, self._last.state, gain)

    def refit(self, k: int, initial: State) -> None:
        """Fit frame ``k`` from its state in another motion, independently of its neighbours."""
        found = self._solve(self._prepared.measure_all(k), initial, self._warm)
        if is_usable(found):
            self._last = found
            self._valid[k] = True

    def repeat_last(self, k: int) -> None:
        """Give frame ``k`` the state of the last frame that was fitted."""
        if self._last is not None:
            self._store(k, self._last)

    def fitted(self) -> FittedTrack:
        """Return the states of all frames."""
        prepared = self._prepared
        valid = self._valid
        confidence = prepared.measurer.joint_confidence(prepared.track.confidence)
        rotations, confidence = with_hands(
            [prepared], self._rotations, confidence, valid, prepared.track.times
        )
        return FittedTrack(
            rotations=rotations,
            t_camera_root=self._root,
            betas=self._betas,
            valid=valid,
            joint_confidence=confidence * valid[:, None],
            iterations=self._iterations / max(int(valid.sum()), 1),
        )

    def _is_continued(self, k: int) -> bool:
        """Whether frame ``k`` follows the last fit closely enough to start from it."""
        track = self._prepared.track
        return bool(not track.acquired[k] and track.times[k] - self._last_s <= LONGEST_COAST_S)

    def _fit(self, k: int, initial: State | None) -> float:
        """Fit frame ``k`` from an initial state, or from a cold start if there is none.

        :return: by how much the stages of a cold start lowered the cost of a warm start that
            contradicted the lifter.
        """
        prepared = self._prepared
        measurements = prepared.measure_all(k)
        found = self._solve(measurements, initial, self._cold if initial is None else self._warm)
        if not is_usable(found):
            return 0.0
        self._last = found
        self._last_s = float(prepared.track.times[k])
        self._valid[k] = True
        if initial is None or not prepared.measurer.contradicts(measurements, found.t_camera_part):
            return 0.0
        restarted = self._solve(measurements, initial, self._cold)
        if restarted.cost < found.cost:
            self._last = restarted
            return float(found.cost - restarted.cost)
        return 0.0

    def _refit_backwards(self, k: int, later: State, gain: float) -> None:
        """Refit the frames before ``k``, each from the frame after it, while a refit costs less
        than was gained.
        """
        track = self._prepared.track
        while k > 0 and self._valid[k - 1] and not track.acquired[k]:
            k -= 1
            found = self._solve(self._prepared.measure_all(k), later, self._warm)
            is_worth_it = is_usable(found) and found.cost - self._cost[k] <= gain
            # The traces of the rotations between the poses.
            traces = np.einsum("kij,kij->k", found.state.Omega, self._rotations[k, 1:])
            if not is_worth_it or (traces > 1 + 2 * np.cos(_SAME_POSE_RAD)).all():
                return
            self._store(k, found)
            later = found.state

    def _solve(self, measurements: Measurements, initial: State | None, options: Options) -> Fit:
        found = fit_tree(self._tree, measurements, initial, self._priors, options)
        self._iterations += found.iterations
        return found

    def _store(self, k: int, fit: Fit) -> None:
        self._rotations[k] = rotations_of(fit.state)
        self._root[k] = fit.state.t_camera_root
        self._cost[k] = fit.cost


def with_hands(
    cameras: Sequence[PreparedTrack | OtherView],
    rotations: FloatArray,
    confidence: Float64Array,
    valid: BoolArray,
    times: Float64Array,
) -> tuple[FloatArray, Float64Array]:
    """Return rotations (T, K+1, 3, 3) with smooth fingers where no camera sees a hand, and the
    confidence (T, K+1) of joints with that of hands.

    :param cameras: that see the person, in T frames at these times.
    :param valid: (T,) which frames were fitted.
    """
    seen = np.zeros((len(valid), len(SIDES)), bool)
    fingers = None
    for camera in cameras:
        if camera.hand_measurer is None or camera.hands is None:
            continue
        fingers = camera.hand_measurer.fingers
        confidence = np.maximum(confidence, camera.hand_measurer.joint_confidence(camera.hands))
        seen |= camera.hands[:, :, 0, 2] > 0
    if fingers is not None:
        rotations = smooth_fingers(rotations, fingers, seen & valid[:, None], times)
    return rotations, confidence


def rotations_of(state: State) -> FloatArray:
    """Return the (K+1, 3, 3) rotations of a state: R_camera_root, then Ω."""
    return np.concatenate([state.R_camera_root[None], state.Omega])


def is_usable(fit: Fit) -> bool:
    """Whether a person was seen, not the floor alone, and the fit gave finite values."""
    return fit.seen > 0 and fit.status is not Status.NON_FINITE
