# SPDX-License-Identifier: GPL-3.0-or-later
"""A viewport that shows a capture over its footage, and a second one beside it that shows the
capture from its side.

Views are not part of what Blender undoes and saves with a scene, so this state is read from the
viewports themselves, and a viewport is restored when "Compare with Footage" is undone.

The camera's frame is fitted into the part of a viewport that no sidebar or toolbar covers. Seen
through a camera, a viewport of ``w`` × ``h`` pixels at zoom ``z`` shows the sensor ``f · max(w,
h)`` pixels long, with ``f = (√2 + z / 50)² / 4``, and the offset ``(dx, dy)`` moves the frame by
``-2 f (dx · w, dy · h)`` pixels. A sensor that is fitted horizontally or vertically has ``w`` or
``h`` in place of ``max(w, h)``.

The view from the side follows the pelvis of one person, so the others must stay within it on either
side, in every frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np
from bpy.app.handlers import persistent
from bpy.types import Area, Collection, Context, Object, Region, Scene, SpaceView3D, Window
from mathutils import Matrix, Quaternion, Vector

from ...solver.errors import ScopeError
from ..scene.datablocks import (
    cameras_of_clip,
    captures_of,
    enter_object_mode,
    holds,
    is_in_layer,
    is_person,
    view_number,
)
from ..scene.visibility import show
from .captured_person import body_of, captured_armature
from .captures import people_of
from .viewports import main_region, viewport_at, viewports

if TYPE_CHECKING:
    from ..arrays import Float64Array

_MIN_SIDE = 0.3  # of the viewport's width
_DRAWN_AFTER_S = 0.2
_SIDE_TILT = math.radians(5.0)
# a viewport shows the distance times this over its focal length, across its longer side
_SENSOR_MM = 72.0
_had_bones: dict[int, bool] = {}  # by viewport: whether it showed bones before the comparison
_FILLED = 0.94  # of the visible part
_ZOOMS = (-30.0, 600.0)  # Blender's limits
# by viewport: zoom and offset before the first fit
_former: dict[int, tuple[float, tuple[float, float]]] = {}
_HALF_HEIGHT_M = 1.3  # above and below the pelvis of a person
_HALF_WIDTH_M = 0.5  # to the left and right of it
_looked_through: set[int] = set()  # areas that showed a capture through its camera before the undo
_sides: set[int] = set()  # areas that showed a capture from its side


def cameras_of(scene: Scene) -> list[Object]:
    """Return the cameras of the scene's last capture, the one of its first video first."""
    collection = scene.scope.result.collection
    cameras = cameras_of_clip(collection) if collection else []
    return cameras if cameras and view_number(cameras[0]) is None else []


def camera_of(scene: Scene) -> Object | None:
    """Return the camera of the first video of the scene's last capture; None if there is none."""
    return next(iter(cameras_of(scene)), None)


def is_looking_through(context: Context) -> bool:
    """Return whether the context's viewport shows only a capture, through its camera."""
    space = context.space_data
    return space is not None and space.type == "VIEW_3D" and looks_through(context.scene, space)


def looks_through(scene: Scene, space: SpaceView3D) -> bool:
    """Return whether a viewport shows only a capture, through one of its cameras."""
    if not space.local_view or space.region_3d.view_perspective != "CAMERA":
        return False
    return scene.camera is not None and scene.camera in cameras_of(scene)


def begin(context: Context, area: Area, collection: Collection) -> None:
    """Show a capture over its footage in a viewport, without bones, which would cover the body."""
    space = area.spaces.active
    _show_alone(context, area, collection)
    # not again where another capture was compared
    _had_bones.setdefault(space.as_pointer(), space.overlay.show_bones)
    space.overlay.show_bones = False
    # In local view, Blender keeps the camera of the capture that was compared before.
    space.camera = context.scene.camera
    if space.region_3d.view_perspective != "CAMERA":
        with _in(context.window, area):
            bpy.ops.view3d.view_camera()
    fit_frame(context.scene, area)


def look_from(scene: Scene, area: Area) -> None:
    """Let a viewport that compares look through another camera, which is the scene's."""
    area.spaces.active.camera = scene.camera
    fit_frame(scene, area)


