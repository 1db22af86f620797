# SPDX-License-Identifier: GPL-3.0-or-later
"""A person of a rendered scene: the body in motion, of any size, in clothes that stand off it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.fitting.rasterizer import vertex_normals
from ...solver import Body
from ...tools.render_sample.truth import LIMBS

Points = NDArray[np.float64]
DENSITY = 1010.0  # kg/m³ of a human body, with air in the lungs
# of the noise that clothes stand off by, and its spatial frequency
CLOTHES_WAVES = 24
CLOTHES_PER_M = 3.0
SIDES = ("left", "right")
LIMB_JOINTS = tuple(f"{side}_{joint}" for joint in LIMBS.values() for side in SIDES)


@dataclass(frozen=True)
class Person:
    """A body in motion. The whole person is ``scale`` times the body of these shape coefficients,
    and so is the way.
    """

    take: str
    rotations: Points  # (T, K+1, 3, 3) joint states, row 0 the root in the world
    trans: Points  # (T, 3) metres in the world, before scaling
    betas: Points  # (P,)
    scale: float
    head_scale: float  # of the head about its joint, in addition: children's heads are larger
    loose_m: float  # the most that clothes stand off the skin
    hair_m: float  # the most that hair stands off
    seed: int  # of clothes and colours

    def __len__(self) -> int:
        return len(self.trans)

    def joints(self, body: Body) -> Points:
        """Return all joints (T, K+1, 3) in the world, metres."""
        joints: Points = (
            self.scale * body.forward_kinematics(self.rotations, self.trans, self.betas)[1]
        )
        return joints

    def limbs(self, body: Body) -> Points:
        """Return the joints ``LIMB_JOINTS`` (T, 12, 3) in the world, metres."""
        return self.joints(body)[:, [body.joint_names.index(name) for name in LIMB_JOINTS]]

    def skin(self, body: Body, frame: int) -> Points:
        """Return the vertices (V, 3) of the skin in one frame, without clothes, in the world,
        metres.
        """
        R, t = body.forward_kinematics(self.rotations[frame], self.trans[frame], self.betas)
        vertices: Points = body.skin(R, t, self.betas)
        head = body.joint_names.index("head")
        share = (body.skin_weights * (body.skin_joints == head)).sum(axis=1)[:, None]
        return self.scale * (vertices + (self.head_scale - 1.0) * share * (vertices - t[head]))

    def dressed(self, body: Body, frame: int, offsets: Points) -> Points:
        """Return the vertices (V, 3) of clothes, hair and bare skin; `offsets` as of the method."""
        skin = self.skin(body, frame)
        return skin + offsets[:, None] * vertex_normals(skin, body.triangles())

    def facing(self) -> Points:
        """Return the horizontal unit vectors (T, 2) to which the pelvis faces."""
        forward = self.rotations[:, 0, :2, 2]
        unit: Points = forward / np.linalg.norm(forward, axis=1, keepdims=True)
        return unit

    def stature_m(self, body: Body) -> float:
        """Return the stature in metres, but for the head's additional size."""
        return self.scale * float(body.stature(self.betas))

    def mass_index(self, body: Body) -> float:
        """Return mass over squared stature, kg/m², of the skin's volume."""
        a, b, c = np.moveaxis(
            (body.v_template + body.shapedirs @ self.betas)[body.triangles()], 1, 0
        )
        volume = float(np.einsum("fi,fi->", a, np.cross(b, c))) / 6.0
        return DENSITY * self.scale * abs(volume) / float(body.stature(self.betas)) ** 2

    def offsets(self, body: Body) -> Points:
        """Return how far clothes and hair stand off each vertex, metres, (V,)."""
        rng = np.random.default_rng(self.seed)
        waves = rng.normal(0.0, 2 * np.pi * CLOTHES_PER_M, (CLOTHES_WAVES, 3))
        phase = rng.uniform(0, 2 * np.pi, CLOTHES_WAVES)
        noise = np.sin(body.v_template @ waves.T + phase).sum(axis=1) / np.sqrt(CLOTHES_WAVES / 2)
        off = np.clip(0.5 + 0.35 * noise, 0.0, 1.0)
        of = {name: _share_of(body, name) for name in ("suit", "suit_accent", "hair")}
        offsets: Points = off * (
            self.loose_m * (of["suit"] + of["suit_accent"]) + self.hair_m * of["hair"]
        )
        return offsets


def _share_of(body: Body, material: str) -> Points:
    """Return which part of the faces around each vertex has a material, (V,)."""
    assert body.face_material is not None
    corners = body.faces.shape[1]
    of = np.repeat(body.face_material == body.material_names.index(material), corners).astype(float)
    counts = np.bincount(body.faces.ravel(), minlength=len(body.v_template))
    share: Points = np.bincount(body.faces.ravel(), of, len(body.v_template)) / np.maximum(
        counts, 1
    )
    return np.where(share < 1.0, 0.0, share)  # the seam with bare skin stays where it is
