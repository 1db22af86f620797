# SPDX-License-Identifier: GPL-3.0-or-later
"""Alignment of a face's landmarks with a reference face: what remains is identity, expression and what views change."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .....solver.rotations import log

VIEW_TERMS = 10
_STEEPEST = 0.9  # radians, component of a rotation beyond which the views' terms do not grow
_Y_UP = np.array([1.0, -1.0, -1.0])  # from pixels and depth to axes with y up and z to the camera


class AlignedFaces(NamedTuple):
    """Landmarks (T, n, 3) in the reference's axes and size, and rotation vectors (T, 3) from the reference's axes."""

    points: NDArray[np.float64]
    turns: NDArray[np.float64]


def aligned(
    landmarks: NDArray[np.float64], reference: NDArray[np.float64], shares: NDArray[np.float64]
) -> AlignedFaces:
    """Align faces by the similarity transform with least squared distance from the reference.

    With the weighted means removed, and the singular values of Σ_n a_n x_n y_nᵀ = U S Vᵀ: R = V diag(1, 1, ±1) Uᵀ and
    s = tr(S diag(1, 1, ±1)) / Σ_n a_n |x_n|² (Umeyama: Least-squares estimation of transformation parameters, 1991).

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


def view_terms(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the terms (T, VIEW_TERMS) of views (T, 3) in which the mean error of landmarks is expressed."""
    v = np.clip(turns, -_STEEPEST, _STEEPEST)
    x, y, z = v.T
    return np.column_stack([v, v**2, x * y, y * z, x * z, abs(y)])
