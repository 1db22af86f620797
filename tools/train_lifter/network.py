# SPDX-License-Identifier: GPL-3.0-or-later
"""The lifting network and its loss, in PyTorch."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ...scope_addon.capture.perception.landmark_network import KEYPOINT_COUNT
from ...scope_addon.capture.perception.lifter import INPUT_SIZE, WINDOW

WIDTH = 512
BLOCKS = 6
MERGES = 2  # 9 moments, 3, 1
assert 3**MERGES == WINDOW
# The loss of a bone of 0.14 rad error, the mean over all bones, has the same gradient as 2 (1 −
# cos).
DIRECTION_WEIGHT = 0.3
LOG_SIGMA_RANGE = (-5.5, 0.5)  # 4 mm .. 1.6 m
_ARMS = [(11, 13), (13, 15), (12, 14), (14, 16)]
_LEGS = [(23, 25), (25, 27), (24, 26), (26, 28)]
BONES = (*_ARMS, *_LEGS, (11, 12), (23, 24), (11, 23), (12, 24))  # start and end
# of BONES
LIMB_BONES = slice(0, 8)
TRUNK_BONES = slice(10, 12)


class Block(nn.Module):
    """x + W₂ relu(W₁ norm(x))."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.first = nn.Linear(width, width)
        self.second = nn.Linear(width, width)
        nn.init.zeros_(self.second.weight)

    def forward(self, x: Tensor) -> Tensor:
        """Map (n, width) to (n, width)."""
        return x + self.second(torch.relu(self.first(self.norm(x))))


class Merge(nn.Module):
    """Three moments into one: x_middle + W₂ relu(W₁ [norm(x_before), norm(x_middle),
    norm(x_after)]).
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.first = nn.Linear(3 * width, width)
        self.second = nn.Linear(width, width)
        nn.init.zeros_(self.second.weight)

    def forward(self, x: Tensor) -> Tensor:
        """Map (n, 3 m, width) to (n, m, width)."""
        n, moments, width = x.shape
        together = self.norm(x).reshape(n, moments // 3, 3 * width)
        return x[:, 1::3] + self.second(torch.relu(self.first(together)))


class LiftingNetwork(nn.Module):
    """(n, 9, 200) -> points (n, 33, 3) metres and log σ (n, 33, 2), across and along the line of
    sight.

    After VideoPose3D (Pavllo et al., CVPR 2019): a residual network whose convolutions over time,
    three moments wide, shrink the window to its middle; the strided form, since windows do not
    share moments. Differences: layer normalization before each layer instead of batch normalization
    after it, further residual blocks once the window is one moment, and deviations in addition to
    the points.
    """

    def __init__(self, width: int = WIDTH, blocks: int = BLOCKS) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(INPUT_SIZE))
        self.register_buffer("spread", torch.ones(INPUT_SIZE))
        self.register_buffer("sigma_offset", torch.zeros(KEYPOINT_COUNT, 2))
        self.enter = nn.Linear(INPUT_SIZE, width)
        self.merges = nn.Sequential(*(Merge(width) for _ in range(MERGES)))
        self.blocks = nn.Sequential(*(Block(width) for _ in range(blocks)))
        self.norm = nn.LayerNorm(width)
        self.leave = nn.Linear(width, KEYPOINT_COUNT * 5)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Return points and log σ."""
        moments = self.merges(self.enter((x - self.mean) / self.spread))
        out = self.leave(self.norm(self.blocks(moments[:, 0]))).float()
        points = out[:, : KEYPOINT_COUNT * 3]
        log_sigma = out[:, KEYPOINT_COUNT * 3 :]
        log_sigma = log_sigma.reshape(-1, KEYPOINT_COUNT, 2) - 3.0
        return points.reshape(-1, KEYPOINT_COUNT, 3), log_sigma.clamp(
            *LOG_SIGMA_RANGE
        ) + self.sigma_offset


def loss(points: Tensor, log_sigma: Tensor, truth: Tensor) -> Tensor:
    """Return the mean −log of the Laplace density of the error e of a coordinate, and that of
    bones' directions.

    −log p(e) = √2 |e| / σ + log σ (+ const), with one σ for both coordinates across the line of
    sight. The error of a direction is the distance |d − d̂| of two unit vectors, with the weight
    DIRECTION_WEIGHT.

    Both are linear in large errors, so that what the image leaves open is answered by the median of
    what was seen in training, and not by the mean: the mean of many straight knees and a few bent
    ones is a knee that nobody has.
    """
    log_sigma = torch.cat([log_sigma[..., :1], log_sigma], -1)
    likelihood = (2**0.5 * (points - truth).abs() * torch.exp(-log_sigma) + log_sigma).mean()
    between = nn.functional.normalize(bones(points), dim=-1) - nn.functional.normalize(
        bones(truth), dim=-1
    )
    return likelihood + DIRECTION_WEIGHT * between.square().sum(-1).add(1e-6).sqrt().mean()


def bones(points: Tensor) -> Tensor:
    """Return the vectors (n, 12, 3) of bones from start to end, of points (n, 33, 3).

    Slices, since an index tensor would have to be copied to the device, which a CUDA graph cannot
    record.
    """
    return torch.stack([points[:, end] - points[:, start] for start, end in BONES], 1)
