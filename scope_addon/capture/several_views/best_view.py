# SPDX-License-Identifier: GPL-3.0-or-later
"""Hands and face of a person in several cameras: each comes from the camera that sees it best.

Networks tell the pose of a hand and the expression of a face from one picture, and guess where it
shows little of them. So cameras are not averaged, and the body's keypoints tell where the hand is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...arrays import Float64Array, IndexArray
from ...kinematics.smoothing import gaussian_smooth
from ..fitting.hand_measurements import reliability
from ..perception.face_record import with_landmarks_of
from ..perception.hand_landmarks import HAND_POINTS, SIDES
from ..tracking.track import Track

# Cut-off frequency of what cameras are compared by, so that a hand that two of them see equally
# well does not change between them in each frame.
COMPARED_HZ = 0.5


def best_camera(scores: Float64Array, times: Float64Array) -> IndexArray:
    """Return (T,) which camera sees something best; one that does not see it in a frame is no
    choice there, if another one does.

    :param scores: (V, T) how well each camera sees it; 0: not at all.
    :param times: (T,) seconds.
    """
    calm = gaussian_smooth(scores.T, times, COMPARED_HZ).T
    return np.argmax(np.where(scores > 0.0, calm, -1.0), axis=0)


def with_best_hands(tracks: Sequence[Track]) -> list[Track]:
    """Return tracks with each hand in the camera alone that sees it best.

    :param tracks: of one person by several cameras, at the same times; the first one has hands,
        seen or not, if another one has.
    """
    if len(tracks) == 1 or not any(track.has_hands for track in tracks):
        return list(tracks)
    hands = [_hands(track) for track in tracks]
    wrists = np.array([reliability(each)[..., 0] for each in hands])
    for side in range(len(SIDES)):
        best = best_camera(wrists[:, :, side], tracks[0].times)
        for number, each in enumerate(hands):
            each[best != number, side] = 0.0
    return [replace(track, hands=each) for track, each in zip(tracks, hands, strict=True)]


def _hands(track: Track) -> Float64Array:
    """Return a copy of the hands (T, 2, 21, 7) of a track; zeros where none were looked for."""
    if track.hands is None:
        return np.zeros((len(track), len(SIDES), HAND_POINTS, 7))
    return np.array(track.hands, float)


def with_best_faces(tracks: Sequence[Track]) -> tuple[list[Track], Track]:
    """Return tracks with the face in the camera alone that sees it best; and the first track with
    the expressions of all of them, whose landmarks are where the first camera sees them.

    :param tracks: of one person by several cameras, at the same times, with expressions.
    """
    first = tracks[0]
    faces = [track.face for track in tracks if track.face is not None]
    if len(tracks) == 1 or len(faces) < len(tracks):
        return list(tracks), first
    best = best_camera(np.array([rows[:, 0] for rows in faces], float), first.times)
    chosen = np.array(faces)[best, np.arange(len(first))]
    landmarks = faces[0]
    alone = [
        replace(track, face=np.where((best == number)[:, None], rows, 0.0))
        for number, (track, rows) in enumerate(zip(tracks, faces, strict=True))
    ]
    return alone, replace(first, face=with_landmarks_of(chosen, landmarks))
