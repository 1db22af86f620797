# SPDX-License-Identifier: Apache-2.0
"""The shape pulled towards a mean: 1/2 w (beta - mean)ᵀ Lambda (beta - mean).

Lambda (P, P) is the identity for the population prior, or an information matrix carried from
earlier frames. As a residual, r = sqrt(w) Lᵀ (beta - mean) with Lambda = L Lᵀ, dr/dbeta = sqrt(w)
Lᵀ. Source: section 3 of the paper (shape prior).
"""

from ..kernel import kernel


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
