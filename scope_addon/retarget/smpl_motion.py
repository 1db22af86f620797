# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading SMPL-style motions: the names that other tools give to rotations, translation, shape
and frame rate.

Rotations may be axis-angle vectors, (T, 3J) or (T, J, 3), matrices, (T, J, 3, 3), the first two
columns or rows of these, (T, J, 6), or quaternions, (T, J, 4); for all joints in one array, or the
root, the body and the hands in several. Trackers save a table for each person, and of each one in
the world and one in camera axes: the world's is read. The files may come from anyone: they are read
by `untrusted.tables`, and the first thing that is wrong is named.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.names import BODY_JOINTS
from ...solver.rotations import log, matrix_from_quaternion
from ...solver.smpl_family import FACE_JOINTS, HAND_ORDER, SKELETONS, gender_of
from ..arrays import Float32Array, Float64Array
from ..errors import MotionFileError
from ..kinematics.axes import transposed
from ..kinematics.frame_blocks import by_blocks
from ..notices import and_more
from ..untrusted.tables import read_tables

MAX_PEOPLE = 100  # of one file
_LISTED = 8  # names of a table's content in a message
MAX_FRAME = 10_000_000  # of the footage
MAX_FRAMES = 500_000  # more than two hours at 60 frames per second
# Of a file for each frame of each person beyond that: a frame takes 3 kB of memory, and zeros
# nothing of a compressed file. Moving people take over a hundred.
_FEWEST_BYTES = 20
_MAX_BETAS = 400
# Frames per second.
SLOWEST = 1e-4
FASTEST = 10_000.0
_POSITIVE = (float(np.finfo(float).tiny), float(np.finfo(float).max))
_ORTHONORMAL = 0.01  # largest deviation of RᵀR from the identity
# Radians, of an axis-angle vector. Half a turn reaches every pose, but fits leave a whole one, and
# as many for the root as somebody spins about the up axis.
_LARGEST_TURN = 4.0 * np.pi
FARTHEST_M = 1e5  # from the origin; a number beyond that is not in metres

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
    "pred_rotmat",
    "pred_pose",
)
_ROOT = ("root_orient", "global_orient")
_BODY = ("pose_body", "body_pose")
_EXPRESSION = ("expression",)
_TRANS = ("trans_world", "trans", "transl", "smpl_trans", "translation", "pred_trans")
_BETAS = ("betas", "beta", "smpl_betas", "shape", "pred_shape")
_RATES = ("mocap_framerate", "mocap_frame_rate", "frame_rate", "framerate", "fps")
_FRAMES = ("frame_ids", "frame_id", "frames", "frame")
_SCALE = ("smpl_scaling",)  # AIST++: by which smpl_trans is to be divided
_GENDER = "gender"
_MODEL = "body_model"
HAND_JOINTS = {
    side: tuple(f"{side}_{finger}{i}" for finger in HAND_ORDER for i in (1, 2, 3))
    for side in ("left", "right")
}
# Names of the arrays that may come with those of root and body, and the joints of each.
_PARTS = (
    (("pose_hand", "hand_pose"), (*HAND_JOINTS["left"], *HAND_JOINTS["right"])),
    (("left_hand_pose",), HAND_JOINTS["left"]),
    (("right_hand_pose",), HAND_JOINTS["right"]),
    (("jaw_pose", "pose_jaw"), FACE_JOINTS[:1]),
    (("pose_eye",), FACE_JOINTS[1:]),
    (("leye_pose",), FACE_JOINTS[1:2]),
    (("reye_pose",), FACE_JOINTS[2:]),
)
_READ = {_GENDER, _MODEL}.union(
    *(_ALL_JOINTS, _ROOT, _BODY, _EXPRESSION, _TRANS, _BETAS, _RATES, _FRAMES, _SCALE),
    *(names for names, _ in _PARTS),
)
_JOINTS_OF_BODY = {len(BODY_JOINTS) - 1: BODY_JOINTS[1:], 23: SKELETONS[24].joint_names[1:]}


