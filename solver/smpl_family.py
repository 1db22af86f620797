# SPDX-License-Identifier: Apache-2.0
"""A user's SMPL, SMPL+H, SMPL-X or STAR model as a ``Body``: tree, shape, skin and keypoints.

    J̄ = J_regressor v_template,   J_s = J_regressor shapedirs
    weights: the four largest of each vertex, scaled to sum to one

J(β) stays exactly linear, and official files have four weights at most. Only the
linear-blend-skinning part is used. The pose correctives (``posedirs``: from rotation matrices in
SMPL, from quaternions and the second shape coefficient in STAR) are left out: they move the surface
near bent joints, never the joints, so that a fitted motion is a motion of the full model.
``Body.license`` states this.

The keypoints are what the 2D detectors find, rigidly attached to parts (Assumption 1 of the paper).

The sets and names are those of the default body: ``blazepose/`` 33, ``coco/`` 17 and six feet
points, ``hand/`` 21 a side. Shoulders, elbows, wrists, hips, knees and ankles are the joints.
Points of the face beyond nose, eyes and ears, and finger joints that the skeleton lacks, are linear
combinations of neighbours, with the default body's proportions.

A *point* is an array (3, 1 + P): a rest position in the model frame and its derivative by each
shape coefficient. Vertices and joints are points, and so is any fixed linear combination of them:
exactly linear in the shape.

The vertex numbers are known for the published templates (``LANDMARK_VERTICES``). For any other mesh
they are searched in the mean rest pose (y up, +x the person's left, facing +z), part by part, where
a part's vertices are those whose largest skin weight is its own. The proportions below were taken
from the default body.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .body import Body
from .body_checks import check_body, check_tables
from .errors import ModelFileError
from .names import BLAZEPOSE, BODY_JOINTS, BODY_PARENTS, COCO, FINGERS
from .part import Array

MAX_BETAS = 16  # as AMASS; SMPL-X and STAR files carry 300, most of them below a millimetre
# how a full SMPL-X file divides shapedirs; older ones have 10 and 10
SMPLX_SHAPE = 300
SMPLX_EXPRESSION = 100
STAR_CORRECTIVES = 93  # 23 quaternions and one shape coefficient; SMPL has 207
REQUIRED = ("v_template", "J_regressor", "kintree_table", "weights", "f")
_GENDERS = {"m": "male", "f": "female", "male": "male", "female": "female", "neutral": "neutral"}

HAND_ORDER = ("index", "middle", "pinky", "ring", "thumb")  # as SMPL+H and SMPL-X store them
FACE_JOINTS = ("jaw", "left_eye_smplhf", "right_eye_smplhf")
_HEAD = BODY_JOINTS.index("head")
_WRISTS = (BODY_JOINTS.index("left_wrist"), BODY_JOINTS.index("right_wrist"))


@dataclass(frozen=True)
class Skeleton:
    """One published skeleton: its name, joint names and parents."""

    name: str
    joint_names: tuple[str, ...]
    parents: tuple[int, ...]


def _with_fingers(names: list[str], parents: list[int]) -> None:
    for side, wrist in zip(("left", "right"), _WRISTS, strict=True):
        for finger in HAND_ORDER:
            for i in (1, 2, 3):
                parents.append(wrist if i == 1 else len(names) - 1)
                names.append(f"{side}_{finger}{i}")


def _skeletons() -> dict[int, Skeleton]:
    smplh = list(BODY_JOINTS)
    smplh_parents = list(BODY_PARENTS)
    _with_fingers(smplh, smplh_parents)
    smplx = [*BODY_JOINTS, *FACE_JOINTS]
    smplx_parents = [*BODY_PARENTS, _HEAD, _HEAD, _HEAD]
    _with_fingers(smplx, smplx_parents)
    every = (
        Skeleton("smpl", (*BODY_JOINTS, "left_hand", "right_hand"), (*BODY_PARENTS, *_WRISTS)),
        Skeleton("smplh", tuple(smplh), tuple(smplh_parents)),
        Skeleton("smplx", tuple(smplx), tuple(smplx_parents)),
    )
    return {len(skeleton.joint_names): skeleton for skeleton in every}


SKELETONS = _skeletons()


def recognise_skeleton(parents: Array) -> Skeleton | None:
    """Return the published skeleton with exactly these parents (K+1,), or None."""
    skeleton = SKELETONS.get(len(parents))
    return (
        skeleton
        if skeleton is not None and skeleton.parents == tuple(int(p) for p in parents)
        else None
    )


# Vertices on the published templates: 6890 of SMPL, SMPL+H and STAR, 10475 of SMPL-X.
LANDMARK_VERTICES: dict[int, dict[str, int]] = {
    6890: {
        "nose": 332, "left_eye": 2800, "right_eye": 6260, "left_ear": 583, "right_ear": 4071,
        "left_big_toe": 3216, "left_small_toe": 3226, "left_heel": 3387,
        "right_big_toe": 6617, "right_small_toe": 6624, "right_heel": 6787,
        "left_thumb_tip": 2746, "left_index_tip": 2319, "left_middle_tip": 2445,
        "left_ring_tip": 2556,
        "left_pinky_tip": 2673, "right_thumb_tip": 6191, "right_index_tip": 5782,
        "right_middle_tip": 5905,
        "right_ring_tip": 6016, "right_pinky_tip": 6133,
    },
    10475: {
        "nose": 9120, "left_eye": 9448, "right_eye": 9929, "left_ear": 6, "right_ear": 616,
        "left_big_toe": 5770, "left_small_toe": 5780, "left_heel": 8846,
        "right_big_toe": 8463, "right_small_toe": 8474, "right_heel": 8635,
        "left_thumb_tip": 5361, "left_index_tip": 4933, "left_middle_tip": 5058,
        "left_ring_tip": 5169,
        "left_pinky_tip": 5286, "right_thumb_tip": 8079, "right_index_tip": 7669,
        "right_middle_tip": 7794,
        "right_ring_tip": 7905, "right_pinky_tip": 8022,
    },
}  # fmt: skip


LANDMARKS = (
    "nose",
    *(
        f"{s}_{n}"
        for s in ("left", "right")
        for n in ("eye", "ear", "big_toe", "small_toe", "heel")
    ),
)

# Left fingertips from the wrist, in units of wrist to middle fingertip: along the arm, up, forward.
_TIP_OFFSETS = {
    "thumb": (0.50, -0.31, 0.43),
    "index": (0.92, -0.19, 0.27),
    "middle": (1.0, -0.19, 0.03),
    "ring": (0.94, -0.16, -0.15),
    "pinky": (0.76, -0.15, -0.26),
}
_TIP_BEYOND = 0.8  # fingertip beyond the last joint, in units of the last phalanx but one


class RestPoints:
    """Vertices and joints of a body as points, and its landmarks by name."""

    def __init__(self, body: Body):
        self.body = body
        self.joint_index = {name: i for i, name in enumerate(body.joint_names)}
        self._main_joint = body.skin_joints[:, 0]
        known = (
            LANDMARK_VERTICES.get(len(body.v_template))
            if recognise_skeleton(body.parents)
            else None
        )
        self._vertices = dict(known) if known else self._search()

    def vertex(self, index: int) -> Array:
        """(3, 1 + P) one vertex."""
        return np.column_stack([self.body.v_template[index], self.body.shapedirs[index]])

    def joint(self, name: str) -> Array:
        """(3, 1 + P) one joint."""
        i = self.joint_index[name]
        return np.column_stack([self.body.J_template[i], self.body.J_shapedirs[i]])

    def landmark(self, name: str) -> Array:
        """(3, 1 + P) one of ``LANDMARKS``."""
        return self.vertex(self._vertices[name])

    def fingertip(self, side: str, finger: str) -> Array:
        """(3, 1 + P) a fingertip: a known vertex, else beyond the last joint, else by the hand's
        proportions.
        """
        known = self._vertices.get(f"{side}_{finger}_tip")
        if known is not None:
            return self.vertex(known)
        if f"{side}_{finger}3" in self.joint_index:
            last = self.joint(f"{side}_{finger}3")
            tip: Array = last + _TIP_BEYOND * (last - self.joint(f"{side}_{finger}2"))
            return tip
        wrist = self.joint(f"{side}_wrist")
        reach = self.vertex(self._farthest_of_hand(side))
        sign = 1.0 if side == "left" else -1.0
        length = abs(reach[0, 0] - wrist[0, 0])
        along, up, forward = _TIP_OFFSETS[finger]
        point: Array = wrist + along * (reach - wrist)
        # reach may be any finger's tip
        point[:, 0] = wrist[:, 0] + length * np.array([sign * along, up, forward])
        return point

    # searching

    def _part(self, *joints: str) -> Array:
        """Vertices of some parts; when they have none, of the nearest ancestor that has, at last
        the whole mesh.
        """
        wanted = {self.joint_index[name] for name in joints if name in self.joint_index}
        while wanted:
            found = np.flatnonzero(np.isin(self._main_joint, list(wanted)))
            if found.size:
                return found
            wanted = {int(self.body.parents[i]) for i in wanted} - {-1}
        return np.arange(len(self.body.v_template))

    def _farthest_of_hand(self, side: str) -> int:
        hand = self._part(f"{side}_hand")
        x = self.body.v_template[hand, 0]
        return int(hand[np.argmax(x) if side == "left" else np.argmin(x)])

    def _search(self) -> dict[str, int]:
        return {**self._search_head(), **self._search_foot("left"), **self._search_foot("right")}

    def _nearest(self, vertices: Array, target: Array) -> int:
        return int(
            vertices[np.argmin(np.sum((self.body.v_template[vertices] - target) ** 2, axis=1))]
        )

    def _search_head(self) -> dict[str, int]:
        """Nose: foremost near the midline. Ears: the sides, level with the nose. Eyes: by
        proportion from these.
        """
        head = self._part("head", "jaw", "left_eye_smplhf", "right_eye_smplhf")
        v = self.body.v_template[head]
        middle = self.body.J_template[self.joint_index["head"], 0]
        half = max(np.ptp(v[:, 0]) / 2, 1e-6)
        midline = np.abs(v[:, 0] - middle) <= max(0.2 * half, np.abs(v[:, 0] - middle).min())
        nose = int(head[midline][np.argmax(v[midline, 2])])
        nose_at = self.body.v_template[nose]
        level = np.abs(v[:, 1] - nose_at[1]) <= max(0.5 * half, np.abs(v[:, 1] - nose_at[1]).min())
        sides = {
            "left": v[level][np.argmax(v[level, 0])],
            "right": v[level][np.argmin(v[level, 0])],
        }
        found = {"nose": nose}
        for side, rim_at in sides.items():
            ear_at = rim_at + 0.15 * (nose_at - rim_at)  # from the rim of the ear to its opening
            width = ear_at[0] - middle
            depth = nose_at[2] - ear_at[2]
            eye_at = np.array(
                [middle + 0.42 * width, nose_at[1] + 0.5 * abs(width), nose_at[2] - 0.25 * depth]
            )
            same_side = head[(v[:, 0] >= middle) if side == "left" else (v[:, 0] <= middle)]
            same_side = same_side if same_side.size else head
            found[f"{side}_ear"] = self._nearest(same_side, ear_at)
            found[f"{side}_eye"] = self._nearest(same_side, eye_at)
        return found

    def _search_foot(self, side: str) -> dict[str, int]:
        """Heel: hindmost of the sole. Toes: foremost of the inner half and of the outer eighth of
        the forefoot.
        """
        sign = 1.0 if side == "left" else -1.0
        foot = self._part(f"{side}_ankle", f"{side}_foot")
        v = self.body.v_template[foot]
        sole = v[:, 1] <= v[:, 1].min() + 0.3 * min(np.ptp(v[:, 1]), 0.12)
        toes = self._part(f"{side}_foot")
        t = self.body.v_template[toes]
        outward = sign * t[:, 0]
        across = (outward - outward.min()) / max(np.ptp(outward), 1e-9)
        # a flat part has no outer side
        inner = across <= 0.5
        outer = across >= min(0.88, across.max())
        return {
            f"{side}_heel": int(foot[sole][np.argmin(v[sole, 2])]),
            f"{side}_big_toe": int(toes[inner][np.argmax(t[inner, 2])]),
            f"{side}_small_toe": int(toes[outer][np.argmax(t[outer, 2])]),
        }


# MediaPipe's joints of a finger, and their positions between wrist and tip when the skeleton has no
# fingers.
_FINGER_JOINTS = {
    "thumb": (("cmc", 0.37), ("mcp", 0.56), ("ip", 0.80), ("tip", 1.0)),
    "index": (("mcp", 0.60), ("pip", 0.75), ("dip", 0.87), ("tip", 1.0)),
    "middle": (("mcp", 0.56), ("pip", 0.74), ("dip", 0.88), ("tip", 1.0)),
    "ring": (("mcp", 0.57), ("pip", 0.735), ("dip", 0.865), ("tip", 1.0)),
    "pinky": (("mcp", 0.66), ("pip", 0.79), ("dip", 0.88), ("tip", 1.0)),
}
_HAND_NAMES = {
    finger: f"{finger}_finger" if finger in ("index", "middle", "ring") else finger
    for finger in FINGERS
}

Attached = tuple[Array, str]  # a point (3, 1 + P) and the part it turns with


def derive_keypoints(body: Body) -> Body:
    """Return the body with all keypoints, or with none when its tree does not have SMPL's 22 body
    joints by name.
    """
    if not set(BODY_JOINTS) <= set(body.joint_names):
        return replace(body, keypoint_shapedirs=np.zeros((0, 3, body.P)))
    points = RestPoints(body)
    hands = {side: _hand(points, side) for side in ("left", "right")}
    found = {**_face(points), **_feet(points)}
    for side, hand in hands.items():
        for name, source in (
            ("index", "index_finger_mcp"),
            ("pinky", "pinky_mcp"),
            ("thumb", "thumb_ip"),
        ):
            found[f"{side}_{name}"] = (hand[source][0], f"{side}_wrist")
    for name in (*BLAZEPOSE, *COCO):
        if name in BODY_JOINTS:
            found[name] = (points.joint(name), name)
    named = {f"blazepose/{name}": found[name] for name in BLAZEPOSE}
    named |= {f"coco/{name}": found[name] for name in COCO}
    named |= {
        f"hand/{side}_{name}": each for side, hand in hands.items() for name, each in hand.items()
    }
    stack = np.stack([point for point, _ in named.values()])
    return replace(
        body,
        keypoint_names=tuple(named),
        keypoint_part=np.array([points.joint_index[part] for _, part in named.values()], np.int32),
        keypoint_template=np.ascontiguousarray(stack[:, :, 0]),
        keypoint_shapedirs=np.ascontiguousarray(stack[:, :, 1:]),
    )


def _face(points: RestPoints) -> dict[str, Attached]:
    nose = points.landmark("nose")
    eye = {side: points.landmark(f"{side}_eye") for side in ("left", "right")}
    ear = {side: points.landmark(f"{side}_ear") for side in ("left", "right")}
    between = (eye["left"] + eye["right"]) / 2
    # the middle of the mouth
    below = nose + 1.18 * (nose - between) + 0.51 * ((ear["left"] + ear["right"]) / 2 - nose)
    face = {"nose": nose}
    for side in ("left", "right"):
        out = eye[side] - between
        face[f"{side}_eye"] = eye[side]
        face[f"{side}_ear"] = ear[side]
        face[f"{side}_eye_inner"] = between + 0.5 * out
        face[f"{side}_eye_outer"] = eye[side] + 0.48 * out + 0.11 * (ear[side] - eye[side])
        face[f"mouth_{side}"] = below + 0.83 * out
    return {name: (point, "head") for name, point in face.items()}


def _feet(points: RestPoints) -> dict[str, Attached]:
    feet: dict[str, Attached] = {}
    for side in ("left", "right"):
        big = points.landmark(f"{side}_big_toe")
        small = points.landmark(f"{side}_small_toe")
        feet[f"{side}_heel"] = (points.landmark(f"{side}_heel"), f"{side}_ankle")
        feet[f"{side}_big_toe"] = (big, f"{side}_foot")
        feet[f"{side}_small_toe"] = (small, f"{side}_foot")
        feet[f"{side}_foot_index"] = (0.85 * big + 0.15 * small, f"{side}_foot")
    return feet


def _hand(points: RestPoints, side: str) -> dict[str, Attached]:
    """Return the 21 points of one hand in MediaPipe's order."""
    wrist = points.joint(f"{side}_wrist")
    hand: dict[str, Attached] = {"wrist": (wrist, f"{side}_wrist")}
    palm = f"{side}_hand" if f"{side}_hand" in points.joint_index else f"{side}_wrist"
    for finger in FINGERS:
        tip = points.fingertip(side, finger)
        for i, (label, fraction) in enumerate(_FINGER_JOINTS[finger], start=1):
            joint = f"{side}_{finger}{min(i, 3)}"
            if joint in points.joint_index:
                each = (tip if label == "tip" else points.joint(joint), joint)
            else:
                each = (
                    wrist + fraction * (tip - wrist),
                    f"{side}_wrist" if finger == "thumb" else palm,
                )
            hand[f"{_HAND_NAMES[finger]}_{label}"] = each
    return hand


