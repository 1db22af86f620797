# SPDX-License-Identifier: Apache-2.0
"""The body model: a kinematic tree with shape, a skinned mesh, and keypoints rigidly attached to
body parts.

    J(β)   = J̄ + J_s β                         rest joints in the model frame (SMPL: y up, facing
                                                +z), metres
    T_0    = (R_0, J_0(β) + trans)              pose of the root part; trans as SMPL means it
    T_i    = T_par · (Ω_i, J_i(β) − J_par(β))   relative pose (Ω_i, S_i β + l_i), Ω_i the state of
                                                joint i
    v      = Σ_k w_vk T_k · (v̄(β) − J_k(β))     linear blend skinning
    p_j    = R_i (V_j β + v̄_j) + t_i            keypoint j on part i (the paper's Assumption 1)

Files are read by ``body_file.load_body``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import as_array, as_arrays, as_integers, described
from .errors import InvalidValueError, ModelFileError, ShapeError
from .part import Array

_ROTATION_TOLERANCE = 0.03  # matrices rounded to two decimals are off by up to 0.02


@dataclass(frozen=True)
class Body:
    """A body model. All lengths in metres, in the model frame, at zero pose.

    Shapes: K+1 parts, P shape coefficients, V vertices, F quads (or triangles), M keypoints.
    """

    name: str
    joint_names: tuple[str, ...]
    parents: NDArray[np.int32]  # (K+1,) int32, −1 for the root, par(i) < i
    J_template: Array  # (K+1, 3)
    J_shapedirs: Array  # (K+1, 3, P)
    v_template: Array  # (V, 3)
    shapedirs: Array  # (V, 3, P)
    skin_joints: NDArray[np.integer[Any]]  # (V, 4) int
    skin_weights: Array  # (V, 4)
    faces: NDArray[np.int32]  # (F, 4) int32, or (F, 3)
    keypoint_names: tuple[str, ...] = ()
    # (M,)
    keypoint_part: NDArray[np.integer[Any]] = field(default_factory=lambda: np.zeros(0, np.int32))
    keypoint_template: Array = field(default_factory=lambda: np.zeros((0, 3)))  # (M, 3)
    keypoint_shapedirs: Array = field(default_factory=lambda: np.zeros((0, 3, 0)))  # (M, 3, P)
    uv: Array | None = None  # (U, 2)
    uv_faces: NDArray[np.integer[Any]] | None = None  # as faces, into uv
    face_material: NDArray[np.integer[Any]] | None = None  # (F,), into material_names
    material_names: tuple[str, ...] = ()
    material_colors: Array | None = None  # (C, 4) linear RGBA
    license: str = ""
    gender: str = "neutral"
    file: str = ""  # of the user's, absolute; empty for a built-in body

    def __repr__(self) -> str:
        """Return name and sizes, not its arrays, which would fill a thousand lines of a
        notebook.
        """
        sizes = f"K={self.K}, P={self.P}, V={len(self.v_template)}, M={len(self.keypoint_names)}"
        return f"Body({self.name!r}, {sizes})"

    @property
    def K(self) -> int:
        """Number of rotational joints (parts without the root)."""
        return len(self.parents) - 1

    @property
    def P(self) -> int:
        """Number of shape coefficients."""
        return int(self.J_shapedirs.shape[2])

    @cached_property
    def S(self) -> Array:
        """(K+1, 3, P) shape derivative of each joint's offset from its parent; the root's is J_s of
        the root.
        """
        return self._minus_parent(self.J_shapedirs)

    @cached_property
    def l(self) -> Array:  # noqa: E743 - the paper's symbol
        """(K+1, 3) offset of each joint from its parent at β = 0; the root's is its rest
        position.
        """
        return self._minus_parent(self.J_template)

    @cached_property
    def V(self) -> Array:
        """(M, 3, P) V_j: shape derivative of keypoint j relative to its part's joint."""
        V: Array = self.keypoint_shapedirs - self.J_shapedirs[self.keypoint_part]
        return V

    @cached_property
    def v_bar(self) -> Array:
        """(M, 3) v̄_j: keypoint j relative to its part's joint at β = 0."""
        v_bar: Array = self.keypoint_template - self.J_template[self.keypoint_part]
        return v_bar

    @cached_property
    def strongest_joints(self) -> Array:
        """(V,) the joint that moves each vertex most."""
        rows = np.arange(len(self.skin_joints))
        joints: Array = self.skin_joints[rows, self.skin_weights.argmax(axis=1)]
        return joints

    def _minus_parent(self, rest: Array) -> Array:
        out = rest.copy()
        out[1:] -= rest[self.parents[1:]]
        return out

    def point(self, name: str) -> int:
        """Return the number of a point in measurements: of a keypoint, such as ``coco/nose``, or of
        a joint, such as ``left_wrist``, which is M + its number.

        :raises InvalidValueError: the body has no point of that name.
        """
        return number_of(numbers_of(self), name)

    def keypoint_set(self, prefix: str) -> dict[str, int]:
        """Return the keypoints of one set, e.g. ``blazepose``: name without the prefix -> index, in
        file order.

        :raises ModelFileError: the body has no keypoints of that name.
        :raises InvalidValueError: the name is not a string.
        """
        if not isinstance(prefix, str):
            raise InvalidValueError(
                f"prefix must be a name such as 'coco', but is {described(prefix)}."
            )
        found = {
            n.split("/", 1)[1]: i
            for i, n in enumerate(self.keypoint_names)
            if n.startswith(prefix + "/")
        }
        if not found:
            sets = sorted({n.split("/", 1)[0] for n in self.keypoint_names})
            raise ModelFileError(
                f"body '{self.name}' has no keypoints '{prefix}'; it has "
                f"{', '.join(sets) or 'none'}"
            )
        return found

    def rest_joints(self, betas: Array | None = None) -> Array:
        """J(β): (K+1, 3) metres, model frame.

        :param betas: (P,); zeros if None.
        :raises ShapeError: betas have another shape.
        """
        return self._shaped(self.J_template, self.J_shapedirs, betas)

    def rest_vertices(self, betas: Array | None = None) -> Array:
        """v̄(β): (V, 3) metres, model frame.

        :param betas: (P,); zeros if None.
        :raises ShapeError: betas have another shape.
        """
        return self._shaped(self.v_template, self.shapedirs, betas)

    def stature(self, betas: Array | None = None) -> float:
        """Return the height of a person standing upright: from the lowest to the highest vertex of
        v̄(β), metres.

        :param betas: (P,); zeros if None.
        :raises ShapeError: betas have another shape.
        """
        return float(np.ptp(self.rest_vertices(betas)[:, 1]))

    def _shaped(self, rest: Array, directions: Array, betas: Array | None) -> Array:
        """Return points (n, 3), at rest at β = 0, which move along directions (n, 3, P)."""
        if betas is None:
            return rest
        moved: Array = rest + directions @ as_array(
            betas, (self.P,), f"betas of body '{self.name}'"
        )
        return moved

    def forward_kinematics(
        self, rotations: Array, trans: Array, betas: Array | None = None
    ) -> tuple[Array, Array]:
        """Return the pose of every part.

        :param rotations: (..., K+1, 3, 3); row 0 the root's rotation into the target frame, the
            others Ω_i.
        :param trans: (3,), or one row for each frame (..., 3): metres, target frame; the root joint
            comes to lie at J_0(β) + trans.
        :param betas: (P,); zeros if None.
        :return: R (..., K+1, 3, 3) and t (..., K+1, 3): part to target frame; t are the joints.
        :raises ShapeError: rotations, trans or betas have another shape.
        :raises InvalidValueError: a matrix is no rotation. One that is not finite may stand for a
            frame that is not known.
        """
        rotations = as_arrays(rotations, (self.K + 1, 3, 3), "rotations")
        _check_rotations(rotations)
        trans = as_arrays(trans, (3,), "trans")
        if trans.shape[:-1] and trans.shape[:-1] != rotations.shape[:-3]:
            wanted = (*rotations.shape[:-3], 3)
            raise ShapeError(
                f"trans must have a row for each frame, shape {wanted} or (3,), but "
                f"got {trans.shape}."
            )
        J = self.rest_joints(betas)
        R = np.empty_like(rotations)
        t = np.empty(rotations.shape[:-1])
        R[..., 0, :, :] = rotations[..., 0, :, :]
        t[..., 0, :] = J[0] + trans
        for i in range(1, self.K + 1):
            p = self.parents[i]
            R[..., i, :, :] = R[..., p, :, :] @ rotations[..., i, :, :]
            t[..., i, :] = t[..., p, :] + R[..., p, :, :] @ (J[i] - J[p])
        return R, t

    def skin(self, R: Array, t: Array, betas: Array | None = None) -> Array:
        """Return the mesh of one frame by linear blend skinning.

        :param R, t: (K+1, 3, 3), (K+1, 3) part poses from ``forward_kinematics``.
        :param betas: (P,); zeros if None.
        :return: (V, 3) vertices in the frame of R and t.
        :raises ShapeError: an array has another shape.
        """
        R = as_array(R, (self.K + 1, 3, 3), "R")
        t = as_array(t, (self.K + 1, 3), "t")
        offset = t - np.einsum("kij,kj->ki", R, self.rest_joints(betas))
        A = np.concatenate([R, offset[..., None]], axis=2).reshape(len(R), 12)
        blended = np.einsum("vs,vsa->va", self.skin_weights, A[self.skin_joints]).reshape(-1, 3, 4)
        v: Array = (
            np.einsum("vij,vj->vi", blended[:, :, :3], self.rest_vertices(betas)) + blended[:, :, 3]
        )
        return v

    def keypoints(
        self,
        R: Array,
        t: Array,
        betas: Array | None = None,
        which: Sequence[int] | slice = slice(None),
    ) -> Array:
        """Return keypoints in metres.

        :param R, t: (..., K+1, 3, 3), (..., K+1, 3) part poses from ``forward_kinematics``.
        :param betas: (P,); zeros if None.
        :param which: numbers (M',) of the keypoints, as ``keypoint_set`` returns them; all if left
            out.
        :return: (..., M', 3) in the frame of R and t.
        :raises ShapeError: an array has another shape, or the body has no keypoint of such a
            number.
        """
        R = as_arrays(R, (self.K + 1, 3, 3), "R")
        t = as_arrays(t, (self.K + 1, 3), "t")
        if R.shape[:-3] != t.shape[:-2]:
            raise ShapeError(
                f"R and t must be of the same frames, but got shapes {R.shape} and {t.shape}."
            )
        chosen = which if isinstance(which, slice) else self._checked_numbers(which)
        local = self._shaped(self.v_bar[chosen], self.V[chosen], betas)
        part = self.keypoint_part[chosen]
        p: Array = np.einsum("...mij,mj->...mi", R[..., part, :, :], local) + t[..., part, :]
        return p

    def _checked_numbers(self, which: Sequence[int]) -> Array:
        numbers = as_integers(which, "which, numbers of keypoints as keypoint_set returns them,")
        if numbers.size and not 0 <= numbers.min() <= numbers.max() < len(self.keypoint_part):
            last = len(self.keypoint_part) - 1
            raise ShapeError(
                f"which must lie in 0..{last}, but goes from {numbers.min()} to {numbers.max()}."
            )
        return numbers

    def triangles(self) -> Array:
        """(F', 3) int32: the faces split along the first diagonal."""
        f = self.faces
        if f.shape[1] == 3:
            return f
        halves: Array = np.concatenate([f[:, [0, 1, 2]], f[:, [0, 2, 3]]]).astype(
            np.int32, order="C"
        )
        return halves