@dataclass(frozen=True)
class SmplMotion:
    """A motion of T frames as a file describes it, in the file's own axes; metres and radians."""

    joint_names: tuple[str, ...]  # J names, the root first
    # (T, J, 3) axis-angle: the root in the file's world, the others relative to parents
    poses: Float32Array
    # (T, 3) pelvis minus its rest position J_0(betas); None if the file has none
    trans: Float64Array | None
    betas: Float64Array  # (B,) the mean over the frames; B may be 0
    rate: float | None  # frames per second; None if the file does not say
    gender: str
    body_model: str  # as our own files name it; empty in those of other tools
    usual_up: str  # the axis that points up in files with these names: "z", "y" or "camera"
    models: tuple[str, ...]  # the published bodies of which the file may be, as ours are named
    # (T,) their numbers in the footage, increasing; from 0 on if the file does not say
    frames: NDArray[np.int64]
    # Names of the file's arrays that are in no form which can be applied to a body.
    left_out: tuple[str, ...] = ()
    trans_name: str = ""  # of the file's array

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


def read_smpl_motions(path: Path) -> list[SmplMotion]:
    """Read the SMPL-style motions of a file, one for each person.

    :raises MotionFileError: the file cannot be read, has no poses, one of its arrays cannot be
        used, or its people need far more memory than the file explains.
    """
    tables = read_tables(path, MotionFileError, "motion file", _READ)
    found = list(_motion_tables(tables, ()))
    if not found:
        raise MotionFileError(
            f"{path} holds no SMPL-style motion: it needs poses, or root_orient and pose_body, or "
            f"global_orient and body_pose; it holds {_contents(tables)}; choose another file"
        )
    rank = min(_rank(names) for names, _ in found)
    best = [arrays for names, arrays in found if _rank(names) == rank]
    motions: list[SmplMotion] = []
    most_frames = MAX_FRAMES + path.stat().st_size // _FEWEST_BYTES
    for arrays in best[:MAX_PEOPLE]:
        motions.append(smpl_motion(arrays, path))
        if sum(map(len, motions)) > most_frames:
            raise MotionFileError(
                f"{path}: its {len(best)} people have more than {most_frames} frames together, but "
                "hardly any movement; cut it, or leave out people"
            )
    return motions


def _motion_tables(
    table: Mapping[str, Any], names: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], dict[str, NDArray[Any]]]]:
    """Generate the tables with the rotations of a body, each with the names on the way to it.

    A table has the single numbers and texts, such as a frame rate, of those around it.
    """
    arrays = {key: value for key, value in table.items() if isinstance(value, np.ndarray)}
    if _first(arrays, _ALL_JOINTS) or (_first(arrays, _ROOT) and _first(arrays, _BODY)):
        yield names, arrays
        return
    shared = {key: value for key, value in arrays.items() if value.size == 1}
    for key, value in table.items():
        if isinstance(value, dict):
            for inner, motion in _motion_tables(value, (*names, key)):
                yield inner, shared | motion


def _rank(names: tuple[str, ...]) -> tuple[int, int]:
    """Return the order in which tables are preferred: in the world, then in axes that the name does
    not say, then of the camera; among these, the outermost.
    """
    text = "/".join(names).lower()
    if "global" in text or "world" in text:
        return 0, len(names)
    return (2 if "cam" in text else 1), len(names)


def _contents(tables: Mapping[str, Any]) -> str:
    """Name what a file holds, for a message."""
    listed = []
    for key, value in list(tables.items())[:_LISTED]:
        inner = f"{{{', '.join(list(value)[:_LISTED])}}}" if isinstance(value, dict) else ""
        shape = str(value.shape) if isinstance(value, np.ndarray) else ""
        listed.append(f"{key} {inner or shape}".strip()[:120])
    return and_more(listed, len(tables)) or "nothing"


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
        position = _numbers(arrays[trans], f"{path}: {trans}")
        if position.shape == (count, 1, 3):
            position = position[:, 0]
        if position.shape != (count, 3):
            raise MotionFileError(
                f"{path}: {trans} must have shape ({count}, 3), as the poses, not {position.shape}"
            )
        position = position / (
            _number_of(arrays, _SCALE, "a positive number", _POSITIVE, path) or 1.0
        )
        if np.abs(position).max() > FARTHEST_M:
            raise MotionFileError(
                f"{path}: {trans} is {np.abs(position).max():.3g} m from the origin; it must be in "
                "metres"
            )
    return SmplMotion(
        joint_names=names,
        poses=poses,
        trans=position,
        betas=_betas(arrays, count, path),
        rate=_number_of(arrays, _RATES, "a number of frames per second", (SLOWEST, FASTEST), path),
        gender=gender_of(arrays.get(_GENDER), Path("neutral")),
        body_model=_text(arrays.get(_MODEL)),
        usual_up=usual_up,
        models=_models(arrays, names),
        frames=_frames(arrays, count),
        left_out=_left_out(arrays, names),
        trans_name=trans or "",
    )


