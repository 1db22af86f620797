# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that exports captures."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from .captured_person import motion_of
from .reporting import ReportingOperator

FORMATS = (
    ("FBX", "FBX", "For Unreal Engine, Unity, Maya and MotionBuilder: armature, mesh and animation", 0),
    ("GLB", "glTF", "For the web, Godot and other engines: one .glb file with everything", 1),
    ("BVH", "BVH", "Only the motion of the skeleton, one file per person", 2),
    ("USDC", "USD", "For Omniverse, Houdini and other studio tools", 3),
    ("NPZ", "NPZ", "For research: SMPL-style arrays of the captured motion before any editing, one file per person", 4),
)
_SUFFIX = {"FBX": ".fbx", "GLB": ".glb", "BVH": ".bvh", "USDC": ".usdc", "NPZ": ".npz"}


class SCOPE_OT_export(ReportingOperator):
    """Write captures to a file"""

    bl_idname = "scope.export"
    bl_label = "Export Capture"
    bl_options = {"REGISTER"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default="*.fbx", options={"HIDDEN", "SKIP_SAVE"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})
    format: EnumProperty(
        name="Format", items=FORMATS, default="FBX", description="File format", options={"HIDDEN", "SKIP_SAVE"}
    )
    which: EnumProperty(
        name="Captures",
        items=(
            ("ALL", "All in the Scene", "Every capture of the scene, with all its people", 0),
            ("ACTIVE", "Active", "The capture that the active object belongs to", 1),
            ("RIG", "My Rig", "The rig chosen under Retarget, with its current animation and its meshes", 2),
        ),
        default="ALL",
        description="What to export",
    )
    shape: EnumProperty(
        name="Shape",
        items=(
            ("AUTO", "Automatic", "Shape keys, or in the mesh for formats whose readers limit shape keys", 0),
            ("KEYS", "Shape Keys", "Morph targets whose values are the shape coefficients", 1),
            ("BAKED", "In the Mesh", "For engines that limit morph targets to 0..1", 2),
        ),
        default="AUTO",
        description="How the body's shape is exported",
    )
    camera: BoolProperty(name="Camera", default=False, description="Export the estimated camera")
    separate: BoolProperty(name="File per Person", default=False, description="Write a separate file for each person")

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the tooltip of the button for the format."""
        return next(text for key, _, text, _ in FORMATS if key == properties.format)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require a capture in the scene."""
        if not any("scope_capture" in c for c in context.scene.collection.children_recursive):
            cls.poll_message_set("The scene contains no capture yet")
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the file."""
        suffix = _SUFFIX[self.format]
        name = Path(context.scene.scope.result.footage).stem or "capture"
        folder = Path(bpy.data.filepath).parent if bpy.data.filepath else Path.home()
        self.filepath, self.filter_glob = str(folder / f"{name}{suffix}"), f"*{suffix}"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def check(self, context: bpy.types.Context) -> bool:
        """Correct the suffix while the name is typed."""
        path: str = bpy.path.ensure_ext(self.filepath, _SUFFIX[self.format])
        changed, self.filepath = path != self.filepath, path
        return bool(changed)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the options in the sidebar of the file browser."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "which")
        if self.format not in ("BVH", "NPZ"):
            layout.prop(self, "shape")
            if self.which != "RIG":
                layout.prop(self, "camera")
                layout.prop(self, "separate")

    def work(self, context: bpy.types.Context) -> str:
        """Write the files."""
        from ..errors import UsageError
        from ..scene.export.export import ExportOptions, captures, export
        from ..scene.rigs.rig_export import export_rig

        if not bpy.path.basename(self.filepath).removesuffix(_SUFFIX[self.format]):
            raise UsageError("the file has no name; enter one")
        path = Path(bpy.path.ensure_ext(bpy.path.abspath(self.filepath), _SUFFIX[self.format]))
        options = ExportOptions(camera=self.camera, shape=self.shape.lower(), separate=self.separate)
        collections, rig = captures(context.scene), context.scene.scope_retarget.rig
        if self.which == "RIG" and self.format == "NPZ":
            raise UsageError("a motion file contains the captured motion, not a rig; choose another format")
        if self.which == "RIG" and rig is None:
            raise UsageError("no rig is chosen under Retarget; choose a rig there and press Retarget first")
        if self.which == "ACTIVE":
            active = context.view_layer.objects.active
            collections = [c for c in collections if active and active.name in c.all_objects]
            if not collections:
                raise UsageError("the active object belongs to no capture; select one of a capture's objects")
        if self.format == "NPZ":
            people = [obj for c in collections for obj in c.all_objects if "scope_source" in obj]
            written = export(path, collections, [motion_of(obj) for obj in people])
        elif self.which == "RIG":
            written = export_rig(path, rig, options)
        else:
            written = export(path, collections, options=options)
        return f"Wrote {', '.join(p.name for p in written)} in {written[0].parent}"


CLASSES = (SCOPE_OT_export,)
