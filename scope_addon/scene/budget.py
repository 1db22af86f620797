# SPDX-License-Identifier: GPL-3.0-or-later
"""How much memory a file may need: a base, and more for each byte of content.

A few bytes of a file can claim hours of motion, years between two frames, or a rig of endless
arrays. Files of real captures and rigs need far less than what is permitted here.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..errors import MotionFileError, OutputError

if TYPE_CHECKING:
    from bpy.types import Object, Scene

    from ..motion import Motion

BASE_BYTES = 2 << 30
LAST_FRAME = 1_048_574  # of Blender's timeline; the first one is its negative
_BYTES_PER_BONE = 2900  # of a frame, by the exporter of .glb; the others need less
_BYTES_PER_ROW = 10_000  # of markers or angles, and of a frame from which they follow
_BYTES_PER_BYTE = 1000  # of compressed content; captures need 300, from 100 to 400
_SAMPLES_PER_KEY = 5  # of a scene whose rate is higher than the footage's
_CURVES_PER_BONE = 4  # of a rotation


def check_content(motion: Motion) -> None:
    """Refuse a motion whose keyframes would need far more memory than its content explains.

    :raises MotionFileError: it is one.
    """
    needed_bytes = len(motion) * motion.joint_count * _BYTES_PER_BONE
    if not _is_explained(motion, needed_bytes):
        raise MotionFileError(
            f"the motion has {len(motion)} frames, but hardly any movement; as keyframes it would "
            f"need {needed_bytes / 1e9:.0f} GB of memory: cut it, or write an .npz"
        )


def check_rows(motion: Motion) -> None:
    """Refuse a motion of which a file with one row for each moment, at the motion's rate, would
    need far more memory than its content explains.

    :raises OutputError: it is one.
    """
    duration_s = float(motion.timestamps[-1] - motion.timestamps[0])
    rows = 1.0 + duration_s * motion.mocap_framerate
    needed_bytes = (len(motion) + rows) * _BYTES_PER_ROW
    if not _is_explained(motion, needed_bytes):
        raise OutputError(
            f"the motion has {len(motion)} frames within {duration_s:.0f} s, but hardly any "
            f"movement; in this format it would need {needed_bytes / 1e9:.0f} GB of memory: cut "
            "it, or write an .npz"
        )


def _is_explained(motion: Motion, needed_bytes: float) -> bool:
    """Return whether a motion's content explains that it needs so much memory."""
    if needed_bytes <= BASE_BYTES:
        return True
    content = zlib.compress(np.concatenate([motion.poses, motion.trans], axis=1).tobytes(), 1)
    return needed_bytes <= BASE_BYTES + _BYTES_PER_BYTE * len(content)


def check_last_frame(frame: float) -> None:
    """Refuse a motion that ends after the last frame that Blender has.

    :raises MotionFileError: it does.
    """
    if frame > LAST_FRAME:
        raise MotionFileError(
            f"the motion ends at frame {frame:.0f} of the scene, but Blender has only "
            f"{LAST_FRAME}: choose a shorter range of the footage, or write an .npz"
        )


def check_samples(scene: Scene, rigs: Sequence[Object]) -> None:
    """Refuse to sample every bone of rigs at every frame of a scene, if that needs far more memory
    than the movement of their keys explains: few keys that years lie between, or a still motion on
    a rig of thousands of bones.

    :raises OutputError: it does.
    """
    from . import actions  # Loads bpy, which on loading may print to stdout.

    frames = scene.frame_end - scene.frame_start + 1
    bones = sum(len(rig.data.bones) for rig in rigs)
    needed_bytes = frames * bones * _BYTES_PER_BONE
    if needed_bytes <= BASE_BYTES or any(actions.nla_strips(rig) for rig in rigs):
        return
    keys = [actions.read_keys(curve)[:, 1] for rig in rigs for curve in actions.fcurves(rig)]
    content = zlib.compress(np.concatenate([*keys, np.empty(0, np.float32)]).tobytes(), 1)
    # The other bones of a rig follow those that have keys, and are sampled like them.
    bones_per_keyed_bone = bones / max(1.0, len(keys) / _CURVES_PER_BONE)
    explained_bytes = _SAMPLES_PER_KEY * _BYTES_PER_BYTE * len(content) * bones_per_keyed_bone
    if needed_bytes > BASE_BYTES + explained_bytes:
        raise OutputError(
            f"{frames} frames of {bones} bones would need {needed_bytes / 1e9:.0f} GB of memory, "
            "for a motion with hardly any movement: choose a shorter range of the footage or a rig "
            "with fewer bones, or write an .npz or a .blend"
        )
