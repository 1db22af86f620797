# SPDX-License-Identifier: GPL-3.0-or-later
"""From a motion of another tool in its file's axes to one of our bodies in the world, z up. Of an
SMPL-style motion,

R_world_root = R_world_file R_file_root,   pelvis_world = R_world_file (J_0(β) + trans)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ...solver.body_file import BUILT_IN
from ...solver.rotations import exp, log
from ..arrays import Float64Array, FloatArray
from ..edit.clip import Clip
from ..errors import MotionFileError, UsageError
from ..kinematics.axes import R_WORLD_LEVELCAMERA, R_WORLD_MODEL, UP, transform_points
from ..kinematics.contact_points import SOLES
from ..kinematics.frame_blocks import by_blocks
from ..kinematics.standing import standing_probability
from ..motion import REQUIRED_KEYS, SIGMA_KEYS, Motion
from ..notices import Notice, notice
from ..untrusted.body_file import load_body
from ..untrusted.bvh_file import read_bvh
from ..untrusted.files import npz_keys
from .performer import find_performers
from .smpl_motion import FASTEST, HAND_JOINTS, SLOWEST, SmplMotion, read_smpl_motions

DEFAULT_RATE = 30.0  # frames per second
# by the axis that points up
R_WORLD_FILE = {"z": np.eye(3), "y": R_WORLD_MODEL, "camera": R_WORLD_LEVELCAMERA}
_AXIS_TEXT = {"z": "z", "y": "y", "camera": "minus y, as in a camera's axes,"}
_UPRIGHT = 0.5  # mean cosine of the trunk with an axis, above which people stand or sit along it
_LATEST_S = 1e10  # of a frame; 300 years
_LARGEST_BODY_M = 50.0
# Units in which some tools write translations, by how many of them make a metre.
_UNITS = {100: "cm", 1000: "mm"}
# Of how far soles slip with another unit to how far they slip in metres, and without translation.
# Of a captured walk, both are 0.01 in the right unit. With a skater's 2 to 25 m/s added to it, no
# unit has below 0.8 of the slip without translation.
_LESS_SLIP = 0.1
_LESS_SLIP_THAN_IN_PLACE = 0.7
_FASTEST_M_S = 60.0  # of a person for half of a clip: a skydiver
_GAP_S = 0.5  # with more between two poses, the motion between them is a guess
_CAMERA_DISTANCE_M = 10.0  # in front of the nearest position; motion files need a camera


@dataclass(frozen=True)
class Imported:
    """An imported motion, the body that it is for, and what had to be assumed, in sentences."""

    motion: Motion
    body: Body
    notes: list[Notice] = field(default_factory=list)


def import_motions(
    path: Path, body: str = "scope", up: str = "auto", rate: float = 0.0
) -> list[Imported]:
    """Read a motion file: our own, a BVH file, or an SMPL-style one of another tool, which may be
    of several people, each on the same body.

    :param body: ``scope``, the built-in body, with fingers if the motion has them; ``scope_h``; or
        a body's file.
    :param up: the axis that points up in the file: ``z``, ``y``, ``camera`` (minus y) or ``auto``.
        Ours have z up.
    :param rate: frames per second, for a file that does not say; 0 for ``DEFAULT_RATE``.
    :raises MotionFileError: the file cannot be used.
    :raises ModelFileError: the body's file cannot be used.
    :raises UsageError: ``up`` or ``rate`` is invalid.
    """
    if up not in (*R_WORLD_FILE, "auto"):
        raise UsageError(f"the up axis must be one of auto, {', '.join(R_WORLD_FILE)}, not '{up}'")
    if not (np.isfinite(rate) and rate >= 0):
        raise UsageError(f"the frame rate must be above zero, not {rate}")
    if npz_keys(path, MotionFileError, "motion file") >= REQUIRED_KEYS:
        own = Motion.load(path)
        chosen = own.body_model if body == "scope" else body
        if body != "scope" or chosen in BUILT_IN:
            if up not in ("auto", "z"):
                raise UsageError(
                    f"{path} was written by Scope, with z up: leave out --up, in Blender set Up to "
                    "Automatic"
                )
            return [_own(own, load_body(chosen), path, rate)]
    if path.suffix.lower() == ".bvh":
        return _from_bvh(path, body, up, rate)
    sources = read_smpl_motions(path)
    built_in = (
        sources[0].body_model
        if sources[0].body_model in BUILT_IN
        else "scope_h"
        if any(source.has_fingers for source in sources)
        else "scope"
    )
    loaded = load_body(built_in if body == "scope" else body)
    if up == "auto" and len(sources) > 1:  # one for all, since some may be lying down
        axis, is_sure = _up_axis(
            np.concatenate([_for_body(source, loaded)[0] for source in sources]),
            loaded,
            sources[0].usual_up,
        )
        up = axis if is_sure else up
    begin = min(int(source.frames[0]) for source in sources)
    per_metre = _units_per_metre(sources, loaded)
    found = []
    for source in sources:
        notes = []
        if per_metre > 1 and source.trans is not None:
            source = replace(source, trans=source.trans / per_metre)
            notes.append(
                notice(
                    "other_unit",
                    file=path.name,
                    array=source.trans_name,
                    unit=_UNITS[per_metre],
                )
            )
        imported = convert(source, loaded, path, up, rate, begin)
        _check_speed(imported.motion, path, source.trans_name)
        found.append(replace(imported, notes=[*notes, *imported.notes]))
    return found


def _check_speed(motion: Motion, path: Path, array: str) -> None:
    """Refuse a person who is faster than anybody, where feet that never rest tell no unit.

    :param array: name of the translations.
    :raises MotionFileError: it is such a person.
    """
    steps_m = np.linalg.norm(np.diff(motion.trans, axis=0), axis=1)
    if not len(steps_m):
        return
    speed_m_s = float(np.median(steps_m / np.diff(motion.timestamps)))
    if speed_m_s > _FASTEST_M_S:
        raise MotionFileError(
            f"{path}: {array} moves the person at {speed_m_s:.3g} m/s; it must be in metres, and "
            "the frame rate that of the motion"
        )


def _units_per_metre(sources: Sequence[SmplMotion], body: Body) -> int:
    """Return by what the translations of a file are divided to be in metres: 1, or a key of
    `_UNITS`.

    People mostly stand on some foot. In the right unit, of u to a metre, a sole then hardly moves,

        slip(u) = median over t of min over soles of |Δ(sole - pelvis) + Δtrans / u|.

    Someone whom skates or a vehicle carry slips in every unit, and in no other one less than with
    the pelvis in place.
    """
    slips: dict[float, list[Float64Array]] = {u: [] for u in (1, *_UNITS, np.inf)}
    for source in sources:
        if source.trans is None:
            continue
        poses, _ = _for_body(source, body)
        soles = np.diff(_soles(body, np.zeros(body.P), poses), axis=0)
        pelvis = np.diff(source.trans, axis=0)[:, None]
        for u, slip in slips.items():
            slip.append(np.linalg.norm(soles + pelvis / u, axis=-1).min(axis=1))
    if not any(map(len, slips[1])):
        return 1
    slip_of = {u: float(np.median(np.concatenate(slip))) for u, slip in slips.items()}
    best = min(_UNITS, key=lambda u: slip_of[u])
    is_told = (
        slip_of[best] < _LESS_SLIP * slip_of[1]
        and slip_of[best] < _LESS_SLIP_THAN_IN_PLACE * slip_of[np.inf]
    )
    return best if is_told else 1


def _ignored_rate(stated: float | None, given: float) -> list[Notice]:
    """Say that the frame rate of a file was used instead of another one that was given, 0: none."""
    if stated is None or not given or np.isclose(given, stated, rtol=1e-3):
        return []
    return [notice("rate_stated", stated=stated, given=given)]


def _own(motion: Motion, body: Body, path: Path, rate: float) -> Imported:
    motion.check_body(body, str(path))
    for each in fields(motion):
        value = getattr(motion, each.name)
        if (
            each.name not in SIGMA_KEYS
            and isinstance(value, np.ndarray)
            and value.dtype.kind == "f"
            and not np.isfinite(value).all()
        ):
            raise MotionFileError(
                f"{path}: {each.name} contains NaN or infinity; choose another file"
            )
    is_possible = (
        SLOWEST <= motion.mocap_framerate <= FASTEST
        and np.abs(motion.timestamps).max() <= _LATEST_S
        and (np.diff(motion.timestamps) > 0).all()
    )
    if not is_possible:
        raise MotionFileError(
            f"{path}: its frame rate or timestamps cannot be used; choose another file"
        )
    _check_size(body, motion.betas, path)
    return Imported(motion, body, _ignored_rate(motion.mocap_framerate, rate))


def _check_size(body: Body, betas: FloatArray, path: Path) -> None:
    """Refuse a shape that is nobody's: formats have no room for its numbers.

    :raises MotionFileError: it is such a shape.
    """
    size_m = np.ptp(body.rest_joints(np.asarray(betas, float)), axis=0).max()
    if size_m > _LARGEST_BODY_M:
        raise MotionFileError(
            f"{path}: with its betas, the body is {size_m:.3g} m large; choose another file"
        )


def _from_bvh(path: Path, body: str, up: str, given_rate: float) -> list[Imported]:
    """Put the people of a BVH file on a body; each stands on the floor."""
    performers = find_performers(read_bvh(path, MotionFileError), path, up)
    fingers = {*HAND_JOINTS["left"], *HAND_JOINTS["right"]}
    has_fingers = any(fingers.intersection(each.parts.values()) for each in performers)
    built_in = "scope_h" if has_fingers else "scope"
    loaded = load_body(built_in if body == "scope" else body)
    betas = np.zeros(loaded.P)
    found = []
    for performer in performers:
        poses, root, notes = performer.on_body(loaded, path)
        rate = performer.file.rate
        notes = [*notes, *_ignored_rate(rate, given_rate)]
        contact, floor = _standing(loaded, betas, poses, root, np.arange(len(root)) / rate)
        trans = root - [0.0, 0.0, floor] - loaded.rest_joints(betas)[0]
        motion = _motion(loaded, betas, poses, trans, contact, rate)
        motion.source = path.name
        found.append(Imported(motion, loaded, notes))
    return found


def convert(
    source: SmplMotion,
    body: Body,
    path: Path,
    up: str = "auto",
    rate: float = 0.0,
    begin: int | None = None,
) -> Imported:
    """Convert an SMPL-style motion to a motion of a body.

    :param path: names the motion.
    :param begin: number of the footage's frame that is at 0 s; None: the person's first one.
    """
    exact = source.body_model == body.name or _shape_space(body.name) in map(
        _shape_space, source.models
    )
    notes: list[Notice] = []
    betas = np.zeros(body.P)
    if exact:
        count = min(body.P, source.betas.size)
        betas[:count] = source.betas[:count]
        _check_size(body, betas, path)
        if source.gender != body.gender:
            notes.append(
                notice(
                    "other_gender",
                    gender=source.gender,
                    body=body.name,
                    body_gender=body.gender,
                )
            )
    elif body.name in BUILT_IN:
        notes.append(notice("other_body"))
    else:
        notes.append(notice("other_model", body=body.name))
    poses, missing = _for_body(source, body)
    if missing:
        notes.append(notice("parts_left_out", body=body.name, parts=missing))
    if source.left_out:
        notes.append(notice("arrays_left_out", arrays=list(source.left_out)))
    frames_per_second = source.rate or rate or DEFAULT_RATE
    if source.rate is None and not rate:
        notes.append(notice("rate_not_stated", rate=DEFAULT_RATE))
    notes += _ignored_rate(source.rate, rate)
    if source.trans is None:
        notes.append(notice("no_translation"))
    trans = np.zeros((len(source), 3)) if source.trans is None else source.trans
    axis, sure = (up, True) if up != "auto" else _up_axis(poses, body, source.usual_up)
    if not sure:
        notes.append(notice("unsure_up", axis=_AXIS_TEXT[axis]))
    R = R_WORLD_FILE[axis]
    J0 = body.rest_joints(betas)[0]
    poses[:, 0] = log(R @ exp(poses[:, 0]))
    root = (J0 + trans) @ R.T
    frames = source.frames - (source.frames[0] if begin is None else begin)
    times = frames / frames_per_second
    gaps_s = np.diff(times)
    is_gap = (gaps_s > _GAP_S) & (np.diff(frames) > 1)
    if is_gap.any():
        begins = times[:-1][is_gap].tolist()
        notes.append(notice("frames_without_poses", times=begins, longest_s=float(gaps_s.max())))
    contact, floor = _standing(body, betas, poses, root, times)
    if not exact or axis != "z":
        root[:, 2] -= floor
    if axis != "z":
        notes.append(notice("other_up", axis=_AXIS_TEXT[axis]))
    motion = _motion(body, betas, poses, root - J0, contact, frames_per_second, frames)
    motion.gender = source.gender
    motion.source = path.name
    return Imported(motion, body, notes)


def _shape_space(model: str) -> str:
    """Return the model whose shape coefficients a model has."""
    return "smpl" if model == "smplh" else model


def _for_body(source: SmplMotion, body: Body) -> tuple[Float64Array, str]:
    """Return the axis-angle vectors of the body's joints, (T, K+1, 3), and what the body lacks of
    the source.
    """
    poses = np.zeros((len(source), body.K + 1, 3))
    names: Sequence[str] = body.joint_names
    for i, name in enumerate(source.joint_names):
        if name in names:
            poses[:, names.index(name)] = source.poses[:, i]
    lacks = [
        ("fingers", source.has_fingers and "left_index1" not in names),
        ("face", source.has_face and "jaw" not in names),
    ]
    return poses, " or ".join(what for what, is_lacking in lacks if is_lacking)


def _up_axis(poses: Float64Array, body: Body, usual: str) -> tuple[str, bool]:
    """Return the axis along which the trunk points on average and True; the usual axis and False if
    there is none.
    """
    J = body.rest_joints()
    trunk = J[body.joint_names.index("neck")] - J[0]
    trunk_file = (exp(poses[:, 0]) @ (trunk / np.linalg.norm(trunk))).mean(axis=0)
    along = {axis: float((R @ trunk_file)[2]) for axis, R in R_WORLD_FILE.items()}
    best = max(along, key=lambda axis: along[axis])
    return (best, True) if along[best] > _UPRIGHT else (usual, False)


def _soles(body: Body, betas: Float64Array, poses: Float64Array) -> Float64Array:
    """Return the sole points (T, 4, 3) of a body whose pelvis is at the origin, metres."""
    (soles,) = by_blocks(
        lambda p: (Clip(np.zeros(len(p)), exp(p), np.zeros((len(p), 3))).soles(body, betas),), poses
    )
    return soles


def _standing(
    body: Body,
    betas: Float64Array,
    poses: Float64Array,
    root: Float64Array,
    times: Float64Array,
) -> tuple[Float64Array, float]:
    """Return the (T, 4) probability that each sole point is in contact, and the height of the floor
    that follows.
    """
    soles = _soles(body, betas, poses) + root[:, None]
    weight = standing_probability(soles, UP, times)
    heights = soles[..., 2]
    standing = weight > 0.5
    return weight, float(np.median(heights[standing] if standing.any() else heights.min(axis=1)))


def _motion(
    body: Body,
    betas: Float64Array,
    poses: Float64Array,
    trans: Float64Array,
    contact: Float64Array,
    rate: float,
    frames: NDArray[np.int64] | None = None,
) -> Motion:
    """Fill a motion. It was not seen by a camera: there are no keypoints, and the image has no
    size.

    :param frames: (T,) their numbers; None: from 0 on.
    """
    count = len(poses)
    frames = np.arange(count) if frames is None else frames
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = R_WORLD_LEVELCAMERA
    world_from_camera[1, 3] = trans[:, 1].min() - _CAMERA_DISTANCE_M
    camera_from_world = np.linalg.inv(world_from_camera)

    def joints(p: NDArray[Any], t: NDArray[Any]) -> tuple[NDArray[Any]]:
        world = body.forward_kinematics(exp(p), t, betas)[1]
        return (transform_points(camera_from_world, world).astype(np.float32),)

    flat = poses.reshape(count, -1)
    return Motion(
        poses=flat,
        trans=trans,
        poses_raw=flat,
        trans_raw=trans,
        betas=betas,
        body_model=body.name,
        gender=body.gender,
        mocap_framerate=rate,
        frames=frames,
        timestamps=frames / rate,
        valid=np.ones(count, bool),
        joints_cam=by_blocks(joints, poses, trans)[0],
        keypoints2d=np.zeros((count, 0, 3)),
        keypoints2d_names=np.zeros(0, "<U1"),
        intrinsics=np.eye(3),
        dist=np.zeros(5),
        joint_confidence=np.ones((count, body.K + 1)),
        world_from_camera=np.tile(world_from_camera, (count, 1, 1)),
        foot_contact=contact[:, : len(SOLES)],
        residual_px=np.zeros(count),
        image_size=np.zeros(2, int),
    )
