# SPDX-License-Identifier: GPL-3.0-or-later
"""Retarget a motion to every kind of rig, print how well it fits, and draw it.

python -m scope.benchmarks.rigs MOTION.npz [PICTURES]    PICTURES: a folder
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy
import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.motion import Motion
from ...scope_addon.untrusted.body_file import load_body
from ...solver.body import Body
from .kinds import KINDS
from .made import MadeRig
from .measured import bone_heads, figures, joints_of, skin_vertices

_SHOWN = 5  # frames in a picture
_PIXELS_PER_M = 110


def drawn(rig: MadeRig, motion: Motion, body: Body) -> NDArray[np.uint8]:
    """Draw the skin (grey) and the captured joints (red) from the front and from the left."""
    joints = joints_of(motion, body)
    parents = np.asarray(body.parents)
    height = round(2.3 * _PIXELS_PER_M)
    width = round(2.0 * _PIXELS_PER_M)
    picture = np.full((2 * height, _SHOWN * width, 3), 255, np.uint8)
    edges = [tuple(edge.vertices) for skin in rig.skins[:1] for edge in skin.data.edges]
    for k, frame in enumerate(np.linspace(0, len(motion) - 1, _SHOWN).astype(int)):
        bpy.context.scene.frame_set(int(frame) + 1)
        vertices = skin_vertices(rig)
        hips = [body.joint_names.index(f"{side}_hip") for side in ("left", "right")]
        middle = joints[frame, hips].mean(axis=0) * [1, 1, 0]
        heads = bone_heads(rig)
        rig_middle = (heads["left hip"] + heads["right hip"]) / 2 * [1, 1, 0]
        for row, axes in enumerate(((0, 2), (1, 2))):
            corner = np.array([(k + 0.5) * width, (row + 0.95) * height])

            def at(points: NDArray[np.float64], origin=None, axes=axes, corner=corner):
                flat = (points - origin)[..., list(axes)] * [1, -1] * _PIXELS_PER_M + corner
                return np.round(flat).astype(int)

            skin = at(vertices, rig_middle)
            for first, second in edges if len(rig.skins) == 1 else ():
                cv2.line(
                    picture, tuple(skin[first].tolist()), tuple(skin[second].tolist()), (150,) * 3
                )
            for point in skin if len(rig.skins) > 1 else ():
                cv2.circle(picture, tuple(point.tolist()), 2, (120,) * 3, -1)
            own = at(joints[frame], middle)
            for joint, parent in enumerate(parents.tolist()):
                if parent >= 0:
                    ends = tuple(own[joint].tolist()), tuple(own[parent].tolist())
                    cv2.line(picture, *ends, (40, 40, 220), 1)
    return picture


def main(motion_file: Path, pictures: Path | None) -> None:
    """Print the table."""
    motion = Motion.load(motion_file)
    body = load_body(str(motion.body_model))
    print("| rig | limbs | hands | trunk | lowest point | wrong bones | warnings |")
    print("|---|---|---|---|---|---|---|")
    for kind in KINDS:
        rig, found = figures(kind, motion, body)
        low, high = found.lowest_m
        codes = ", ".join(notice.code for notice in found.notices) or "–"
        print(
            f"| {kind.name} | {found.limbs_deg:.1f}° | {found.hands_deg:.1f}° | "
            f"{found.trunk_deg:.1f}° | {100 * low:.1f} to {100 * high:.1f} cm | "
            f"{', '.join(found.wrong_bones) or '–'} | {codes} |",
            flush=True,
        )
        if pictures is not None:
            pictures.mkdir(parents=True, exist_ok=True)
            name = "".join(c if c.isalnum() else "_" for c in kind.name)
            cv2.imwrite(str(pictures / f"{name}.png"), drawn(rig, motion, body))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
