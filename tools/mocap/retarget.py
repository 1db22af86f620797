# SPDX-License-Identifier: GPL-3.0-or-later
"""Correspondence between a source's skeleton and the body's parts, and the shape with the source's
bone lengths.

Rotations: part i follows a segment s of the source, R_world_part = R_world_s · C_i, where the
constant C_i takes the part's rest bone and hinge axis to the segment's. It fixes the twist, which
joint positions alone leave open. Positions: joint j follows a point fixed to a segment, p_world_j =
p_world_s + R_world_s · o_j; the constant o_j is the distance between the two skeletons' joints
(CMU's hip joints are 15-18 cm apart, the body's 21 cm).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ...solver.errors import ShapeError
from ...solver.rotations import exp, log
from .take import Take

SIDES = ("left", "right")
CMU_SPLAY = np.radians(20.0)  # of CMU's thighs at zero pose
# of CMU's elbow axis about the outstretched arm at zero pose, up at the front
CMU_ELBOW_ROLL = np.radians(30.0)
# median forward pitch to which heads are set: people look slightly down
HEAD_PITCH = np.radians(5.0)
MAX_HEAD_PITCH = np.radians(25.0)
STANCE_SPEED = 0.12  # m/s: a foot slower than this stands
TRUNK = ("pelvis", "spine1", "spine2", "spine3")
LENGTHS = (  # joint, joint, source joint, source joint, standard deviation in metres
    *((f"{s}_{a}", f"{s}_{b}", f"{s}_{a}", f"{s}_{b}", 0.01)
      for s in SIDES for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"))),
)  # fmt: skip
# ends of the forearm: body, source
ARM_LENGTHS = {"cmu": ("hand", "knuckle"), "deepmimic": ("wrist", "wrist")}


@dataclass(frozen=True)
class Follow:
    """A part that follows a segment, or a mixture: ``share`` of the way from segment ``first`` to
    ``second``.
    """

    first: str
    second: str = ""
    share: float = 0.0
    # per radian^2, against 24000 per metre^2 of a joint: 300 is a lever of 11 cm
    weight: float = 300.0


@dataclass(frozen=True)
class Point:
    """A joint that follows the source's joint ``joint``, with an offset fixed in ``segment``."""

    joint: str
    segment: str
    confidence: float = 1.0


@dataclass
class Correspondence:
    """The correspondence between one performer's skeleton and the body."""

    parts: dict[str, Follow]
    points: dict[str, Point]
    C: dict[str, NDArray[np.float64]] = field(default_factory=dict)  # (3, 3) for each of parts
    # (3,) metres for each of points, in its segment
    offset: dict[str, NDArray[np.float64]] = field(default_factory=dict)


def _sided(table: dict[str, Any]) -> dict[str, Any]:
    """Return both sides' entries of a table whose names begin with ``*_``."""

    def put(value: Any, side: str) -> Any:
        changes = {k: v.replace("*", side) for k, v in vars(value).items() if isinstance(v, str)}
        return type(value)(**{**vars(value), **changes})

    return {
        k.replace("*", s): put(v, s)
        for k, v in table.items()
        for s in (SIDES if "*" in k else ("",))
    }


