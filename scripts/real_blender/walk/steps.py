# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of the random walk: every operator of the extension, its settings and its tools with
the mouse.
"""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d
from shared.session import addon, interface, invoke, use, viewport
from walk.file_steps import FileSteps, Step

TOOLS = ("pick_person", "pin_limb", "upright_line")
# Cancelled or not, these change what is not undone: the view, the frame.
UNCHECKED = (
    "cancel",
    "go_to_frame",
    "side_view",
    "look_through",
    "add_capture_preset",
    "import_video",
)


class Steps(FileSteps):
    """Chooses steps at random."""

    def __init__(self, chance: random.Random, folder: Path, footage: str) -> None:
        """Choose with ``chance``, write files to ``folder``, and capture ``footage``."""
        super().__init__(chance, folder)
        self.footage = shutil.copy(footage, folder)  # the walk never writes beside the original
        # of an earlier walk; a capture takes longer than a walk
        self.kept = folder.parent / "walk_cache"
        names = sorted(set(dir(bpy.ops.scope)) - {"documentation"})  # which opens a browser
        # which have most variants
        self.operators = [*names, *("export",) * 3, *("import_motion",) * 2]

    def prepare(self) -> None:
        """Show all panels, capture once, write a motion file, and copy the cache, which steps
        clear.
        """
        for panel in list(bpy.types.Panel.__subclasses__()):
            if panel.__name__.startswith("SCOPE_PT_") and "DEFAULT_CLOSED" in getattr(
                panel, "bl_options", ()
            ):
                bpy.utils.unregister_class(panel)
                panel.bl_options = set()
                bpy.utils.register_class(panel)
        if self.kept.is_dir():
            self.restore_cache()
        self.settings()
        invoke(bpy.ops.scope.capture)
        shutil.copytree(cache().root, self.kept, dirs_exist_ok=True)
        self.pushed("capture")
        invoke(bpy.ops.scope.export, filepath=str(self.folder / "kept.npz"), format="NPZ")

    def settings(self) -> None:
        """Choose the settings whose capture is in the cache."""
        scene = bpy.context.window_manager.windows[0].scene
        scene.scope.footage = self.footage
        scene.scope.quality = "FAST"

    def restore_cache(self) -> None:
        """Copy the cache back, except when a capture uses it."""
        if addon().state.job is None:
            shutil.copytree(self.kept, cache().root, dirs_exist_ok=True)

    def choose(self) -> Step:
        """Return the next step: half of them are operators of the extension."""
        if self.next:
            return self.next.pop(0)
        captured = any(
            "scope_source" in obj for obj in bpy.context.window_manager.windows[0].scene.objects
        )
        if not captured and self.random.random() < 0.3:
            return self.capture()
        return self.operator() if self.random.random() < 0.5 else self.any_step()

    def operator(self) -> Step:
        """Run any operator of the extension, with random settings."""
        name = self.random.choice(self.operators)
        operator = getattr(bpy.ops.scope, name)
        if name == "capture":
            return self.capture()
        if name in TOOLS and not bpy.app.background:
            return self.tool(name)
        settings = self.arguments(name)
        # Always with a step to undo, as from a button: after a script's changes without one,
        # Blender itself may crash when it undoes earlier steps.
        return Step(
            f"scope.{name}({settings})",
            lambda: use(operator, **settings),
            checked=name not in UNCHECKED,
        )

    def capture(self) -> Step:
        """Capture from the button or from a script; the cache has the result."""
        modal = self.random.random() < 0.5

        def take() -> object:
            self.restore_cache()
            self.settings()
            return use(bpy.ops.scope.capture, "INVOKE_DEFAULT" if modal else "EXEC_DEFAULT")

        return Step(f"scope.capture({'modal' if modal else 'script'})", take)

    def tool(self, name: str) -> Step:
        """Start a tool, drag with the mouse, do something else meanwhile, and leave the tool."""

        def take() -> object:
            outcome = use(getattr(bpy.ops.scope, name), "INVOKE_DEFAULT")
            if "RUNNING_MODAL" in outcome:
                self.next = [*self.dragging(), self.mouse("ESC", "", "PRESS")]
            return outcome

        step = Step(f"scope.{name}(tool)", take)
        if name != "upright_line":
            return step
        self.next.append(step)  # the line is drawn in the view of the comparison
        return Step("scope.look_through({})", lambda: use(bpy.ops.scope.look_through))

    def dragging(self) -> list[Step]:
        """Return steps of the mouse, with other steps in between."""
        steps: list[Step] = []
        for _ in range(self.random.randrange(1, 3)):
            bone = self.random.choice(("left_wrist", "right_ankle", "head"))
            steps += [self.mouse("MOUSEMOVE", bone), self.mouse("LEFTMOUSE", bone, "PRESS")]
            if self.random.random() < 0.3:
                steps.append(self.any_step())
            steps += [self.mouse("MOUSEMOVE"), self.mouse("LEFTMOUSE", "", "RELEASE")]
            if self.random.random() < 0.4:
                steps.append(self.operator() if self.random.random() < 0.5 else self.any_step())
        return steps

    def mouse(self, kind: str, bone: str = "", value: str = "NOTHING") -> Step:
        """Move the mouse to a bone's head or anywhere over the viewport, or press and release
        there.
        """
        share = self.random.random(), self.random.random()

        def take() -> object:
            context = viewport()
            region = context["region"]
            window = context["window"]
            place = [region.x + share[0] * region.width, region.y + share[1] * region.height]
            active = window.view_layer.objects.active
            if bone and active is not None and active.pose and bone in active.pose.bones:
                head = active.matrix_world @ active.pose.bones[bone].head
                at = location_3d_to_region_2d(region, context["area"].spaces.active.region_3d, head)
                place = [region.x + at[0], region.y + at[1]] if at else place
            x = min(max(int(place[0]), region.x), region.x + region.width - 1)
            y = min(max(int(place[1]), region.y), region.y + region.height - 1)
            window.event_simulate(type=kind, value=value, x=x, y=y)
            return f"{x}, {y}"

        return Step(f"mouse({kind} {value} {bone})", take)

    def arguments(self, name: str) -> dict[str, object]:
        """Choose values for some of an operator's properties."""
        found: dict[str, object] = {}
        for prop in getattr(bpy.ops.scope, name).get_rna_type().properties:
            path = (
                getattr(prop, "subtype", "") in ("FILE_PATH", "DIR_PATH", "FILE_NAME")
                or "path" in prop.identifier
            )
            if prop.identifier == "rna_type" or (self.random.random() < 0.4 and not path):
                continue
            value = self.value(prop, path)
            if value is not None:
                found[prop.identifier] = value
        if self.random.random() < 0.6:  # what has a chance of success
            found |= self.likely(name)
        return found

    def likely(self, name: str) -> dict[str, object]:
        """Choose values with which an operator can do its work on the walk's capture."""
        chance = self.random
        folder = self.folder
        first = chance.randrange(3, 30)
        span = {"start": first, "end": first + chance.randrange(1, 12)}
        place = [chance.uniform(-0.5, 0.5), chance.uniform(-0.5, 0.5), chance.uniform(0.2, 1.5)]
        values: dict[str, dict[str, object]] = {
            **dict.fromkeys(
                (
                    "interpolate_span",
                    "exchange_sides",
                    "foot_stands",
                    "this_rests",
                    "flip_limb",
                    "turn_around",
                ),
                span,
            ),
            **dict.fromkeys(("choose_footage", "import_video"), {"filepath": self.footage}),
            "import_motion": {
                "filepath": str(folder / "kept.npz"),
                "directory": "",
                "body": "SCOPE",
            },
            "load_bone_map": {"filepath": str(folder / "bones.json")},
            "choose_file": {
                "filepath": str(folder / "kept.npz"),
                "owner": "scope",
                "setting": "body_file",
            },
            "export": {
                "filepath": str(folder / "made"),
                "format": chance.choice(
                    ("FBX", "GLB", "BVH", "USDC", "NPZ", "TRC", "MOT", "C3D", "VRMA")
                ),
                "which": chance.choice(("ALL", "ALL", "ALL", "ACTIVE", "RIG")),
            },
            "loop": {"start": 1, "end": 60, "shortest": 0.5, "movement": 0.0},
            "add_pin": {
                "joint": chance.choice(("left_wrist", "right_ankle", "head")),
                "location": place,
                "frame": first,
            },
            "set_upright": {"start": (300, 100), "end": (300 + chance.uniform(-30, 30), 400)},
            "set_upright_in_view": {
                "start": (0, 0, 0),
                "end": (0, chance.uniform(-0.2, 0.2), 1.5),
                "direction": (1.0, 0.0, chance.uniform(-0.1, 0.1)),
            },
            "remove_correction": {"index": chance.choice((-1, 0, 0, 1))},
        }
        return values.get(name, {})

    def value(self, prop: bpy.types.Property, path: bool) -> object:
        """Choose the value of a property; None leaves its default."""
        chance = self.random
        if prop.type == "BOOLEAN" and not prop.is_array:
            return chance.random() < 0.5
        if prop.type == "ENUM" and prop.enum_items:
            items = [item.identifier for item in prop.enum_items]
            return {chance.choice(items)} if prop.is_enum_flag else chance.choice(items)
        if prop.type in ("INT", "FLOAT"):
            low = max(prop.soft_min, -20)
            high = min(prop.soft_max, 120)
            if low > high:
                return None
            count = prop.array_length if prop.is_array else 1
            pick = chance.randint if prop.type == "INT" else chance.uniform
            values = [
                pick(int(low), int(high)) if prop.type == "INT" else pick(low, high)
                for _ in range(count)
            ]
            return values if prop.is_array else values[0]
        if prop.type == "STRING":
            return self.path() if path else chance.choice(["", "left_foot", *self.names("objects")])
        return None

    def path(self) -> str:
        """Choose a path: of a file to write, one that there may be, none, a folder."""
        names = ("made.npz", "made.fbx", "made", "bones.json", "kept.npz", "no folder/made.npz")
        found = [str(self.folder / name) for name in names]
        return self.random.choice([*found, str(self.folder), ""])

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

    step_rig_again = step_rig

    def step_select_captured(self) -> Step:
        """Select a captured armature of the scene."""

        def take() -> object:
            layer = bpy.context.window_manager.windows[0].view_layer
            people = [obj for obj in layer.objects if "scope_source" in obj]
            if not people:
                return "none"
            if layer.objects.active is not None and layer.objects.active.mode != "OBJECT":
                use(bpy.ops.object.mode_set, mode="OBJECT")
            chosen = layer.objects.active = self.random.choice(people)
            return self.pushed(chosen.name_full)

        return Step("select captured()", take)

    step_select_captured_again = step_select_captured_often = step_select_captured

    def step_show_capture(self) -> Step:
        """Select a capture in the list."""

        def take() -> object:
            scene = bpy.context.window_manager.windows[0].scene
            scene.scope.capture_index = self.random.randrange(-1, len(bpy.data.collections) + 1)
            return self.pushed(scene.scope.capture_index)

        return Step("show capture()", take)

    def step_preset(self) -> Step:
        """Apply a preset of the capture settings that an earlier step has added."""
        folders = bpy.utils.preset_paths("scope/capture")
        files = sorted(str(path) for folder in folders for path in Path(folder).glob("*.py"))
        if not files:
            return Step(
                "scope.add_capture_preset()",
                lambda: use(bpy.ops.scope.add_capture_preset, name="walk"),
            )
        settings = {
            "filepath": self.random.choice(files),
            "menu_idname": "SCOPE_PT_capture_presets",
        }
        return Step(f"preset({settings})", lambda: use(bpy.ops.script.execute_preset, **settings))

    def step_property(self) -> Step:
        """Change a setting of the extension that does not change the capture."""

        def take() -> object:
            scene = bpy.context.window_manager.windows[0].scene
            group, names = self.random.choice(
                (
                    (scene.scope_retarget, ("feet", "root", "captured", "active")),
                    (
                        scene.scope,
                        (
                            "frame_rate",
                            "start_frame",
                            "set_frame_range",
                            "with_camera",
                            "shape",
                            "take",
                        ),
                    ),
                )
            )
            prop = group.bl_rna.properties[self.random.choice(names)]
            value = self.value(prop, path=False)
            setattr(group, prop.identifier, value)
            return self.pushed(f"{prop.identifier}={value}")

        return Step("property()", take)

    def step_restart_extension(self) -> Step:
        """Disable and enable the extension, as its update does."""
        if self.random.random() < 0.5:
            return self.step_undo()
        name = next(
            (a.module for a in bpy.context.preferences.addons if a.module.endswith(".scope")), None
        )
        if name is None:  # in PyPI's bpy
            return self.operator()

        def take() -> object:
            bpy.ops.preferences.addon_disable(module=name)
            return bpy.ops.preferences.addon_enable(module=name)

        return Step(f"restart({name})", take)


def cache():
    """Return the extension's cache."""
    return interface("preferences").cache()
