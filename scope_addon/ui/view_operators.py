# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators for viewing the result: through the camera, at a frame, in the sequencer."""

from __future__ import annotations

import bpy
from bpy.props import IntProperty
from bpy.types import ID, Collection, Context, Object, Operator, Scene
from mathutils import Matrix

from ..footage import PICTURE_SUFFIXES
from ..scene.datablocks import holds, view_number
from ..scene.stored_values import start_frame
from ..scene.visibility import hide_again
from . import comparison
from .captured_person import captured_people, motion_if_stored
from .captures import people_of
from .comparison import camera_of, cameras_of, is_looking_through, is_side_view
from .reporting import ReportingOperator, refuse, rpt_
from .viewports import main_region, redraw_sidebars_twice, viewport_of


def hide_startup_cube(context: Context) -> None:
    """Hide the unmodified default cube of an unsaved file, which is where the person stands, in
    viewports and renders.
    """
    cube = context.scene.objects.get("Cube")
    if bpy.data.filepath or cube is None or cube.type != "MESH" or len(cube.data.vertices) != 8:
        return
    modified = cube.animation_data or cube.modifiers or cube.constraints or cube.children
    if (
        not modified
        and cube.matrix_world == Matrix.Identity(4)
        and cube.name in context.view_layer.objects
    ):
        cube.hide_set(True)
        cube.hide_render = True


def frame_selected(context: Context) -> None:
    """Frame the selected objects in the context's or the largest viewport, unless it shows a
    camera's view.
    """
    area = viewport_of(context)
    if area is None:
        return
    if area.spaces.active.region_3d.view_perspective == "CAMERA":
        return
    with context.temp_override(window=context.window, area=area, region=main_region(area)):
        if bpy.ops.view3d.view_selected.poll():
            bpy.ops.view3d.view_selected()


def show_new_capture(context: Context, scene: Scene | None) -> None:
    """Show the capture that was just added to a scene: the viewports leave the comparison of an
    earlier one.

    Where another scene is shown by now, its viewports and objects stay as they are.

    :param scene: None if it was removed.
    """
    if scene != context.scene:
        return
    hide_startup_cube(context)
    shown = context.scene.scope.result.collection
    if shown is not None:
        comparison.end_others(context.scene, shown)
        _hide_others_again(context, shown)
        if not any(holds(shown, obj) for obj in context.selected_objects):
            return  # the user is working on something else
    frame_selected(context)


def _hide_others_again(context: Context, shown: Collection) -> None:
    """Hide people of other captures than the shown one who were shown for a comparison alone."""
    for other in [obj for obj in captured_people(context) if not holds(shown, obj)]:
        hide_again(other, context.view_layer)


def _set_camera(context: Context, camera: Object, filmed: ID) -> None:
    """Set the scene's camera, and the resolution to that of the footage.

    :param filmed: what stores the footage's resolution: a capture, or a further camera.
    """
    from ..scene.camera import set_resolution

    context.scene.camera = camera
    camera.hide_viewport = False  # a hidden camera shows no footage
    camera.hide_set(False, view_layer=context.view_layer)
    set_resolution(context.scene, filmed)


class SCOPE_OT_look_through(Operator):
    """Toggle the view of the body over the footage. Sets the scene's camera and resolution"""

    bl_idname = "scope.look_through"
    bl_label = "Compare with Footage"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require that the last capture has a camera and is not hidden."""
        if is_side_view(context):
            return refuse(cls, "Use this in the viewport with the footage")
        if camera_of(context.scene) is None:
            return refuse(
                cls,
                "The scene has no camera of a capture: capture with the option Camera with Footage",
            )
        collection = context.scene.scope.result.collection
        if not is_looking_through(context) and not _is_shown(
            collection, context.view_layer.layer_collection
        ):
            name = collection.name
            return refuse(
                cls, "The collection '{name}' is hidden; show it in the Outliner", name=name
            )
        return True

    def execute(self, context: Context) -> set[str]:
        """Set the scene's camera and resolution, and the viewport's view."""
        shown = context.scene.scope.result.collection
        camera = camera_of(context.scene)
        if is_looking_through(context):
            comparison.end(context.window, context.area)
            if side := comparison.side_area(context.window.screen):
                comparison.close_side_view(context.window, side)
            for person in people_of(shown):
                hide_again(person, context.view_layer)
            redraw_sidebars_twice()
            return {"FINISHED"}
        assert camera is not None  # checked by poll
        _set_camera(context, camera, shown)
        _hide_others_again(context, shown)  # which were compared before
        if not bpy.app.background and context.area and context.area.type == "VIEW_3D":
            comparison.begin(context, context.area, shown)
        redraw_sidebars_twice()
        return {"FINISHED"}


class SCOPE_OT_compare_view(Operator):
    """Show the body over the footage of this camera. Sets the scene's camera and resolution"""

    bl_idname = "scope.compare_view"
    bl_label = "Compare with This Camera"
    bl_options = {"UNDO"}

    index: IntProperty(name="Camera", min=0)

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require several cameras."""
        return len(cameras_of(context.scene)) > 1

    def execute(self, context: Context) -> set[str]:
        """Set the scene's camera and resolution, and what the viewport shows."""
        scene = context.scene
        cameras = cameras_of(scene)
        if self.index >= len(cameras):
            return {"CANCELLED"}
        camera = cameras[self.index]
        is_compared = is_looking_through(context)
        is_first = view_number(camera) is None
        _set_camera(context, camera, scene.scope.result.collection if is_first else camera)
        if is_compared:
            comparison.look_from(scene, context.area)
        redraw_sidebars_twice()
        return {"FINISHED"}


