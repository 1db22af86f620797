# SPDX-License-Identifier: GPL-3.0-or-later
"""Train the lifting network: ``python -m scope.tools.train_lifter.train MOTIONS -o assets/lifter``.

AdamW with a cosine schedule; the exponential mean of the weights is exported. Batches are drawn on
the device of the training. On a GPU, products are in bfloat16, and drawing and training run as two
CUDA graphs; on a CPU, products are in single precision unless ``--bfloat16`` is given, with which a
step takes a third of the time on CPUs that multiply bfloat16 themselves (AMX). Every tenth take and
all takes of the joint prior's test performers are held out, to evaluate and to calibrate the
uncertainties. The weights are kept next to the exported network, from which another training can
continue (``--start``), as from an exported network itself.

On the same kind of device, the same arguments give the same batches.
"""

from __future__ import annotations

import argparse
import copy
import json
import math
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch

from ...scope_addon.atomic_write import atomic_path
from ...scope_addon.capture.perception.lifter import MIDDLE
from ...scope_addon.errors import MotionFileError
from ...scope_addon.untrusted.body_file import load_body
from ...solver.body import Body
from .dataset import Batch, Dataset, Variety
from .export import export, read_exported
from .measure import COUNT, calibrate, held_out_batches, measure_all
from .motions import Motions, load_motions
from .network import LiftingNetwork, loss
from .split import training_frames

BATCH = 4096
PEAK_RATE = 1e-3
WARM_UP = 300
DECAY = 0.01
BETAS = (0.9, 0.98)
LARGEST_GRADIENT = 1.0
MEAN_DECAY = 0.9995
CHECKPOINT = "lifter.pt"
NETWORK = "lifter.onnx"
LOG = "log.json"
NORMALIZATION_COUNT = 8192  # windows from which the input's mean and spread are taken
GRAPH_WARM_UP = 3  # runs before a CUDA graph is recorded, in which libraries allocate their memory


@dataclass(frozen=True)
class Settings:
    """A training: ``steps`` batches of ``batch`` windows of ``variety``, drawn from ``seed``;
    highest rate ``rate``; products in bfloat16 or in single precision.
    """

    variety: Variety
    steps: int
    seed: int = 1
    rate: float = PEAK_RATE
    batch: int = BATCH
    bfloat16: bool = False


