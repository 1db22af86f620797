# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading SMPL-style .npz files: the names that other tools give to rotations, translation, shape
and frame rate.

Rotations may be axis-angle vectors, (T, 3J) or (T, J, 3), or matrices, (T, J, 3, 3); for all joints
in one array, or the root, the body and the hands in several. The files may come from anyone: only
the arrays below are read, nothing is unpickled, and the first thing that is wrong is named.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.names import BODY_JOINTS
from ...solver.rotations import log
from ...solver.smpl_family import FACE_JOINTS, HAND_ORDER, SKELETONS, gender_of
from ..errors import MotionFileError
from ..kinematics.frame_blocks import by_blocks
from ..untrusted.files import read_npz

MAX_FRAMES = 500_000  # more than two hours at 60 frames per second
_MAX_BETAS = 400
_LARGEST_RATE = 10_000.0
_ORTHONORMAL = 0.01  # largest deviation of RᵀR from the identity
_FARTHEST_M = 1e5  # from the origin; a number beyond that is not in metres

# Names of one thing in the files of different tools, in the order in which they are preferred.
_ALL_JOINTS = (
    "poses",
    "pose_world",
    "pose",
    "smpl_poses",
    "smpl_pose",
    "fullpose",
    "full_pose",
    "thetas",
)
_ROOT = ("root_orient", "global_orient")
_BODY = ("pose_body", "body_pose")
_HANDS = ("pose_hand", "hand_pose")
_LEFT_HAND = ("left_hand_pose",)
_RIGHT_HAND = ("right_hand_pose",)
_TRANS = ("trans_world", "trans", "transl", "smpl_trans", "translation")
_BETAS = ("betas", "beta", "smpl_betas", "shape")
_RATES = ("mocap_framerate", "mocap_frame_rate", "frame_rate", "framerate", "fps")
_SCALE = ("smpl_scaling",)  # AIST++: by which smpl_trans is to be divided
_GENDER = "gender"
_MODEL = "body_model"
_READ = {
    *_ALL_JOINTS,
    *_ROOT,
    *_BODY,
    *_HANDS,
    *_LEFT_HAND,
    *_RIGHT_HAND,
    *_TRANS,
    *_BETAS,
    *_RATES,
    *_SCALE,
}
_READ |= {_GENDER, _MODEL}

HAND_JOINTS = {
    side: tuple(f"{side}_{finger}{i}" for finger in HAND_ORDER for i in (1, 2, 3))
    for side in ("left", "right")
}
_JOINTS_OF_BODY = {len(BODY_JOINTS) - 1: BODY_JOINTS[1:], 23: SKELETONS[24].joint_names[1:]}


@dataclass(frozen=True)
class SmplMotion:
    """A motion of T frames as a file describes it, in the file's own axes; metres and radians."""

    joint_names: tuple[str, ...]  # J names, the root first
    # (T, J, 3) axis-angle: the root in the file's world, the others relative to parents
    poses: NDArray[np.float32]
    # (T, 3) pelvis minus its rest position J_0(betas); None if the file has none
    trans: NDArray[np.float64] | None
    betas: NDArray[np.float64]  # (B,) the mean over the frames; B may be 0
    rate: float | None  # frames per second; None if the file does not say
    gender: str
    body_model: str  # as our own files name it; empty in those of other tools
    usual_up: str  # the axis that points up in files with these names: "z", "y" or "camera"

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def has_fingers(self) -> bool:
        """Whether any finger is rotated."""
        return self._rotates((*HAND_JOINTS["left"], *HAND_JOINTS["right"]))

    @property
    def has_face(self) -> bool:
        """Whether jaw or eyes are rotated."""
        return self._rotates(FACE_JOINTS)

    def _rotates(self, joints: Sequence[str]) -> bool:
        these = [i for i, name in enumerate(self.joint_names) if name in joints]
        return bool((np.abs(self.poses[:, these]) > 1e-6).any())


def read_smpl_motion(path: Path) -> SmplMotion:
    """Read an SMPL-style motion from a .npz file.

    :raises MotionFileError: the file cannot be read, has no poses, or one of its arrays cannot be
        used.
    """
    return smpl_motion(read_npz(path, MotionFileError, "motion file", wanted=_READ), path)


