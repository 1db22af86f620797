# SPDX-License-Identifier: GPL-3.0-or-later
"""Correcting the key times of a binary glTF at frame rates such as 29.97.

Blender's exporter computes the rate as ``fps`` times ``fps_base`` instead of fps / fps_base: 29.97
becomes 30.03, and the motion drifts from the footage's sound. Therefore a scene is written at its
integer ``fps``, and the times in the file are scaled afterwards. (Blender's importer has the same
error as its exporter.)
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

# bytes: magic, version, length of the file; length, type of a chunk
_HEADER = 12
_CHUNK_HEADER = 8


@contextmanager
def corrected_key_times(path: Path, scene: bpy.types.Scene) -> Iterator[None]:
    """Correct the key times of the .glb that the block writes to ``path``."""
    base = scene.render.fps_base
    scene.render.fps_base = 1.0
    try:
        yield
    finally:
        scene.render.fps_base = base
    if base != 1.0 and path.is_file():
        _scale_times(path, base)


def _scale_times(path: Path, factor: float) -> None:
    """Multiply the times of all keys in the file."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, _HEADER)
    begin = _HEADER + _CHUNK_HEADER
    gltf = json.loads(data[begin : begin + length])
    binary = bytearray(data[begin + length :])
    for index in {
        sampler["input"]
        for animation in gltf.get("animations", ())
        for sampler in animation["samplers"]
    }:
        accessor = gltf["accessors"][index]
        start = gltf["bufferViews"][accessor["bufferView"]].get("byteOffset", 0) + accessor.get(
            "byteOffset", 0
        )
        times = np.frombuffer(binary, "<f4", accessor["count"], _CHUNK_HEADER + start)
        times *= np.float32(factor)
        accessor["min"] = [float(times.min())]
        accessor["max"] = [float(times.max())]
    text = json.dumps(gltf, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    total = begin + len(text) + len(binary)
    head = data[:8] + struct.pack("<II", total, len(text)) + data[16:begin]
    path.write_bytes(head + text + binary)