# CMU puts the wrist 4-5 cm too far out (radius and wrist bone together are 29 cm), which
# exaggerates its angles: hands take their twist from the forearm and 0.4 of the rest. Half of the
# forearm's twist goes to the elbow, half to the wrist.
CMU_PARTS = _sided({
    "pelvis": Follow("pelvis", weight=500.0), "spine1": Follow("spine1"),
    "spine2": Follow("spine2"),
    "spine3": Follow("spine3"), "neck": Follow("neck2", weight=200.0),
    "head": Follow("head", weight=200.0),
    "*_collar": Follow("*_collar", weight=100.0), "*_shoulder": Follow("*_shoulder"),
    "*_elbow": Follow("*_elbow", "*_forearm", 0.5),
    "*_wrist": Follow("*_forearm", "*_wrist", 0.4, weight=100.0),
    "*_hand": Follow("*_forearm", "*_wrist", 0.6, weight=20.0), "*_hip": Follow("*_hip"),
    "*_knee": Follow("*_knee"),
    "*_ankle": Follow("*_ankle", weight=200.0), "*_foot": Follow("*_foot", weight=100.0),
})  # fmt: skip
CMU_POINTS = _sided({
    "neck": Point("neck2", "spine3"), "head": Point("head", "neck2", 0.5),
    "*_hip": Point("*_hip", "pelvis"),
    "*_knee": Point("*_knee", "*_hip"), "*_ankle": Point("*_ankle", "*_knee"),
    "*_foot": Point("*_foot", "*_ankle"),
    "*_shoulder": Point("*_shoulder", "*_collar"), "*_elbow": Point("*_elbow", "*_shoulder"),
    "*_wrist": Point("*_wrist", "*_forearm", 0.5), "*_hand": Point("*_knuckle", "*_forearm", 0.5),
})  # fmt: skip
# DeepMimic bends the trunk at one joint and has no hands or toes; parts without a segment stay near
# rest.
DEEPMIMIC_PARTS = _sided({
    "pelvis": Follow("pelvis", weight=500.0), "spine1": Follow("pelvis", "chest", 0.33),
    "spine2": Follow("pelvis", "chest", 0.67), "spine3": Follow("chest"),
    "neck": Follow("chest", "neck", 0.5, weight=200.0), "head": Follow("neck", weight=200.0),
    "*_shoulder": Follow("*_shoulder"), "*_elbow": Follow("*_elbow"), "*_hip": Follow("*_hip"),
    "*_knee": Follow("*_knee"), "*_ankle": Follow("*_ankle", weight=200.0),
})  # fmt: skip
DEEPMIMIC_POINTS = _sided({
    "neck": Point("neck", "chest", 0.5), "*_hip": Point("*_hip", "pelvis"),
    "*_knee": Point("*_knee", "*_hip"),
    "*_ankle": Point("*_ankle", "*_knee"), "*_shoulder": Point("*_shoulder", "chest"),
    "*_elbow": Point("*_elbow", "*_shoulder"), "*_wrist": Point("*_wrist", "*_elbow"),
})  # fmt: skip


def correspond(body: Body, betas: NDArray[np.float64], takes: list[Take]) -> Correspondence:
    """Return the correspondence for one performer's takes, with level feet and upright heads, and
    zero offsets.
    """
    cmu = has_cmu_skeleton(takes[0])
    found = Correspondence(
        CMU_PARTS if cmu else DEEPMIMIC_PARTS, CMU_POINTS if cmu else DEEPMIMIC_POINTS
    )
    rest = body.rest_joints(betas)
    for part in found.parts:
        found.C[part] = _rest_alignment(body, rest, part, cmu)
    for part in found.parts:
        if part.endswith(("_ankle", "_foot")):
            found.C[part] = _levelled(found.C[part], found.parts[part], takes, part.split("_")[0])
    if cmu:
        head = np.concatenate([segment_rotations(t, found.parts["head"]) for t in takes])
        pitch = float(np.median(np.arctan2(_forward_lean(head), head[:, 1, 1])))
        found.C["head"] = exp(
            [np.clip(HEAD_PITCH - pitch, -MAX_HEAD_PITCH, MAX_HEAD_PITCH), 0.0, 0.0]
        )
    found.offset = {joint: np.zeros(3) for joint in found.points}
    return found


def has_cmu_skeleton(take: Take) -> bool:
    """Return whether the take has the joints of CMU's skeleton, not those of DeepMimic's
    humanoid.
    """
    return "left_knuckle" in take.joint_names


