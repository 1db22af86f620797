# SPDX-License-Identifier: GPL-3.0-or-later
"""A person over time, captured or true: named points in one frame of reference, the camera's or the
world's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.motion import Motion
from ...solver.body import Body
from ...solver.rotations import exp
from .joint_sets import REGRESSED17, on_body

SMPL_VERTICES = 6890
SMPL_FEET = (3216, 3387, 6617, 6787)  # left toe and heel, right toe and heel, of WHAM's evaluation
_FEET = ("left_foot_index", "left_heel", "right_foot_index", "right_heel")
_BLOCK = 64  # frames whose vertices are held at once


@dataclass(frozen=True)
class MeasuredJoints:
    """Joints that were measured, by markers for instance: names and positions (T, J, 3), metres."""

    names: tuple[str, ...]
    positions: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.positions)

    def joints(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the named joints, (T, J, 3).

        :raises KeyError: one of them was not measured.
        """
        at = {name: k for k, name in enumerate(self.names)}
        return self.positions[:, [at[name] for name in names]]

    def select(self, rows: NDArray[np.integer]) -> MeasuredJoints:
        """Return the frames `rows` (n,) alone."""
        return replace(self, positions=self.positions[rows])


@dataclass(frozen=True)
class PosedBody:
    """A body with one shape, posed in T frames.

    ``rotations`` (T, K+1, 3, 3): the root into the frame of reference, the others relative to their
    parents; ``root`` (T, 3): position of the root joint, metres; ``betas`` (P,); ``regressor`` (17,
    V) or None: gives the joints of `REGRESSED17` from the vertices.
    """

    body: Body
    betas: NDArray[np.float64]
    rotations: NDArray[np.float64]
    root: NDArray[np.float64]
    regressor: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.root)

    @classmethod
    def of_motion(
        cls,
        body: Body,
        motion: Motion,
        regressor: NDArray[np.float64] | None = None,
        in_world: bool = False,
    ) -> PosedBody:
        """Return a captured person, in the axes of each frame's camera or in the world.

        :param regressor: (17, V), if its V is the body's; see the class.
        """
        betas = motion.betas.astype(float)
        rotations = exp(motion.poses.reshape(len(motion), -1, 3).astype(float))
        root = body.rest_joints(betas)[0] + motion.trans.astype(float)
        posed = cls(body, betas, rotations, root, regressor)
        return posed if in_world else posed.moved(np.linalg.inv(motion.world_from_camera))

    def moved(self, T: NDArray[np.float64]) -> PosedBody:
        """Return the person in another frame of reference; T (T, 4, 4) or (4, 4) rigid
        transforms.
        """
        R = T[..., :3, :3]
        t = T[..., :3, 3]
        rotations = self.rotations.copy()
        rotations[:, 0] = R @ rotations[:, 0]
        return replace(
            self, rotations=rotations, root=np.einsum("...ij,...j->...i", R, self.root) + t
        )

    def select(self, rows: NDArray[np.integer]) -> PosedBody:
        """Return the frames `rows` (n,) alone."""
        return replace(self, rotations=self.rotations[rows], root=self.root[rows])

    @property
    def has_smpl_mesh(self) -> bool:
        """Whether the vertices are SMPL's, which others' figures of the mesh are about."""
        return len(self.body.v_template) == SMPL_VERTICES

    def joints(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the named joints, (T, J, 3): by the regressor if there is one for them, else those
        of the skeleton.

        :raises KeyError: the body has no such joint.
        """
        if self.regressor is not None and set(names) <= set(REGRESSED17):
            matrix = self.regressor[[REGRESSED17.index(name) for name in names]]
            return np.concatenate(
                [np.zeros((0, len(names), 3)), *(matrix @ v for v in self.vertex_blocks())]
            )
        parts, offsets = on_body(self.body, tuple(names), self.betas)
        R, t = self._parts(slice(None))
        points: NDArray[np.float64] = np.einsum("tjab,jb->tja", R[:, parts], offsets) + t[:, parts]
        return points

    def vertex_blocks(self) -> Iterator[NDArray[np.float64]]:
        """Yield the vertices of some frames at a time, (n, V, 3), by linear blend skinning without
        correctives.
        """
        for start in range(0, len(self), _BLOCK):
            R, t = self._parts(slice(start, start + _BLOCK))
            yield np.stack([self.body.skin(R[k], t[k], self.betas) for k in range(len(R))])

    def feet(self) -> NDArray[np.float64]:
        """Return points under toes and heels, (T, 4, 3): four vertices of SMPL's mesh, or a body's
        own keypoints.
        """
        if self.has_smpl_mesh:
            return np.concatenate(
                [np.zeros((0, 4, 3)), *(v[:, SMPL_FEET] for v in self.vertex_blocks())]
            )
        at = self.body.keypoint_set("blazepose")
        R, t = self._parts(slice(None))
        return self.body.keypoints(R, t, self.betas, [at[name] for name in _FEET])

    def _parts(self, rows: slice) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        trans = self.root[rows] - self.body.rest_joints(self.betas)[0]
        return self.body.forward_kinematics(self.rotations[rows], trans, self.betas)


Subject = MeasuredJoints | PosedBody
