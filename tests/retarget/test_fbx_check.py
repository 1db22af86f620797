# SPDX-License-Identifier: GPL-3.0-or-later
"""FBX files whose arrays unpack to more than they say, or whose nodes do not fit into each other,
are refused.
"""

import struct
import tracemalloc

import pytest
from scope.scope_addon.retarget import rig_source
from scope.scope_addon.retarget.rig_source import check_fbx
from scope.solver.errors import InputError

from .made_files import array, fbx, node


def test_a_whole_file_passes(tmp_path):
    arrays = (
        array(b"d", 3, bytes(24)),
        array(b"i", 2, bytes(8), compressed=False),
        array(b"b", 0, b""),
    )
    check_fbx(fbx(tmp_path / "rig.fbx", *arrays, b"C\x01", b"R" + struct.pack("<I", 2) + b"ab"))


@pytest.mark.parametrize(
    ("properties", "says"),
    [
        ([array(b"d", 4, bytes(24))], "not have the size"),
        ([array(b"i", 3, bytes(8), compressed=False)], "not have the size"),
        ([array(b"i", 2, bytes(8), size=1000)], "does not lie within"),
        ([array(b"d", 0xFFFFFFFF, bytes(24))], "too large"),
        ([b"S" + struct.pack("<I", 0xFFFFFFFF)], "does not lie within"),
        ([b"Q"], "of type 'Q'"),
        ([b"d" + struct.pack("<III", 1, 1, 3) + b"bad"], "incorrect header"),
    ],
)
def test_a_file_that_contradicts_itself_is_refused(tmp_path, properties, says):
    with pytest.raises(InputError, match=rf"rig\.fbx: this FBX file is damaged .*{says}"):
        check_fbx(fbx(tmp_path / "rig.fbx", *properties))


def test_nodes_without_end_are_refused(tmp_path, monkeypatch):
    """They would be read for hours, or until nothing is left of the stack."""
    path = fbx(tmp_path / "rig.fbx")  # two nodes, and the end of each list of them
    monkeypatch.setattr(rig_source, "_MAX_NODES", 4)
    check_fbx(path)
    monkeypatch.setattr(rig_source, "_MAX_NODES", 3)
    with pytest.raises(InputError, match="it has too many nodes"):
        check_fbx(path)
    monkeypatch.setattr(rig_source, "_DEEPEST", 0)
    with pytest.raises(InputError, match="nested too deeply"):
        check_fbx(path)


def model(number: int, kind: bytes):
    """An object of a scene, as a function of its offset."""
    name = f"bone {number}".encode()
    texts = [b"S" + struct.pack("<I", len(text)) + text for text in (name, kind)]
    return lambda at: node(at, b"Model", [b"L" + struct.pack("<q", number), *texts])


@pytest.mark.parametrize(("kind", "bones"), [(b"LimbNode", 4096), (b"Limb", 4097), (b"Null", 4097)])
def test_bones_are_counted_before_blender_imports_them(tmp_path, kind, bones):
    path = fbx(tmp_path / "rig.fbx")
    made = node(27, b"Objects", [], [model(number, kind) for number in range(bones)])
    path.write_bytes(path.read_bytes()[:27] + made + bytes(13))
    if kind == b"Null" or bones <= 4096:
        check_fbx(path)
        return
    with pytest.raises(InputError, match="has 4097 bones, with which Blender would take minutes"):
        check_fbx(path)


def test_a_bomb_takes_no_memory(tmp_path):
    """30 MB of zeros in 30 kB, said to be 24 bytes."""
    path = fbx(tmp_path / "rig.fbx", array(b"d", 3, bytes(30_000_000)))
    assert path.stat().st_size < 60_000
    tracemalloc.start()
    with pytest.raises(InputError, match="not have the size"):
        check_fbx(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5_000_000
