# SPDX-License-Identifier: GPL-3.0-or-later
"""Held-out likelihoods of the prior and the baselines: ``python -m scope.tools.train_prior.report
MOTIONS``.

Prints the table of assets/prior/README.md: mean negative log-likelihood, in nats against the
normalized Haar measure, of the test performers' states as recorded. The baselines are fitted to the
same training performers without blur, each with the better of two weightings of the performers.
Needs no PyTorch.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.untrusted.body_file import load_body
from ...solver.learned_prior import BUILT_IN, JointPrior, load_joint_prior
from .baselines import Density, gaussian, matrix_fisher
from .data import MODELS, TEST, TRUNK, Samples, load_samples, mirrored
from .rotation_statistics import balanced, mean_rotation


@dataclass(frozen=True)
class Row:
    """Mean NLL of one joint under three densities, and of the flow and the Gaussian for each test
    performer.
    """

    joint: str
    flow: float
    gaussian: float
    fisher: float
    by_performer: dict[str, tuple[float, float]]

    @property
    def best(self) -> bool:
        """Return whether the flow has the smallest."""
        return self.flow < min(self.gaussian, self.fisher)


def held_out(prior: JointPrior, samples: dict[str, Samples]) -> list[Row]:
    """Measure every joint that has data. A left and a right joint share their samples, and so their
    row.
    """
    rows = []
    for model in MODELS:
        s = samples[model]
        states = s.rotations[s.is_test]
        group = s.group[s.is_test]
        joint = model if model in TRUNK else f"left_{model}"
        flow = -prior.log_density(joint, states)
        if model not in TRUNK:  # the right joint on the mirror images is the same number
            other = -prior.log_density(f"right_{model}", mirrored(states))
            assert np.allclose(flow, other, atol=1e-6), model
        best = [_better(fit, s, states) for fit in (_fit_gaussian, matrix_fisher)]
        by_performer = {
            g: (float(flow[group == g].mean()), float(best[0][group == g].mean())) for g in TEST
        }
        rows.append(
            Row(
                model,
                float(flow.mean()),
                float(best[0].mean()),
                float(best[1].mean()),
                by_performer,
            )
        )
    return rows


def _fit_gaussian(rotations: NDArray[np.float64], weights: NDArray[np.float64]) -> Density:
    return gaussian(rotations, weights, mean_rotation(rotations, weights))


def _better(
    fit: Callable[[NDArray[np.float64], NDArray[np.float64]], Density],
    s: Samples,
    states: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the NLL (n,) of the test states under the better of the fits with frames equal and
    performers balanced.
    """
    training = s.rotations[s.is_training]
    group = s.group[s.is_training]
    found = [-fit(training, balanced(group, balance))(states) for balance in (0.0, 0.7)]
    return min(found, key=np.mean)


def table(rows: list[Row]) -> str:
    """Return the rows and their mean over joints as Markdown."""
    count = [1 if r.joint in TRUNK else 2 for r in rows]
    lines = [
        "| joint | flow | Gaussian | matrix Fisher | "
        + " | ".join(f"{g}: flow / Gaussian" for g in TEST)
        + " |"
    ]
    lines.append("|---" * (4 + len(TEST)) + "|")
    for r in rows:
        name = r.joint if r.joint in TRUNK else f"left and right {r.joint}"
        performers = " | ".join(f"{a:.2f} / {b:.2f}" for a, b in r.by_performer.values())
        lines.append(
            f"| {name} | {_bold(r.flow, r.best)} | {r.gaussian:.3f} | {r.fisher:.3f} | "
            f"{performers} |"
        )
    mean = [
        np.average([getattr(r, key) for r in rows], weights=count)
        for key in ("flow", "gaussian", "fisher")
    ]
    performers = " | ".join(
        " / ".join(
            f"{np.average([r.by_performer[g][k] for r in rows], weights=count):.2f}" for k in (0, 1)
        )
        for g in TEST
    )
    lines.append(f"| mean of {sum(count)} joints | {_bold(mean[0], mean[0] < min(mean[1:]))} | "
                 f"{mean[1]:.3f} | "
                 f"{mean[2]:.3f} | {performers} |")  # fmt: skip
    won = sum(n for n, r in zip(count, rows, strict=True) if r.best)
    lost = ", ".join(r.joint for r in rows if not r.best) or "none"
    lines.append(f"\nThe flow has the least on {won} of {sum(count)} joints; not on: {lost}.")
    return "\n".join(lines)


def _bold(value: float, best: bool) -> str:
    return f"**{value:.3f}**" if best else f"{value:.3f}"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description="Measure the joint-state prior on performers it has not seen."
    )
    parser.add_argument("motions", type=Path, help="motions.npz of tools/mocap")
    parser.add_argument("--prior", type=Path, default=BUILT_IN, help="(default: %(default)s)")
    arguments = parser.parse_args()
    samples = load_samples(arguments.motions, load_body("scope").joint_names)
    print(table(held_out(load_joint_prior(arguments.prior), samples)))


if __name__ == "__main__":
    main()
