# SPDX-License-Identifier: GPL-3.0-or-later
"""What the page's 3D view needs of a capture, in quantized arrays as base64 text.

    positions    uint16, low + step · n per axis      at most half a step, 20 µm, off
    weights      uint8, their sum 255                 four per vertex
    rotations    int16 quaternion (w, x, y, z) · 32767, w ≥ 0: at most 0.005° off per joint

The view poses the skeleton and skins the mesh from these by the equations of `solver.body`.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ...solver.rotations import quaternion_from_rotation_vector
from ..arrays import Float64Array, Uint8Array
from ..motion import Motion

MAX_BYTES = 4_500_000  # of all people over time; of longer clips, every n-th frame is shown
_QUATERNION = 32767


def shown_rows(motions: Sequence[Motion]) -> NDArray[np.int64]:
    """Return the rows of the motions that the page shows, (n,): all, or evenly spaced ones of a
    very long clip.
    """
    frames = len(motions[0])
    of_camera = 12 * 4 + 8
    of_root = 3 * 4 + 1
    size = frames * (of_camera + sum(8 * motion.joint_count + of_root for motion in motions))
    return np.arange(0, frames, max(1, -(-size // MAX_BYTES)))


def viewer_data(
    motions: Sequence[Motion], body: Body, rows: NDArray[np.int64], colors: Sequence[str]
) -> dict[str, Any]:
    """Return the body, the people's motions and the camera as a value for JSON.

    :param rows: (n,) rows of the motions.
    :param colors: of the people, in CSS.
    """
    triangles = body.triangles()
    index = np.uint16 if len(body.v_template) <= 1 << 16 else np.uint32
    first = motions[0]
    camera = first.world_from_camera[rows, :3]
    static = bool((camera == camera[0]).all())
    zoom = np.ones(len(first)) if first.zoom is None else first.zoom
    return {
        "parents": body.parents.tolist(),
        "joints": list(body.joint_names),
        "triangles": encoded(triangles.astype(index)),
        "wide": index is np.uint32,
        "skinJoints": encoded(body.skin_joints.astype(np.uint8)),
        "skinWeights": encoded(quantized_weights(body.skin_weights)),
        "times": encoded(first.timestamps[rows].astype(np.float32)),
        "frames": encoded(first.frames[rows].astype(np.int32)),
        "camera": encoded(camera[: 1 if static else None].astype(np.float32)),
        "intrinsics": first.intrinsics.tolist(),
        "zoom": encoded(zoom[rows].astype(np.float32)),
        "imageSize": first.image_size.tolist(),
        "people": [
            _person(motion, body, rows, color)
            for motion, color in zip(motions, colors, strict=True)
        ],
    }


def _person(motion: Motion, body: Body, rows: NDArray[np.int64], color: str) -> dict[str, Any]:
    betas = motion.betas.astype(float)
    positions, low, step = quantized_positions(body.rest_vertices(betas))
    return {
        "color": color,
        "positions": encoded(positions),
        "low": low.tolist(),
        "step": step.tolist(),
        "rest": np.round(body.rest_joints(betas), 6).tolist(),
        "rotations": encoded(
            quantized_rotations(motion.poses[rows].reshape(len(rows), -1, 3).astype(float))
        ),
        "trans": encoded(motion.trans[rows].astype(np.float32)),
        "valid": encoded(motion.valid[rows].astype(np.uint8)),
    }


def encoded(array: NDArray[Any]) -> str:
    """Return an array, (...,), in C order and little-endian, as base64."""
    little = np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<"), copy=False)
    return base64.b64encode(little.tobytes()).decode("ascii")


def quantized_positions(
    points: Float64Array,
) -> tuple[NDArray[np.uint16], Float64Array, Float64Array]:
    """Return (V, 3) integers n, and low (3,) and step (3,), so that the points (V, 3) are low +
    step · n.
    """
    low = points.min(axis=0)
    step = np.maximum(np.ptp(points, axis=0), 1e-9) / 65535
    return np.round((points - low) / step).astype(np.uint16), low, step


def quantized_weights(weights: Float64Array) -> Uint8Array:
    """Return weights (V, 4), each row of which has the sum 1, as integers (V, 4) with the sum
    255.
    """
    integers = np.round(255 * weights).astype(int)
    largest = integers.argmax(axis=1)
    integers[np.arange(len(integers)), largest] += 255 - integers.sum(axis=1)
    return integers.astype(np.uint8)


def quantized_rotations(poses: Float64Array) -> NDArray[np.int16]:
    """Return axis-angle vectors (T, K+1, 3) as unit quaternions (T, K+1, 4), w first and not
    negative, times 32767.
    """
    quaternions = quaternion_from_rotation_vector(poses)
    quaternions *= np.where(quaternions[..., :1] < 0, -1, 1)
    return np.round(_QUATERNION * quaternions).astype(np.int16)
