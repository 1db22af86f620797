# SPDX-License-Identifier: GPL-3.0-or-later
"""Left-right swaps: finds the frames in which the network confused left and right, and repairs
them.

The smaller networks do so for dozens of frames, or for most of a clip, when a person's face is not
visible. A single frame is ambiguous, but a body does not turn round between two frames, so the
labels jump at either end of a swap. Which side of a jump is right is decided by the reference
network, the largest one, which estimates a few frames (see `tracker`). Its landmarks also correct
the world landmarks in neighbouring frames where the two networks differ much.

`limb_swap` repairs swaps of the legs alone, or the arms alone.

For a network without depth, the lifting network's result is judged instead, for the keypoints as
detected and for the swapped ones: in a side view, the image alone does not distinguish a step from
swapped legs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...arrays import BoolArray, Float32Array, Float64Array, FloatArray, IndexArray
from ...kinematics.sequences import least_cost_path
from ..camera.intrinsics import Camera
from ..perception.landmark_network import KEYPOINT_NAMES, PoseEstimate
from ..perception.lifter import default_lifter
from .hand_assignment import with_sides_exchanged
from .track import Track

_OPPOSITE = {"left": "right", "right": "left"}
MIRROR_PARTNER = np.array(
    [
        KEYPOINT_NAMES.index("_".join(_OPPOSITE.get(word, word) for word in name.split("_")))
        for name in KEYPOINT_NAMES
    ]
)
"""(33,) index of each keypoint's counterpart on the other side (of the nose: itself)."""

LIMBS = np.array([11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28])
# The cost of overruling the network in a frame, as metres of jump. The largest network is nearly
# always right: only intervals of some ten frames are overruled, so that a person who spins between
# two frames at a low rate is kept.
FRAME_COST_M = 0.005
FRAME_COST_WITHOUT_REFERENCE_M = 0.04
DEPTH_COST_M = 0.005  # for reversing the depth in addition
CHANGE_COST_M = 0.025  # for each change of the labels: a smaller gain is chance
# The same where both readings were lifted, per second: at a low rate, a person who walks moves far
# between frames.
LIFTED_COST_M_S = 0.05
# An occluded keypoint stays occluded: the jump in metres that equals a change of its confidence
# from 1 to 0.
M_PER_CONFIDENCE = 0.3
# Where the reference landmarks are farther away than this, they correct those of neighbouring
# frames.
CORRECTION_DISTANCE_M = 0.12
CORRECTION_S = 0.13

# How to read a frame; DEPTH_REVERSED: swapped, and with reversed depth, because front and back were
# confused.
AS_DETECTED = 0
LEFT_RIGHT_SWAPPED = 1
DEPTH_REVERSED = 2


def repair_left_right(track: Track, camera: Camera) -> Track:
    """Return the track with left and right (and depth) as `find_labels` gives them, corrected by
    the reference.

    :param camera: the intrinsics, for a track without depth.
    """
    reference: Float32Array | None = None
    if len(track.reference_rows):
        reference = np.full(track.world_landmarks.shape, np.nan, np.float32)
        reference[track.reference_rows] = track.reference_landmarks
    if not track.has_depth:
        return swap_keypoints(track, _find_lifted_labels(track, camera, reference) != AS_DETECTED)
    world = np.where(track.seen[:, None, None], track.world_landmarks, np.nan)
    frame_cost_m = FRAME_COST_WITHOUT_REFERENCE_M if reference is None else FRAME_COST_M
    labels = find_labels(world, track.acquired, reference, frame_cost_m)
    del reference
    if not (labels != AS_DETECTED).any() and not len(track.reference_rows):
        return track
    repaired = apply_labels(world, labels)
    repaired += _correction(repaired, track)
    return replace(
        swap_keypoints(track, labels != AS_DETECTED),
        world_landmarks=np.where(track.seen[:, None, None], repaired, 0.0),
    )


def swap_keypoints(
    track: Track, where: BoolArray, order: IndexArray = MIRROR_PARTNER, *, with_hands: bool = True
) -> Track:
    """Return the track with its keypoints reordered, and the hands swapped, in some frames.

    :param where: (T,) in which frames.
    :param order: (33,) index of the keypoint that takes each place.
    :param with_hands: whether the hands belong to the keypoints that are swapped.
    """
    if not where.any():
        return track
    hands = track.hands
    if hands is not None and with_hands:
        hands = hands.copy()
        hands[where] = with_sides_exchanged(hands[where])
    keypoints_px, confidence = (
        reorder_keypoints(v, where, order) for v in (track.keypoints_px, track.confidence)
    )
    return replace(track, keypoints_px=keypoints_px, confidence=confidence, hands=hands)


