# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of the random walk: every operator of the extension, and what a user does to the file around them."""

from __future__ import annotations

import random
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
from session import addon, invoke, use

_BLOCKS = ("objects", "meshes", "armatures", "actions", "cameras", "collections", "scenes")
_DATA = (*_BLOCKS, "materials", "images", "movieclips", "texts")


@dataclass
class Step:
    """A step: what the log says, and what it does."""

    text: str
    take: Callable[[], object]


class Steps:
    """Chooses steps at random."""

    def __init__(self, chance: random.Random, folder: Path, footage: str) -> None:
        """Choose with ``chance``, write files to ``folder``, and capture ``footage``."""
        self.random, self.folder = chance, folder
        self.footage = shutil.copy(footage, folder)  # the walk never writes beside the original
        self.kept = folder.parent / "walk_cache"  # of an earlier walk; a capture takes longer than a walk
        self.next: Step | None = None
        self.actions = [name[5:] for name in dir(self) if name.startswith("step_")]

    def prepare(self) -> None:
        """Show all panels, capture once, and copy the cache, which steps clear."""
        for panel in list(bpy.types.Panel.__subclasses__()):
            if panel.__name__.startswith("SCOPE_PT_") and "DEFAULT_CLOSED" in getattr(panel, "bl_options", ()):
                bpy.utils.unregister_class(panel)
                panel.bl_options = set()
                bpy.utils.register_class(panel)
        if self.kept.is_dir():
            self.restore_cache()
        self.settings()
        invoke(bpy.ops.scope.capture)
        shutil.copytree(cache().root, self.kept, dirs_exist_ok=True)
        self.pushed("capture")

    def settings(self) -> None:
        """Choose the settings whose capture is in the cache."""
        scene = bpy.context.window_manager.windows[0].scene
        scene.scope.footage, scene.scope.quality = self.footage, "FAST"

    def restore_cache(self) -> None:
        """Copy the cache back, except when a capture uses it."""
        if addon().state.job is None:
            shutil.copytree(self.kept, cache().root, dirs_exist_ok=True)

    def choose(self) -> Step:
        """Return the next step: half of them are operators of the extension."""
        if self.next is not None:
            step, self.next = self.next, None
            return step
        captured = any("scope_source" in obj for obj in bpy.context.window_manager.windows[0].scene.objects)
        if not captured and self.random.random() < 0.2:
            return self.capture()
        if self.random.random() < 0.5:
            return self.operator()
        name = self.random.choice(self.actions)
        return getattr(self, f"step_{name}")()

    # Operators of the extension

    def operator(self) -> Step:
        """Run any operator of the extension, with random settings."""
        name = self.random.choice(sorted(dir(bpy.ops.scope)))
        operator = getattr(bpy.ops.scope, name)
        if name == "capture":
            return self.capture()
        settings = self.arguments(operator)
        # Always with a step to undo, as from a button: after a script's changes without one, Blender itself may crash
        # when it undoes earlier steps.
        return Step(f"scope.{name}({settings})", lambda: use(operator, **settings))

    def capture(self) -> Step:
        """Capture from the button or from a script; the cache has the result."""
        modal = self.random.random() < 0.5

        def take() -> object:
            self.restore_cache()
            self.settings()
            return use(bpy.ops.scope.capture, "INVOKE_DEFAULT" if modal else "EXEC_DEFAULT")

        return Step(f"scope.capture({'modal' if modal else 'script'})", take)

    def arguments(self, operator: object) -> dict[str, object]:
        """Choose values for some of an operator's properties."""
        found: dict[str, object] = {}
        for prop in operator.get_rna_type().properties:
            path = getattr(prop, "subtype", "") in ("FILE_PATH", "DIR_PATH", "FILE_NAME") or "path" in prop.identifier
            if prop.identifier == "rna_type" or (self.random.random() < 0.4 and not path):
                continue
            value = self.value(prop, path)
            if value is not None:
                found[prop.identifier] = value
        return found

    def value(self, prop: bpy.types.Property, path: bool) -> object:
        """Choose the value of a property; None leaves its default."""
        chance = self.random
        if prop.type == "BOOLEAN" and not prop.is_array:
            return chance.random() < 0.5
        if prop.type == "ENUM" and prop.enum_items:
            items = [item.identifier for item in prop.enum_items]
            return {chance.choice(items)} if prop.is_enum_flag else chance.choice(items)
        if prop.type in ("INT", "FLOAT"):
            low, high = max(prop.soft_min, -20), min(prop.soft_max, 120)
            if low > high:
                return None
            count = prop.array_length if prop.is_array else 1
            pick = chance.randint if prop.type == "INT" else chance.uniform
            values = [pick(int(low), int(high)) if prop.type == "INT" else pick(low, high) for _ in range(count)]
            return values if prop.is_array else values[0]
        if prop.type == "STRING":
            return self.path() if path else chance.choice(["", "left_foot", *self.names("objects")])
        return None

    def path(self) -> str:
        """Choose a path: of a file to write, one that there may be, none, a folder."""
        names = ("made.npz", "made.fbx", "made", "bones.json", "kept.npz", "no folder/made.npz")
        found = [str(self.folder / name) for name in names]
        return self.random.choice([*found, str(self.folder), ""])

    # What others do to the file

    def step_undo(self) -> Step:
        """Undo some steps; redo some of them in the next step."""
        if bpy.app.background:
            return self.operator()
        count = self.random.choice((1, 1, 2, 5))
        again = self.random.choice((0, 0, 1, count))
        if again:
            self.next = Step(f"redo({again})", lambda: [invoke(bpy.ops.ed.redo) for _ in range(again)][-1])
        return Step(f"undo({count})", lambda: [invoke(bpy.ops.ed.undo) for _ in range(count)][-1])

    step_undo_again = step_undo_often = step_undo

    def step_save(self) -> Step:
        """Save the file."""
        path = str(self.folder / f"saved{self.random.randrange(3)}.blend")
        return Step(f"save({path})", lambda: bpy.ops.wm.save_as_mainfile(filepath=path, check_existing=False))

    def step_reopen(self) -> Step:
        """Open a saved file."""
        saved = sorted(self.folder.glob("saved*.blend"))
        if not saved:
            return self.step_save()
        path, load_ui = str(self.random.choice(saved)), self.random.random() < 0.5
        return Step(f"open({path}, {load_ui})", lambda: bpy.ops.wm.open_mainfile(filepath=path, load_ui=load_ui))

    def new_file(self) -> Step:
        """Begin a new file and capture in it."""
        return Step("new file()", lambda: bpy.ops.wm.read_homefile(load_ui=self.random.random() < 0.5))

    def step_import_file(self) -> Step:
        """Link or append from a saved file, with or without an override. Blender crashes on the file that is open."""
        saved = sorted(path for path in self.folder.glob("saved*.blend") if str(path) != bpy.data.filepath)
        if not saved:
            return self.step_save()
        path, link = str(self.random.choice(saved)), self.random.random() < 0.5
        kind = self.random.choice(("objects", "collections", "actions", "meshes"))

        def take() -> object:
            with bpy.data.libraries.load(path, link=link) as (there, here):
                names = list(getattr(there, kind))
                setattr(here, kind, [self.random.choice(names)] if names else [])
            scene = bpy.context.window_manager.windows[0].scene
            for block in filter(None, getattr(here, kind)):
                if kind == "objects" and block.name not in scene.collection.objects:
                    scene.collection.objects.link(block)
                elif kind == "collections" and block.name not in scene.collection.children:
                    scene.collection.children.link(block)
                if link and kind in ("objects", "collections") and self.random.random() < 0.5:
                    block.override_hierarchy_create(scene, bpy.context.window_manager.windows[0].view_layer)
            return self.pushed(f"{kind} {names[:1]}")

        return Step(f"{'link' if link else 'append'}({kind}, {path})", take)

    def step_rename(self) -> Step:
        """Rename a datablock, also to a name that another one has."""
        kind = self.random.choice(_BLOCKS)
        return self.on(kind, "rename", lambda block: setattr(block, "name", self.random.choice(["x", "walk", 'a"b\\'])))

    def step_delete(self) -> Step:
        """Delete a datablock, as the Outliner does."""
        kind = self.random.choice(_DATA)
        return self.on(kind, "delete", lambda block: getattr(bpy.data, kind).remove(block))

    def step_delete_capture(self) -> Step:
        """Delete a collection with everything in it."""
        return self.on(
            "collections", "delete hierarchy", lambda block: bpy.data.batch_remove([*block.all_objects, block])
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
        return self.on(self.random.choice(("collections", "actions", "scenes")), "copy", lambda block: block.copy())

    def step_purge(self) -> Step:
        """Remove unused datablocks, and those that nothing but a library holds."""
        return Step("purge()", lambda: self.pushed(bpy.data.orphans_purge(do_recursive=True)))

    def step_library(self) -> Step:
        """Reload, remove or make local what is linked."""
        if not len(bpy.data.libraries):
            return self.step_import_file()
        index, what = self.random.randrange(len(bpy.data.libraries)), self.random.choice(("reload", "remove", "local"))

        def take() -> object:
            library = bpy.data.libraries[index]
            if what == "reload":
                library.reload()
            elif what == "remove":
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
        return Step(f"frame({frame})", lambda: bpy.context.window_manager.windows[0].scene.frame_set(frame))

    def step_rate(self) -> Step:
        """Change the frame rate."""
        fps = self.random.choice((1, 24, 25, 30, 120))
        return Step(f"rate({fps})", lambda: setattr(bpy.context.window_manager.windows[0].scene.render, "fps", fps))

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
                data.nla_tracks.new().strips.new(data.action.name, int(data.action.frame_range[0]), data.action)
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
            "objects", "parent", lambda obj: setattr(obj, "parent", self.random.choice([None, *bpy.data.objects]))
        )

    def step_hide(self) -> Step:
        """Hide or show an object."""
        how = self.random.choice(("hide_viewport", "hide_render", "hide_select"))
        return self.on("objects", how, lambda obj: setattr(obj, how, not getattr(obj, how)))

    def step_scene(self) -> Step:
        """Add a scene, show another one, or remove the one that is shown."""
        what = self.random.choice(("NEW", "FULL_COPY", "LINK_COPY", "show", "show", "remove"))

        def take() -> object:
            window = bpy.context.window_manager.windows[0]
            if what == "show":
                window.scene = self.random.choice(list(bpy.data.scenes))
            elif what == "remove":
                return use(bpy.ops.scene.delete)
            else:
                return use(bpy.ops.scene.new, type=what)
            return what

        return Step(f"scene({what})", take)

    def step_rig(self) -> Step:
        """Choose a rig to retarget to: a copy of a captured skeleton, or any armature."""

        def take() -> object:
            scene = bpy.context.window_manager.windows[0].scene
            armatures = [obj for obj in bpy.data.objects if obj.type == "ARMATURE"]
            if not armatures:
                return "none"
            chosen = self.random.choice(armatures)
            if self.random.random() < 0.7:
                rig = bpy.data.objects.new("rig", chosen.data.copy())
                scene.collection.objects.link(rig)
                rig.scale = (1.2, 1.2, 1.2)
                chosen = rig
            scene.scope_retarget.rig = chosen
            scene.scope_retarget.pairs.clear()
            return self.pushed(chosen.name)

        return Step("rig()", take)

    def step_property(self) -> Step:
        """Change a setting of the extension that does not change the capture."""

        def take() -> object:
            scene = bpy.context.window_manager.windows[0].scene
            group, names = self.random.choice(
                (
                    (scene.scope_retarget, ("feet", "root", "captured", "active")),
                    (scene.scope, ("frame_rate", "start_frame", "set_frame_range", "with_camera", "shape")),
                )
            )
            prop = group.bl_rna.properties[self.random.choice(names)]
            value = self.value(prop, path=False)
            setattr(group, prop.identifier, value)
            return self.pushed(f"{prop.identifier}={value}")

        return Step("property()", take)

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

    def step_view(self) -> Step:
        """Switch local view, the camera view or a full-screen area."""
        what = self.random.choice((bpy.ops.view3d.localview, bpy.ops.view3d.view_camera, bpy.ops.view3d.toggle_shading))
        return Step(f"view({what.idname_py()})", lambda: use(what))

    def step_restart_extension(self) -> Step:
        """Disable and enable the extension, as its update does."""
        if self.random.random() < 0.5:
            return self.step_undo()
        name = next((a.module for a in bpy.context.preferences.addons if a.module.endswith(".scope")), None)
        if name is None:  # in PyPI's bpy
            return self.operator()

        def take() -> object:
            bpy.ops.preferences.addon_disable(module=name)
            return bpy.ops.preferences.addon_enable(module=name)

        return Step(f"restart({name})", take)

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
        name, library = block.name, block.library.filepath if block.library else None

        def take() -> object:
            try:
                change(getattr(bpy.data, kind)[(name, library)])
            except (AttributeError, TypeError, ValueError, RuntimeError) as error:  # linked, overridden, in use
                return f"refused: {error}"
            return self.pushed(what)

        return Step(f"{what}({kind} {name!r} {library})", take)

    def pushed(self, what: object) -> object:
        """Add a step to undo, as an operator would."""
        if not bpy.app.background:
            invoke(bpy.ops.ed.undo_push, message="Walk")
        return what


def cache():
    """Return the extension's cache."""
    return sys.modules[addon().__name__.replace("capture.capture_operators", "preferences")].cache()