def _check_rotations(rotations: Array) -> None:
    """Check matrices (..., 3, 3): two rows must be orthonormal, and the third their product. All
    inner products and the determinant take several times as long.
    """
    first = rotations[..., 0, :]
    second = rotations[..., 1, :]
    third = rotations[..., 2, :]
    off = np.abs(np.cross(first, second) - third).max(axis=-1)
    for a, b, product in ((first, first, 1.0), (second, second, 1.0), (first, second, 0.0)):
        off = np.maximum(off, np.abs(np.einsum("...i,...i", a, b) - product))
    wrong = np.argwhere(off > _ROTATION_TOLERANCE)
    for at in wrong[:1]:
        raise InvalidValueError(
            "rotations must be rotation matrices, orthonormal and of determinant 1, but number "
            f"{', '.join(map(str, at))} is {rotations[tuple(at)].tolist()}."
        )


def numbers_of(body: object) -> Mapping[str, int]:
    """Return the number of each point that a body names: its keypoints, and joint i as M + i.

    :param body: `keypoint_names` (M,) and `joint_names` (K+1,) are read, if it has them.
    """
    keypoints = list(getattr(body, "keypoint_names", ()))
    joints = list(getattr(body, "joint_names", ()))
    first = len(getattr(body, "keypoint_part", keypoints))
    numbers = {name: first + i for i, name in enumerate(joints)}
    return numbers | {name: j for j, name in enumerate(keypoints)}


def number_of(numbers: Mapping[str, int], name: Any) -> int:
    """Return the number of a point.

    :param numbers: of `numbers_of`.
    :raises InvalidValueError: the body has no point of that name.
    """
    if not isinstance(name, str):
        raise InvalidValueError(f"The name of a point must be a text, but is {described(name)}.")
    if name not in numbers:
        near = get_close_matches(name, numbers, 3, 0.5)
        near = near or [known for known in numbers if known.endswith(f"/{name}")]
        hint = f"did you mean {' or '.join(map(repr, near))}?" if near else _known(numbers)
        raise InvalidValueError(f"the body has no point named {name!r}; {hint}")
    return numbers[name]


def _known(numbers: Mapping[str, int]) -> str:
    return f"it has {', '.join(numbers)}." if numbers else "its points have no names."
