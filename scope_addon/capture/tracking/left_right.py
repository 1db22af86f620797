# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds the frames of a clip in which the network took the person's left for the right, and puts them right.

The smaller networks do so for dozens of frames at a stretch, for most of a clip even, when a person's face does not
show. One frame does not tell, but the body does not turn round between two frames: at either end of such a stretch the
labels jump. Which side of a jump is right, the largest network says, which looked at a few frames, and stood in where
labels jumped (`tracker`). Its judgement also corrects the landmarks in space round these frames, where the two networks
are far apart.

Legs or arms alone that changed sides are the affair of `limb_exchange`.

A network that tells nothing of depth is judged by what the lifting network makes of its keypoints, as said and with
left and right exchanged: in the picture alone, seen from the side, exchanged legs are a step as good as any.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...kinematics.viterbi import cheapest_path
from ..camera.intrinsics import Camera
from ..perception.landmark_network import KEYPOINT_NAMES, PoseEstimate
from ..perception.lifter import default_lifter
from .track import Track

_PARTNERS = {"left": "right", "right": "left"}
SWAPPED = np.array(
    [KEYPOINT_NAMES.index("_".join(_PARTNERS.get(word, word) for word in name.split("_"))) for name in KEYPOINT_NAMES]
)
"""(33,) number of each keypoint's mirror partner (of the nose: itself)."""

_LIMBS = np.array([11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28])
# What overruling the network costs per frame, as metres of jump. The largest network is right nearly always: only
# stretches of some ten frames are overruled, lest somebody who spins between two frames at a low rate is undone.
FRAME_COST_M = 0.005
FRAME_COST_UNJUDGED_M = 0.04
TURN_COST_M = 0.005  # for reversing the depth on top
CHANGE_COST_M = 0.025  # for every change of the labels: gaining less by it than this is chance
# The same where both readings were lifted. Per second: whoever walks at a low rate makes long steps between frames.
LIFTED_COST_M_S = 0.05
# What is hidden stays hidden: how many metres of jump a keypoint that is sure and then not at all is as good as.
M_PER_CONFIDENCE = 0.3
# Where the judge's landmarks are further off than this, they pull on those of the frames near by.
FAR_APART_M = 0.12
REACH_S = 0.13

AS_SAID, EXCHANGED, TURNED = 0, 1, 2  # TURNED: exchanged, and the depth reversed: the front taken for the back


def repair_left_right(track: Track, camera: Camera) -> Track:
    """The track with left and right (and depth) as `find_labels` finds them, and corrected by the judged frames."""
    judged = None
    if len(track.judged_rows):
        judged = np.full(track.world_landmarks.shape, np.nan, np.float32)
        judged[track.judged_rows] = track.judged_landmarks
    if not track.knows_depth:
        return exchanged(track, _find_lifted_labels(track, camera, judged) != AS_SAID)
    world = np.where(track.seen[:, None, None], track.world_landmarks, np.nan)
    labels = find_labels(world, track.acquired, judged, FRAME_COST_UNJUDGED_M if judged is None else FRAME_COST_M)
    del judged
    if not (labels != AS_SAID).any() and not len(track.judged_rows):
        return track
    repaired = labelled(world, labels)
    repaired += _pull(repaired, track)
    return replace(
        exchanged(track, labels != AS_SAID), world_landmarks=np.where(track.seen[:, None, None], repaired, 0.0)
    )


def exchanged(track: Track, where: np.ndarray, order: np.ndarray = SWAPPED, *, with_hands: bool = True) -> Track:
    """The track with keypoints in another order in the frames ``where`` (T,) says so, and the hands exchanged.

    :param order: (33,) which keypoint each one is.
    """
    if not where.any():
        return track
    hands = track.hands
    if hands is not None and with_hands:
        hands = np.where(where[:, None, None, None], hands[:, ::-1], hands)
    keypoints_px, confidence = (reordered(v, where, order) for v in (track.keypoints_px, track.confidence))
    return replace(track, keypoints_px=keypoints_px, confidence=confidence, hands=hands)