def end(window: Window, area: Area) -> None:
    """Show the scene in a viewport again as before the comparison."""
    space = area.spaces.active
    # unknown after the file was opened again
    space.overlay.show_bones = _had_bones.pop(space.as_pointer(), True)
    unfit_frame(space)
    with _in(window, area):
        if space.local_view:
            bpy.ops.view3d.localview(frame_selected=False)
        if space.region_3d.view_perspective == "CAMERA":
            bpy.ops.view3d.view_camera()  # Blender's own toggle restores the previous view
    if not space.use_local_camera:
        space.camera = window.scene.camera  # leaving local view brings back the one from before it


def end_others(scene: Scene, shown: Collection) -> None:
    """End every comparison of a capture other than the shown one: its footage would be behind the
    wrong body.
    """
    _end_where(lambda space: _compares_another(scene, space, shown))


def end_of(shown: Collection) -> None:
    """End every comparison of a capture."""
    _end_where(lambda space: bool(space.local_view and space.camera and holds(shown, space.camera)))


def _end_where(compares: Callable[[SpaceView3D], bool]) -> None:
    """End the comparisons of some viewports, with the side views beside them."""
    for window, area in viewports():
        if compares(area.spaces.active):
            end(window, area)
            if side := side_area(window.screen):
                _close_later(side)


def _close_later(side: Area) -> None:
    """Close the side view when no operator runs: Blender crashes when a running one's context was
    closed.
    """
    pointer = side.as_pointer()

    def close() -> None:
        found = viewport_at(pointer)
        if found is not None and _is_side(found[1].spaces.active):
            close_side_view(*found)

    if not bpy.app.background:
        bpy.app.timers.register(close, first_interval=_DRAWN_AFTER_S)


def _compares_another(scene: Scene, space: SpaceView3D, shown: Collection) -> bool:
    """Return whether a viewport looks through the camera of a capture of the scene that is not the
    shown one.
    """
    camera = space.camera
    if not space.local_view or space.region_3d.view_perspective != "CAMERA" or camera is None:
        return False
    has_capture = any(holds(each, camera) for each in captures_of(scene))
    return has_capture and not holds(shown, camera)


def side_area(screen: bpy.types.Screen) -> Area | None:
    """Return the viewport with the side view; None if there is none."""
    return next(
        (area for area in screen.areas if area.type == "VIEW_3D" and _is_side(area.spaces.active)),
        None,
    )


def is_side_view(context: Context) -> bool:
    """Return whether the context's viewport is the side view."""
    space = context.space_data
    return space is not None and space.type == "VIEW_3D" and _is_side(space)


def _is_side(space: SpaceView3D) -> bool:
    followed = space.lock_object
    return bool(space.local_view and followed is not None and is_person(followed))


def open_side_view(context: Context, area: Area) -> None:
    """Split a viewport, and show the capture from its side in the new one; if nobody of it is left,
    do nothing.
    """
    collection = context.scene.scope.result.collection
    people = people_of(collection)
    active = captured_armature(context)
    if not people:
        return
    window = context.window
    screen = context.window.screen
    before = {each.as_pointer() for each in screen.areas}
    # What the sidebar and the toolbar leave is shared equally.
    covered = sum(
        region.width
        for region in area.regions
        if region.type in ("TOOLS", "UI") and region.width > 1
    )
    factor = max(_MIN_SIDE, (1.0 - covered / max(1, area.width)) / 2.0)
    width = factor * area.width
    with _in(window, area):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=factor)
    side = next(each for each in screen.areas if each.as_pointer() not in before)
    _show_alone(context, side, collection)
    space = side.spaces.active
    space.show_region_ui = space.show_region_toolbar = False
    space.overlay.show_bones = space.overlay.show_extras = False
    space.lock_object = active if active in people else people[0]
    space.lock_bone = space.lock_object.data.bones[0].name
    view = space.region_3d
    view.view_perspective = "ORTHO"
    # Slightly from above: in an orthographic view that is level, Blender draws no floor.
    turn = _side_rotation(context.scene.camera.matrix_world).to_quaternion() @ Quaternion(
        (1.0, 0.0, 0.0), -_SIDE_TILT
    )
    view.view_rotation = turn
    shown = side_extent(space.lock_object, people, np.array(turn.to_matrix()))
    view.view_distance = _span(shown, width / max(1, area.height)) * space.lens / _SENSOR_MM
    _fit_later(area)


def _span(shown: tuple[float, float], aspect: float) -> float:
    """Return what a viewport must show across its longer side for a width and height to fit.

    :param aspect: width divided by height of the viewport.
    """
    return max(shown[0] / aspect, shown[1]) * max(1.0, aspect)