def reorder_keypoints(values: FloatArray, where: BoolArray, order: IndexArray) -> FloatArray:
    """Return values (T, 33, ...) with their keypoints in ``order`` (33,) in the frames ``where``
    (T,) is True.
    """
    out = values.copy()
    out[where] = values[where][:, order]
    return out


def apply_labels(world_landmarks: FloatArray, labels: IndexArray) -> FloatArray:
    """Return world landmarks (T, 33, 3) read as the labels (T,) of `find_labels` say."""
    out = reorder_keypoints(world_landmarks, labels != AS_DETECTED, MIRROR_PARTNER)
    out[labels == DEPTH_REVERSED] *= [1.0, 1.0, -1.0]
    return out


def looks_swapped(before: PoseEstimate, after: PoseEstimate) -> bool:
    """Return whether the bodies of two successive frames are closer with left and right swapped in
    one of them.
    """
    return swap_ratio(before, after) < 1.0


def swap_ratio(before: PoseEstimate, after: PoseEstimate) -> float:
    """Return the distance of the bodies of two successive frames with left and right swapped in
    one, over that without.

    It is below 1 where they look swapped, about 1 where a body is turned by a right angle, and
    infinite where both are the same.
    """
    a = _centred_body(before)
    b = _centred_body(after)
    plain = float(_limb_distance(a, b))
    return float(_limb_distance(a[MIRROR_PARTNER], b)) / plain if plain else float("inf")


def _centred_body(estimate: PoseEstimate) -> FloatArray:
    """Return the (33, n) body about its middle: in space, or in the image where depth is
    unknown.
    """
    if estimate.world_landmarks.any():
        return estimate.world_landmarks
    return estimate.keypoints_px - estimate.keypoints_px[LIMBS].mean(axis=0)


def find_labels(
    world_landmarks: FloatArray,
    starts: BoolArray | None = None,
    reference: FloatArray | None = None,
    frame_cost_m: float = FRAME_COST_M,
) -> IndexArray:
    """Find how each frame's landmarks should be read.

    The labels x_t minimize

        Σ_t cost(x_t) + Σ_t (d(w_{t−1}(x_{t−1}), w_t(x_t)) + change · [x_t ≠ x_{t−1}])
            + Σ_{t in A} d(w_t(x_t), a_t),

    with d the mean distance of the shoulders, elbows, wrists, hips, knees and ankles, and a_t the
    reference landmarks in the frames A. Without a reference, a swap costs less than its two jumps
    only if it lasts for less than half of the clip, so the majority of the frames decides.

    :param world_landmarks: (T, 33, 3) metres, hips at 0, camera axes; rows of NaN where nobody was
        seen.
    :param starts: (T,) frames that need not continue the one before, because the person was found
        again.
    :param reference: (T, 33, 3) the same from the reference network; rows of NaN where it was not
        asked.
    :param frame_cost_m: of overruling the network in a frame.
    :return: (T,) AS_DETECTED, LEFT_RIGHT_SWAPPED or DEPTH_REVERSED.
    """
    known = np.isfinite(world_landmarks[:, LIMBS]).all(axis=(1, 2))
    readings = readings_of(world_landmarks[known])
    return _cheapest(
        readings, _steps(readings), known, reading_costs(frame_cost_m), starts, reference
    )


def reading_costs(frame_cost_m: float = FRAME_COST_M) -> Float64Array:
    """Return the costs (3,) of the three ways to read a frame, metres; see `find_labels`."""
    return np.array([0.0, frame_cost_m, frame_cost_m + DEPTH_COST_M])


def readings_of(world_landmarks: FloatArray) -> FloatArray:
    """Return the limbs (3, T, 12, 3) of landmarks (T, 33, 3), read in each of the three ways."""
    swapped = world_landmarks[:, MIRROR_PARTNER[LIMBS]]
    reversed_ = swapped * np.array([1, 1, -1], swapped.dtype)
    return np.stack([world_landmarks[:, LIMBS], swapped, reversed_])


