# SPDX-License-Identifier: GPL-3.0-or-later
"""Expression weights fitted to a clip's landmarks, by the response of the landmark network to the
body's own face.

Frame t's aligned landmarks x_t (D,) are modelled as

    x_t = m + V f(v_t) + c + G (v_t − v̄) + Eᵀ w_t + e_t        e_t ~ N(0, Σ)

m: the mean face; f(v_t): terms of the view v_t; c and G: this person's face, and how it looks in
other views than his mean one v̄, constant over the clip; E (U, D): the response to each unit of
expression. The weights minimize

    ½ (r_t − Eᵀ w)ᵀ Σ⁻¹ (r_t − Eᵀ w) + λ Σ_u w_u        0 ≤ w ≤ w_max

by coordinate descent, in turns with c and G. λ grows with the errors in the clip: it is `SPARSITY`
times q over that in the rendered faces, with q = median_t mean_u (E Σ⁻¹ e_t)_u² / (E Σ⁻¹ Eᵀ)_uu.
`tools/calibrate_face` measures m, V, E, Σ on rendered faces, with the network's errors: a lid that
the network closes only by half still counts as closed.

The landmarks also show best how the head turns and leans to the side. With the rotation vector v of
the landmarks against the reference face (`aligned`), in the axes of a camera that looks at the
face, and Y from y up to y down, the direction from the right to the left ear is

    d = R_camera_virtual Y exp(v) exp(c) (1, 0, 0)

c: from the reference's axes to the head's. How far the head nods stays with the body's keypoints:
of somebody whom the network has not seen before, it is off by 4 degrees, and by more where the
focal length is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....solver.errors import ModelFileError
from ....solver.rotations import exp, log
from ...arrays import BoolArray, Float64Array, FloatArray, unit_vectors
from ...scene_gaps import steps_in_scenes
from ...untrusted.files import read_npz
from ..camera.intrinsics import Camera
from ..perception.face_landmarks import EXPRESSION_POINTS, ExpressionNetwork
from ..perception.face_record import (
    MAX_NOISE,
    gaze,
    kept_landmarks,
    landmarks_of,
    noise_of_size,
    parts,
    presence_of,
    with_expression,
)
from ..perception.lifter import camera_towards

FILE = Path(__file__).resolve().parents[3] / "assets" / "face" / "response.npz"
# The time, and the number of frames, that tell a person's face at rest.
MIN_S = 2.0
MIN_FRAMES = 10
SURE = 0.3  # confidence of frames that tell the person's face
SPARSITY = 3.0  # λ
# The w_max of the units that turn the eyes: eyes turn farther than the body's keys at 1.
LARGEST_GAZE = 2.0
_TIME_TOLERANCE_S = 0.005  # of their sum
_ROUNDS = 4
_SWEEPS = 30
_STILL = 1e-6  # change of the weights in a sweep after which no other follows
_TURN_RIDGE = 0.03  # on G, in squared radians
_BLOCK = 2048  # frames that are solved at once: they fit into a processor's cache
VIEW_TERMS = 10
_STEEPEST = 0.9  # radians, component of a rotation beyond which the views' terms do not grow
_Y_UP = np.array([1.0, -1.0, -1.0])  # from pixels and depth to axes with y up and z to the camera
# Mean rotation vector from the reference's axes to the default body's head, over the hundred people
# of the set `poses`.
_HEAD_FROM_REFERENCE = np.radians([5.3, -0.4, 0.7])
_Y_DOWN = np.diag([1.0, -1.0, -1.0])
# Cosine of the angle between face and ears from which a face counts for nothing, and to which it
# counts in full: at the back of a head, the network may see a face that looks the other way.
_CONTRADICTED = np.cos(np.radians(60.0))
_AGREED = np.cos(np.radians(30.0))


@dataclass(frozen=True)
class FaceResponse:
    """The response of the landmark network: U units of expression, n landmarks, D = 3 n."""

    landmarks: NDArray[np.int64]  # (n,) numbers in the mesh of 478
    reference: Float64Array  # (n, 3) to which faces are aligned
    shares: Float64Array  # (n,) of the landmarks in the alignment
    mean: Float64Array  # (D,) m
    view: Float64Array  # (VIEW_TERMS, D) V
    response: Float64Array  # (U, D) E
    projection: Float64Array  # (U, D) E Σ⁻¹
    units: Float64Array  # (U, 52) which expressions each unit moves: 0 or 1
    gaze: Float64Array  # (U, 2) tangents of the eyes' turn to the left and up at weight 1
    noise: Float64Array  # () q in rendered faces

    @property
    def largest(self) -> Float64Array:
        """(U,) w_max."""
        return np.where(self.gaze.any(axis=1), LARGEST_GAZE, 1.0)


@cache
def load_response() -> FaceResponse:
    """Read the built-in response.

    :raises ModelFileError: the file is missing or damaged.
    """
    data = read_npz(FILE, ModelFileError, "file of the face's response")
    try:
        return FaceResponse(
            data["landmarks"],
            *(data[name].astype(float) for name in list(FaceResponse.__annotations__)[1:]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ModelFileError(f"{FILE} is damaged ({error}); install Scope again") from error


def fitted(rows: FloatArray) -> FloatArray:
    """Return rows whose weights and gaze are fitted to the landmarks.

    :param rows: (T, RECORD) see `face_record`, for which `is_known`.
    :raises ModelFileError: the response of the landmarks is missing or damaged.
    """
    seen = np.flatnonzero(rows[:, 0] > 0)
    response = load_response()
    confidence, size, *_ = parts(rows[seen])
    faces = aligned(
        landmarks_of(rows[seen], response.landmarks).astype(float),
        response.reference,
        response.shares,
    )
    sure = confidence >= min(SURE, float(np.median(confidence)))
    units = fit_units(
        response, faces.points.reshape(len(seen), -1), faces.turns, noise_of_size(size), sure
    )
    out = rows.copy()
    out[seen] = with_expression(
        rows[seen], np.minimum(units @ response.units, 1.0), _directions(units @ response.gaze)
    )
    return out


def is_known(rows: FloatArray, times: Float64Array) -> bool:
    """Return whether a face was seen for long enough that the person's face at rest is known.

    :param rows: (T, RECORD) see `face_record`.
    :param times: (T,) seconds; those since the frame before are added up over the frames in which
        it was seen, but not across a cut.
    """
    seen = rows[:, 0] > 0
    seconds = float(steps_in_scenes(times)[seen].sum())
    return int(seen.sum()) >= MIN_FRAMES and seconds >= MIN_S - _TIME_TOLERANCE_S


def fit_units(
    response: FaceResponse,
    points: Float64Array,
    turns: Float64Array,
    noise: Float64Array,
    sure: BoolArray,
) -> Float64Array:
    """Return the weights (T, U) of the units of expression.

    :param points: (T, D) aligned landmarks.
    :param turns: (T, 3) rotation vectors of the head.
    :param noise: (T,) least ratio of the squared errors to those in the rendered faces.
    :param sure: (T,) frames by which the person's face is known.
    """
    E = response.response
    x = points - response.mean - view_terms(turns) @ response.view
    views = turns - turns[sure].mean(axis=0)
    ridge = _TURN_RIDGE * sure.sum() * np.eye(3)
    normal = E @ response.projection.T
    w = np.zeros((len(x), len(E)))
    ratio = 1.0
    for _ in range(_ROUNDS):
        rest = x[sure] - w[sure] @ E
        constant = np.median(rest, axis=0)
        v = views[sure]
        turned = np.linalg.solve(v.T @ v + ridge, v.T @ (rest - constant))
        own = x - constant - views @ turned
        target = own @ response.projection.T - SPARSITY * np.clip(noise, ratio, MAX_NOISE)[:, None]
        for a in range(0, len(x), _BLOCK):
            _descend(w[a : a + _BLOCK], normal, target[a : a + _BLOCK], response.largest)
        ratio = min(
            max(error_size(response, own[sure] - w[sure] @ E) / float(response.noise), ratio),
            MAX_NOISE,
        )
    return w


def error_size(response: FaceResponse, errors: Float64Array) -> float:
    """Return q, see the module, of errors (T, D) of landmarks."""
    scores = errors @ response.projection.T
    return float(
        np.median(
            (scores**2 / np.einsum("ud,ud->u", response.response, response.projection)).mean(axis=1)
        )
    )


def _descend(
    w: Float64Array, normal: Float64Array, target: Float64Array, largest: Float64Array
) -> None:
    """Minimize ½ wᵀ H w − gᵀ w in the box 0 ≤ w ≤ w_max, for all frames at once, in place.

    :param w: (T, U) where to begin.
    :param normal: (U, U) H.
    :param target: (T, U) g.
    """
    # A unit's numbers lie together.
    weights = np.ascontiguousarray(w.T)
    g = np.ascontiguousarray(target.T)
    before = np.empty_like(weights)
    diagonal = np.diag(normal).tolist()
    for _ in range(_SWEEPS):
        before[:] = weights
        for u, most in enumerate(largest.tolist()):
            best = g[u] - normal[u] @ weights
            best /= diagonal[u]
            best += weights[u]
            np.maximum(best, 0.0, out=best)
            np.minimum(best, most, out=weights[u])
        if np.abs(weights - before).max() <= _STILL:
            break
    w[:] = weights.T


def _directions(tangents: Float64Array) -> Float64Array:
    """Return unit vectors (T, 2, 3), the same of both eyes, from the tangents (T, 2) to the left
    and up.
    """
    ahead = np.concatenate([tangents, np.ones((len(tangents), 1))], axis=1)
    return np.repeat(unit_vectors(ahead)[:, None], 2, axis=1)


def with_expressions(rows: FloatArray, times: Float64Array) -> FloatArray:
    """Return rows of one person with weights and gaze: fitted, or by the expression network of a
    face seen briefly.

    They are found when all frames have been observed: only then is it known whether a face was seen
    for long enough, and the expression network, which few captures need, does not run for the
    others.

    :param rows: (T, RECORD) see `face_record`.
    :param times: (T,) seconds.
    :raises SetupError: the expression network is needed and has not been built.
    :raises ModelFileError: what they are found with is damaged.
    """
    seen = np.flatnonzero(rows[:, 0] > 0)
    if is_known(rows, times):
        return fitted(rows)
    if not len(seen):
        return rows
    # It runs on the CPU, whatever the other networks run on: it takes a millisecond.
    network = ExpressionNetwork()
    landmarks = landmarks_of(rows[seen], np.array(EXPRESSION_POINTS))[..., :2]
    weights = np.array([network.estimate(face) for face in landmarks])
    directions = np.array([gaze(kept_landmarks(row)) for row in rows[seen]])
    out = rows.copy()
    out[seen] = with_expression(rows[seen], weights, directions)
    return out


class AlignedFaces(NamedTuple):
    """Landmarks (T, n, 3) in the reference's axes and size, and rotation vectors (T, 3) from the
    reference's axes.
    """

    points: Float64Array
    turns: Float64Array


def aligned(landmarks: Float64Array, reference: Float64Array, shares: Float64Array) -> AlignedFaces:
    """Align faces by the similarity transform with least squared distance from the reference.

    With the weighted means removed, and the singular values of Σ_n a_n x_n y_nᵀ = U S Vᵀ: R = V
    diag(1, 1, ±1) Uᵀ and s = tr(S diag(1, 1, ±1)) / Σ_n a_n |x_n|² (Umeyama: Least-squares
    estimation of transformation parameters, 1991).

    :param landmarks: (T, n, 3) pixels, and depth in pixels.
    :param reference: (n, 3).
    :param shares: (n,) weights a of the points, with sum 1.
    """
    x = landmarks * _Y_UP
    x = x - np.einsum("n,tnx->tx", shares, x)[:, None]
    middle = shares @ reference
    y = reference - middle
    U, S, Vt = np.linalg.svd(np.einsum("n,tnx,ny->txy", shares, x, y))
    signs = np.ones((len(x), 3))
    signs[:, 2] = np.sign(np.linalg.det(U @ Vt))
    R = np.einsum("tji,tj,tkj->tik", Vt, signs, U)
    scale = (S * signs).sum(axis=1) / np.maximum(np.einsum("n,tnx->t", shares, x**2), 1e-12)
    points = scale[:, None, None] * np.einsum("tij,tnj->tni", R, x) + middle
    return AlignedFaces(points, log(R.transpose(0, 2, 1)))


def view_terms(turns: Float64Array) -> Float64Array:
    """Return the terms (T, VIEW_TERMS) of views (T, 3) in which the mean error of landmarks is
    expressed.
    """
    v = np.clip(turns, -_STEEPEST, _STEEPEST)
    x, y, z = v.T
    return np.column_stack([v, v**2, x * y, y * z, x * z, abs(y)])


def across_head(face: FloatArray, camera: Camera, zoom: Float64Array | None = None) -> Float64Array:
    """Return the unit vectors d (T, 3) of the module's equation, in camera axes; zeros where no
    face was seen.

    :param face: (T, RECORD) see `face_record`.
    :param zoom: (T,) focal length over the camera's.
    :raises ModelFileError: the response of the landmarks, which has the reference face, is missing
        or damaged.
    """
    directions = np.zeros((len(face), 3))
    seen = face[:, 0] > 0
    if not seen.any():
        return directions
    response = load_response()
    landmarks = landmarks_of(face[seen], response.landmarks).astype(float)
    landmarks[..., :2] = camera.undistort(landmarks[..., :2])
    turns = aligned(landmarks, response.reference, response.shares).turns
    z = np.concatenate([landmarks[..., :2].mean(axis=1), np.ones((len(turns), 1))], axis=1)
    z = z @ np.linalg.inv(camera.intrinsics).T
    if zoom is not None:
        z[:, :2] /= zoom[seen, None]
    R_camera_virtual = np.swapaxes(camera_towards(z[:, :2]), 1, 2)
    directions[seen] = (R_camera_virtual @ _Y_DOWN @ exp(turns) @ exp(_HEAD_FROM_REFERENCE))[..., 0]
    return directions


def certainty(face: FloatArray, directions: Float64Array, ears: FloatArray) -> Float64Array:
    """Return how much each direction counts (T,), 1 of a large face that is surely there, 0 where
    there is none.

    A face counts by its size, and by the cube of its presence, since landmarks of blurred and
    hidden faces jump.

    :param face: (T, RECORD) see `face_record`.
    :param directions: (T, 3) of `across_head`.
    :param ears: (T, 3) from the right to the left ear by the body's keypoints, camera axes.
    """
    cosine = (ears * directions).sum(axis=1) / np.maximum(np.linalg.norm(ears, axis=1), 1e-9)
    agreed = np.clip((cosine - _CONTRADICTED) / (_AGREED - _CONTRADICTED), 0.0, 1.0)
    return agreed * parts(face)[0] * presence_of(face) ** 2
