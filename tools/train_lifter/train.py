# SPDX-License-Identifier: GPL-3.0-or-later
"""Train the lifting network: ``python -m scope.tools.train_lifter.train MOTIONS PAIRS -o assets/lifter``.

AdamW with a cosine schedule in bfloat16; the exponential mean of the weights is exported. Every tenth take is held out,
to evaluate and to calibrate the uncertainties; the landmark network's renders only evaluate. The weights are kept next
to the exported network, from which another training can continue (``--start``), as from an exported network itself.
"""

from __future__ import annotations

import argparse
import copy
import json
import math
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import asdict, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ...scope_addon.capture.perception.lifter import HIPS, network_input
from ...scope_addon.capture.perception.lifter_window import MIDDLE, WINDOW
from ...solver.loaders.body_file import load_body
from .augment import load_motions
from .dataset import USUAL, WIDE, Batch, Dataset, Variety
from .export import export, read_exported
from .network import LiftingNetwork, loss
from .pairs import load_pairs
from .split import held_out_frames, training_frames

BATCH = 1024
PEAK_RATE, WARM_UP, DECAY = 1e-3, 200, 0.01
MEAN_DECAY = 0.997
CHECKPOINT = "lifter.pt"
AHEAD = 16  # batches made before they are needed
_TRAINING, _VALIDATION = 0, 1  # first number of a batch's seed

_dataset: Dataset | None = None


def _start(motions: Path, variety: Variety) -> None:
    global _dataset
    _dataset = Dataset(load_body("scope"), training_frames(load_motions(motions)), variety)


def _make(seed: tuple[int, ...]) -> Batch:
    assert _dataset is not None
    return _dataset.batch(seed, BATCH)


def batches(motions: Path, variety: Variety, seed: int, steps: int, workers: int) -> Iterator[Batch]:
    """Yield the batches of a training, in an order that does not depend on the number of processes."""
    with get_context("spawn").Pool(workers, _start, (motions, variety)) as pool:
        waiting = deque(pool.apply_async(_make, ((_TRAINING, seed, k),)) for k in range(min(AHEAD, steps)))
        for k in range(len(waiting), steps + len(waiting)):
            yield waiting.popleft().get()
            if k < steps:
                waiting.append(pool.apply_async(_make, ((_TRAINING, seed, k),)))


def held_out_batch(motions: Path, variety: Variety, n: int = 8192) -> Batch:
    """Return samples of the held-out takes."""
    return Dataset(load_body("scope"), held_out_frames(load_motions(motions)), variety).batch((_VALIDATION, 0), n)


def renders(pairs: Path) -> Batch:
    """Return the landmark network's output on rendered stills of the default body, with known world landmarks."""
    points, rays, confidence, world = load_pairs(pairs)
    x, R = network_input(rays, confidence, world, np.ones(len(rays)))
    relative = points - points[:, HIPS].mean(axis=1, keepdims=True)
    windows = np.repeat(x.astype(np.float32)[:, None], WINDOW, axis=1)
    return Batch(windows, (relative @ np.swapaxes(R, 1, 2)).astype(np.float32))


@torch.no_grad()
def measure(network: LiftingNetwork, batch: Batch) -> dict[str, Any]:
    """Return errors in mm, and the standard deviation of error over σ across and along the line of sight."""
    points, log_sigma = network(torch.from_numpy(batch.input))
    error = (points - torch.from_numpy(batch.points)).numpy()
    z = error / np.exp(log_sigma.numpy())[..., [0, 0, 1]]
    limbs = np.linalg.norm(error, axis=-1)[:, [11, 12, 13, 14, 15, 16, 25, 26, 27, 28]]
    known = batch.input[:, MIDDLE, -2] > 0.5
    result = {
        "mpjpe_with_world_mm": float(1000 * limbs[known].mean()),
        "depth_rms_mm": float(1000 * np.sqrt(np.square(error[..., 2]).mean())),
        "deviation_across": float(z[..., :2].std()),
        "deviation_along": float(z[..., 2].std()),
    }
    if not known.all():
        result["mpjpe_without_world_mm"] = float(1000 * limbs[~known].mean())
    return result


@torch.no_grad()
def calibrate(network: LiftingNetwork, batch: Batch) -> None:
    """Shift each keypoint's log σ so that its errors over σ have unit variance (of 99 % of them) on the batch."""
    network.sigma_offset.zero_()
    points, log_sigma = network(torch.from_numpy(batch.input))
    error = (points - torch.from_numpy(batch.points)).numpy()
    z = np.abs(error / np.exp(log_sigma.numpy())[..., [0, 0, 1]])
    for k, axes in enumerate(([0, 1], [2])):
        part = np.moveaxis(z[..., axes], 1, 0).reshape(z.shape[1], -1)
        part = np.minimum(part, np.quantile(part, 0.99, axis=1, keepdims=True))
        network.sigma_offset[:, k] = torch.from_numpy(np.log(np.sqrt(np.square(part).mean(axis=1))).astype(np.float32))


