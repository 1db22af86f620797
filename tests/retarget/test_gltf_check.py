# SPDX-License-Identifier: GPL-3.0-or-later
"""glTF files that claim more than they hold, or name other files, are refused before an importer
reads them.
"""

import copy
import json
import os

import pytest
from scope.scope_addon.retarget.rig_source import check_gltf
from scope.solver.errors import InputError

from .made_files import glb

GLTF = {
    "asset": {"version": "2.0"},
    "buffers": [{"byteLength": 400}],
    "bufferViews": [
        {"buffer": 0, "byteOffset": 16, "byteLength": 384},
        {"buffer": 0, "byteLength": 16},
    ],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "type": "MAT4", "count": 6},
        {
            "componentType": 5126,
            "type": "VEC3",
            "count": 9,
            "sparse": {
                "count": 2,
                "indices": {"bufferView": 1, "componentType": 5123},
                "values": {"bufferView": 0},
            },
        },
    ],
}


def changed(*keys, to):
    gltf = copy.deepcopy(GLTF)
    inner = gltf
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = to
    return gltf


def test_a_whole_file_passes(tmp_path):
    check_gltf(glb(tmp_path / "rig.glb", GLTF))
    check_gltf(glb(tmp_path / "strided.glb", changed("bufferViews", 0, "byteStride", to=64)))


@pytest.mark.parametrize(
    "gltf",
    [
        changed("accessors", 0, "count", to=7),
        changed("accessors", 0, "count", to="6"),
        changed("accessors", 0, "byteOffset", to=4),
        changed("accessors", 1, "count", to=2_000_000_000),
        changed("accessors", 1, "sparse", "count", to=9),
        changed("bufferViews", 0, "byteLength", to=385),
        changed("buffers", 0, "byteLength", to=401),
        changed("buffers", 0, "uri", to="data:application/octet-stream;base64,AAAA"),
        [1, 2],
    ],
)
def test_a_file_that_contradicts_itself_is_refused(tmp_path, gltf):
    with pytest.raises(InputError, match=r"rig\.glb: this glTF file is damaged"):
        check_gltf(glb(tmp_path / "rig.glb", gltf))


def test_files_beside_the_rig_are_used(tmp_path):
    (tmp_path / "textures").mkdir()
    (tmp_path / "textures" / "my skin.png").write_bytes(b"png")
    (tmp_path / "rig.bin").write_bytes(bytes(400))
    gltf = changed("buffers", 0, "uri", to="rig.bin") | {
        "images": [{"uri": "textures/my%20skin.png"}]
    }
    (tmp_path / "rig.gltf").write_text(json.dumps(gltf))
    check_gltf(tmp_path / "rig.gltf")
    (tmp_path / "rig.bin").write_bytes(bytes(399))
    with pytest.raises(InputError, match="damaged"):
        check_gltf(tmp_path / "rig.gltf")


@pytest.mark.parametrize(
    ("uri", "says"),
    [
        ("../other.bin", "outside its own folder"),
        ("..%2Fother.bin", "outside its own folder"),
        ("https://example.com/a.bin", "outside its own folder"),
        ("link.bin", "outside its own folder"),
        ("missing.bin", "is missing"),
    ],
)
def test_other_files_are_not_read(tmp_path, uri, says):
    folder = tmp_path / "rig"
    folder.mkdir()
    (tmp_path / "other.bin").write_bytes(bytes(400))
    (folder / "link.bin").symlink_to(tmp_path / "other.bin")
    for gltf in (changed("buffers", 0, "uri", to=uri), {**GLTF, "images": [{"uri": uri}]}):
        with pytest.raises(InputError, match=says):
            check_gltf(glb(folder / "rig.glb", gltf))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no named pipes in folders")
def test_a_pipe_beside_the_rig_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "rig.bin")
    with pytest.raises(InputError, match=r"rig\.bin is a pipe or a device"):
        check_gltf(glb(tmp_path / "rig.glb", changed("buffers", 0, "uri", to="rig.bin")))


@pytest.mark.parametrize("extension", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_a_compression_that_blender_does_not_read_is_named(tmp_path, extension):
    """Its buffers have no data without the extension, but the file is not damaged."""
    path = tmp_path / "rig.gltf"
    buffers = [{"byteLength": 100, "extensions": {extension: {"fallback": True}}}]
    gltf = {"extensionsRequired": [extension], "buffers": buffers}
    path.write_text(json.dumps(gltf))
    with pytest.raises(InputError, match=f"is compressed with {extension}") as caught:
        check_gltf(path)
    assert "damaged" not in str(caught.value)


@pytest.mark.parametrize("bones", [4096, 4097])
def test_bones_are_counted_before_blender_imports_them(tmp_path, bones):
    """Once each, however many skins they move."""
    content = copy.deepcopy(GLTF)
    content["skins"] = [{"joints": list(range(bones))}, {"joints": list(range(bones))}]
    path = tmp_path / "rig.glb"
    glb(path, content)
    if bones <= 4096:
        check_gltf(path)
        return
    with pytest.raises(InputError, match="has 4097 bones, with which Blender would take minutes"):
        check_gltf(path)
