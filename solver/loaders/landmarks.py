# SPDX-License-Identifier: GPL-3.0-or-later
"""Nose, eyes, ears, heels, toes and fingertips of a skinned T-posed mesh.

A *point* is an array (3, 1 + P): a rest position in the model frame and its derivative by each
shape coefficient. Vertices and joints are points, and so is any fixed linear combination of them:
exactly linear in the shape.

The vertex numbers are known for the published templates (``LANDMARK_VERTICES``). For any other mesh
they are searched in the mean rest pose (y up, +x the person's left, facing +z), part by part, where
a part's vertices are those whose largest skin weight is its own. The proportions below were taken
from the default body.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..body import Body
from .skeletons import LANDMARK_VERTICES, recognise_skeleton

FINGERS = ("thumb", "index", "middle", "ring", "pinky")
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

    def vertex(self, index: int) -> NDArray[np.float64]:
        """(3, 1 + P) one vertex."""
        return np.concatenate(
            [self.body.v_template[index][:, None], self.body.shapedirs[index]], axis=1
        )

    def joint(self, name: str) -> NDArray[np.float64]:
        """(3, 1 + P) one joint."""
        i = self.joint_index[name]
        return np.concatenate([self.body.J_template[i][:, None], self.body.J_shapedirs[i]], axis=1)

    def landmark(self, name: str) -> NDArray[np.float64]:
        """(3, 1 + P) one of ``LANDMARKS``."""
        return self.vertex(self._vertices[name])

    def fingertip(self, side: str, finger: str) -> NDArray[np.float64]:
        """(3, 1 + P) a fingertip: a known vertex, else beyond the last joint, else by the hand's
        proportions.
        """
        known = self._vertices.get(f"{side}_{finger}_tip")
        if known is not None:
            return self.vertex(known)
        if f"{side}_{finger}3" in self.joint_index:
            last = self.joint(f"{side}_{finger}3")
            before = self.joint(f"{side}_{finger}2")
            return last + _TIP_BEYOND * (last - before)
        wrist = self.joint(f"{side}_wrist")
        reach = self.vertex(self._farthest_of_hand(side))
        sign = 1.0 if side == "left" else -1.0
        length = abs(reach[0, 0] - wrist[0, 0])
        along, up, forward = _TIP_OFFSETS[finger]
        point = wrist + along * (reach - wrist)
        # reach may be any finger's tip
        point[:, 0] = wrist[:, 0] + length * np.array([sign * along, up, forward])
        return point

    # searching

    def _part(self, *joints: str) -> NDArray[np.intp]:
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

    def _nearest(self, vertices: NDArray[np.intp], target: NDArray[np.float64]) -> int:
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