def _frames(arrays: Mapping[str, NDArray[Any]], count: int) -> NDArray[np.int64]:
    """Return the (T,) numbers that trackers give to the frames in which they have seen a person;
    from 0 on where there are none, or what has such a name is something else.
    """
    key = _first(arrays, _FRAMES)
    numbers = None if key is None else np.squeeze(arrays[key])
    if numbers is None or numbers.shape != (count,) or numbers.dtype.kind not in "iuf":
        return np.arange(count)
    is_number = np.isfinite(numbers) & (numbers >= 0) & (numbers <= MAX_FRAME)
    if not is_number.all() or (numbers != np.round(numbers)).any() or (np.diff(numbers) <= 0).any():
        return np.arange(count)
    return numbers.astype(np.int64)


def _models(arrays: Mapping[str, NDArray[Any]], joint_names: Sequence[str]) -> tuple[str, ...]:
    """Return the published bodies of which a file may be: the one that it states, or whose joints
    it has.

    A file with the body and the hands apart may leave out the face, so that SMPL-X looks like
    SMPL+H.
    """
    stated = _text(arrays.get(_MODEL)).lower()
    if stated:
        return (stated.replace("-", "").replace("+", ""),)
    all_models = {skeleton.name: count for count, skeleton in SKELETONS.items()}
    in_one_array = _first(arrays, _ALL_JOINTS) is not None
    joint_count = sum(in_one_array or name not in FACE_JOINTS for name in joint_names)
    is_whole = in_one_array or joint_count == all_models["smpl"]
    fitting = tuple(name for name, count in all_models.items() if count == joint_count)
    return fitting if is_whole and fitting else tuple(all_models)


def _poses(
    arrays: Mapping[str, NDArray[Any]], path: Path
) -> tuple[tuple[str, ...], Float32Array, str]:
    """Return the joints' names, their axis-angle vectors (T, J, 3), and the axis that usually
    points up.
    """
    key = _first(arrays, _ALL_JOINTS)
    root = _first(arrays, _ROOT)
    body = _first(arrays, _BODY)
    if key is not None:
        poses = _axis_angles(arrays[key], f"{path}: {key}", w_last=_has_w_last(arrays[key]))
        skeleton = SKELETONS.get(poses.shape[1])
        if skeleton is None and poses.shape[1] != len(BODY_JOINTS):
            known = ", ".join(f"{3 * n} ({s.name})" for n, s in SKELETONS.items())
            raise MotionFileError(
                f"{path}: {key} has {3 * poses.shape[1]} numbers per frame, but must have {known}"
            )
        return (
            skeleton.joint_names if skeleton else BODY_JOINTS,
            poses,
            "y" if key.startswith("smpl_") else "camera" if key.startswith("pred_") else "z",
        )
    if root is None or body is None:
        raise MotionFileError(
            f"{path} holds no SMPL-style motion: it needs poses, or root_orient and pose_body, or "
            "global_orient and "
            "body_pose; choose another file"
        )
    # The root, which may face any way, and hands follow the body.
    w_last = _has_w_last(arrays[body], arrays[root])
    parts = [_axis_angles(arrays[name], f"{path}: {name}", w_last=w_last) for name in (root, body)]
    if parts[0].shape[1] != 1 or parts[1].shape[1] not in _JOINTS_OF_BODY:
        raise MotionFileError(
            f"{path}: {root} must have 1 joint and {body} 21 or 23, but they have "
            f"{parts[0].shape[1]} and "
            f"{parts[1].shape[1]}"
        )
    names = [BODY_JOINTS[0], *_JOINTS_OF_BODY[parts[1].shape[1]]]
    for of_part, joints in _PARTS:
        found = _first(arrays, of_part)
        if found is None or joints[0] in names:
            continue
        part = _part(arrays[found], f"{path}: {found}", joints, len(parts[0]), w_last=w_last)
        if part is not None:
            parts.append(part)
            names += joints
    if len({len(part) for part in parts}) > 1:
        counts = ", ".join(str(len(part)) for part in parts)
        raise MotionFileError(
            f"{path}: the poses of {root}, {body} and hands must have as many frames, not {counts}"
        )
    return tuple(names), np.concatenate(parts, axis=1), "z" if root == "root_orient" else "camera"


