# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion for avatars: VRM Animation files (.vrma), binary glTF with the extension
VRMC_vrm_animation 1.0 of the VRM consortium.

Nodes are the body's joints in its T-pose, y up and facing +z, with the names of VRM's humanoid. The
hips have a translation and all of them rotations, at the times of the motion's frames. Players put
the rotations on any avatar and scale the translation by the height of its hips. Free of bpy.
"""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING, Any

import numpy as np

from ...arrays import Float64Array
from ...kinematics.axes import R_WORLD_MODEL
from ...motion import Motion
from ...retarget.bone_names import bone_names

if TYPE_CHECKING:
    from ....solver.body import Body

_EXTENSION = "VRMC_vrm_animation"
_FLOAT = 5126
_JSON_CHUNK = b"JSON"
_BINARY_CHUNK = b"BIN\x00"


def vrma_bytes(motion: Motion, body: Body, start_s: float) -> bytes:
    """Return the content of a file.

    :param body: that the motion was fitted with.
    :param start_s: timestamp at which the file begins, seconds.
    """
    # It loads numba, and the command line starts without it.
    from ...kinematics.smoothing import continuous_quaternions

    betas = np.asarray(motion.betas, float)
    rest = body.rest_joints(betas)
    rest_height_m = rest[0, 1] - body.rest_vertices(betas)[:, 1].min()
    local = motion.joint_rotations()
    hips = (rest[0] + np.asarray(motion.trans, float)) @ R_WORLD_MODEL
    # The root of the motion turns the model into the world, z up; here, the world is y up, too.
    local[:, 0] = R_WORLD_MODEL.T @ local[:, 0]
    named = bone_names("vrm")
    if "left_index1" not in body.joint_names:
        named = {part: name for part, name in named.items() if not part.endswith("_hand")}
    joints = [joint for joint, part in enumerate(body.joint_names) if part in named]
    nodes: list[dict[str, Any]] = []
    for joint in joints:
        offset = rest[joint] - rest[body.parents[joint]] if joint else [0.0, rest_height_m, 0.0]
        below = [k for k, each in enumerate(joints) if each and body.parents[each] == joint]
        node = {"name": named[body.joint_names[joint]], "translation": [float(v) for v in offset]}
        nodes.append(node | ({"children": below} if below else {}))
    file = _Buffers()
    times = file.add(np.asarray(motion.timestamps - start_s), "SCALAR", bounds=True)
    outputs = [(0, "translation", file.add(hips, "VEC3"))]
    turns = continuous_quaternions(local)[..., [1, 2, 3, 0]]  # glTF has the real part last.
    for node_number, joint in enumerate(joints):
        outputs.append((node_number, "rotation", file.add(turns[:, joint], "VEC4")))
    gltf = {
        "asset": {"version": "2.0", "generator": "Scope"},
        "extensionsUsed": [_EXTENSION],
        "extensions": {
            _EXTENSION: {
                "specVersion": "1.0",
                "humanoid": {
                    "humanBones": {node["name"]: {"node": k} for k, node in enumerate(nodes)}
                },
            }
        },
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "animations": [
            {
                "samplers": [{"input": times, "output": output} for *_, output in outputs],
                "channels": [
                    {"sampler": k, "target": {"node": node_number, "path": path}}
                    for k, (node_number, path, _) in enumerate(outputs)
                ],
            }
        ],
        "accessors": file.accessors,
        "bufferViews": file.views,
        "buffers": [{"byteLength": len(file.content)}],
    }
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    chunks = [(_JSON_CHUNK, text), (_BINARY_CHUNK, bytes(file.content))]
    whole = b"".join(struct.pack("<I4s", len(data), kind) + data for kind, data in chunks)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(whole)) + whole


class _Buffers:
    """The binary part of a file, whose accessors have four-byte floats."""

    def __init__(self) -> None:
        self.content = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: Float64Array, kind: str, *, bounds: bool = False) -> int:
        """Add an array (T,) or (T, n), and return the number of its accessor."""
        data = np.asarray(values, "<f4")
        self.views.append({"buffer": 0, "byteOffset": len(self.content), "byteLength": data.nbytes})
        self.content += data.tobytes()
        accessor = {"bufferView": len(self.accessors), "componentType": _FLOAT}
        accessor |= {"count": len(data), "type": kind}  # type: ignore[dict-item]
        limits = {"min": [float(data.min())], "max": [float(data.max())]} if bounds else {}
        self.accessors.append(accessor | limits)
        return len(self.accessors) - 1
