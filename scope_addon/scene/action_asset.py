# SPDX-License-Identifier: GPL-3.0-or-later
"""Marking an action as an asset, with metadata for the asset browser and a picture of its pose.

The picture is a small one of the skeleton, drawn with numpy alone, so that no window and no
renderer is needed. Every bone is a capsule, shaded as if it was lit from the upper left. The view
is level, and shows the widest side of the pose.
"""

from __future__ import annotations

import re
from pathlib import Path

import bpy
import numpy as np
from bpy.types import Action, Object

from ...solver.errors import InputError
from ..arrays import Float32Array, Float64Array
from ..errors import UsageError
from ..kinematics.axes import transform_points
from ..motion import Motion
from ..review_spans import find_review_spans
from ..untrusted.files import check_regular
from .character.armature import SIDES, side_of
from .timing import current_frame_kept, show_frame
from .visibility import evaluated

TAGS = ("mocap", "scope")
CATALOGS_FILE = "blender_assets.cats.txt"
_LARGEST_BYTES = 1 << 24  # of that file
_ID = re.compile(r"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}", re.ASCII | re.IGNORECASE)
_SIZE = 256  # pixels of Blender's large previews
_MAX_BONES = 200
# of a bone without a ring: share of its length, and limits in metres
_THICKNESS = 0.12
_THIN = 0.012
_THICK = 0.07
_RING_TO_LIMB = 0.7  # a ring lies around the surface; a thinner capsule shows the limbs apart
_FINER = 2  # drawn at this multiple of the size, then averaged
_MARGIN = 0.08  # of the size
_LIGHT = np.array([-0.45, 0.6, 0.66])  # unit vector towards the light: right, up, to the viewer
_AMBIENT = 0.4


def mark_action(action: Action, author: str, description: str, catalog: str) -> None:
    """Mark an action as an asset, or change the metadata of one; tags that the user has given it
    stay.

    :param catalog: path of the catalog, such as "Poses/Walks"; empty: it stays as it is.
    :raises UsageError: the action is linked, or the catalog does not exist.
    """
    if action.library is not None:
        raise UsageError(
            f"the action '{action.name}' is linked from {action.library.filepath}; "
            "make it local first"
        )
    catalog_id = _catalog_id(catalog) if catalog else None
    action.asset_mark()
    data = action.asset_data
    for tag in TAGS:
        data.tags.new(tag, skip_if_exists=True)
    data.author = author
    data.description = description
    if catalog_id is not None:
        data.catalog_id = catalog_id