def _part(
    array: NDArray[Any], what: str, joints: Sequence[str], frames: int, *, w_last: bool
) -> Float32Array | None:
    """Return axis-angle vectors (T, J, 3) of hands or of a part of the face; None for what is left
    out: components of MANO's hands, which are no rotations, and a face that does not fit the body's
    frames, as files without a captured face hold all kinds of numbers there.
    """
    if _has_components(array, joints):
        return None
    is_face = joints[0] in FACE_JOINTS
    try:
        part = _axis_angles(array, what, w_last=w_last)
        if part.shape[1] != len(joints):
            raise MotionFileError(
                f"{what} must have {len(joints)} "
                f"joint{'s' if len(joints) > 1 else ''}, but has {part.shape[1]}"
            )
    except MotionFileError:
        if is_face:
            return None
        raise
    if is_face and len(part) == 1:  # as it is where nobody has set it
        return np.repeat(part, frames, axis=0)
    return None if is_face and len(part) != frames else part


def _has_components(array: NDArray[Any], joints: Sequence[str]) -> bool:
    """Return whether an array for these joints holds the components of MANO's hands, six for each,
    and no rotations.
    """
    hands = len(joints) // len(HAND_JOINTS["left"])
    if hands == 0 or array.ndim == 0 or array.shape[-1] != 6 * hands:
        return False
    return array.ndim <= 2 or array.shape[1:-1] == (1,)


