# SPDX-License-Identifier: GPL-3.0-or-later
"""Train the joint-state prior: ``python -m scope.tools.train_prior.train build/mocap/motions.npz``.

Maximum likelihood on the training performers. Each model's blur of samples, regularization of its
nonlinear part and number of steps are chosen by leaving performers out in turn; then one flow for
each model is trained on all of them. Only report.py uses the test performers.
"""

from __future__ import annotations

import argparse
import itertools
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from ...scope_addon.untrusted.body_file import load_body
from ...solver.learned_prior import BUILT_IN
from .data import FOLDS, MODELS, Samples, load_samples
from .export import by_joint, save
from .flow import Flow, chart
from .rotation_statistics import balanced, blurred, mean_rotation

SEED = 0
LAYERS = 4
HIDDEN = 4
# degrees: fits of recordings with one axis scatter by 0.3; 3 hides a performer's habits
BLURS = (0.3, 1.0, 3.0)
PENALTIES = (0.05, 0.5)  # penalty on the squares of the parameters that make a layer nonlinear
STEPS = 800
BATCH = 256
LEARNING_RATE = 3e-3
EVALUATE_EVERY = 50
AVERAGE = 0.98  # of the parameters over steps
# degrees of blur of a few samples, which gives every density some tail
FAR = 10.0
FAR_SHARE = 0.005
BALANCE = 0.7  # a performer of n samples counts as n^(1 - BALANCE)
CONDITIONERS = ("out2", "out3", "bias2", "bias3", "beta")


@dataclass(frozen=True)
class Candidate:
    """Hyperparameters of one model."""

    model: str
    blur: float  # degrees
    penalty: float


@dataclass(frozen=True)
class Choice:
    """The best hyperparameters and number of steps of a model, and their result on the performers
    left out.
    """

    candidate: Candidate
    step: int
    nll: float  # nats


def train(
    candidates: list[Candidate], samples: dict[str, Samples], left_out: tuple[str, ...]
) -> Iterator[tuple[int, Flow]]:
    """Train one flow for each candidate, without the performers ``left_out``, and yield (step,
    averaged flow).
    """
    rng = np.random.default_rng(SEED)
    training = {}
    chances = {}
    for model in {c.model: None for c in candidates}:
        used = samples[model].is_training & ~np.isin(samples[model].group, left_out)
        training[model] = samples[model].rotations[used]
        chances[model] = balanced(samples[model].group[used], BALANCE)
    means = {m: mean_rotation(training[m], chances[m]) for m in training}
    cumulative = {m: np.cumsum(p) for m, p in chances.items()}
    blur = np.array([c.blur for c in candidates])[:, None]
    penalty = torch.tensor([c.penalty for c in candidates])

    def batch(n: int) -> torch.Tensor:
        rotations = np.empty((len(candidates), n, 3, 3))
        for k, c in enumerate(candidates):
            rows = np.searchsorted(cumulative[c.model], rng.random(n))
            rotations[k] = training[c.model][np.minimum(rows, len(training[c.model]) - 1)]
        degrees = np.where(rng.random(rotations.shape[:2]) < FAR_SHARE, np.maximum(FAR, blur), blur)
        return torch.tensor(blurred(rotations, degrees, rng), dtype=torch.float32)

    flow = Flow(
        torch.tensor(np.array([means[c.model] for c in candidates]), dtype=torch.float32),
        LAYERS,
        HIDDEN,
        SEED,
    )
    with torch.no_grad():
        flow.whiten(chart(batch(4096), flow.means[:, None])[0])
    averaging = torch.optim.swa_utils.get_ema_multi_avg_fn(AVERAGE)
    average = torch.optim.swa_utils.AveragedModel(flow, multi_avg_fn=averaging)
    optimizer = torch.optim.Adam(flow.parameters(), LEARNING_RATE)
    for step in range(1, STEPS + 1):
        rate = (
            LEARNING_RATE
            * min(1.0, step / 50)
            * 0.5
            * (1.0 + math.cos(math.pi * step / (STEPS + 1)))
        )
        optimizer.param_groups[0]["lr"] = rate
        nll = -flow.log_likelihood(batch(BATCH)).mean(1)
        held_back = sum((getattr(flow, name) ** 2).flatten(1).sum(1) for name in CONDITIONERS)
        optimizer.zero_grad()
        (nll + penalty * held_back).sum().backward()
        torch.nn.utils.clip_grad_norm_(flow.parameters(), 100.0)
        optimizer.step()
        average.update_parameters(flow)
        if step % EVALUATE_EVERY == 0:
            yield step, average.module