def smpl_body(arrays: Mapping[str, Array], path: Path, betas: int = MAX_BETAS) -> Body:
    """Return the body of a model's arrays.

    Needs v_template (V, 3), weights (V, K+1), J_regressor (K+1, V), kintree_table (2, K+1) with
    par(i) < i and f (F, 3); takes shapedirs (V, 3, P'), posedirs (.., n), of which n tells STAR
    from SMPL, gender and joint_names when present. Metres, y up, facing +z.

    :param path: of the file, for names and messages.
    :param betas: the most shape coefficients to keep; the leading ones are kept.
    :return: a ``Body`` named smpl, smplh, smplx, star, or after the file when the tree is none of
        these.
    :raises ModelFileError: an array is missing, cannot be used, or they contradict each other.
    """
    missing = [key for key in REQUIRED if key not in arrays]
    if missing:
        raise ModelFileError(
            f"{path} lacks {', '.join(missing)}: it is not an SMPL, SMPL+H, SMPL-X or STAR body; "
            "choose another file"
        )
    check_tables(arrays, path)
    parents = _parents(arrays["kintree_table"], path)
    skeleton = recognise_skeleton(parents)
    name = skeleton.name if skeleton else path.stem
    posedirs = np.shape(arrays.get("posedirs", ()))
    if name == "smpl" and posedirs[-1:] == (STAR_CORRECTIVES,):
        name = "star"
    v_template = arrays["v_template"].astype(np.float64)
    shapedirs = _shapedirs(arrays.get("shapedirs"), len(v_template), name, betas)
    regressor = arrays["J_regressor"].astype(np.float64)
    skin_joints, skin_weights = reduce_weights(arrays["weights"], path)
    body = Body(
        name=name,
        joint_names=skeleton.joint_names
        if skeleton
        else _joint_names(arrays.get("joint_names"), len(parents)),
        parents=parents,
        J_template=regressor @ v_template,
        J_shapedirs=np.tensordot(regressor, shapedirs, axes=1),
        v_template=v_template,
        shapedirs=shapedirs,
        skin_joints=skin_joints,
        skin_weights=skin_weights,
        faces=arrays["f"].astype(np.int32),
        license=_license(name, path),
        gender=gender_of(arrays.get("gender"), path),
    )
    body = derive_keypoints(body)
    check_body(body, path)
    return body


