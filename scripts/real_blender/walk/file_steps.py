# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of the random walk that are not Scope's: what a user does to the file around its
operators.

They keep clear of what crashes Blender 4.3 without Scope: linking from the file that is open;
removing the library of the scene that the window shows (``bpy.data.libraries.remove`` leaves the
window without a scene); deleting a movie clip that the viewport shows as a camera's background,
after which, at once or after undo, drawing reads the clip's freed textures; scenes that share their
objects (``scene.new(type="LINK_COPY")``) with undo, and then showing another scene.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
from shared.session import invoke, use

_BLOCKS = ("objects", "meshes", "armatures", "actions", "cameras", "collections", "scenes")
_DATA = (*_BLOCKS, "materials", "images", "texts")


@dataclass
class Step:
    """A step: what the log says, and what it does."""

    text: str
    take: Callable[[], object]
    checked: bool = False  # whether it must leave the file as it was if it fails or is cancelled


class FileSteps:
    """Steps of any Blender user. Each pushes a step to undo, even where it fails half-way."""

    def __init__(self, chance: random.Random, folder: Path) -> None:
        """Choose with ``chance``, and save files to ``folder``."""
        self.random = chance
        self.folder = folder
        self.next: list[Step] = []
        self.actions = [name[5:] for name in dir(self) if name.startswith("step_")]

    def any_step(self) -> Step:
        """Return any of these steps."""
        found: Step = getattr(self, f"step_{self.random.choice(self.actions)}")()
        return found

    def step_undo(self) -> Step:
        """Undo some steps; redo some of them in the next step."""
        if bpy.app.background:
            return self.step_select()
        count = self.random.choice((1, 1, 2, 5))
        again = self.random.choice((0, 0, 1, count))
        if again:
            self.next.append(
                Step(f"redo({again})", lambda: [invoke(bpy.ops.ed.redo) for _ in range(again)][-1])
            )
        return Step(f"undo({count})", lambda: [invoke(bpy.ops.ed.undo) for _ in range(count)][-1])

    step_undo_again = step_undo_often = step_undo

    def step_save(self) -> Step:
        """Save the file."""
        path = str(self.folder / f"saved{self.random.randrange(3)}.blend")
        return Step(
            f"save({path})",
            lambda: bpy.ops.wm.save_as_mainfile(filepath=path, check_existing=False),
        )

    def step_reopen(self) -> Step:
        """Open a saved file."""
        saved = sorted(self.folder.glob("saved*.blend"))
        if not saved:
            return self.step_save()
        path = str(self.random.choice(saved))
        load_ui = self.random.random() < 0.5
        return Step(
            f"open({path}, {load_ui})",
            lambda: bpy.ops.wm.open_mainfile(filepath=path, load_ui=load_ui),
        )

    def new_file(self) -> Step:
        """Begin a new file and capture in it."""
        return Step(
            "new file()", lambda: bpy.ops.wm.read_homefile(load_ui=self.random.random() < 0.5)
        )

    def step_import_file(self) -> Step:
        """Link or append from a saved file, with or without an override."""
        saved = sorted(
            path for path in self.folder.glob("saved*.blend") if str(path) != bpy.data.filepath
        )
        if not saved:
            return self.step_save()
        path = str(self.random.choice(saved))
        link = self.random.random() < 0.5
        kind = self.random.choice(
            ("objects", "objects", "collections", "scenes", "actions", "armatures", "meshes")
        )

        def take() -> object:
            with bpy.data.libraries.load(path, link=link) as (there, here):
                names = list(getattr(there, kind))
                setattr(here, kind, [self.random.choice(names)] if names else [])
            window = bpy.context.window_manager.windows[0]
            for block in filter(None, getattr(here, kind)):
                if kind == "objects" and block.name not in window.scene.collection.objects:
                    window.scene.collection.objects.link(block)
                elif kind == "collections" and block.name not in window.scene.collection.children:
                    window.scene.collection.children.link(block)
                elif kind == "scenes" and self.random.random() < 0.5:
                    window.scene = block
                elif kind == "armatures":
                    window.scene.collection.objects.link(bpy.data.objects.new("imported", block))
                if link and kind in ("objects", "collections") and self.random.random() < 0.5:
                    block.override_hierarchy_create(window.scene, window.view_layer)
            return self.pushed(f"{kind} {names[:1]}")

        return Step(f"{'link' if link else 'append'}({kind}, {path})", take)

    step_import_file_again = step_import_file

    def step_rename(self) -> Step:
        """Rename a datablock, also to a name that another one has."""
        kind = self.random.choice(_BLOCKS)
        return self.on(
            kind,
            "rename",
            lambda block: setattr(block, "name", self.random.choice(["x", "walk", 'a"b\\'])),
        )

    def step_delete(self) -> Step:
        """Delete a datablock, as the Outliner does."""
        kind = self.random.choice(_DATA)
        return self.on(kind, "delete", lambda block: getattr(bpy.data, kind).remove(block))

    def step_delete_capture(self) -> Step:
        """Delete a collection with everything in it."""
        return self.on(
            "collections",
            "delete hierarchy",
            lambda block: bpy.data.batch_remove([*block.all_objects, block]),
        )

    def step_delete_selected(self) -> Step:
        """Delete the selected objects."""
        return Step("delete selected()", lambda: use(bpy.ops.object.delete, confirm=False))

    def step_duplicate(self) -> Step:
        """Duplicate the selected objects, with or without their data."""
        linked = self.random.random() < 0.5
        return Step(f"duplicate({linked})", lambda: use(bpy.ops.object.duplicate, linked=linked))

    def step_copy(self) -> Step:
        """Copy a collection or an action."""
        return self.on(
            self.random.choice(("collections", "actions", "scenes")),
            "copy",
            lambda block: block.copy(),
        )

    def step_purge(self) -> Step:
        """Remove unused datablocks, and those that nothing but a library holds."""
        return Step("purge()", lambda: self.pushed(bpy.data.orphans_purge(do_recursive=True)))

    def step_library(self) -> Step:
        """Reload, remove or make local what is linked."""
        if not len(bpy.data.libraries):
            return self.step_import_file()
        index = self.random.randrange(len(bpy.data.libraries))
        what = self.random.choice(("reload", "remove", "local"))

        def take() -> object:
            library = bpy.data.libraries[index]
            if what == "reload":
                library.reload()
            elif what == "remove":
                window = bpy.context.window_manager.windows[0]
                local = next((scene for scene in bpy.data.scenes if scene.library is None), None)
                if window.scene.library is not None and local is not None:
                    window.scene = local
                if window.scene.library is None:  # else Blender would crash
                    bpy.data.libraries.remove(library)
            else:
                return use(bpy.ops.object.make_local, type="ALL")
            return self.pushed(what)

        return Step(f"library({what})", take)

    def step_frame(self) -> Step:
        """Go to a frame, or play."""
        frame = self.random.randint(-20, 150)
        if frame < 0:
            return Step("play()", lambda: invoke(bpy.ops.screen.animation_play))
        return Step(
            f"frame({frame})", lambda: bpy.context.window_manager.windows[0].scene.frame_set(frame)
        )

    def step_rate(self) -> Step:
        """Change the frame rate."""
        fps = self.random.choice((1, 24, 25, 30, 120))

        def take() -> object:
            bpy.context.window_manager.windows[0].scene.render.fps = fps
            return self.pushed(fps)

        return Step(f"rate({fps})", take)

    def step_select(self) -> Step:
        """Select one object and make it the active one."""

        def take(obj: bpy.types.Object) -> None:
            layer = bpy.context.window_manager.windows[0].view_layer
            if obj.name in layer.objects and layer.objects[obj.name] == obj:
                if layer.objects.active is not None and layer.objects.active.mode != "OBJECT":
                    invoke(bpy.ops.object.mode_set, mode="OBJECT")
                invoke(bpy.ops.object.select_all, action="DESELECT")
                obj.select_set(True, view_layer=layer)
                layer.objects.active = obj

        return self.on("objects", "select", take)

    step_select_again = step_select

    def step_mode(self) -> Step:
        """Change the mode of the active object."""
        mode = self.random.choice(("OBJECT", "POSE", "EDIT", "WEIGHT_PAINT"))

        def take() -> object:
            try:
                return use(bpy.ops.object.mode_set, mode=mode)
            except TypeError as error:  # the active object does not have it
                return f"refused: {error}"

        return Step(f"mode({mode})", take)

    def step_nla(self) -> Step:
        """Push the action down, tweak a strip, or remove the tracks."""
        what = self.random.choice(("push", "push", "tweak", "leave", "clear", "mute", "solo"))

        def take(obj: bpy.types.Object) -> None:
            data = obj.animation_data or obj.animation_data_create()
            if what == "push" and data.action is not None and not data.use_tweak_mode:
                data.nla_tracks.new().strips.new(
                    data.action.name, int(data.action.frame_range[0]), data.action
                )
                data.action = None
            elif what in ("tweak", "leave"):
                if what == "tweak" and data.nla_tracks:
                    data.nla_tracks.active = data.nla_tracks[-1]
                    for strip in data.nla_tracks[-1].strips:
                        strip.select = True
                data.use_tweak_mode = what == "tweak"
            elif what == "clear":
                for track in list(data.nla_tracks):
                    data.nla_tracks.remove(track)
            elif data.nla_tracks:
                setattr(data.nla_tracks[-1], "mute" if what == "mute" else "is_solo", True)

        return self.on("objects", f"nla {what}", take)

    def step_assign_action(self) -> Step:
        """Give an object another action, or none."""

        def take(obj: bpy.types.Object) -> None:
            data = obj.animation_data or obj.animation_data_create()
            data.action = self.random.choice([None, *bpy.data.actions])

        return self.on("objects", "assign action", take)

    def step_parent(self) -> Step:
        """Give an object a parent, or none."""
        return self.on(
            "objects",
            "parent",
            lambda obj: setattr(obj, "parent", self.random.choice([None, *bpy.data.objects])),
        )

    def step_hide(self) -> Step:
        """Hide or show an object."""
        how = self.random.choice(("hide_viewport", "hide_render", "hide_select"))
        return self.on("objects", how, lambda obj: setattr(obj, how, not getattr(obj, how)))

    def step_scene(self) -> Step:
        """Add a scene, show another one, or remove the one that is shown."""
        what = self.random.choice(("NEW", "FULL_COPY", "show", "show", "remove"))

        def take() -> object:
            window = bpy.context.window_manager.windows[0]
            if what == "show":
                window.scene = self.random.choice(list(bpy.data.scenes))
                return self.pushed(window.scene.name_full)
            if what == "remove":
                return use(bpy.ops.scene.delete)
            return use(bpy.ops.scene.new, type=what)

        return Step(f"scene({what})", take)

    def step_bones(self) -> Step:
        """Rename or remove a bone, or change its rotation mode."""
        what = self.random.choice(("rename", "remove", "mode"))

        def take(obj: bpy.types.Object) -> object:
            if obj.type != "ARMATURE" or not obj.data.bones or obj.library or obj.data.library:
                return "no bones"
            bone = self.random.choice(list(obj.data.bones)).name
            if what == "rename":
                obj.data.bones[bone].name = "renamed"
            elif what == "mode" and obj.pose and bone in obj.pose.bones:
                obj.pose.bones[bone].rotation_mode = "XYZ"
            elif obj.mode == "EDIT" and bone in obj.data.edit_bones:
                obj.data.edit_bones.remove(obj.data.edit_bones[bone])
            return bone

        return self.on("objects", f"bone {what}", take)

    def step_repeat(self) -> Step:
        """Run the last operator again, or change its settings, as the panel Adjust Last Operation
        does.
        """
        what = self.random.choice((bpy.ops.screen.repeat_last, bpy.ops.ed.undo_redo))
        return Step(f"repeat({what.idname_py()})", lambda: invoke(what))

    def step_view(self) -> Step:
        """Switch local view, the camera view or a full-screen area."""
        what = self.random.choice(
            (bpy.ops.view3d.localview, bpy.ops.view3d.view_camera, bpy.ops.view3d.toggle_shading)
        )
        return Step(f"view({what.idname_py()})", lambda: use(what))

    # Tools

    def names(self, kind: str) -> list[str]:
        """Return the names of all datablocks of a kind."""
        return [block.name for block in getattr(bpy.data, kind)]

    def on(self, kind: str, what: str, change: Callable) -> Step:
        """Change a random datablock of a kind, with a step to undo."""
        count = len(getattr(bpy.data, kind))
        if not count:
            return self.step_undo()
        block = getattr(bpy.data, kind)[self.random.randrange(count)]
        name = block.name
        library = block.library.filepath if block.library else None

        def take() -> object:
            try:
                change(getattr(bpy.data, kind)[(name, library)])
            # linked, overridden, in use
            except (AttributeError, TypeError, ValueError, RuntimeError) as error:
                return self.pushed(f"refused: {error}")
            return self.pushed(what)

        return Step(f"{what}({kind} {name!r} {library})", take)

    def pushed(self, what: object) -> object:
        """Add a step to undo, as an operator would."""
        if not bpy.app.background:
            invoke(bpy.ops.ed.undo_push, message="Walk")
        return what