def choose(samples: dict[str, Samples]) -> dict[str, Choice]:
    """Return the best candidate and step of every model: the least NLL of performers left out, mean
    over folds.
    """
    candidates = [Candidate(*c) for c in itertools.product(samples, BLURS, PENALTIES)]
    total = np.zeros((STEPS // EVALUATE_EVERY, len(candidates)))
    start = time.perf_counter()
    for fold in FOLDS:
        held_out, share = _held_out(samples, candidates, fold)
        for row, (_, flow) in enumerate(train(candidates, samples, fold)):
            with torch.no_grad():
                total[row] -= (flow.log_likelihood(held_out) * share).sum(1).numpy() / len(FOLDS)
        print(f"without {', '.join(fold)}: {time.perf_counter() - start:.0f} s", flush=True)
    choices = {}
    for model in samples:
        of_model = np.array([c.model == model for c in candidates])
        best = np.unravel_index(np.where(of_model, total, np.inf).argmin(), total.shape)
        choices[model] = Choice(
            candidates[int(best[1])], (int(best[0]) + 1) * EVALUATE_EVERY, float(total[best])
        )
    return choices


def _held_out(
    samples: dict[str, Samples], candidates: list[Candidate], fold: tuple[str, ...]
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return every second rotation of a fold (candidates, n, 3, 3), not blurred, and weights
    (candidates, n).
    """
    chosen = {
        c.model: np.flatnonzero(np.isin(samples[c.model].group, fold))[::2] for c in candidates
    }
    n = max(len(rows) for rows in chosen.values())
    rotations = np.tile(np.eye(3), (len(candidates), n, 1, 1))
    share = np.zeros((len(candidates), n))
    for k, c in enumerate(candidates):
        rows = chosen[c.model]
        rotations[k, : len(rows)] = samples[c.model].rotations[rows]
        share[k, : len(rows)] = balanced(samples[c.model].group[rows], 1.0)
    return torch.tensor(rotations, dtype=torch.float32), torch.tensor(share, dtype=torch.float32)


def train_all(
    samples: dict[str, Samples], choices: dict[str, Choice]
) -> dict[str, dict[str, NDArray[np.float64]]]:
    """Return the parameters of every model, trained on all training performers."""
    models = list(choices)
    parameters = {}
    for step, flow in train([choices[m].candidate for m in models], samples, ()):
        parameters.update({m: flow.row(k) for k, m in enumerate(models) if choices[m].step == step})
    return parameters


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Train the joint-state prior.")
    parser.add_argument("motions", type=Path, help="motions.npz of tools/mocap")
    parser.add_argument(
        "-o", "--output", type=Path, default=BUILT_IN, help="(default: %(default)s)"
    )
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(SEED)
    names = load_body("scope").joint_names
    samples = load_samples(arguments.motions, names)
    choices = choose(samples)
    for model in MODELS:
        c = choices[model]
        print(f"{model:9s} blur {c.candidate.blur:.1f} degrees, penalty {c.candidate.penalty}, "
              f"{c.step} steps: "
              f"{c.nll:.3f} nats on performers left out")  # fmt: skip
    save(arguments.output, by_joint(train_all(samples, choices), samples), names)
    print(f"{arguments.output}: {arguments.output.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
