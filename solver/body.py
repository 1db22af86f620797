# SPDX-License-Identifier: GPL-3.0-or-later
"""The body model: a kinematic tree with shape, a skinned mesh, and keypoints rigidly attached to body parts.

    J(β)   = J̄ + J_s β                         rest joints in the model frame (SMPL: y up, facing +z), metres
    T_0    = (R_0, J_0(β) + trans)              pose of the root part; trans as SMPL means it
    T_i    = T_par · (Ω_i, J_i(β) − J_par(β))   relative pose (Ω_i, S_i β + l_i), Ω_i the state of joint i
    v      = Σ_k w_vk T_k · (v̄(β) − J_k(β))     linear blend skinning
    p_j    = R_i (V_j β + v̄_j) + t_i            keypoint j on part i (the paper's Assumption 1)

File format: a .npz of plain arrays, see ``load_body``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from .errors import ModelFileError, ShapeError
from .npz import read_npz
from .validation import as_array

ASSETS = Path(__file__).resolve().parent.parent / "assets"
BUILT_IN = {"scope": ASSETS / "body" / "scope.npz", "scope_h": ASSETS / "body" / "scope_h.npz"}


def body_with_hands(which: str) -> str:
    """The built-in body with fingers instead of the one without; any other stays."""
    return "scope_h" if which == "scope" else which


@dataclass(frozen=True)
class Body:
    """A body model. All lengths in metres, in the model frame, at zero pose.

    Shapes: K+1 parts, P shape coefficients, V vertices, F quads (or triangles), M keypoints.
    """

    name: str
    joint_names: tuple[str, ...]
    parents: np.ndarray  # (K+1,) int32, −1 for the root, par(i) < i
    J_template: np.ndarray  # (K+1, 3)
    J_shapedirs: np.ndarray  # (K+1, 3, P)
    v_template: np.ndarray  # (V, 3)
    shapedirs: np.ndarray  # (V, 3, P)
    skin_joints: np.ndarray  # (V, 4) int
    skin_weights: np.ndarray  # (V, 4)
    faces: np.ndarray  # (F, 4) int32, or (F, 3)
    keypoint_names: tuple[str, ...] = ()
    keypoint_part: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))  # (M,)
    keypoint_template: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))  # (M, 3)
    keypoint_shapedirs: np.ndarray = field(default_factory=lambda: np.zeros((0, 3, 0)))  # (M, 3, P)
    uv: np.ndarray | None = None  # (U, 2)
    uv_faces: np.ndarray | None = None  # as faces, into uv
    face_material: np.ndarray | None = None  # (F,), into material_names
    material_names: tuple[str, ...] = ()
    material_colors: np.ndarray | None = None  # (C, 4) linear RGBA
    license: str = ""
    gender: str = "neutral"
    file: str = ""  # of the user's, absolute; empty for a built-in body

    @property
    def K(self) -> int:
        """Number of rotational joints (parts without the root)."""
        return len(self.parents) - 1

    @property
    def P(self) -> int:
        """Number of shape coefficients."""
        return int(self.J_shapedirs.shape[2])

    @cached_property
    def S(self) -> np.ndarray:
        """(K+1, 3, P) shape derivative of each joint's offset from its parent; the root's is J_s of the root."""
        return self._minus_parent(self.J_shapedirs)

    @cached_property
    def l(self) -> np.ndarray:  # noqa: E743 - the paper's symbol
        """(K+1, 3) offset of each joint from its parent at β = 0; the root's is its rest position."""
        return self._minus_parent(self.J_template)

    @cached_property
    def V(self) -> np.ndarray:
        """(M, 3, P) V_j: shape derivative of keypoint j relative to its part's joint."""
        return self.keypoint_shapedirs - self.J_shapedirs[self.keypoint_part]

    @cached_property
    def v_bar(self) -> np.ndarray:
        """(M, 3) v̄_j: keypoint j relative to its part's joint at β = 0."""
        return self.keypoint_template - self.J_template[self.keypoint_part]

    def _minus_parent(self, rest: np.ndarray) -> np.ndarray:
        out = rest.copy()
        out[1:] -= rest[self.parents[1:]]
        return out

    def keypoint_set(self, prefix: str) -> dict[str, int]:
        """Keypoints of one set, e.g. ``blazepose``: name without the prefix -> index, in file order.

        :raises ModelFileError: the body has no keypoints of that name.
        """
        found = {n.split("/", 1)[1]: i for i, n in enumerate(self.keypoint_names) if n.startswith(prefix + "/")}
        if not found:
            sets = sorted({n.split("/", 1)[0] for n in self.keypoint_names})
            raise ModelFileError(f"body '{self.name}' has no keypoints '{prefix}'; it has {', '.join(sets) or 'none'}")
        return found

    def rest_joints(self, betas: np.ndarray | None = None) -> np.ndarray:
        """J(β): (K+1, 3) metres, model frame.

        :param betas: (P,); zeros if None.
        :raises ShapeError: betas have another shape.
        """
        return self.J_template if betas is None else self.J_template + self.J_shapedirs @ self._betas(betas)

    def rest_vertices(self, betas: np.ndarray | None = None) -> np.ndarray:
        """v̄(β): (V, 3) metres, model frame.

        :param betas: (P,); zeros if None.
        :raises ShapeError: betas have another shape.
        """
        return self.v_template if betas is None else self.v_template + self.shapedirs @ self._betas(betas)

    def stature(self, betas: np.ndarray | None = None) -> float:
        """Height of who stands: from the lowest to the highest vertex of v̄(β), metres.

        :param betas: (P,); zeros if None.
        :raises ShapeError: betas have another shape.
        """
        return float(np.ptp(self.rest_vertices(betas)[:, 1]))

    def _betas(self, betas: np.ndarray) -> np.ndarray:
        return as_array(betas, (self.P,), f"betas of body '{self.name}'")

    def forward_kinematics(
        self, rotations: np.ndarray, trans: np.ndarray, betas: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pose of every part.

        :param rotations: (..., K+1, 3, 3); row 0 the root's rotation into the target frame, the others Ω_i.
        :param trans: (..., 3) metres, target frame; the root joint comes to lie at J_0(β) + trans.
        :param betas: (P,); zeros if None.
        :return: R (..., K+1, 3, 3) and t (..., K+1, 3): part to target frame; t are the joints.
        :raises ShapeError: rotations or betas have another shape.
        """
        rotations = np.asarray(rotations, float)
        if rotations.shape[-3:] != (self.K + 1, 3, 3):
            raise ShapeError(f"rotations must have shape (..., {self.K + 1}, 3, 3), but got {rotations.shape}")
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

    def skin(self, R: np.ndarray, t: np.ndarray, betas: np.ndarray | None = None) -> np.ndarray:
        """Linear blend skinning of one frame.

        :param R, t: (K+1, 3, 3), (K+1, 3) part poses from ``forward_kinematics``.
        :param betas: (P,); zeros if None.
        :return: (V, 3) vertices in the frame of R and t.
        :raises ShapeError: betas have another shape.
        """
        offset = t - np.einsum("kij,kj->ki", R, self.rest_joints(betas))
        A = np.concatenate([R, offset[..., None]], axis=2).reshape(len(R), 12)
        blended = np.einsum("vs,vsa->va", self.skin_weights, A[self.skin_joints]).reshape(-1, 3, 4)
        return np.einsum("vij,vj->vi", blended[:, :, :3], self.rest_vertices(betas)) + blended[:, :, 3]

    def keypoints(
        self, R: np.ndarray, t: np.ndarray, betas: np.ndarray | None = None, which: Sequence[int] | slice = slice(None)
    ) -> np.ndarray:
        """Keypoints, metres.

        :param R, t: (..., K+1, 3, 3), (..., K+1, 3) part poses from ``forward_kinematics``.
        :param betas: (P,); zeros if None.
        :param which: numbers (M',) of the keypoints; all if left out.
        :return: (..., M', 3) in the frame of R and t.
        :raises ShapeError: betas have another shape.
        """
        local = self.v_bar[which] if betas is None else self.v_bar[which] + self.V[which] @ self._betas(betas)
        part = self.keypoint_part[which]
        return np.einsum("...mij,mj->...mi", R[..., part, :, :], local) + t[..., part, :]

    def triangles(self) -> np.ndarray:
        """(F', 3) int32: the faces split along the first diagonal."""
        f = self.faces
        if f.shape[1] == 3:
            return f
        return np.concatenate([f[:, [0, 1, 2]], f[:, [0, 2, 3]]]).astype(np.int32)


# What a file's array must hold, and its shape; None is any extent.
Form = tuple[str, tuple[int | None, ...]]
_KINDS = {"numbers": "iuf", "whole numbers": "iu", "text": "U"}

_REQUIRED: dict[str, Form] = {
    "joint_names": ("text", (None,)),
    "kintree_table": ("whole numbers", (2, None)),
    "v_template": ("numbers", (None, 3)),
    "shapedirs": ("numbers", (None, 3, None)),
    "J_template": ("numbers", (None, 3)),
    "J_shapedirs": ("numbers", (None, 3, None)),
    "skin_joints": ("whole numbers", (None, 4)),
    "skin_weights": ("numbers", (None, 4)),
    "faces": ("whole numbers", (None, None)),
    "keypoint_names": ("text", (None,)),
    "keypoint_part": ("whole numbers", (None,)),
    "keypoint_template": ("numbers", (None, 3)),
    "keypoint_shapedirs": ("numbers", (None, 3, None)),
}
_OPTIONAL: dict[str, Form] = {
    "uv": ("numbers", (None, 2)),
    "uv_faces": ("whole numbers", (None, None)),
    "face_material": ("whole numbers", (None,)),
    "material_names": ("text", (None,)),
    "material_colors": ("numbers", (None, 4)),
    "name": ("text", ()),
    "license": ("text", ()),
}


def load_body(which: str | Path = "scope") -> Body:
    """Load a body by name (``scope``: K = 23, ``scope_h``: K = 51), from a .npz in the same format, or a user's model.

    A user's SMPL, SMPL+H, SMPL-X or STAR file (.npz, or .pkl) goes through ``loaders.load_model``. Our own format:

    Keys: joint_names, kintree_table (2, K+1), v_template, shapedirs, J_template, J_shapedirs, skin_joints,
    skin_weights, faces, keypoint_names/part/template/shapedirs; optional uv, uv_faces, face_material,
    material_names, material_colors, name, license. Shapes as in ``Body``.

    :raises ModelFileError: the file is missing, not a body, or contradicts itself.
    """
    path = BUILT_IN.get(str(which), Path(which))
    choice = f"give one of {', '.join(BUILT_IN)}, or a body's .npz or .pkl file"
    if not path.is_file():
        raise ModelFileError(f"body '{which}' was not found: {choice}")
    from .loaders import is_motion, is_user_model, load_model  # here, because the loaders build a Body

    if is_user_model(path):
        return load_model(path)
    if is_motion(path):
        raise ModelFileError(f"{path} is a motion file, which holds how a body moves and not the body: {choice}")
    data = read_npz(path, ModelFileError, "body file")
    missing = [k for k in _REQUIRED if k not in data]
    if missing:
        raise ModelFileError(f"{path} lacks {', '.join(missing)}: it is not a Scope body file")
    forms = _REQUIRED | _OPTIONAL
    check_arrays(data, forms, path)
    for key, (kind, _) in forms.items():
        if key in data and kind == "numbers":
            data[key] = data[key].astype(np.float64)
    body = Body(
        name=str(data.get("name", path.stem)),
        joint_names=tuple(map(str, data["joint_names"])),
        parents=data["kintree_table"][0].astype(np.int32),
        keypoint_names=tuple(map(str, data["keypoint_names"])),
        keypoint_part=data["keypoint_part"].astype(np.int32),
        skin_joints=data["skin_joints"].astype(np.intp),
        faces=data["faces"].astype(np.int32),
        material_names=tuple(map(str, data.get("material_names", ()))),
        license=str(data.get("license", "")),
        v_template=data["v_template"],
        shapedirs=data["shapedirs"],
        J_template=data["J_template"],
        J_shapedirs=data["J_shapedirs"],
        skin_weights=data["skin_weights"],
        keypoint_template=data["keypoint_template"],
        keypoint_shapedirs=data["keypoint_shapedirs"],
        uv=data.get("uv"),
        uv_faces=data.get("uv_faces"),
        face_material=data.get("face_material"),
        material_colors=data.get("material_colors"),
        file="" if str(which) in BUILT_IN else str(path.resolve()),
    )
    _check(body, path)
    return body


def check_arrays(arrays: Mapping[str, np.ndarray], forms: Mapping[str, Form], path: Path) -> None:
    """What the arrays of a file hold, and their shapes, at the door. Those that are not there may be left out.

    :raises ModelFileError: an array of another kind or shape.
    """
    for key, (kind, shape) in forms.items():
        if key not in arrays:
            continue
        array = arrays[key]
        no_names = kind == "text" and array.size == 0  # which numpy writes as numbers
        if array.dtype.kind not in _KINDS[kind] and not no_names:
            raise ModelFileError(f"{path}: {key} must hold {kind}, but holds {array.dtype}")
        if array.ndim != len(shape) or any(b not in (None, a) for a, b in zip(array.shape, shape, strict=True)):
            wanted = ", ".join("any" if b is None else str(b) for b in shape)
            raise ModelFileError(f"{path}: {key} must have shape ({wanted}), but has {array.shape}")


def _check(body: Body, path: Path) -> None:
    """Shapes and index ranges of a file that may be hostile."""
    n, p, v, m = len(body.parents), body.P, len(body.v_template), len(body.keypoint_names)
    materials = max(1, len(body.material_names))
    if body.faces.shape[1] not in (3, 4):
        raise ModelFileError(f"{path}: faces must be triangles or quads, but have {body.faces.shape[1]} corners")
    expected = {
        "J_template": (n, 3),
        "J_shapedirs": (n, 3, p),
        "v_template": (v, 3),
        "shapedirs": (v, 3, p),
        "skin_joints": (v, 4),
        "skin_weights": (v, 4),
        "keypoint_part": (m,),
        "keypoint_template": (m, 3),
        "keypoint_shapedirs": (m, 3, p),
        "uv_faces": body.faces.shape,
        "face_material": (len(body.faces),),
        "material_colors": (materials, 4),
    }
    for key, shape in expected.items():
        array = getattr(body, key)
        if array is not None and array.shape != shape:
            raise ModelFileError(f"{path}: {key} must have shape {shape}, but has {array.shape}")
    if len(body.joint_names) != n:
        raise ModelFileError(f"{path}: {len(body.joint_names)} joint names for {n} joints")
    if n == 0 or body.parents[0] != -1 or (body.parents[1:] < 0).any() or (body.parents[1:] >= np.arange(1, n)).any():
        raise ModelFileError(f"{path}: kintree_table must list each joint after its parent, the root first")
    tops = {"skin_joints": n, "faces": v, "keypoint_part": n, "face_material": materials}
    if body.uv is not None:
        tops["uv_faces"] = len(body.uv)
    for key, top in tops.items():
        index = getattr(body, key)
        if index is not None and index.size and (index.min() < 0 or index.max() >= top):
            raise ModelFileError(f"{path}: {key} points outside 0..{top - 1}")
    for key in (key for key, (kind, _) in (_REQUIRED | _OPTIONAL).items() if kind == "numbers"):
        array = getattr(body, key)
        if array is not None and not np.isfinite(array).all():
            raise ModelFileError(f"{path}: {key} contains NaN or infinity")
