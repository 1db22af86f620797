# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure a lifting network in PyTorch on windows of held-out recordings, and calibrate its
standard deviations.
"""

from __future__ import annotations

import torch
from torch import Tensor

from ...scope_addon.capture.perception.lifter import MIDDLE
from ...solver.body import Body
from .dataset import Batch, Dataset, Variety
from .motions import Motions
from .network import LIMB_BONES, TRUNK_BONES, LiftingNetwork, bones
from .split import held_out_frames

# Recombined and rotated limbs before usual cameras, movements as recorded, and wide-angle, near or
# off-centre cameras.
VARIETIES = {
    "augmented": Variety(),
    "as_recorded": Variety(natural_share=1.0, still_share=0.0),
    "wide_cameras": Variety(
        nearest_m=1.2, field=(0.75, 0.5), any_height_share=0.5, focal_spread=0.35
    ),
}
SEED = 99
COUNT = 8192
_AT_ONCE = 2048
# shoulders, elbows, wrists, knees, ankles; the hips' centre is the origin
_LIMBS = [*range(11, 17), *range(25, 29)]
_KNOWN = -2  # of the input: whether there are world landmarks


def held_out_batches(
    body: Body, motions: Motions, device: str, count: int = COUNT
) -> dict[str, Batch]:
    """Draw ``count`` windows of the held-out frames in each of the `VARIETIES`; sets the device's
    generator.
    """
    held_out = held_out_frames(motions)
    batches = {}
    for name, variety in VARIETIES.items():
        torch.manual_seed(SEED)
        batches[name] = Dataset(body, held_out, variety, device).batch(count)
    return batches


@torch.no_grad()
def run(network: LiftingNetwork, x: Tensor) -> tuple[Tensor, Tensor]:
    """Return points (n, 33, 3) and log σ (n, 33, 2) of windows (n, WINDOW, 200), in single
    precision.
    """
    parts = [network(part) for part in x.split(_AT_ONCE)]
    points, log_sigma = (torch.cat(part) for part in zip(*parts, strict=True))
    return points, log_sigma


def measure(network: LiftingNetwork, batch: Batch) -> dict[str, float]:
    """Return mean errors of limbs' keypoints, mm, mean angles of bones, degrees, and deviations of
    error over σ.

    Errors are those of windows with and without world landmarks; angles those between the bones and
    the true ones, of all windows; the deviations across and along the line of sight are 1 where the
    network states them rightly.
    """
    points, log_sigma = run(network, batch.input)
    error = points - batch.points
    limbs = 1000 * error.norm(dim=-1)[:, _LIMBS].mean(1)
    known = batch.input[:, MIDDLE, _KNOWN] > 0.5
    cosine = torch.nn.functional.cosine_similarity(bones(points), bones(batch.points), dim=-1)
    angle = torch.rad2deg(torch.acos(cosine.clamp(-1, 1)))
    sigma = torch.exp(log_sigma)
    return {
        "with_world_mm": limbs[known].mean().item(),
        "without_world_mm": limbs[~known].mean().item(),
        "limb_deg": angle[:, LIMB_BONES].mean().item(),
        "trunk_deg": angle[:, TRUNK_BONES].mean().item(),
        "deviation_across": (error[..., :2] / sigma[..., :1]).std().item(),
        "deviation_along": (error[..., 2] / sigma[..., 1]).std().item(),
    }


def measure_all(network: LiftingNetwork, batches: dict[str, Batch]) -> dict[str, dict[str, float]]:
    """Return `measure` of each batch, rounded."""
    return {
        name: {k: round(v, 2) for k, v in measure(network, b).items()}
        for name, b in batches.items()
    }


@torch.no_grad()
def calibrate(network: LiftingNetwork, batch: Batch) -> None:
    """Shift each keypoint's log σ so that its errors over σ have unit variance (of 99 % of them) on
    the batch.
    """
    network.sigma_offset.zero_()
    points, log_sigma = run(network, batch.input)
    z = (points - batch.points).abs() / torch.exp(torch.cat([log_sigma[..., :1], log_sigma], -1))
    for k, axes in enumerate((slice(0, 2), slice(2, 3))):
        part = z[..., axes].transpose(0, 1).flatten(1)
        part = torch.minimum(part, torch.quantile(part, 0.99, dim=1, keepdim=True))
        network.sigma_offset[:, k] = part.square().mean(1).sqrt().log()
