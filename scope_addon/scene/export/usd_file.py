# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a USD crate file holds what Blender's exporter has put into it.

USD writes a crate piece by piece, and the exporter does not say when the disk refuses one of them:
the others follow, and there are zeros in its place. So the layer is copied in memory before it is
saved, and compared with what the file holds, by USD's own module, which comes with Blender.
"""

from __future__ import annotations

import importlib
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy

_CRATE = b"PXR-USDC"
_SECTION = struct.Struct("<16sqq")  # name, start, size
# A layer of USD; None where Blender has no module for it.
Layer = Any


@contextmanager
def saved_layers() -> Iterator[list[Layer]]:
    """Collect a copy of each layer that Blender's exporter saves within the block; of none, if this
    Blender comes without USD's module.
    """
    copies: list[Layer] = []
    sdf = _usd_module()
    if sdf is None:
        yield copies
        return

    class CopyLayer(bpy.types.USDHook):  # type: ignore[misc]
        """Copies the layer once it is complete."""

        bl_idname = "scope_copy_layer"
        bl_label = "Copy Layer"

        @staticmethod
        def on_export(context: Any) -> bool:
            layer = sdf.Layer.CreateAnonymous()
            layer.TransferContent(context.get_stage().GetRootLayer())
            copies.append(layer)
            return True

    bpy.utils.register_class(CopyLayer)
    try:
        yield copies
    finally:
        bpy.utils.unregister_class(CopyLayer)


def has_content(path: Path, layer: Layer) -> bool:
    """Return whether a file holds every value of a layer."""
    sdf = _usd_module()
    paths: list[Any] = []
    layer.Traverse(sdf.Path.absoluteRootPath, paths.append)
    try:
        found = sdf.Layer.OpenAsAnonymous(str(path))
        return all(
            _has_values(found.GetObjectAtPath(each), spec)
            for each in paths
            if (spec := layer.GetObjectAtPath(each)) is not None  # the target of a relation is none
        )
    except (RuntimeError, AttributeError):  # USD cannot read it; it lacks an object
        return False


def _has_values(found: Any, spec: Any) -> bool:
    return all(_is_same(found.GetInfo(key), spec.GetInfo(key)) for key in spec.ListInfoKeys())


def _is_same(found: Any, value: Any) -> bool:
    if found == value:
        return True
    text = repr(value)  # NaN, as rigs may have it, differs from itself
    return "nan" in text and repr(found) == text


def _usd_module() -> Any:
    """Return USD's module for layers; None if Blender comes without it.

    Blender's Python finds the modules that come with it, but not another Python, into which Blender
    was installed as a module.
    """
    python = Path(bpy.utils.resource_path("LOCAL"), "python", "lib")
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    before = list(sys.path)
    sys.path += [str(python / version / "site-packages"), str(python / "site-packages")]
    try:
        return importlib.import_module("pxr.Sdf")
    except ImportError:
        return None
    finally:
        sys.path[:] = before


def is_whole_crate(path: Path) -> bool:
    """Return whether a USD crate file has its table of contents, and more than the root of the
    scene.

    The table is written last and located by the header. The exporter writes the file first without
    and then with the scene.

    Source: OpenUSD, pxr/usd/usd/crateFile.h: identifier (8 bytes), version (8), offset of the table
    (8); the table is a count (8) of sections of 32 bytes each; the section of paths begins with
    their count (8).
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(24)
        if len(head) < 24 or head[:8] != _CRATE:
            return False
        (table,) = struct.unpack("<q", head[16:])
        if not 24 <= table <= size - 8:
            return False
        file.seek(table)
        (count,) = struct.unpack("<q", file.read(8))
        if not 0 < count <= (size - table - 8) // _SECTION.size:
            return False
        sections = [_SECTION.unpack(file.read(_SECTION.size)) for _ in range(count)]
        starts = [start for name, start, _ in sections if name.rstrip(b"\0") == b"PATHS"]
        if not starts or not 0 <= starts[0] <= size - 8:
            return False
        file.seek(starts[0])
        (paths,) = struct.unpack("<q", file.read(8))
    return bool(paths > 1)
