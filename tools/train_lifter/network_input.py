# SPDX-License-Identifier: GPL-3.0-or-later
"""The lifting network's input, as `capture.perception.lifter` defines it, in PyTorch, for windows
of moments.
"""

from __future__ import annotations

import torch
from torch import Tensor

from ...scope_addon.capture.perception.lifter import WORLD_UNIT_M


def hip_center(points: Tensor) -> Tensor:
    """Return the mean of both hips (..., 1, D) of keypoints (..., 33, D)."""
    return points[..., 23:25, :].mean(-2, keepdim=True)


def virtual_camera(rays: Tensor) -> Tensor:
    """Return R_virtual_camera (..., 3, 3) for normalized image coordinates (..., 33, 2)."""
    center = torch.cat([rays[..., 11:13, :], rays[..., 23:25, :]], -2).mean(-2)
    z = torch.cat([center, torch.ones_like(center[..., :1])], -1)
    z = z / z.norm(dim=-1, keepdim=True)
    x = torch.stack([z[..., 2], torch.zeros_like(z[..., 0]), -z[..., 0]], -1)
    x = x / x.norm(dim=-1, keepdim=True)
    return torch.stack([x, torch.linalg.cross(z, x), z], -2)


def person_size(image_points: Tensor) -> Tensor:
    """Return the person's size s (...,) of points (..., 33, 2), in the points' unit."""
    limbs = torch.cat(
        [image_points[..., :1, :], image_points[..., 11:17, :], image_points[..., 23:29, :]], -2
    )
    square = (limbs - limbs.mean(-2, keepdim=True)).square().sum(-1).mean(-1)
    return square.sqrt().clamp(min=1e-4)


def network_input(
    rays: Tensor, confidence: Tensor, world: Tensor, known: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the network's input (..., 200) and R_virtual_camera (..., 3, 3).

    :param rays: (..., 33, 2) normalized image coordinates;  confidence: (..., 33), 0..1;  world:
        (..., 33, 3) metres, camera axes, hip centre at 0;  known: (...,) 1 where the world
        landmarks are used, else 0.
    """
    R = virtual_camera(rays)
    view = rays @ R[..., :2].transpose(-1, -2) + R[..., None, :, 2]
    u = view[..., :2] / view[..., 2:].clamp(min=0.1)
    s = person_size(u)[..., None]
    known = known[..., None]
    parts = [
        (u.flatten(-2) / s).clamp(-6.0, 6.0),
        confidence,
        world.flatten(-2) / WORLD_UNIT_M * known,
        known,
        s.log(),
    ]
    return torch.cat(parts, -1), R