def smpl_motion(arrays: Mapping[str, NDArray[Any]], path: Path) -> SmplMotion:
    """Interpret the arrays of a file.

    :param arrays: poses (T, 72) or in another layout that `docs/motion_file.md` lists, and what
        goes with them.
    :raises MotionFileError: there are no poses among them, or one of them cannot be used.
    """
    names, poses, usual_up = _poses(arrays, path)
    count = len(poses)
    trans = _first(arrays, _TRANS)
    position = None
    if trans is not None:
        position = _numbers(arrays[trans], trans, path)
        if position.shape != (count, 3):
            raise MotionFileError(
                f"{path}: {trans} must have shape ({count}, 3), as the poses, not {position.shape}"
            )
        position = position / (
            _positive(arrays, _SCALE, "a positive number", float(np.finfo(float).max), path) or 1.0
        )
        if np.abs(position).max() > _FARTHEST_M:
            raise MotionFileError(
                f"{path}: {trans} is {np.abs(position).max():.3g} m from the origin; it must be in "
                "metres"
            )
    return SmplMotion(
        joint_names=names,
        poses=poses,
        trans=position,
        betas=_betas(arrays, count, path),
        rate=_positive(arrays, _RATES, "a number of frames per second", _LARGEST_RATE, path),
        gender=gender_of(arrays.get(_GENDER), Path("neutral")),
        body_model=_text(arrays.get(_MODEL)),
        usual_up=usual_up,
    )


def _poses(
    arrays: Mapping[str, NDArray[Any]], path: Path
) -> tuple[tuple[str, ...], NDArray[np.float32], str]:
    """Return the joints' names, their axis-angle vectors (T, J, 3), and the axis that usually
    points up.
    """
    key = _first(arrays, _ALL_JOINTS)
    root = _first(arrays, _ROOT)
    body = _first(arrays, _BODY)
    if key is not None:
        poses = _axis_angles(arrays[key], key, path)
        skeleton = SKELETONS.get(poses.shape[1])
        if skeleton is None and poses.shape[1] != len(BODY_JOINTS):
            known = ", ".join(f"{3 * n} ({s.name})" for n, s in SKELETONS.items())
            raise MotionFileError(
                f"{path}: {key} has {3 * poses.shape[1]} numbers per frame, but must have {known}"
            )
        return (
            skeleton.joint_names if skeleton else BODY_JOINTS,
            poses,
            "y" if key.startswith("smpl_") else "z",
        )
    if root is None or body is None:
        raise MotionFileError(
            f"{path} holds no SMPL-style motion: it needs poses, or root_orient and pose_body, or "
            "global_orient and "
            "body_pose; choose another file"
        )
    parts = [_axis_angles(arrays[name], name, path) for name in (root, body)]
    if parts[0].shape[1] != 1 or parts[1].shape[1] not in _JOINTS_OF_BODY:
        raise MotionFileError(
            f"{path}: {root} must have 1 joint and {body} 21 or 23, but they have "
            f"{parts[0].shape[1]} and "
            f"{parts[1].shape[1]}"
        )
    names = [BODY_JOINTS[0], *_JOINTS_OF_BODY[parts[1].shape[1]]]
    for hands, sides in (
        (_HANDS, ("left", "right")),
        (_LEFT_HAND, ("left",)),
        (_RIGHT_HAND, ("right",)),
    ):
        found = _first(arrays, hands)
        joints = [joint for side in sides for joint in HAND_JOINTS[side]]
        # 6: MANO's components
        if found is None or joints[0] in names or arrays[found].shape[-1:] == (6 * len(sides),):
            continue
        parts.append(_axis_angles(arrays[found], found, path))
        if parts[-1].shape[1] != len(joints):
            raise MotionFileError(
                f"{path}: {found} must have {len(joints)} joints, but has {parts[-1].shape[1]}"
            )
        names += joints
    if len({len(part) for part in parts}) > 1:
        counts = ", ".join(str(len(part)) for part in parts)
        raise MotionFileError(
            f"{path}: the poses of {root}, {body} and hands must have as many frames, not {counts}"
        )
    return tuple(names), np.concatenate(parts, axis=1), "z" if root == "root_orient" else "camera"


