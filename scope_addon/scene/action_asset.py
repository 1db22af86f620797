# SPDX-License-Identifier: GPL-3.0-or-later
"""Marking an action as an asset, with a picture of its pose and with metadata for the asset
browser.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ..errors import UsageError
from ..motion import Motion
from ..review_spans import find_review_spans
from .character.bone_display import SIDES, side_of
from .skeleton_picture import skeleton_picture

TAGS = ("mocap", "scope")
CATALOGS_FILE = "blender_assets.cats.txt"
_ID = re.compile(r"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}", re.ASCII | re.IGNORECASE)
_SIZE = 256  # pixels of Blender's large previews
_MAX_BONES = 200
# of a bone without a ring: share of its length, and limits in metres
_THICKNESS = 0.12
_THIN = 0.012
_THICK = 0.07
_RING_TO_LIMB = 0.7  # a ring lies around the surface; a thinner capsule shows the limbs apart


@dataclass(frozen=True)
class AssetDetails:
    """What the asset browser shows of an asset."""

    author: str = ""
    description: str = ""
    catalog: str = ""  # path of the catalog, such as "Poses/Walks"; empty: unassigned


def mark_action(action: bpy.types.Action, details: AssetDetails) -> None:
    """Mark an action as an asset, or change the metadata of one; tags that the user has given it
    stay.

    :raises UsageError: the action is linked, or the catalog does not exist.
    """
    if action.library is not None:
        raise UsageError(
            f"the action '{action.name}' is linked from {action.library.filepath}; "
            "make it local first"
        )
    catalog = _catalog_id(details.catalog) if details.catalog else None
    action.asset_mark()
    data = action.asset_data
    for tag in TAGS:
        data.tags.new(tag, skip_if_exists=True)
    data.author = details.author
    data.description = details.description
    if catalog is not None:
        data.catalog_id = catalog


def set_preview(action: bpy.types.Action, armature: bpy.types.Object, frame: float) -> None:
    """Give an action a preview of an armature's pose at a scene frame.

    :param armature: animated by the action.
    """
    scene = bpy.context.scene
    current = scene.frame_current, scene.frame_subframe
    scene.frame_set(int(np.floor(frame)), subframe=float(frame - np.floor(frame)))
    try:
        posed = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        bones = [bone for bone in posed.pose.bones if bone.bone.use_deform] or list(
            posed.pose.bones
        )
        bones = bones[:_MAX_BONES]
        if not bones:
            return
        place = np.array(posed.matrix_world, float)
        ends = np.array([[*bone.head, *bone.tail] for bone in bones], float).reshape(-1, 2, 3)
        ends = ends @ place[:3, :3].T + place[:3, 3]
        scale = float(np.cbrt(abs(np.linalg.det(place[:3, :3]))))
        radii = scale * np.array([_radius(bone) for bone in bones])
        colors = np.array([SIDES[side_of(bone.name)] for bone in bones])
    finally:
        scene.frame_set(current[0], subframe=current[1])
    pixels = skeleton_picture(ends[:, 0], ends[:, 1], radii, colors, _SIZE)
    preview = action.preview_ensure()
    preview.image_size = (_SIZE, _SIZE)
    preview.image_pixels_float.foreach_set(pixels.ravel())


def first_reliable_frame(motion: Motion) -> int:
    """Return the first row of a motion that needs no review; 0 if all do."""
    reliable = motion.valid.copy()
    for span in find_review_spans(motion):
        reliable[span.first : span.last + 1] = False
    return int(reliable.argmax())


def catalogs() -> dict[str, str]:
    """Return the ids of the asset catalogs of the current file, by their paths; empty if it is not
    saved.
    """
    folder = _library_folder()
    found: dict[str, str] = {}
    try:
        lines = (folder / CATALOGS_FILE).read_text(encoding="utf-8").splitlines() if folder else []
    except (OSError, ValueError):
        return {}
    for line in lines:
        parts = [part.strip() for part in line.split(":")]
        if len(parts) >= 2 and _ID.fullmatch(parts[0]):  # Blender leaves out other lines too
            found[parts[1]] = parts[0]
    return found


def _catalog_id(path: str) -> str:
    known = catalogs()
    if path not in known:
        names = (
            ", ".join(sorted(known)) or "none yet: save the file and add one in the Asset Browser"
        )
        raise UsageError(f"there is no asset catalog '{path}'; there are {names}")
    return known[path]


def _library_folder() -> Path | None:
    """Return the folder of the current file's asset library: that of the preferences, or else the
    file's own.
    """
    if not bpy.data.filepath:
        return None
    folder = Path(bpy.data.filepath).parent
    libraries = [
        Path(bpy.path.abspath(each.path))
        for each in bpy.context.preferences.filepaths.asset_libraries
    ]
    around = [library for library in libraries if library == folder or library in folder.parents]
    return max(around, key=lambda library: len(library.parts), default=folder)


def _radius(bone: bpy.types.PoseBone) -> float:
    """Return the radius of a bone's capsule in the armature's units, from its ring if it has
    one.
    """
    if bone.custom_shape is not None and not bone.use_custom_shape_bone_size:
        return _RING_TO_LIMB * float(min(bone.custom_shape_scale_xyz))
    return float(np.clip(_THICKNESS * bone.length, _THIN, _THICK))
