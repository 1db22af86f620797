# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of datablocks: no longer than Blender allows, and not unique where some are linked from
another file.
"""

from __future__ import annotations

import bpy

_LONGEST = 63 if bpy.app.version < (5, 0) else 255  # bytes
SUFFIX_BYTES = 24  # room for what is appended to a capture's name, such as ``_person12_body.001``


def short_name(name: str) -> str:
    """Return the beginning of a capture's name to which Blender can append a suffix without
    truncating it.

    Blender cuts off the end, so that the names of armature, body and camera would be the same but
    for a number.
    """
    return name.encode("utf-8", "replace")[: _LONGEST - SUFFIX_BYTES].decode("utf-8", "ignore")


def holds(collection: bpy.types.Collection, obj: bpy.types.Object) -> bool:
    """Return whether an object is in a collection or in one below it.

    Looking it up by its name alone would also find an object of that name which is linked from
    another file.
    """
    return _contains(collection.all_objects, obj)


def is_in_layer(view_layer: bpy.types.ViewLayer, obj: bpy.types.Object) -> bool:
    """Return whether an object is in a view layer, found as in `holds`."""
    return _contains(view_layer.objects, obj)


def _contains(objects: bpy.types.bpy_prop_collection, obj: bpy.types.Object) -> bool:
    # the panel asks at every redraw, and only a namesake needs the whole scene
    named = objects.get(obj.name)
    return named == obj or (named is not None and any(each == obj for each in objects))