class Trainer:
    """A network in training, and its batches.

    Everything that a step reads or writes is an attribute: CUDA graphs work on fixed addresses, so
    these tensors must live as long as the graphs.
    """

    def __init__(
        self, body: Body, motions: Motions, settings: Settings, start: Path | None, device: str
    ) -> None:
        torch.manual_seed(settings.seed)
        self.settings = settings
        self.device = device
        self.dataset = Dataset(body, training_frames(motions), settings.variety, device)
        self.network = LiftingNetwork() if start is None else read_weights(start)
        self.network.to(device)
        if start is None:
            x = self.dataset.batch(NORMALIZATION_COUNT).input[:, MIDDLE]
            self.network.mean.copy_(x.mean(0))
            self.network.spread.copy_(x.std(0) + 1e-3)
        self.network.sigma_offset.zero_()
        self.mean = copy.deepcopy(self.network)
        self.parameters, self.mean_parameters = (
            list(self.network.parameters()),
            list(self.mean.parameters()),
        )
        self.rate, self.mean_share, self.total_loss = (
            torch.zeros((), device=device) for _ in range(3)
        )
        self.optimizer = self._optimizer()
        batch = self.dataset.batch(settings.batch)
        self.input = batch.input
        self.points = batch.points
        self._draw, self._step = (
            graphed(self._draw_batch, device),
            graphed(self._train_batch, device),
        )
        self._forget_warm_up()
        # On a CPU, the next batch is drawn beside the training, which keeps a second core busy.
        self._drawing = None if device == "cuda" else ThreadPoolExecutor(1)
        self._ahead = self._draw_ahead(0)

    def _draw_ahead(self, number: int) -> Future[Batch] | None:
        """Begin to draw the batch of step ``number``, if there is one."""
        if self._drawing is None or number >= self.settings.steps:
            return None
        return self._drawing.submit(self.dataset.batch, self.settings.batch)

    def _optimizer(self) -> torch.optim.Optimizer:
        matrices = {"params": [p for p in self.parameters if p.ndim > 1], "weight_decay": DECAY}
        others = {"params": [p for p in self.parameters if p.ndim == 1], "weight_decay": 0.0}
        optimizer = torch.optim.AdamW(
            [matrices, others], self.rate, BETAS, fused=True, capturable=self.device == "cuda"
        )
        for group in optimizer.param_groups:
            group["lr"] = self.rate
        return optimizer

    def _forget_warm_up(self) -> None:
        """Set back what `graphed` changed; with the rate and the mean's share at 0, the weights
        have not changed.
        """
        for state in self.optimizer.state.values():
            for value in state.values():
                value.zero_()
        self.total_loss.zero_()

    def _draw_batch(self) -> None:
        batch = self.dataset.batch(self.settings.batch)
        self.input.copy_(batch.input)
        self.points.copy_(batch.points)

    def _train_batch(self) -> None:
        # Without the cache, whose casts of the weights would not be repeated when a graph is
        # replayed.
        with torch.autocast(
            self.device, torch.bfloat16, enabled=self.settings.bfloat16, cache_enabled=False
        ):
            points, log_sigma = self.network(self.input)
        value = loss(points, log_sigma, self.points)
        value.backward()
        torch.nn.utils.clip_grad_norm_(self.parameters, LARGEST_GRADIENT)
        self.optimizer.step()
        self.optimizer.zero_grad(set_to_none=False)
        with torch.no_grad():
            for mean, parameter in zip(self.mean_parameters, self.parameters, strict=True):
                mean.add_((parameter - mean) * self.mean_share)
            self.total_loss += value.detach()

    def step(self, number: int) -> None:
        """Draw a batch and train on it, as step ``number`` of the training, from 0."""
        self.rate.fill_(self.settings.rate * schedule(number, self.settings.steps))
        self.mean_share.fill_(1 - min(MEAN_DECAY, (number + 1) / (number + 10)))
        if self._ahead is None:
            self._draw()
        else:
            batch = self._ahead.result()
            self._ahead = self._draw_ahead(number + 1)
            self.input = batch.input
            self.points = batch.points
        self._step()

    def take_loss(self) -> float:
        """Return the sum of the losses since the last call."""
        value = self.total_loss.item()
        self.total_loss.zero_()
        return value


def schedule(step: int, steps: int) -> float:
    """Return the factor on the highest rate: it rises over `WARM_UP` steps, and falls as ½ + ½
    cos(π step / steps).
    """
    return min((step + 1) / WARM_UP, 0.5 + 0.5 * math.cos(math.pi * step / steps))


def graphed(work: Callable[[], None], device: str) -> Callable[[], Any]:
    """Return what does the same work as a CUDA graph, on other devices the work itself."""
    if device != "cuda":
        return work
    stream = torch.cuda.Stream()
    stream.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(stream):
        for _ in range(GRAPH_WARM_UP):
            work()
    torch.cuda.current_stream().wait_stream(stream)
    torch.cuda.synchronize()
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        work()
    return graph.replay


def read_weights(path: Path) -> LiftingNetwork:
    """Read a network from the weights of a training (`CHECKPOINT`), or from its export.

    :raises KeyError: a file that ends in .onnx is no lifting network.
    :raises RuntimeError: the weights are those of another network.
    """
    if path.suffix == ".onnx":
        return read_exported(path)
    network = LiftingNetwork()
    network.load_state_dict(torch.load(path, map_location="cpu", weights_only=True))
    return network