def reordered(values: np.ndarray, where: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Values (T, 33, ...) with the keypoints in another order in the frames ``where`` (T,) says so."""
    out = values.copy()
    out[where] = values[where][:, order]
    return out


def labelled(world_landmarks: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """World landmarks (T, 33, 3) with the labels (T,) of `find_labels` applied."""
    out = reordered(world_landmarks, labels != AS_SAID, SWAPPED)
    out[labels == TURNED] *= [1.0, 1.0, -1.0]
    return out


def looks_swapped(before: PoseEstimate, after: PoseEstimate) -> bool:
    """Whether the bodies of two successive frames lie closer with left and right exchanged in one of them."""
    a, b = _body(before), _body(after)
    return bool(_distance(a[SWAPPED], b) < _distance(a, b))


def _body(estimate: PoseEstimate) -> np.ndarray:
    """(33, n) the body about its middle: in space, or in the picture where depth is not known."""
    if estimate.world_landmarks.any():
        return estimate.world_landmarks
    return estimate.keypoints_px - estimate.keypoints_px[_LIMBS].mean(axis=0)


def find_labels(
    world_landmarks: np.ndarray,
    starts: np.ndarray | None = None,
    judged: np.ndarray | None = None,
    frame_cost_m: float = FRAME_COST_M,
) -> np.ndarray:
    """How each frame's landmarks should be read, (T,) int: AS_SAID, EXCHANGED or TURNED.

    The labels x_t with the least

        Σ_t cost(x_t) + Σ_t (d(w_{t−1}(x_{t−1}), w_t(x_t)) + change · [x_t ≠ x_{t−1}]) + Σ_{t judged} d(w_t, judged_t),

    d the mean distance of the shoulders, elbows, wrists, hips, knees and ankles.
    Without a judge a stretch that is wrong costs less than its two jumps only when most of the clip says otherwise, so
    the majority of frames decides.

    :param world_landmarks: (T, 33, 3) metres, hips at 0, camera axes; rows of NaN where nobody was seen.
    :param starts: (T,) bool, frames that need not continue the one before (the person was found anew).
    :param judged: (T, 33, 3) the same as a better network sees it; rows of NaN where it did not look.
    """
    known = np.isfinite(world_landmarks[:, _LIMBS]).all(axis=(1, 2))
    exchanged = world_landmarks[known][:, SWAPPED[_LIMBS]]
    turned = exchanged * np.array([1, 1, -1], exchanged.dtype)
    readings = np.stack([world_landmarks[known][:, _LIMBS], exchanged, turned])
    costs = np.array([0.0, frame_cost_m, frame_cost_m + TURN_COST_M])
    return _cheapest(readings, _steps(readings), known, costs, starts, judged)


def _find_lifted_labels(track: Track, camera: Camera, judged: np.ndarray | None) -> np.ndarray:
    """Labels, (T,) AS_SAID or EXCHANGED, of a track without depth: those of `find_labels` for the lifted bodies.

    The lifting network may move one reading less than the other, which says nothing: the mean counts. The confidences
    count beside the positions.
    """
    rays, lifter = camera.rays(track.keypoints_px)[..., :2], default_lifter()
    readings = []
    for order in (np.arange(len(SWAPPED)), SWAPPED):
        body = lifter.lift(rays[:, order], track.confidence[:, order], None).points
        sureness = M_PER_CONFIDENCE * track.confidence[:, order, None]
        readings.append(np.concatenate([body, sureness], axis=-1)[track.seen][:, _LIMBS].astype(np.float32))
    step_s = float(np.median(np.diff(track.times))) if len(track) > 1 else 0.0
    costs = np.array([0.0, LIFTED_COST_M_S * step_s])
    steps = _steps(np.stack(readings))
    steps = (steps + steps[:, ::-1, ::-1]) / 2
    return _cheapest(np.stack(readings), steps, track.seen, costs, track.acquired, judged)


def _cheapest(
    readings: np.ndarray,
    steps: np.ndarray,
    known: np.ndarray,
    own_cost: np.ndarray,
    starts: np.ndarray | None,
    judged: np.ndarray | None,
) -> np.ndarray:
    """(T,) labels of least cost, see `find_labels`; AS_SAID in frames that are not ``known`` (T,).

    :param readings: (n, N, 12, 3 or more: what else is compared) the limbs in the N known frames, by label.
    :param steps: (N−1, n, n) what it costs that one label follows another.  own_cost: (n,) of each label, per frame.
    """
    switching = steps + CHANGE_COST_M * (1 - np.eye(len(own_cost)))
    if starts is not None:
        switching[starts[known][1:]] = 0.0
    costs = np.tile(own_cost, (readings.shape[1], 1))
    if judged is not None:
        far = _apart(readings[..., :3], judged[known][:, _LIMBS]).T
        costs += np.where(np.isfinite(far), far, 0.0)
    labels = np.full(len(known), AS_SAID)
    labels[known] = cheapest_path(costs, switching)
    return labels


def _steps(readings: np.ndarray) -> np.ndarray:
    """(N−1, n, n) mean distances of the readings (n, N, 12, ...) of each frame and the next."""
    return np.array([[_apart(before[:-1], after[1:]) for after in readings] for before in readings]).transpose(2, 0, 1)


def _pull(world: np.ndarray, track: Track) -> np.ndarray:
    """(T, 33, 3) what to add to the landmarks so that they meet the judge's where the two are far apart.

    Linear in time between judged frames that are near each other, else falling to nothing within the reach.
    """
    judged = {
        int(row): landmarks
        for row, landmarks in zip(track.judged_rows, track.judged_landmarks, strict=True)
        if track.seen[row]
    }
    # at a low frame rate it would only make its own frame jump
    if not judged or len(track) < 2 or np.median(np.diff(track.times)) > REACH_S:
        return np.zeros_like(world)
    knots: list[float] = []
    values: list[np.ndarray] = []
    nothing = np.zeros(world.shape[1:])
    for row in sorted(judged):
        time = track.times[row]
        far = _distance(judged[row], world[row]) > FAR_APART_M
        if not knots or time - REACH_S > knots[-1] + REACH_S:
            if knots:
                knots.append(knots[-1] + REACH_S)
                values.append(nothing)
            knots.append(time - REACH_S)
            values.append(nothing)
        knots.append(time)
        values.append(judged[row] - world[row] if far else nothing)
    knots.append(knots[-1] + REACH_S)
    values.append(nothing)
    out = np.empty_like(world)
    for column, value in zip(out.reshape(len(out), -1).T, np.array(values).reshape(len(knots), -1).T, strict=True):
        column[:] = np.interp(track.times, knots, value)
    return out


def _distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Mean distance of the limbs' landmarks of bodies (..., 33, n)."""
    return _apart(a[..., _LIMBS, :], b[..., _LIMBS, :])


def _apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(...) mean distance of points (..., n, 3 or more)."""
    return np.linalg.norm(a - b, axis=-1).mean(axis=-1)