def _axis_angles(array: NDArray[Any], name: str, path: Path) -> NDArray[np.float32]:
    """Return axis-angle vectors (T, J, 3) of an array of them, or of rotation matrices (T, J, 3,
    3).
    """
    if array.ndim == 0 or len(array) == 0:
        raise MotionFileError(f"{path}: {name} has no frames; choose another file")
    if len(array) > MAX_FRAMES:
        raise MotionFileError(
            f"{path}: {name} has {len(array)} frames, but at most {MAX_FRAMES} can be imported; "
            "cut it"
        )
    values = _numbers(array, name, path)
    if (
        values.ndim >= 3
        and values.shape[-2:] == (3, 3)
        and (values.ndim == 4 or values.shape[1:] == (3, 3))
    ):
        matrices = values.reshape(len(values), -1, 3, 3)
        return by_blocks(lambda block: (_logarithms(block, name, path),), matrices)[0]
    if values.ndim == 2 and values.shape[1] and values.shape[1] % 3 == 0:
        return values.reshape(len(values), -1, 3).astype(np.float32)
    if values.ndim == 3 and values.shape[2] == 3 and values.shape[1]:
        return values.astype(np.float32)
    raise MotionFileError(
        f"{path}: {name} has shape {array.shape}, but must hold one person's axis-angle vectors, "
        "(frames, 3 x joints), "
        "or rotation matrices, (frames, joints, 3, 3)"
    )


def _logarithms(matrices: NDArray[np.float64], name: str, path: Path) -> NDArray[np.float32]:
    gram = np.swapaxes(matrices, -1, -2) @ matrices
    if np.abs(gram - np.eye(3)).max() > _ORTHONORMAL or np.linalg.det(matrices).min() < 0.5:
        raise MotionFileError(
            f"{path}: {name} holds matrices that are not rotations; choose another file"
        )
    return log(matrices).astype(np.float32)


def _numbers(array: NDArray[Any], name: str, path: Path) -> NDArray[np.float64]:
    if array.dtype.kind not in "fiu":
        raise MotionFileError(f"{path}: {name} must hold numbers, but holds {array.dtype}")
    array = np.atleast_1d(array)
    bad = np.flatnonzero(~np.isfinite(array).all(axis=tuple(range(1, array.ndim))))
    if len(bad):
        raise MotionFileError(
            f"{path}: {name} contains NaN or infinity, first in frame {bad[0]}; repair or cut it"
        )
    return array.astype(np.float64)


def _betas(arrays: Mapping[str, NDArray[Any]], count: int, path: Path) -> NDArray[np.float64]:
    key = _first(arrays, _BETAS)
    if key is None:
        return np.zeros(0)
    values = _numbers(arrays[key], key, path)
    if (
        values.ndim > 2
        or values.shape[-1] > _MAX_BETAS
        or (values.ndim == 2 and len(values) not in (1, count))
    ):
        raise MotionFileError(
            f"{path}: {key} has shape {values.shape}, but must have (10,) or ({count}, 10), or 16"
        )
    return values if values.ndim == 1 else values.mean(axis=0)


def _positive(
    arrays: Mapping[str, NDArray[Any]],
    names: tuple[str, ...],
    wanted: str,
    largest: float,
    path: Path,
) -> float | None:
    """Return the first of these numbers that the file has, which must be positive; None if it has
    none.
    """
    key = _first(arrays, names)
    if key is None:
        return None
    array = arrays[key]
    if array.size != 1 or array.dtype.kind not in "fiu":
        raise MotionFileError(
            f"{path}: {key} must be {wanted}, but has shape {array.shape} and holds {array.dtype}"
        )
    number = float(array.reshape(-1)[0])
    if not 0 < number <= largest:
        raise MotionFileError(f"{path}: {key} must be {wanted}, but is {number:g}")
    return number


def _text(array: NDArray[Any] | None) -> str:
    return (
        str(array.reshape(-1)[0])
        if array is not None and array.size == 1 and array.dtype.kind == "U"
        else ""
    )


def _first(arrays: Mapping[str, NDArray[Any]], names: tuple[str, ...]) -> str | None:
    return next((name for name in names if name in arrays), None)