def segment_rotations(take: Take, follow: Follow) -> NDArray[np.float64]:
    """Return R_world_segment (T, 3, 3) of the segment or mixture that a part follows.

    :raises ShapeError: when the take has positions only.
    """
    if take.orientations is None:
        raise ShapeError(
            f"{take.name} has no orientations: the body cannot be fitted to joint positions alone"
        )
    R = take.orientations[:, take.index(follow.first)]
    if follow.second:
        between = np.swapaxes(R, -1, -2) @ take.orientations[:, take.index(follow.second)]
        R = R @ exp(follow.share * log(between))
    return R


def targets(take: Take, found: Correspondence) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return target rotations (T, parts, 3, 3) of parts and target positions (T, points, 3) of
    joints.
    """
    R = np.stack(
        [segment_rotations(take, follow) @ found.C[part] for part, follow in found.parts.items()],
        axis=1,
    )
    p = np.stack(
        [
            take.joint(point.joint)
            + segment_rotations(take, Follow(point.segment)) @ found.offset[joint]
            for joint, point in found.points.items()
        ],
        axis=1,
    )
    return R, p


def shape_from_lengths(body: Body, take: Take) -> NDArray[np.float64]:
    """Fit the shape (P,) to bone lengths and trunk height by Gauss-Newton on (length − measured)/σ
    and β/1.
    """
    ours, theirs = ARM_LENGTHS["cmu" if has_cmu_skeleton(take) else "deepmimic"]
    pairs = [
        *LENGTHS,
        *((f"{s}_elbow", f"{s}_{ours}", f"{s}_elbow", f"{s}_{theirs}", 0.01) for s in SIDES),
    ]
    index = {name: i for i, name in enumerate(body.joint_names)}
    rows = []  # (P + 1, 3) of the vector between two joints and its measured length
    measured = []
    sigma = []
    affine = np.concatenate([body.J_template[..., None], body.J_shapedirs], axis=2)  # (K+1, 3, 1+P)
    for a, b, source_a, source_b, deviation in pairs:
        rows.append(affine[index[b]] - affine[index[a]])
        bones = np.diff([take.joint(j) for j in _chain(source_a, source_b)], axis=0)
        # some sources' bones vary
        measured.append(float(np.median(np.linalg.norm(bones, axis=2).sum(axis=0))))
        sigma.append(deviation)
    middle = [
        0.5 * (affine[index[f"left_{j}"]] + affine[index[f"right_{j}"]])
        for j in ("hip", "shoulder")
    ]
    trunk = np.mean([take.joint(f"{s}_shoulder") - take.joint(f"{s}_hip") for s in SIDES], axis=0)
    rows.append(middle[1] - middle[0])
    # upright: bending shortens it
    measured.append(float(np.quantile(np.linalg.norm(trunk, axis=1), 0.9)))
    sigma.append(0.03)
    A = np.array(rows)
    beta = np.zeros(body.P)
    for _ in range(10):
        v = A[:, :, 0] + A[:, :, 1:] @ beta
        length = np.linalg.norm(v, axis=1)
        J = np.einsum("nip,ni->np", A[:, :, 1:], v / length[:, None]) / np.c_[sigma]
        r = (length - measured) / sigma
        beta -= np.linalg.solve(J.T @ J + np.eye(body.P), J.T @ r + beta)
    return beta


def _chain(a: str, b: str) -> list[str]:
    """Return the source's joints from a to b: its forearm is two bones, followed by the hand."""
    if not b.endswith("_knuckle"):
        return [a, b]
    side = b.split("_")[0]
    return [a, f"{side}_forearm", f"{side}_wrist", b]


