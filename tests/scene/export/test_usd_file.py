# SPDX-License-Identifier: GPL-3.0-or-later
"""A USD file that lacks a piece is not written, though its length and its table are right."""

from pathlib import Path

import bpy
import pytest
from scope.scope_addon.errors import OutputError
from scope.scope_addon.scene.export import formats
from scope.scope_addon.scene.export.export import export_motions

PIECE = 256  # bytes

pytestmark = pytest.mark.skipif(
    bpy.app.version < (4, 5, 0), reason="the module of Blender 4.2 comes without USD's own"
)


@pytest.mark.parametrize("place", [0.3, 0.95])
def test_a_piece_that_the_disk_has_refused_is_noticed(
    body, make_motion, tmp_path, monkeypatch, place
):
    export = formats.call_operator

    def refuse_piece(operator, **settings):
        export(operator, **settings)
        file = Path(settings["filepath"])
        content = bytearray(file.read_bytes())
        start = int(place * len(content))
        assert any(content[start : start + PIECE])
        content[start : start + PIECE] = bytes(PIECE)
        file.write_bytes(content)
        assert formats.is_whole_crate(file)

    path = tmp_path / "walk.usdc"
    path.write_text("before")
    monkeypatch.setattr(formats, "call_operator", refuse_piece)
    with pytest.raises(OutputError, match="could not be written completely"):
        export_motions([make_motion(body, 5)], body, path)
    assert path.read_text("utf-8") == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_what_is_no_number_is_the_same_in_the_file(tmp_path):
    sdf = formats._usd_module()
    path = tmp_path / "some.usdc"
    layer, other = (sdf.Layer.CreateAnonymous() for _ in range(2))
    for each, last in ((layer, 0.0), (other, 1.0)):
        prim = sdf.PrimSpec(each, "some", sdf.SpecifierDef)
        sizes = sdf.AttributeSpec(prim, "sizes", sdf.ValueTypeNames.FloatArray)
        sizes.default = [float("nan"), -0.0, last]
    layer.Export(str(path))
    assert formats.has_content(path, layer)
    assert not formats.has_content(path, other)


def test_nothing_stays_registered(body, make_motion, tmp_path):
    hooks = bpy.types.USDHook.__subclasses__
    before = len([each for each in hooks() if each.is_registered])
    export_motions([make_motion(body, 1)], body, tmp_path / "walk.usdc")
    assert len([each for each in hooks() if each.is_registered]) == before
