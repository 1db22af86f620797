# SPDX-License-Identifier: GPL-3.0-or-later
"""The key times of a glTF file are those of the footage."""

import struct

import numpy as np
import pytest
from scope.scope_addon.scene.export.export import ExportOptions, export_motions

from ..exported import glb_json


@pytest.mark.parametrize("rate", [12.5, 24000 / 1001, 30000 / 1001, 24.449])
def test_glb_key_times_are_those_of_the_footage(body, make_motion, tmp_path, rate):
    """Read from the file itself, because Blender's importer has the same error as its exporter."""
    motion = make_motion(body, 7, rate=rate)
    path = tmp_path / "walk.glb"
    export_motions([motion], body, path, export_options=ExportOptions(camera=True))
    gltf = glb_json(path)
    data = path.read_bytes()
    assert len(data) == struct.unpack("<I", data[8:12])[0]
    binary = data[28 + struct.unpack("<I", data[12:16])[0] :]
    for index in {sampler["input"] for sampler in gltf["animations"][0]["samplers"]}:
        accessor = gltf["accessors"][index]
        start = gltf["bufferViews"][accessor["bufferView"]]["byteOffset"]
        times = np.frombuffer(binary, "<f4", accessor["count"], start)
        np.testing.assert_allclose(times, motion.timestamps[: len(times)], atol=1e-6)
        assert (accessor["min"], accessor["max"]) == ([times[0]], [times[-1]])
        assert len(times) in (2, 7)  # constant shapes have their ends alone
