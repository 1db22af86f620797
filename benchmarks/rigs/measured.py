# SPDX-License-Identifier: GPL-3.0-or-later
"""Retargeting a motion to a made rig, and measuring how well it fits."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.motion import Motion
from ...scope_addon.notices import Notice
from ...scope_addon.scene.build import BuildOptions, build_scene
from ...scope_addon.scene.rig_retarget import retarget, usable_guess
from ...solver.body import Body
from ...solver.rotations import exp
from .kinds import RigKind
from .made import MadeRig, make_rig

_SEGMENTS = [
    (f"{side}_{first}", f"{side}_{second}")
    for side in ("left", "right")
    for first, second in (
        *(("hip", "knee"), ("knee", "ankle")),
        *(("shoulder", "elbow"), ("elbow", "wrist")),
    )
]


@dataclass(frozen=True)
class RigFigures:
    """How well a rig follows a motion of T measured frames."""

    limbs_deg: float  # the largest angle between a limb and the body's
    hands_deg: float
    trunk_deg: float
    lowest_m: tuple[float, float]  # the smallest and largest height of the lowest vertex
    wrong_bones: list[str]  # that were taken for another part than they are
    notices: list[Notice]


def retargeted(
    kind: RigKind, motion: Motion, body: Body
) -> tuple[MadeRig, list[str], list[Notice]]:
    """Make a rig in an empty file and retarget the motion to it, as the panel does.

    :return: the rig, the bones that were guessed wrong, and the warnings.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.fps = round(motion.mocap_framerate)
    built = build_scene([motion], body, None, BuildOptions(start_frame=1.0))
    person = built.people[0]
    rig = make_rig(kind)
    bone_map = usable_guess(rig.armature)
    result = retarget(person.armature, body, motion.betas, rig.armature, bone_map, built.frame_rate)
    parts = {"ball": "foot"}
    right = {
        rig.bone_at[f"{side} {place}"]: f"{side}_{parts.get(place, place)}"
        for side in ("left", "right")
        for place in ("hip", "knee", "ankle", "ball", "shoulder", "elbow", "wrist")
        if f"{side} {place}" in rig.bone_at
    }
    wrong = [bone for bone, part in right.items() if bone_map.parts.get(bone) != part]
    return rig, wrong, result.warnings


def measured(
    rig: MadeRig, joints: NDArray[np.float64], names: list[str], frames: NDArray[np.intp]
) -> dict[str, NDArray[np.float64]]:
    """Return the angles of limbs, hands and trunk, degrees, and the lowest points, metres.

    :param joints: (T, K+1, 3) of the body in the world, metres.
    :param frames: of those to be measured, from 0.
    """
    angles: dict[str, list[float]] = {"limbs": [], "hands": [], "trunk": []}
    lowest = []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame) + 1)
        body = dict(zip(names, joints[frame], strict=True))
        heads = bone_heads(rig)
        for first, second in _SEGMENTS:
            side, _, upper = first.partition("_")
            lower = second.partition("_")[2]
            along = heads[f"{side} {lower}"] - heads[f"{side} {upper}"]
            angles["limbs"].append(_angle(along, body[second] - body[first]))
        for side in ("left", "right"):
            along = heads[f"{side} hand"] - heads[f"{side} wrist"]
            angles["hands"].append(_angle(along, body[f"{side}_hand"] - body[f"{side}_wrist"]))
        hips = (heads["left hip"] + heads["right hip"]) / 2
        shoulders = (heads["left shoulder"] + heads["right shoulder"]) / 2
        body_hips = (body["left_hip"] + body["right_hip"]) / 2
        body_shoulders = (body["left_shoulder"] + body["right_shoulder"]) / 2
        angles["trunk"].append(_angle(shoulders - hips, body_shoulders - body_hips))
        lowest.append(skin_vertices(rig)[:, 2].min())
    found = {name: np.array(values) for name, values in angles.items()}
    return found | {"lowest": np.array(lowest)}


def bone_heads(rig: MadeRig) -> dict[str, NDArray[np.float64]]:
    """Return the heads of the bones at each place, and the ends of the hands, in the world."""
    posed = rig.armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    world = posed.matrix_world
    heads = {place: world @ posed.pose.bones[bone].head for place, bone in rig.bone_at.items()}
    for side, end in rig.hand_ends.items():
        bone = posed.pose.bones[rig.bone_at[f"{side} wrist"]]
        heads[f"{side} hand"] = world @ bone.matrix @ bone.bone.matrix_local.inverted() @ end
    return {place: np.array(head) for place, head in heads.items()}


def skin_vertices(rig: MadeRig) -> NDArray[np.float64]:
    """Return the deformed vertices of the skin (V, 3) in the world."""
    graph = bpy.context.evaluated_depsgraph_get()
    found = []
    for skin in rig.skins:
        evaluated = skin.evaluated_get(graph)
        mesh = evaluated.to_mesh()
        points = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", points)
        matrix = np.array(evaluated.matrix_world)
        found.append(points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3])
        evaluated.to_mesh_clear()
    return np.concatenate(found)


def figures(kind: RigKind, motion: Motion, body: Body) -> tuple[MadeRig, RigFigures]:
    """Retarget a motion to a kind of rig and measure every fifth frame."""
    rig, wrong, notices = retargeted(kind, motion, body)
    joints = joints_of(motion, body)
    frames = np.arange(0, len(motion), 5)
    names = list(body.joint_names)
    seen = measured(rig, joints, names, frames)
    lowest = (float(seen["lowest"].min()), float(seen["lowest"].max()))
    return rig, RigFigures(
        float(seen["limbs"].max()),
        float(seen["hands"].max()),
        float(seen["trunk"].max()),
        lowest,
        wrong,
        notices,
    )


def joints_of(motion: Motion, body: Body) -> NDArray[np.float64]:
    """Return the joints (T, K+1, 3) in the world, metres."""
    rotations = exp(motion.poses.astype(float).reshape(len(motion), -1, 3))
    _, joints = body.forward_kinematics(rotations, motion.trans.astype(float), motion.betas)
    return np.asarray(joints)


def _angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    cosine = a @ b / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-12)
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