def _find_lifted_labels(track: Track, camera: Camera, reference: FloatArray | None) -> IndexArray:
    """Find the labels (T,) AS_DETECTED or LEFT_RIGHT_SWAPPED of a track without depth from the
    lifted bodies.

    The lifting network may move less in one reading than in the other, which means nothing: the
    mean of the two counts. Confidences count in addition to positions.
    """
    rays = camera.rays(track.keypoints_px)[..., :2]
    lifter = default_lifter()
    readings = []
    for order in (np.arange(len(MIRROR_PARTNER)), MIRROR_PARTNER):
        body = lifter.lift(rays[:, order], track.confidence[:, order], None).points
        certainty = M_PER_CONFIDENCE * track.confidence[:, order, None]
        readings.append(
            np.concatenate([body, certainty], axis=-1)[track.seen][:, LIMBS].astype(np.float32)
        )
    costs = np.array([0.0, LIFTED_COST_M_S * track.step_s])
    steps = _steps(np.stack(readings))
    steps = (steps + steps[:, ::-1, ::-1]) / 2
    return _cheapest(np.stack(readings), steps, track.seen, costs, track.acquired, reference)


def _cheapest(
    readings: FloatArray,
    steps: FloatArray,
    known: BoolArray,
    label_cost: Float64Array,
    starts: BoolArray | None,
    reference: FloatArray | None,
) -> IndexArray:
    """Return the (T,) labels with the least cost, see `find_labels`; AS_DETECTED in frames that are
    not known.

    :param readings: (n, N, 12, 3 or more) the limbs in the N known frames by label: positions, and
        what else counts.
    :param steps: (N−1, n, n) cost of one label after another.
    :param known: (T,)
    :param label_cost: (n,) of each label, per frame.
    """
    switching = steps + CHANGE_COST_M * (1 - np.eye(len(label_cost)))
    if starts is not None:
        switching[starts[known][1:]] = 0.0
    costs = np.tile(label_cost, (readings.shape[1], 1))
    if reference is not None:
        distance = mean_distance(readings[..., :3], reference[known][:, LIMBS]).T
        costs += np.where(np.isfinite(distance), distance, 0.0)
    labels = np.full(len(known), AS_DETECTED)
    labels[known] = least_cost_path(costs, switching)
    return labels


def _steps(readings: FloatArray) -> FloatArray:
    """Return the (N−1, n, n) mean distances between the readings (n, N, 12, ...) of each frame and
    the next.
    """
    distances = [
        [mean_distance(before[:-1], after[1:]) for after in readings] for before in readings
    ]
    return np.array(distances).transpose(2, 0, 1)


def _correction(world: FloatArray, track: Track) -> FloatArray:
    """Return the (T, 33, 3) offsets that take the landmarks to the reference's where the two differ
    much.

    Linear in time between reference frames that are near each other; otherwise it falls to zero
    within CORRECTION_S.
    """
    references = {
        int(row): landmarks
        for row, landmarks in zip(track.reference_rows, track.reference_landmarks, strict=True)
        if track.seen[row]
    }
    # At a low frame rate only the reference's own frame would move.
    if not references or len(track) < 2 or track.step_s > CORRECTION_S:
        return np.zeros_like(world)
    knots: list[float] = []
    values: list[FloatArray] = []
    zero = np.zeros(world.shape[1:])
    for row in sorted(references):
        time = track.times[row]
        differs = _limb_distance(references[row], world[row]) > CORRECTION_DISTANCE_M
        if not knots or time - CORRECTION_S > knots[-1] + CORRECTION_S:
            if knots:
                knots.append(knots[-1] + CORRECTION_S)
                values.append(zero)
            knots.append(time - CORRECTION_S)
            values.append(zero)
        knots.append(time)
        values.append(references[row] - world[row] if differs else zero)
    knots.append(knots[-1] + CORRECTION_S)
    values.append(zero)
    out = np.empty_like(world)
    for column, value in zip(
        out.reshape(len(out), -1).T, np.array(values).reshape(len(knots), -1).T, strict=True
    ):
        column[:] = np.interp(track.times, knots, value)
    return out


def _limb_distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the mean distance of the limbs' landmarks of bodies (..., 33, n)."""
    return mean_distance(a[..., LIMBS, :], b[..., LIMBS, :])


def mean_distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the (...) mean distance of corresponding points a (..., n, m) and b (..., n, m)."""
    return np.linalg.norm(a - b, axis=-1).mean(axis=-1)
