# SPDX-License-Identifier: GPL-3.0-or-later
"""The response of the landmark network to expressions, from rendered faces in single poses and in
motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.perception.face_landmarks import EXPRESSION_POINTS
from ...scope_addon.capture.tracking.expression_fit import (
    VIEW_TERMS,
    AlignedFaces,
    FaceResponse,
    aligned,
    error_size,
    view_terms,
)
from ...scope_addon.kinematics.face import EXPRESSIONS
from .observe import SeenFaces

TOGETHER = (  # what both eyes do, as people's do and as the network sees it
    ("eyeLookOutLeft", "eyeLookInRight"),
    ("eyeLookInLeft", "eyeLookOutRight"),
    ("eyeLookUpLeft", "eyeLookUpRight"),
    ("eyeLookDownLeft", "eyeLookDownRight"),
)
UNSEEN = ("tongueOut",)
_ROUNDS = 8  # of reference, alignment and shares
_RIDGE = 0.02
_TURN_RIDGE = 0.03
_OF_POSES = 0.2  # of the covariance of errors in unrelated poses that is added to that in motion
_DEGRADED = 0.5  # of the covariance of errors in motion that is from small and compressed pictures
_SHRINK = 0.05  # of the covariance to its diagonal


def units_of_expression() -> NDArray[np.float64]:
    """Return the units (U, 52) as rows of 0 and 1."""
    apart = [n for n in EXPRESSIONS if n not in UNSEEN and not any(n in both for both in TOGETHER)]
    rows: list[tuple[str, ...]] = [*((n,) for n in apart), *TOGETHER]
    return np.array([[float(name in row) for name in EXPRESSIONS] for row in rows])


def measure_response(poses: SeenFaces, moving: SeenFaces, degraded: SeenFaces) -> FaceResponse:
    """Measure the response on people in unrelated poses, and its errors also on people who talk.

    :param degraded: the same people as ``moving``, in small and compressed pictures.
    """
    units = units_of_expression()
    share = units / units.sum(axis=1, keepdims=True)
    landmarks = np.array(EXPRESSION_POINTS)
    points = poses.landmarks[:, EXPRESSION_POINTS]
    W = poses.truth["weights"]
    person = poses.truth["person"]
    neutral = ~W.any(axis=1)
    people = np.unique(person)
    first = np.array([np.flatnonzero(neutral & (person == p))[0] for p in people])
    reference = points[first[0]] * [1, -1, -1]
    shares = np.full(len(landmarks), 1 / len(landmarks))
    for _ in range(_ROUNDS):
        reference = aligned(points[first], _unit(reference), shares).points.mean(axis=0)
        faces = aligned(points, reference := _unit(reference), shares)
        rest = np.array([faces.points[neutral & (person == p)].mean(axis=0) for p in people])
        moves = (
            ((faces.points - rest[np.searchsorted(people, person)]) ** 2).sum(axis=2).mean(axis=0)
        )
        shares = 1 / (moves + 0.1 * np.median(moves))
        shares /= shares.sum()
    faces = aligned(points, reference, shares)
    x = (faces.points - rest[np.searchsorted(people, person)]).reshape(len(W), -1)
    terms = np.c_[W @ share.T, view_terms(faces.turns)]
    both = np.linalg.solve(terms.T @ terms + _RIDGE * np.eye(terms.shape[1]), terms.T @ x)
    E = both[:-VIEW_TERMS]
    view = both[-VIEW_TERMS:]
    mean = rest.mean(axis=0).ravel()
    covariance = _OF_POSES * np.cov((x - terms @ both).T)
    errors = [
        _errors_in_motion(
            seen, aligned(seen.landmarks[:, landmarks], reference, shares), E, view, mean, share
        )
        for seen in (moving, degraded)
    ]
    covariance += (1 - _DEGRADED) * np.cov(errors[0].T) + _DEGRADED * np.cov(errors[1].T)
    diagonal = np.diag(np.diag(covariance))
    inverse = np.linalg.inv((1 - _SHRINK) * covariance + _SHRINK * diagonal)
    found = FaceResponse(
        landmarks,
        reference,
        shares,
        mean,
        view,
        E,
        E @ inverse,
        units,
        _gaze(poses, units, share),
        np.array(1.0),
    )
    return replace(found, noise=np.array(error_size(found, errors[0])))


def _unit(reference: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points with mean 0 and mean square 1."""
    centred = reference - reference.mean(axis=0)
    out: NDArray[np.float64] = centred / np.sqrt((centred**2).sum(axis=1).mean())
    return out


def _errors_in_motion(
    moving: SeenFaces,
    faces: AlignedFaces,
    E: NDArray[np.float64],
    view: NDArray[np.float64],
    mean: NDArray[np.float64],
    share: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return what is left (T, D) once a person's face and its change with the view are known."""
    x = faces.points.reshape(len(faces.points), -1) - mean - view_terms(faces.turns) @ view
    x -= moving.truth["weights"] @ share.T @ E
    left = []
    for p in np.unique(moving.truth["person"]):
        rows = moving.truth["person"] == p
        own = x[rows] - x[rows].mean(axis=0)
        v = faces.turns[rows] - faces.turns[rows].mean(axis=0)
        turned = np.linalg.solve(v.T @ v + _TURN_RIDGE * rows.sum() * np.eye(3), v.T @ own)
        left.append(own - v @ turned)
    return np.concatenate(left)


def _gaze(
    poses: SeenFaces, units: NDArray[np.float64], share: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the tangents (U, 2) by which the units turn the eyes of the body, mean of both
    eyes.
    """
    tangents = (poses.truth["gaze"][..., :2] / poses.truth["gaze"][..., 2:]).mean(axis=1)
    turning = units.sum(axis=1) > 1
    terms = np.c_[poses.truth["weights"] @ share[turning].T, np.ones(len(tangents))]
    out = np.zeros((len(units), 2))
    out[turning] = np.linalg.lstsq(terms, tangents, rcond=None)[0][:-1]
    return out