def close_side_view(window: Window, side: Area) -> None:
    """Give the place of the side view back to the viewport that it was split from."""
    with _in(window, side):
        bpy.ops.screen.area_close()
    for area in window.screen.areas:
        if area.type == "VIEW_3D" and looks_through(window.scene, area.spaces.active):
            _fit_later(area)


def _fit_later(area: Area) -> None:
    """Fit the camera's frame into a viewport whose size changes when it is drawn next."""
    pointer = area.as_pointer()

    def fit() -> None:
        found = viewport_at(pointer)
        if found is not None and looks_through(found[0].scene, found[1].spaces.active):
            fit_frame(found[0].scene, found[1])
            found[1].tag_redraw()

    if not bpy.app.background:
        bpy.app.timers.register(fit, first_interval=_DRAWN_AFTER_S)


def _side_rotation(camera: Matrix) -> Matrix:
    """Return the rotation (3, 3) of a view that is level and looks to the right of where a camera
    looks.

    :param camera: (4, 4) world from camera, whose z points backwards.
    """
    back = -(camera.to_3x3() @ Vector((1.0, 0.0, 0.0)))
    back.z = 0.0
    if back.length < 1e-6:  # the camera lies on its side
        back = Vector((-1.0, 0.0, 0.0))
    back.normalize()
    up = Vector((0.0, 0.0, 1.0))
    return Matrix((up.cross(back), up, back)).transposed()


def _show_alone(context: Context, area: Area, collection: Collection) -> None:
    """Show only the capture in local view, because other objects could hide the footage or the
    body.
    """
    selected = context.selected_objects
    enter_object_mode(context.view_layer)
    with _in(context.window, area):
        if area.spaces.active.local_view:
            bpy.ops.view3d.localview(frame_selected=False)
        bpy.ops.object.select_all(action="DESELECT")
        # copied, because hiding and showing invalidates the iterator
        for obj in list(collection.all_objects):
            if is_person(obj):  # it may be hidden because of a retargeted rig
                show(obj, context.view_layer, temporarily=True)
            if is_in_layer(context.view_layer, obj):  # not where its collection is excluded
                obj.select_set(True)
        bpy.ops.view3d.localview(frame_selected=False)
        bpy.ops.object.select_all(action="DESELECT")
    for obj in selected:
        obj.select_set(True)


def _in(window: Window, area: Area) -> bpy.types.ContextTempOverride:
    """Return the context of a viewport's main region."""
    return bpy.context.temp_override(window=window, area=area, region=main_region(area))


def fit_frame(scene: Scene, area: Area) -> None:
    """Zoom and move a viewport's camera view so that the whole frame of the scene's camera is
    visible.
    """
    region = main_region(area)
    space = area.spaces.active
    if min(region.width, region.height) < 2:
        return
    left, right, bottom, top = visible_part(area, region)
    render = scene.render
    size = render.resolution_x * render.pixel_aspect_x, render.resolution_y * render.pixel_aspect_y
    width, height = _frame_at_one(scene.camera.data.sensor_fit, size, (region.width, region.height))
    factor = _FILLED * min((right - left) / width, (top - bottom) / height)
    view = space.region_3d
    _former.setdefault(space.as_pointer(), (view.view_camera_zoom, tuple(view.view_camera_offset)))
    zoom = 50.0 * (math.sqrt(4.0 * max(factor, 0.0)) - math.sqrt(2.0))
    view.view_camera_zoom = min(max(zoom, _ZOOMS[0]), _ZOOMS[1])
    factor = (math.sqrt(2.0) + view.view_camera_zoom / 50.0) ** 2 / 4.0
    view.view_camera_offset = (
        -((left + right - region.width) / 2.0) / (2.0 * factor * region.width),
        -((bottom + top - region.height) / 2.0) / (2.0 * factor * region.height),
    )


def unfit_frame(space: SpaceView3D) -> None:
    """Restore the zoom and offset from before the first fit."""
    if (former := _former.pop(space.as_pointer(), None)) is not None:
        space.region_3d.view_camera_zoom, space.region_3d.view_camera_offset = former


def _frame_at_one(
    fit: str, size: tuple[float, float], region: tuple[int, int]
) -> tuple[float, float]:
    """Return the width and height of the frame, pixels, where the sensor is as long as the
    viewport.
    """
    horizontal = fit == "HORIZONTAL" or (fit == "AUTO" and size[0] >= size[1])
    along = {"HORIZONTAL": region[0], "VERTICAL": region[1]}.get(fit, max(region))
    scale = along / (size[0] if horizontal else size[1])
    return size[0] * scale, size[1] * scale