def train(
    motions: Motions,
    folder: Path,
    settings: Settings,
    start: Path | None,
    device: str,
    report_every: int = 500,
) -> None:
    """Train, and write weights, network and log into the folder.

    :param start: weights of an earlier training to go on from, or its export;  report_every: steps
        between two rows of the log.
    """
    torch.backends.cuda.matmul.allow_tf32 = True
    body = load_body("scope")
    held_out = held_out_batches(body, motions, device, COUNT)
    trainer = Trainer(body, motions, settings, start, device)
    log: list[dict[str, Any]] = []
    began = time.perf_counter()
    since = 0
    for step in range(settings.steps):
        trainer.step(step)
        since += 1
        if since == report_every or step + 1 == settings.steps:
            row: dict[str, Any] = {"step": step + 1, "s": round(time.perf_counter() - began)}
            row["loss"] = round(trainer.take_loss() / since, 4)
            log.append(row | measure_all(trainer.mean, held_out))
            print(json.dumps(log[-1]), flush=True)
            _save(trainer.mean, folder)
            since = 0
    calibrate(trainer.mean, held_out["augmented"])
    measured = measure_all(trainer.mean, held_out)
    print(json.dumps(measured), flush=True)
    _save(trainer.mean, folder)
    export(trainer.mean.cpu(), folder / NETWORK)
    summary = {**asdict(settings), "start": str(start) if start else None, "device": device}
    with atomic_path(folder / LOG) as temporary:
        temporary.write_text(
            json.dumps(summary | {"held_out": measured, "log": log}, indent=1) + "\n"
        )


def _save(network: LiftingNetwork, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with atomic_path(folder / CHECKPOINT) as temporary:
        torch.save({name: value.cpu() for name, value in network.state_dict().items()}, temporary)


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Train the lifting network.")
    parser.add_argument("motions", type=Path, help="file written by scope.tools.mocap.fit_body")
    parser.add_argument("-o", "--output", type=Path, default=Path("assets/lifter"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=20_800)
    parser.add_argument("--batch", type=int, default=BATCH, help="windows of a step")
    parser.add_argument("--rate", type=float, default=PEAK_RATE, help="the highest learning rate")
    parser.add_argument(
        "--start", type=Path, help="weights of an earlier training to go on from: .pt or .onnx"
    )
    parser.add_argument(
        "--natural", type=float, default=0.6, help="share of samples whose joints are as recorded"
    )
    parser.add_argument(
        "--segments", type=float, default=0.0, help="spread of the lengths of trunk, arms and legs"
    )
    parser.add_argument(
        "--offsets", choices=("none", "random"), default="none", help="the landmark network's"
    )
    parser.add_argument(
        "--bfloat16", action="store_true", help="products in bfloat16, as always on a GPU"
    )
    parser.add_argument(
        "--device", choices=("cuda", "cpu"), default="cuda" if torch.cuda.is_available() else "cpu"
    )
    return parser


def main() -> None:
    """Run the command line."""
    parser = _arguments()
    a = parser.parse_args()
    if a.steps < 1 or a.batch < 1:
        parser.error("--steps and --batch must be at least 1")
    if not 0 <= a.natural <= 1:
        parser.error(f"--natural is a share from 0 to 1, but is {a.natural}")
    if a.start and not a.start.is_file():
        parser.error(
            f"{a.start} does not exist; --start expects the weights or the export of an "
            "earlier training"
        )
    try:
        motions = load_motions(a.motions)
    except MotionFileError as error:
        parser.error(str(error))
    variety = Variety(
        natural_share=a.natural,
        segment_spread=a.segments,
        random_offsets=a.offsets == "random",
        nearest_m=1.5,
        field=(0.6, 0.45),
        any_height_share=0.25,
        rolled_share=0.1,
        focal_spread=0.2,
    )
    settings = Settings(variety, a.steps, a.seed, a.rate, a.batch, a.bfloat16 or a.device == "cuda")
    train(motions, a.output, settings, a.start, a.device)


if __name__ == "__main__":
    main()