def _left_out(arrays: Mapping[str, NDArray[Any]], joint_names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of arrays that say something about the person, but hold no rotations that
    `_poses` has read.
    """
    found = []
    if _first(arrays, _ALL_JOINTS) is None:
        parts = [(_first(arrays, names), joints[0]) for names, joints in _PARTS]
        found += [name for name, joint in parts if name and joint not in joint_names]
    expression = _first(arrays, _EXPRESSION)
    if expression is not None:
        found.append(expression)
    # Zeros say nothing.
    return tuple(n for n in found if arrays[n].dtype.kind in "fiu" and np.any(arrays[n]))


def _has_w_last(*arrays: NDArray[Any]) -> bool:
    """Return whether quaternions (T, J, 4) have w last rather than first, by the first of the
    arrays that holds any: a body's joints are nearer to rest than to half a turn, so w is the
    larger one of the two.
    """
    for array in arrays:
        if array.ndim == 3 and array.shape[2] == 4 and array.dtype.kind in "fiu":
            first, *_, last = np.abs(array).sum(axis=(0, 1), dtype=float)
            return bool(last > first)
    return False


def _axis_angles(array: NDArray[Any], what: str, *, w_last: bool) -> Float32Array:
    """Return axis-angle vectors (T, J, 3) of an array of them, of rotation matrices (T, J, 3, 3),
    or of quaternions.

    :param what: names the array in messages.
    """
    if array.ndim == 0 or len(array) == 0:
        raise MotionFileError(f"{what} has no frames; choose another file")
    if len(array) > MAX_FRAMES:
        raise MotionFileError(
            f"{what} has {len(array)} frames, but at most {MAX_FRAMES} can be imported; cut it"
        )
    values = _numbers(array, what)
    if (
        values.ndim >= 3
        and values.shape[-2:] == (3, 3)
        and (values.ndim == 4 or values.shape[1:] == (3, 3))
    ):
        matrices = values.reshape(len(values), -1, 3, 3)
        return by_blocks(lambda block: (_logarithms(block, what),), matrices)[0]
    if values.ndim == 2 and values.shape[1] and values.shape[1] % 3 == 0:
        values = values.reshape(len(values), -1, 3)
    if values.ndim == 3 and values.shape[2] == 3 and values.shape[1]:
        largest = float(np.linalg.norm(values[:, 1:], axis=-1).max(initial=0.0))
        if largest > _LARGEST_TURN:
            raise MotionFileError(
                f"{what} holds axis-angle vectors of up to {largest:.4g} radians, several turns, "
                "so it is probably in degrees; convert it to radians, as numpy.radians does"
            )
        return values.astype(np.float32)
    if values.ndim == 3 and values.shape[2] in (4, 6) and values.shape[1]:
        to_matrices = _from_six
        if values.shape[2] == 4:
            to_matrices = _from_quaternions
            values = np.roll(values, 1, axis=-1) if w_last else values
        return by_blocks(lambda block: (_logarithms(to_matrices(block, what), what),), values)[0]
    raise MotionFileError(
        f"{what} has shape {array.shape}, but must hold one person's axis-angle vectors, "
        "(frames, 3 x joints), "
        "rotation matrices, (frames, joints, 3, 3), two of their columns or rows, (frames, joints, "
        "6), or quaternions, (frames, joints, 4)"
    )


def _from_quaternions(values: Float64Array, what: str) -> Float64Array:
    """Return the matrices (T, J, 3, 3) of quaternions (T, J, 4), w first."""
    if np.abs(np.linalg.norm(values, axis=-1) - 1.0).max() > _ORTHONORMAL:
        raise MotionFileError(f"{what} holds quaternions that are not of length 1")
    return matrix_from_quaternion(values)


def _from_six(values: Float64Array, what: str) -> Float64Array:
    """Return the matrices (T, J, 3, 3) of six numbers (T, J, 6): the first two rows one after the
    other, as PyTorch3D has them, or the first two columns row by row, as HMR has them. Only one of
    them has two vectors of length 1 at right angles.
    """
    in_rows = values.reshape(*values.shape[:-1], 2, 3)
    in_columns = transposed(values.reshape(*values.shape[:-1], 3, 2))

    def deviation(pairs: Float64Array) -> float:
        gram = pairs @ transposed(pairs)
        return float(np.abs(gram - np.eye(2)).mean())

    is_rows = deviation(in_rows) <= deviation(in_columns)
    first, second = np.moveaxis(in_rows if is_rows else in_columns, -2, 0)
    matrices = np.stack([first, second, np.cross(first, second)], axis=-2)
    return matrices if is_rows else transposed(matrices)


def _logarithms(matrices: Float64Array, what: str) -> Float32Array:
    gram = transposed(matrices) @ matrices
    if np.abs(gram - np.eye(3)).max() > _ORTHONORMAL or np.linalg.det(matrices).min() < 0.5:
        raise MotionFileError(f"{what} holds matrices that are not rotations; choose another file")
    return log(matrices).astype(np.float32)


def _numbers(array: NDArray[Any], what: str) -> Float64Array:
    if array.dtype.kind not in "fiu":
        raise MotionFileError(f"{what} must hold numbers, but holds {array.dtype}")
    array = np.atleast_1d(array)
    bad = np.flatnonzero(~np.isfinite(array).all(axis=tuple(range(1, array.ndim))))
    if len(bad):
        raise MotionFileError(
            f"{what} contains NaN or infinity, first in frame {bad[0]}; repair or cut it"
        )
    return array.astype(np.float64)


def _betas(arrays: Mapping[str, NDArray[Any]], count: int, path: Path) -> Float64Array:
    key = _first(arrays, _BETAS)
    if key is None:
        return np.zeros(0)
    values = _numbers(arrays[key], f"{path}: {key}")
    if (
        values.ndim > 2
        or values.shape[-1] > _MAX_BETAS
        or (values.ndim == 2 and len(values) not in (1, count))
    ):
        raise MotionFileError(
            f"{path}: {key} has shape {values.shape}, but must have (10,) or ({count}, 10), or 16"
        )
    return values if values.ndim == 1 else values.mean(axis=0)


def _number_of(
    arrays: Mapping[str, NDArray[Any]],
    names: tuple[str, ...],
    wanted: str,
    limits: tuple[float, float],
    path: Path,
) -> float | None:
    """Return the first of these numbers that the file has, which must lie within the limits; None
    if it has none.
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
    if not limits[0] <= number <= limits[1]:
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