def _parents(kintree: Array, path: Path) -> Array:
    """Return the parents (K+1,). Row 1 names the joints, row 0 the parents; the root's is 2³² − 1,
    −1 or itself.
    """
    columns = {int(name): column for column, name in enumerate(kintree[1])}
    if len(columns) != kintree.shape[1]:
        raise ModelFileError(f"{path}: kintree_table names a joint twice; download it again")
    parents = np.array([-1, *(columns.get(int(name), -1) for name in kintree[0, 1:])], np.int32)
    if (parents[1:] < 0).any() or (parents[1:] >= np.arange(1, len(parents))).any():
        raise ModelFileError(
            f"{path}: kintree_table must list each joint after its parent, the root first"
        )
    return parents


def _shapedirs(shapedirs: Array | None, vertices: int, name: str, max_betas: int) -> Array:
    """Return the leading shape directions (V, 3, P), without the facial expressions that SMPL-X
    stores after them.
    """
    if shapedirs is None:
        return np.zeros((vertices, 3, 0))
    count = shapedirs.shape[2]
    if name == "smplx":
        count = min(count, SMPLX_SHAPE if count >= SMPLX_SHAPE + SMPLX_EXPRESSION else 10)
    return shapedirs[:, :, : min(count, max_betas)].astype(np.float64)