def _weights(path: Path) -> dict[str, Any]:
    """Read the weights of a training (`CHECKPOINT`), or of an exported network."""
    if path.suffix == ".onnx":
        return read_exported(path).state_dict()
    weights: dict[str, Any] = torch.load(path, weights_only=True)
    return weights


def train(
    motions: Path,
    pairs: Path,
    folder: Path,
    seed: int,
    steps: int,
    workers: int,
    minutes: float,
    rate: float = PEAK_RATE,
    start_from: Path | None = None,
    variety: Variety = USUAL,
) -> None:
    """Train and export. The schedule follows the steps or the time, ``minutes``, whichever ends first.

    :param rate: the highest learning rate;  start_from: weights of an earlier training (`CHECKPOINT`), or its export;
        variety: of the training and the held-out data.
    """
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    validation = held_out_batch(motions, variety)
    rendered = renders(pairs)
    network = LiftingNetwork()
    x = torch.from_numpy(validation.input[:, MIDDLE])
    network.mean.copy_(x.mean(0))
    network.spread.copy_(x.std(0) + 1e-3)
    if start_from:
        network.load_state_dict(_weights(start_from))
        network.sigma_offset.zero_()
    mean = copy.deepcopy(network)
    matrices = {"params": [p for p in network.parameters() if p.ndim > 1], "weight_decay": DECAY}
    others = {"params": [p for p in network.parameters() if p.ndim == 1], "weight_decay": 0.0}
    optimizer = torch.optim.AdamW([matrices, others], rate, (0.9, 0.98))
    log: list[dict[str, Any]] = []
    start, total = time.perf_counter(), 0.0
    for step, batch in enumerate(batches(motions, variety, seed, steps, workers)):
        done = max(step / steps, (time.perf_counter() - start) / (60 * minutes))
        if done >= 1:
            break
        for group in optimizer.param_groups:
            group["lr"] = rate * min((step + 1) / WARM_UP, 0.5 + 0.5 * math.cos(math.pi * done))
        with torch.autocast("cpu", torch.bfloat16):
            points, log_sigma = network(torch.from_numpy(batch.input))
        value = loss(points, log_sigma, torch.from_numpy(batch.points))
        optimizer.zero_grad(set_to_none=True)
        value.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        decay = min(MEAN_DECAY, (step + 1) / (step + 10))
        with torch.no_grad():
            for a, b in zip(mean.parameters(), network.parameters(), strict=True):
                a.lerp_(b, 1 - decay)
        total += value.item()
        if (step + 1) % 500 == 0:
            row = {"step": step + 1, "s": round(time.perf_counter() - start), "loss": total / 500}
            row |= measure(mean, validation)
            row["mpjpe_renders_mm"] = measure(mean, rendered)["mpjpe_with_world_mm"]
            total = 0.0
            log.append({k: round(v, 4) for k, v in row.items()})
            print(json.dumps(log[-1]), flush=True)
            folder.mkdir(parents=True, exist_ok=True)
            torch.save(mean.state_dict(), folder / CHECKPOINT)
    calibrate(mean, validation)
    measured = {"held_out": measure(mean, validation), "renders": measure(mean, rendered)}
    settings = {"seed": seed, "steps": step, "rate": rate, "batch": BATCH, "variety": asdict(variety)}
    summary = {**settings, **measured, "log": log}
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "log.json").write_text(json.dumps(summary, indent=1) + "\n")
    export(mean, folder / "lifter.onnx")
    print(json.dumps(measured))


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Train the lifting network.")
    parser.add_argument("motions", type=Path, help="file written by scope.tools.mocap.fit_body")
    parser.add_argument("pairs", type=Path, help="file written by scope.tools.train_lifter.render_pairs")
    parser.add_argument("-o", "--output", type=Path, default=Path("assets/lifter"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=6000)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rate", type=float, default=PEAK_RATE, help="the highest learning rate")
    parser.add_argument("--start", type=Path, help="weights of an earlier training to go on from: .pt or .onnx")
    parser.add_argument("--wide", action="store_true", help="more cameras, focal lengths and hanging arms")
    parser.add_argument("--no-offsets", action="store_true", help="without the landmark network's keypoint offsets")
    a = parser.parse_args()
    variety = replace(WIDE if a.wide else USUAL, mean_offsets=not a.no_offsets)
    train(a.motions, a.pairs, a.output, a.seed, a.steps, a.workers, a.minutes, a.rate, a.start, variety)


if __name__ == "__main__":
    main()