def visible_part(area: Area, region: Region) -> tuple[float, float, float, float]:
    """Return the left, right, bottom and top of what no other region covers, in pixels of the
    viewport's region.
    """
    left = 0.0
    right = float(region.width)
    bottom = 0.0
    top = float(region.height)
    for other in area.regions:
        if min(other.width, other.height) < 2:  # hidden
            continue
        x = other.x - region.x
        y = other.y - region.y
        if other.type == "TOOLS":
            left = max(left, x + other.width)
        elif other.type == "UI":
            right = min(right, x)
        elif other.type in ("HEADER", "TOOL_HEADER") and y > region.height / 2:
            top = min(top, y)
        elif other.type in ("HEADER", "TOOL_HEADER"):
            bottom = max(bottom, y + other.height)
    wide_enough = right - left > 0.2 * region.width and top - bottom > 0.2 * region.height
    return (
        (left, right, bottom, top)
        if wide_enough
        else (0.0, float(region.width), 0.0, float(region.height))
    )


def side_extent(
    followed: Object, people: Sequence[Object], R_world_view: Float64Array
) -> tuple[float, float]:
    """Return the width and height that a view along -z must show around the pelvis of ``followed``,
    in units of the scene, in which people may be scaled.

    :param people: captured armatures; one whose keys are missing is left out.
    :param R_world_view: (3, 3), view axes to world.
    """
    from ..scene.timing import scene_rate

    rate = scene_rate(bpy.context.scene)
    far = np.zeros(2)
    path = _pelvis_path(followed, rate)
    paths = [_pelvis_path(person, rate) for person in people if person != followed]
    if path is not None:
        for their in (other for other in paths if other is not None):
            place = np.stack(
                [np.interp(path[:, 0], their[:, 0], their[:, k]) for k in (1, 2, 3)], axis=1
            )
            far = np.maximum(far, np.abs((place - path[:, 1:]) @ R_world_view[:, :2]).max(axis=0))
    size = followed.matrix_world.median_scale
    width = 2.0 * (float(far[0]) + size * _HALF_WIDTH_M)
    return width, 2.0 * (float(far[1]) + size * _HALF_HEIGHT_M)


def _pelvis_path(armature: Object, rate: float) -> Float64Array | None:
    """Return the scene frame and the world position of the pelvis at every key, (T, 4); None
    without keys.
    """
    from ..kinematics.axes import transform_points
    from ..scene.character.keys import read_clip
    from ..scene.character.root_object import clip_as_displayed, parent_transform, root_object

    try:
        clip, frames = read_clip(armature, body_of(armature), rate)
    except ScopeError:
        return None
    empty = root_object(armature)
    M = np.array(armature.matrix_world)
    if empty is not None:  # whose transform is in the clip, in the armature's units
        size = armature.matrix_basis.median_scale
        M = np.array(parent_transform(empty) @ Matrix.Scale(size, 4))
    shown = clip_as_displayed(armature, clip, frames)
    return np.column_stack([frames, transform_points(M, shown.root)])


def attach() -> None:
    """Add the handlers of undo."""
    bpy.app.handlers.undo_pre.append(_before_undo)
    bpy.app.handlers.undo_post.append(_after_undo)


def detach() -> None:
    """Remove the handlers of undo."""
    bpy.app.handlers.undo_pre.remove(_before_undo)
    bpy.app.handlers.undo_post.remove(_after_undo)


@persistent
def _before_undo(*_: object) -> None:
    _looked_through.clear()
    _sides.clear()
    for window, area in viewports():
        if area == side_area(window.screen):
            _sides.add(area.as_pointer())
        if looks_through(window.scene, area.spaces.active):
            _looked_through.add(area.as_pointer())


@persistent
def _after_undo(*_: object) -> None:
    if _looked_through:
        bpy.app.timers.register(_leave)  # operators must not run during an undo


def _leave() -> None:
    """Leave local view and camera view in the viewports that no longer show a capture through its
    camera.
    """
    left = False
    for window, area in viewports():
        if area.as_pointer() in _looked_through and not looks_through(
            window.scene, area.spaces.active
        ):
            end(window, area)
            left = True
    for window, side in [pair for pair in viewports() if left and pair[1].as_pointer() in _sides]:
        close_side_view(window, side)
    _looked_through.clear()