def reduce_weights(weights: Array, path: Path) -> tuple[Array, Array]:
    """Return the four largest skin weights of each vertex, scaled to sum to one; weights below zero
    count as zero.

    :param weights: (V, K+1).
    :return: skin_joints (V, 4) int and skin_weights (V, 4); with fewer than four joints, the rest
        is joint 0 at zero.
    :raises ModelFileError: a vertex has no weight that is positive.
    """
    weights = np.maximum(weights.astype(np.float64), 0.0)
    if weights.shape[1] < 4:
        weights = np.pad(weights, ((0, 0), (0, 4 - weights.shape[1])))
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    kept = np.take_along_axis(weights, joints, axis=1)
    total = kept.sum(axis=1, keepdims=True)
    if not (total > 0.0).all():
        raise ModelFileError(f"{path}: weights leaves a vertex without a joint; download it again")
    joints[kept == 0.0] = 0
    return joints, kept / total


def _joint_names(names: Array | None, count: int) -> tuple[str, ...]:
    if (
        names is not None
        and names.shape == (count,)
        and names.dtype.kind == "U"
        and len(set(names.tolist())) == count
    ):
        return tuple(names.tolist())
    return tuple(f"joint_{i:02d}" for i in range(count))


def stored_gender(stored: Array | None) -> str | None:
    """Return male, female or neutral as a file holds it, () text; None if it does not."""
    if stored is None or stored.size != 1 or stored.dtype.kind not in "SU":
        return None
    item = stored.reshape(-1)[0]
    text = (item.decode("latin1") if isinstance(item, bytes) else str(item)).strip().lower()
    return _GENDERS.get(text)


def gender_of(stored: Array | None, path: Path) -> str:
    """Return male, female or neutral: as the file says, else as its name or its folder's says, else
    neutral.

    :param stored: () text, what the file holds as gender.
    """
    found = stored_gender(stored)
    if found is not None:
        return found
    for text in (path.stem, path.parent.name):
        for word in re.split(r"[^a-z]+", text.lower()):
            if word in _GENDERS:
                return _GENDERS[word]
    return "neutral"


def _license(name: str, path: Path) -> str:
    return (
        f"Read from the user's own file {path.name} ({name}): its publisher's licence holds for "
        "mesh and shape. "
        "Pose correctives are not used."
    )