def set_preview(action: Action, armature: Object, frame: float) -> None:
    """Give an action a preview of an armature's pose at a scene frame.

    :param armature: animated by the action.
    """
    scene = bpy.context.scene
    with evaluated(armature), current_frame_kept(scene):
        show_frame(scene, frame)
        posed = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        bones = [bone for bone in posed.pose.bones if bone.bone.use_deform] or list(
            posed.pose.bones
        )
        bones = bones[:_MAX_BONES]
        if not bones:
            return
        place = np.array(posed.matrix_world, float)
        ends = np.array([[*bone.head, *bone.tail] for bone in bones], float).reshape(-1, 2, 3)
        ends = transform_points(place, ends)
        scale = float(np.cbrt(abs(np.linalg.det(place[:3, :3]))))
        radii = scale * np.array([_radius(bone) for bone in bones])
        colors = np.array([SIDES[side_of(bone.name)] for bone in bones])
    pixels = _skeleton_picture(ends[:, 0], ends[:, 1], radii, colors)
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
    saved, or if they cannot be read.
    """
    folder = _library_folder()
    found: dict[str, str] = {}
    if folder is None:
        return {}
    file = folder / CATALOGS_FILE
    try:
        check_regular(file, InputError, "list of catalogs", _LARGEST_BYTES)
        text = file.read_text(encoding="utf-8")
    except (InputError, OSError, ValueError):
        return {}
    for line in text.splitlines():
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


def _skeleton_picture(
    heads: Float64Array, tails: Float64Array, radii: Float64Array, colors: Float64Array
) -> Float32Array:
    """Draw bones as capsules on a transparent background.

    :param heads: (B, 3) metres, z up.
    :param tails: (B, 3) metres.
    :param radii: (B,) metres.
    :param colors: (B, 3) display-referred red, green, blue, 0 to 1.
    :return: (_SIZE, _SIZE, 4) red, green, blue, alpha, not premultiplied; the first row is the
        lowest one.
    """
    fine = _FINER * _SIZE
    a, b, r = _on_screen(heads, tails, radii, fine)
    depth = np.full((fine, fine), -np.inf)
    picture = np.zeros((fine, fine, 4))
    for start, end, radius, color in zip(a, b, r, colors, strict=True):
        _draw_capsule(picture, depth, start, end, float(radius), color)
    blocks = picture.reshape(_SIZE, _FINER, _SIZE, _FINER, 4)
    alpha = blocks[..., 3].mean(axis=(1, 3))
    color = (blocks[..., :3] * blocks[..., 3:]).mean(axis=(1, 3)) / np.maximum(alpha, 1e-6)[
        ..., None
    ]
    return np.concatenate([np.clip(color, 0.0, 1.0), alpha[..., None]], axis=2).astype(np.float32)


def _on_screen(
    heads: Float64Array, tails: Float64Array, radii: Float64Array, size: int
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return heads and tails (B, 3) in pixels right, up and towards the viewer, and radii (B,) in
    pixels.
    """
    points = np.concatenate([heads, tails])
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    # the horizontal direction in which the pose is widest
    right = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    right *= 1.0 if right[np.abs(right).argmax()] > 0 else -1.0
    axes = np.array([[*right, 0.0], [0.0, 0.0, 1.0], [right[1], -right[0], 0.0]])
    seen = points @ axes.T
    twice = np.concatenate([radii, radii])[:, None]
    low = (seen[:, :2] - twice).min(axis=0)
    high = (seen[:, :2] + twice).max(axis=0)
    scale = (1.0 - 2.0 * _MARGIN) * size / max(float((high - low).max()), 1e-6)
    seen[:, :2] -= 0.5 * (low + high)
    seen *= scale
    seen[:, :2] += 0.5 * size
    return seen[: len(heads)], seen[len(heads) :], radii * scale


def _draw_capsule(
    picture: Float64Array,
    depth: Float64Array,
    start: Float64Array,
    end: Float64Array,
    radius: float,
    color: Float64Array,
) -> None:
    """Draw where the capsule is nearer to the viewer than what is there.

    :param picture: (S, S, 4), changed.
    :param depth: (S, S) towards the viewer, changed.
    :param start, end: (3,) of the capsule's axis, pixels.
    :param radius: pixels.
    """
    size = len(depth)
    low = np.clip(np.floor(np.minimum(start, end)[:2] - radius), 0, size).astype(int)
    high = np.clip(np.ceil(np.maximum(start, end)[:2] + radius) + 1, 0, size).astype(int)
    x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
    along = (end - start)[:2]
    share = ((x - start[0]) * along[0] + (y - start[1]) * along[1]) / max(
        float(along @ along), 1e-9
    )
    share = np.clip(share, 0.0, 1.0)
    dx = x - start[0] - share * along[0]
    dy = y - start[1] - share * along[1]
    inside = dx**2 + dy**2 < radius**2
    height = np.sqrt(np.maximum(radius**2 - dx**2 - dy**2, 0.0))
    z = start[2] + share * (end[2] - start[2]) + height
    rows = slice(low[1], high[1])
    columns = slice(low[0], high[0])
    nearer = inside & (z > depth[rows, columns])
    light = np.maximum(
        (dx * _LIGHT[0] + dy * _LIGHT[1] + height * _LIGHT[2]) / max(radius, 1e-9), 0.0
    )
    shaded = np.clip((_AMBIENT + (1.0 - _AMBIENT) * light)[..., None] * color, 0.0, 1.0)
    picture[rows, columns][nearer] = np.concatenate([shaded, np.ones((*light.shape, 1))], axis=2)[
        nearer
    ]
    depth[rows, columns][nearer] = z[nearer]
