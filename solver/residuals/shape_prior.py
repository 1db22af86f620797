# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape pulled towards a mean: 1/2 w (beta - mean)ᵀ Lambda (beta - mean).

Lambda (P, P) is the identity for the population prior, or an information matrix carried from
earlier frames. As a residual, r = sqrt(w) Lᵀ (beta - mean) with Lambda = L Lᵀ, dr/dbeta = sqrt(w)
Lᵀ. Source: section 3 of the paper (shape prior).
"""

import numpy as np

from ..kernel import kernel
from ..part import Array, Linearization, Part


@kernel
def accumulate(mean, information, weight, pose, blocks):  # type: ignore[no-untyped-def]
    """Add to C and c and return the cost. mean (W,), information (W, W), padded with zeros."""
    if weight <= 0.0:
        return 0.0
    cost = 0.0
    for a in range(mean.shape[0]):
        total = 0.0
        for b in range(mean.shape[0]):
            total += information[a, b] * (pose.beta[b] - mean[b])
            blocks.C[a, b] += weight * information[a, b]
        blocks.c[a] += weight * total
        cost += 0.5 * weight * total * (pose.beta[a] - mean[a])
    return cost


def evaluate(part: Part, mean: Array, information: Array, weight: float = 1.0) -> Linearization:
    """Return the residual (P rows) and its derivatives for `mean` (P,) and `information` (P, P),
    positive definite.
    """
    root = np.sqrt(weight) * np.linalg.cholesky(information).T
    n = len(part.beta)
    return Linearization(root @ (part.beta - mean), np.zeros((n, 6)), np.zeros((n, 3)), root)