def _rest_alignment(
    body: Body, rest: NDArray[np.float64], part: str, cmu: bool
) -> NDArray[np.float64]:
    """Return C, which takes a part's rest bone and hinge axis to the source's.

    It is the identity for parts whose up is the source's. DeepMimic's hips, chest and neck are one
    vertical line at zero pose, while the body's hips lie before it, as people's do.
    """
    side, _, name = part.rpartition("_")
    mirror = -1.0 if side == "right" else 1.0
    child = {"hip": "knee", "knee": "ankle", "shoulder": "elbow", "elbow": "wrist"}.get(name)
    splay = exp([0.0, 0.0, mirror * CMU_SPLAY if cmu else 0.0])
    if name in ("ankle", "foot"):
        return splay
    if name in ("wrist", "hand"):
        return np.eye(3) if cmu else _hanging(mirror)
    if child is None:
        return _upright_trunk(body, rest) if part in TRUNK and not cmu else np.eye(3)
    bone = rest[body.joint_names.index(f"{side}_{child}")] - rest[body.joint_names.index(part)]
    if name in ("hip", "knee"):
        return splay @ _frame([0.0, -1.0, 0.0], [1.0, 0.0, 0.0]) @ _frame(bone, [1.0, 0.0, 0.0]).T
    ours = _frame(bone, [0.0, -mirror, 0.0])
    if not cmu:
        return _hanging(mirror) @ _frame([mirror, 0.0, 0.0], [0.0, -mirror, 0.0]) @ ours.T
    axis = mirror * np.array([0.0, -np.cos(CMU_ELBOW_ROLL), np.sin(CMU_ELBOW_ROLL)])
    if name == "elbow":  # follows halfway to the forearm, whose zero has no roll
        axis = mirror * np.array([0.0, -np.cos(0.5 * CMU_ELBOW_ROLL), np.sin(0.5 * CMU_ELBOW_ROLL)])
    return _frame([mirror, 0.0, 0.0], axis) @ ours.T


def _upright_trunk(body: Body, rest: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the turn about the left that makes the line from the hips to the neck vertical."""
    hips = [rest[body.joint_names.index(f"{side}_hip")] for side in SIDES]
    _, up, ahead = rest[body.joint_names.index("neck")] - np.mean(hips, axis=0)
    return exp([-np.arctan2(ahead, up), 0.0, 0.0])


def _hanging(mirror: float) -> NDArray[np.float64]:
    """Return the rotation of an arm from the T-pose to hanging, palms to the thighs."""
    return exp([0.0, 0.0, -mirror * np.pi / 2])


def _frame(
    bone: NDArray[np.float64] | list[float], axis: NDArray[np.float64] | list[float]
) -> NDArray[np.float64]:
    """Return the rotation with columns (bone, the axis made perpendicular to it, their cross
    product).
    """
    b = np.asarray(bone, float) / np.linalg.norm(bone)
    a = np.asarray(axis, float) - b * (b @ axis)
    a /= np.linalg.norm(a)
    return np.stack([b, a, np.cross(b, a)], axis=1)


def _levelled(
    C: NDArray[np.float64], follow: Follow, takes: list[Take], side: str
) -> NDArray[np.float64]:
    """Return C turned by the smallest rotation that makes the foot level in the median frame in
    which it stands.
    """
    ups = []
    for take in takes:
        ball = f"{side}_foot" if f"{side}_foot" in take.joint_names else f"{side}_foot_end"
        moved = [
            np.linalg.norm(np.gradient(take.joint(j), axis=0), axis=1)
            for j in (ball, f"{side}_ankle")
        ]
        height = take.joint(f"{side}_ankle")[:, 1]
        stands = (np.maximum(*moved) * take.fps < STANCE_SPEED) & (
            height < np.quantile(height, 0.5)
        )
        # world's up in the segment's axes
        ups.append(segment_rotations(take, follow)[stands][:, 1])
    up = np.concatenate(ups)
    if len(up) < 10:
        return C
    up = np.median(up, axis=0)
    up /= np.linalg.norm(up)
    own = C[:, 1]
    axis = np.cross(own, up)
    sine = np.linalg.norm(axis)
    return exp(axis / max(sine, 1e-12) * np.arctan2(sine, own @ up)) @ C


def _forward_lean(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (T,) how far a segment's up axis leans in its facing direction, in the horizontal
    plane.
    """
    facing = R[:, [0, 2], 2] / np.maximum(
        np.linalg.norm(R[:, [0, 2], 2], axis=1, keepdims=True), 1e-9
    )
    return np.einsum("ti,ti->t", facing, R[:, [0, 2], 1])
