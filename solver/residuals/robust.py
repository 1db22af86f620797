# SPDX-License-Identifier: GPL-3.0-or-later
"""The Geman-McClure kernel, and what it does to a Gauss-Newton term.

    rho(s) = sigma s / (sigma + s),  s = |r|^2        cost 1/2 w rho(s)
With k = sigma / (sigma + s): rho = s k, rho' = k^2, rho''/rho' = -2 k / sigma. The kernels take
1/sigma, so that 0 turns it off. First-order reweighting replaces JᵀJ by k^2 JᵀJ; Triggs' correction
subtracts from it, along r, 4 (s/sigma) k of the part, which for s > sigma/3 would make the term
concave, so it is clamped by `triggs` in [0, 1).
"""

from ..compiled.kernel import kernel


@kernel
def geman_mcclure(s: float, inv_sigma: float) -> tuple[float, float]:
    """Return (rho(s), rho'(s)); s in the square of the residual's unit, sigma likewise."""
    k = 1.0 / (1.0 + s * inv_sigma)
    return s * k, k * k


@kernel
def triggs_share(s: float, inv_sigma: float, triggs: float) -> float:
    """Return kappa >= 0: the second-order term takes rho' (JᵀJ - kappa (Jᵀr)(Jᵀr)ᵀ / s) instead of
    rho' JᵀJ.
    """
    x = s * inv_sigma
    return min(4.0 * x / (1.0 + x), triggs)