def _is_shown(collection: Collection, layer: bpy.types.LayerCollection) -> bool:
    """Return whether a collection is visible in this layer collection or in one below it."""
    here = layer.collection == collection and layer.is_visible
    return here or any(_is_shown(collection, child) for child in layer.children)


class SCOPE_OT_side_view(Operator):
    """Show the captured body from its side in a second viewport, beside the one with the footage"""

    bl_idname = "scope.side_view"
    bl_label = "Side View"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a viewport that compares a capture with its footage."""
        if not is_looking_through(context):
            return refuse(cls, "Compare with Footage first")
        return True

    def execute(self, context: Context) -> set[str]:
        """Open the second viewport, or close it."""
        side = comparison.side_area(context.window.screen)
        if side is None:
            comparison.open_side_view(context, context.area)
        else:
            comparison.close_side_view(context.window, side)
        return {"FINISHED"}


class SCOPE_OT_go_to_frame(Operator):
    """Go to the frame that the warning is about"""

    bl_idname = "scope.go_to_frame"
    bl_label = "Go to Frame"
    bl_options = {"INTERNAL"}

    frame: IntProperty(name="Frame", description="Scene frame")

    def execute(self, context: Context) -> set[str]:
        """Set the current frame."""
        context.scene.frame_set(self.frame)
        return {"FINISHED"}


class SCOPE_OT_footage_to_sequencer(ReportingOperator):
    """Add the footage with its sound to the video sequencer, synchronized with the motion"""

    bl_idname = "scope.footage_to_sequencer"
    bl_label = "Footage to Sequencer"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a capture."""
        if not context.scene.scope.result.footage:
            return refuse(cls, "The capture does not say where its footage is")
        return True

    def work(self, context: Context) -> str:
        """Add the strips."""
        from ..scene.footage_strip import (
            add_footage_strips,
            pictures_of_frames,
            strips_of,
            turn_strip,
        )
        from ..scene.timing import scene_rate

        scene = context.scene
        result = context.scene.scope.result
        armatures = [o for o in result.collection.all_objects if "scope_start" in o]
        start = next((start_frame(o) for o in armatures), 0.0)
        known = set(strips_of(scene.sequence_editor)) if scene.sequence_editor else set()
        footage = bpy.path.abspath(result.footage)
        motion = next((m for m in map(motion_if_stored, armatures) if m is not None), None)
        pictures: list[int] = []
        is_picture = footage.lower().endswith(PICTURE_SUFFIXES)
        if motion is not None and len(motion) > 1 and is_picture:
            start, pictures = pictures_of_frames(motion, start, scene_rate(scene))
        speed = 1.0 if motion is None else motion.footage_speed
        strips = add_footage_strips(scene, footage, start, pictures, with_sound=speed == 1.0)
        camera = camera_of(scene)
        if camera is not None and camera.data.background_images:
            turn_strip(strips[-1], camera.data.background_images[0])
        # of what happened, which slow motion plays more slowly
        rate = getattr(strips[-1], "fps", 0.0) * speed
        if rate and abs(rate - scene_rate(scene)) > 0.01:
            self.report(
                {"WARNING"},
                rpt_(
                    "The scene has {scene:.5g} frames/s and the footage {footage:.5g}: the strip "
                    "will not stay "
                    "synchronized with the motion",
                    scene=scene_rate(scene),
                    footage=rate,
                ),
            )
            return ""
        return rpt_("The footage is already in the sequencer") if strips[-1] in known else ""


CLASSES = (
    SCOPE_OT_look_through,
    SCOPE_OT_compare_view,
    SCOPE_OT_side_view,
    SCOPE_OT_go_to_frame,
    SCOPE_OT_footage_to_sequencer,
)
