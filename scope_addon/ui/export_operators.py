# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing captures to files, from the panel and from File > Export."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from .captured_person import cached_motion
from .reporting import ReportingOperator

FORMATS = (
    ("FBX", "FBX", "For Unreal Engine, Unity, Maya and MotionBuilder: armature, mesh and animation", 0),
    ("GLB", "glTF", "For the web, Godot and other engines: one .glb file with everything", 1),
    ("BVH", "BVH", "The skeleton's motion alone, one file per person", 2),
    ("USDC", "USD", "For Omniverse, Houdini and other studio tools", 3),
    ("NPZ", "NPZ", "For research: SMPL-style arrays of what was captured, before any editing; one file per person", 4),
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
            ("RIG", "My Rig", "The rig chosen under Retarget as it moves now, with its meshes", 2),
        ),
        default="ALL",
        description="What to write",
    )
    shape: EnumProperty(
        name="Shape",
        items=(
            ("AUTO", "Automatic", "Shape keys; in the mesh where the format's readers limit shape keys", 0),
            ("KEYS", "Shape Keys", "As morph targets whose value is the shape coefficient", 1),
            ("BAKED", "In the Mesh", "For engines that limit morph targets to 0..1", 2),
        ),
        default="AUTO",
        description="How the body's shape is written",
    )
    camera: BoolProperty(name="Camera", default=False, description="Write the footage's camera too")
    separate: BoolProperty(
        name="File per Person", default=False, description="Write a file for each of several people instead of one"
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """The tooltip of each button."""
        return next(text for key, _, text, _ in FORMATS if key == properties.format)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """The scene holds a capture."""
        if not any("scope_capture" in c for c in context.scene.collection.children_recursive):
            cls.poll_message_set("The scene holds no capture yet")
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask where to."""
        suffix = _SUFFIX[self.format]
        name = Path(context.scene.scope.result.footage).stem or "capture"
        folder = Path(bpy.data.filepath).parent if bpy.data.filepath else Path.home()
        self.filepath, self.filter_glob = str(folder / f"{name}{suffix}"), f"*{suffix}"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def check(self, context: bpy.types.Context) -> bool:
        """Keep the suffix right while the name is typed."""
        wanted = bpy.path.ensure_ext(self.filepath, _SUFFIX[self.format])
        changed, self.filepath = wanted != self.filepath, wanted
        return changed

    def draw(self, context: bpy.types.Context) -> None:
        """Options beside the file browser."""
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
        """Write."""
        from ..errors import UsageError
        from ..scene.export.export import ExportOptions, captures, export
        from ..scene.rigs.rig_export import export_rig

        if not bpy.path.basename(self.filepath).removesuffix(_SUFFIX[self.format]):
            raise UsageError("give the file to write a name")
        path = Path(bpy.path.ensure_ext(bpy.path.abspath(self.filepath), _SUFFIX[self.format]))
        options = ExportOptions(camera=self.camera, shape=self.shape.lower(), separate=self.separate)
        collections, rig = captures(context.scene), context.scene.scope_retarget.rig
        if self.which == "RIG" and self.format == "NPZ":
            raise UsageError("a motion file holds what was captured, not a rig; choose another format")
        if self.which == "RIG" and rig is None:
            raise UsageError("no rig is chosen under Retarget; choose yours there and press Retarget first")
        if self.which == "ACTIVE":
            active = context.view_layer.objects.active
            collections = [c for c in collections if active and active.name in c.all_objects]
            if not collections:
                raise UsageError("the active object belongs to no capture; select one of a capture's objects")
        if self.format == "NPZ":
            people = [obj for c in collections for obj in c.all_objects if "scope_source" in obj]
            written = export(path, collections, [cached_motion(obj) for obj in people])
        elif self.which == "RIG":
            written = export_rig(path, rig, options)
        else:
            written = export(path, collections, options=options)
        return f"Wrote {', '.join(p.name for p in written)} in {written[0].parent}"


CLASSES = (SCOPE_OT_export,)
