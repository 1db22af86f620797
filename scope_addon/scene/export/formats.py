# SPDX-License-Identifier: GPL-3.0-or-later
"""One writer per file format, with the settings that other tools need, and checks that Blender has
written a file to its end: some of its writers do not report that a write failed.

Of a binary glTF at frame rates such as 29.97, the key times are corrected. Blender's exporter
computes the rate as ``fps`` times ``fps_base`` instead of fps / fps_base: 29.97 becomes 30.03, and
the motion drifts from the footage's sound. Therefore a scene is written at its integer ``fps``, and
the times in the file are scaled afterwards. (Blender's importer has the same error as its
exporter.)

So are the fields of view of several cameras. Blender's exporter gives all of them the shape of the
scene's picture. glTF's cameras cannot hold a shifted centre, a distortion or a lens that zooms.

USD writes a crate piece by piece, and the exporter does not say when the disk refuses one of them:
the others follow, and there are zeros in its place. So the layer is copied in memory before it is
saved, and compared with what the file holds, by USD's own module, which comes with Blender.
"""

from __future__ import annotations

import ctypes
import errno
import importlib
import io
import json
import math
import os
import re
import struct
import sys
from collections.abc import Iterator
from contextlib import (
    ExitStack,
    contextmanager,
    nullcontext,
    redirect_stderr,
    redirect_stdout,
    suppress,
)
from pathlib import Path
from typing import Any

import addon_utils
import bpy
import numpy as np
from bpy.types import Object, Scene
from mathutils import Matrix

from ...errors import OutputError
from ...kinematics.axes import transform_points, transposed, unscaled
from .. import timing
from ..character.root_object import parent_transform, root_object
from ..datablocks import cameras_in, changed
from . import bvh
from .fbx_file import correct_fbx

_ZSTANDARD = b"\x28\xb5\x2f\xfd"
# magic numbers around the table of a seekable Zstandard file
_TABLE = 0x184D2A5E
_TABLE_END = 0x8F92EAB1
_HAS_CHECKSUMS = 0x80
# bytes: magic, version, length of the file; length, type of a chunk
_HEADER = 12
_CHUNK_HEADER = 8
_CRATE = b"PXR-USDC"
_SECTION = struct.Struct("<16sqq")  # name, start, size
# A layer of USD; None where Blender has no module for it.
Layer = Any


def write_glb(
    path: Path, camera: bool = False, take: str = "Animation", deform_bones: bool = False
) -> None:
    """Write the active scene as binary glTF: y up, metres, shape keys as morph targets, all motion
    in one animation.

    :param take: name of the animation.
    :param deform_bones: leave out bones that deform nothing.
    :raises OutputError: Blender cannot write it.
    """
    enable_addon("io_scene_gltf2")
    scene = bpy.context.scene
    moving = [obj for obj in scene.objects if obj.animation_data]
    with corrected_key_times(path, scene), _corrected_fields_of_view(path, scene):
        call_operator(
            bpy.ops.export_scene.gltf,
            filepath=str(path),
            export_format="GLB",
            use_selection=False,
            use_active_scene=True,
            export_yup=True,
            export_apply=False,  # it would leave out the shape keys, see mesh_modifiers
            export_cameras=camera,
            export_skins=True,
            export_influence_nb=4,
            export_all_influences=False,
            export_morph=True,
            export_morph_normal=True,
            export_morph_animation=True,
            export_rest_position_armature=True,
            export_def_bones=deform_bones,
            export_leaf_bone=False,
            export_animations=True,
            export_animation_mode="ACTIVE_ACTIONS",
            export_nla_strips_merged_animation_name=take,
            # otherwise Blender 4.2 includes other actions of the file
            export_anim_single_armature=False,
            export_force_sampling=True,
            export_frame_range=True,
            # players start at zero and would wait for the first frame
            export_anim_slide_to_zero=True,
            export_optimize_animation_size=False,
            # Faster, but it hides all animated objects except the first, which then do not move.
            export_optimize_disable_viewport=len(moving) < 2,
        )


def write_fbx(
    path: Path, camera: bool = False, take: str = "Take", deform_bones: bool = False
) -> None:
    """Write the active scene as FBX: y up, centimetres, objects at scale 1, no leaf bones, every
    frame keyed from 0 s.

    :param take: name of the animation.
    :param deform_bones: leave out bones that deform nothing, and carry none that do.
    :raises OutputError: Blender cannot write it.
    """
    enable_addon("io_scene_fbx")
    call_operator(
        bpy.ops.export_scene.fbx,
        filepath=str(path),
        use_selection=False,
        object_types={"ARMATURE", "MESH", "CAMERA"} if camera else {"ARMATURE", "MESH"},
        apply_unit_scale=True,
        apply_scale_options="FBX_SCALE_ALL",
        bake_space_transform=False,  # broken with armatures
        axis_forward="-Z",
        axis_up="Y",
        use_mesh_modifiers=False,  # they would leave out the shape keys, see mesh_modifiers
        mesh_smooth_type="FACE",
        add_leaf_bones=False,
        primary_bone_axis="Y",
        secondary_bone_axis="X",
        use_armature_deform_only=deform_bones,
        bake_anim=True,
        bake_anim_use_all_bones=True,
        bake_anim_use_nla_strips=False,
        bake_anim_use_all_actions=False,
        bake_anim_force_startend_keying=True,
        bake_anim_step=1.0,
        bake_anim_simplify_factor=0.0,
        path_mode="AUTO",
    )
    correct_fbx(path, take)


def write_usd(path: Path, camera: bool = False, deform_bones: bool = False) -> None:
    """Write the active scene as a USD crate: z up, metres, skeleton, blend shapes, preview
    materials.

    :param deform_bones: leave out bones that deform nothing, and carry none that do.
    :raises OSError: when the file is incomplete.
    :raises OutputError: Blender cannot write it.
    """
    with saved_layers() as layers:
        call_operator(
            bpy.ops.wm.usd_export,
            filepath=str(path),
            selected_objects_only=False,
            visible_objects_only=False,
            export_animation=True,
            export_armatures=True,
            only_deform_bones=deform_bones,
            export_shapekeys=True,
            export_uvmaps=True,
            export_normals=True,
            export_materials=True,
            generate_preview_surface=True,
            export_textures=False,
            export_cameras=camera,
            export_lights=False,
            convert_world_material=False,
            root_prim_path="/root",
        )
    if path.is_file() and not (
        is_whole_crate(path) and all(has_content(path, layer) for layer in layers)
    ):
        raise _incomplete(path)


def write_blend(path: Path, scene: Scene) -> None:
    """Write a .blend of one scene and its dependencies; paths of footage are relative to the file.

    :raises OSError: when the file is incomplete.
    """
    bpy.data.libraries.write(str(path), {scene}, path_remap="RELATIVE_ALL", compress=True)
    if path.is_file() and not is_whole_blend(path):
        raise _incomplete(path)


def _incomplete(path: Path) -> OSError:
    return OSError(errno.ENOSPC, "the file could not be written completely", str(path))


def write_bvh(path: Path, scene: Scene, rig: Object, unit: str) -> None:
    """Write one armature as BVH, sampled at the scene's whole frames.

    :param unit: of the file's lengths, ``cm`` or ``m``.
    """
    path.write_text(
        bvh.bvh_text(sample_armature(scene, rig), unit), encoding="utf-8", errors="replace"
    )


def sample_armature(scene: Scene, rig: Object) -> bvh.SampledPose:
    """Sample the pose of an armature at every frame of the scene's range, in the world frame."""
    bones = list(rig.data.bones)
    names = [bone.name for bone in bones]
    rest = np.array([np.array(bone.matrix_local) for bone in bones])
    frames = range(scene.frame_start, scene.frame_end + 1)
    posed = np.empty((len(frames), len(bones), 4, 4))
    # deforming meshes would take most of the time
    deforming = [m for obj in scene.objects for m in obj.modifiers if m.type == "ARMATURE"]
    with timing.current_frame_kept(scene), changed(deforming, show_viewport=False):
        for row, frame in enumerate(frames):
            scene.frame_set(frame)
            evaluated = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
            world = np.array(evaluated.matrix_world)
            for column, name in enumerate(names):
                posed[row, column] = world @ np.array(evaluated.pose.bones[name].matrix)
    world = np.array(_place_at_rest(rig))
    rest_world = world @ rest
    tails = transform_points(world, np.array([bone.tail_local for bone in bones]))
    return bvh.SampledPose(
        names=names,
        parents=[names.index(bone.parent.name) if bone.parent else -1 for bone in bones],
        heads=rest_world[:, :3, 3],
        tails=tails,
        rotations=unscaled(posed[..., :3, :3]) @ transposed(unscaled(rest_world[:, :3, :3])),
        joints=posed[..., :3, 3],
        rate=timing.scene_rate(scene),
    )


def _place_at_rest(rig: Object) -> Matrix:
    """Return an armature's transform to the world (4, 4) without its root object's, which is part
    of the motion and would turn the rest pose.
    """
    empty = root_object(rig)
    if empty is None:
        return rig.matrix_world
    return parent_transform(empty) @ empty.matrix_world.inverted_safe() @ rig.matrix_world


class _NullStream(io.TextIOBase):
    """A null stream that is never closed, because exporters keep log handlers that outlive the
    call.
    """

    def write(self, text: str) -> int:
        """Discard the text."""
        return len(text)


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress the output of Blender's importers and exporters: standard output may carry a
    machine-readable report.

    Blender prints the traceback of one that fails, and USD what it thinks of it; with
    SCOPE_TRACEBACK set, standard error is left alone.
    """
    shows_errors = bool(os.environ.get("SCOPE_TRACEBACK"))
    errors = nullcontext() if shows_errors else redirect_stderr(_NullStream())
    with ExitStack() as stack:
        for number in (1,) if shows_errors else (1, 2):  # output of Blender's C++ code
            stack.enter_context(_discarded(number))
        with redirect_stdout(_NullStream()), errors:  # output of Python
            yield


@contextmanager
def _discarded(number: int) -> Iterator[None]:
    """Discard what is written to a file descriptor."""
    # None where it was closed when Python started
    stream = sys.stdout if number == 1 else sys.stderr
    if stream is not None:
        stream.flush()
    try:
        keep = os.dup(number)
    except OSError:  # it is closed, as for a program without a terminal on Windows
        yield
        return
    devnull = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(devnull, number)
        yield
    finally:
        if stream is not None:
            stream.flush()
        _flush_c_streams()
        os.dup2(keep, number)
        os.close(keep)
        os.close(devnull)


def _flush_c_streams() -> None:
    """Write what C++ code has printed: without a terminal, it stays in the buffers of C until the
    program ends.
    """
    with suppress(OSError, AttributeError):
        ctypes.CDLL("ucrtbase" if os.name == "nt" else None).fflush(None)


def enable_addon(module: str) -> None:
    """Enable an exporter or importer that is part of Blender, for this session only, if the user
    has disabled it.
    """
    if not addon_utils.check(module)[1]:
        addon_utils.enable(module, default_set=False)


def call_operator(operator: Any, **settings: Any) -> None:
    """Call an exporter or importer with those of the settings that this Blender version supports.

    :raises OutputError: when this Blender lacks the operator.
    :raises RuntimeError: when the operator fails.
    :raises KeyboardInterrupt: when the user presses Ctrl-C.
    """
    try:
        known = operator.get_rna_type().properties.keys()
    except KeyError as error:
        raise OutputError(
            "this Blender was built without the format; use a build from blender.org"
        ) from error
    try:
        operator(**{name: value for name, value in settings.items() if name in known})
    except RuntimeError as error:
        # Blender converts all exceptions to this one
        if re.search(r"^KeyboardInterrupt\b", str(error), re.MULTILINE):
            raise KeyboardInterrupt from None
        raise


def is_whole_blend(path: Path) -> bool:
    """Return whether a .blend file is as long as its own table says, and Blender finds its end."""
    if not _has_all_frames(path):
        return False
    try:
        with bpy.data.libraries.load(str(path)):
            return True
    except OSError:
        return False


def _has_all_frames(path: Path) -> bool:
    """Return whether the compressed parts of a .blend fill the file; True if it is not compressed.

    Source: Zstandard, contrib/seekable_format: the file ends with a frame that lists the compressed
    and the full size of every other one, their number, a byte of flags and a magic number.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(4) != _ZSTANDARD:
            return True  # whether it is a .blend at all, Blender says
        if size < 17:
            return False
        file.seek(size - 9)
        count, flags, magic = struct.unpack("<IBI", file.read(9))
        entry = 12 if flags & _HAS_CHECKSUMS else 8
        start = size - 17 - count * entry
        if magic != _TABLE_END or start < 0:
            return False
        file.seek(start)
        if struct.unpack("<I", file.read(4))[0] != _TABLE:
            return False
        file.seek(4, 1)
        table = file.read(count * entry)
    return bool(sum(struct.unpack_from("<I", table, k * entry)[0] for k in range(count)) == start)


@contextmanager
def corrected_key_times(path: Path, scene: Scene) -> Iterator[None]:
    """Correct the key times of the .glb that the block writes to ``path``."""
    base = scene.render.fps_base
    with changed([scene.render], fps_base=1.0):
        yield
    if base != 1.0 and path.is_file():
        with _changed_glb(path) as (gltf, binary):
            _scale_key_times(gltf, binary, base)


@contextmanager
def _corrected_fields_of_view(path: Path, scene: Scene) -> Iterator[None]:
    """Give every camera of a capture its own shape of the picture, and field of view, in the .glb
    that the block writes to ``path``.
    """
    yield
    aspects = {
        camera.data.name: camera.data.sensor_width / camera.data.sensor_height
        for collection in scene.collection.children
        for camera in cameras_in(collection)
        if camera.data.sensor_fit == "HORIZONTAL"
    }
    if aspects and path.is_file():
        with _changed_glb(path) as (gltf, _):
            for camera in gltf.get("cameras", ()):
                _set_aspect(camera, aspects)


def _set_aspect(camera: dict[str, Any], aspects: dict[str, float]) -> None:
    """Set a camera's ratio of width to height, and keep its horizontal field of view.

    :param aspects: by the names of cameras; others stay.
    """
    aspect = aspects.get(camera.get("name", ""))
    lens = camera.get("perspective")
    if aspect is None or lens is None:
        return
    half_width = math.tan(lens["yfov"] / 2) * lens["aspectRatio"]
    lens["aspectRatio"] = aspect
    lens["yfov"] = 2 * math.atan(half_width / aspect)


def _scale_key_times(gltf: dict[str, Any], binary: bytearray, factor: float) -> None:
    """Multiply the times of all keys in a file."""
    for index in {
        sampler["input"]
        for animation in gltf.get("animations", ())
        for sampler in animation["samplers"]
    }:
        accessor = gltf["accessors"][index]
        start = gltf["bufferViews"][accessor["bufferView"]].get("byteOffset", 0) + accessor.get(
            "byteOffset", 0
        )
        times = np.frombuffer(binary, "<f4", accessor["count"], _CHUNK_HEADER + start)
        times *= np.float32(factor)
        accessor["min"] = [float(times.min())]
        accessor["max"] = [float(times.max())]


@contextmanager
def _changed_glb(path: Path) -> Iterator[tuple[dict[str, Any], bytearray]]:
    """Read a .glb, give its description and what follows it to the block, which may change both,
    and write them.
    """
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, _HEADER)
    begin = _HEADER + _CHUNK_HEADER
    gltf = json.loads(data[begin : begin + length])
    binary = bytearray(data[begin + length :])
    yield gltf, binary
    text = json.dumps(gltf, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    total = begin + len(text) + len(binary)
    head = data[:8] + struct.pack("<II", total, len(text)) + data[16:begin]
    path.write_bytes(head + text + binary)


@contextmanager
def saved_layers() -> Iterator[list[Layer]]:
    """Collect a copy of each layer that Blender's exporter saves within the block; of none, if this
    Blender comes without USD's module.
    """
    copies: list[Layer] = []
    sdf = _usd_module()
    if sdf is None:
        yield copies
        return

    class CopyLayer(bpy.types.USDHook):  # type: ignore[misc]
        """Copies the layer once it is complete."""

        bl_idname = "scope_copy_layer"
        bl_label = "Copy Layer"

        @staticmethod
        def on_export(context: Any) -> bool:
            layer = sdf.Layer.CreateAnonymous()
            layer.TransferContent(context.get_stage().GetRootLayer())
            copies.append(layer)
            return True

    bpy.utils.register_class(CopyLayer)
    try:
        yield copies
    finally:
        bpy.utils.unregister_class(CopyLayer)


def has_content(path: Path, layer: Layer) -> bool:
    """Return whether a file holds every value of a layer."""
    sdf = _usd_module()
    paths: list[Any] = []
    layer.Traverse(sdf.Path.absoluteRootPath, paths.append)
    try:
        found = sdf.Layer.OpenAsAnonymous(str(path))
        return all(
            _has_values(found.GetObjectAtPath(each), spec)
            for each in paths
            if (spec := layer.GetObjectAtPath(each)) is not None  # the target of a relation is none
        )
    except (RuntimeError, AttributeError):  # USD cannot read it; it lacks an object
        return False


def _has_values(found: Any, spec: Any) -> bool:
    return all(_is_same(found.GetInfo(key), spec.GetInfo(key)) for key in spec.ListInfoKeys())


def _is_same(found: Any, value: Any) -> bool:
    if found == value:
        return True
    text = repr(value)  # NaN, as rigs may have it, differs from itself
    return "nan" in text and repr(found) == text


def _usd_module() -> Any:
    """Return USD's module for layers; None if Blender comes without it.

    Blender's Python finds the modules that come with it, but not another Python, into which Blender
    was installed as a module.
    """
    python = Path(bpy.utils.resource_path("LOCAL"), "python", "lib")
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    before = list(sys.path)
    sys.path += [str(python / version / "site-packages"), str(python / "site-packages")]
    try:
        return importlib.import_module("pxr.Sdf")
    except ImportError:
        return None
    finally:
        sys.path[:] = before


def is_whole_crate(path: Path) -> bool:
    """Return whether a USD crate file has its table of contents, and more than the root of the
    scene.

    The table is written last and located by the header. The exporter writes the file first without
    and then with the scene.

    Source: OpenUSD, pxr/usd/usd/crateFile.h: identifier (8 bytes), version (8), offset of the table
    (8); the table is a count (8) of sections of 32 bytes each; the section of paths begins with
    their count (8).
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(24)
        if len(head) < 24 or head[:8] != _CRATE:
            return False
        (table,) = struct.unpack("<q", head[16:])
        if not 24 <= table <= size - 8:
            return False
        file.seek(table)
        (count,) = struct.unpack("<q", file.read(8))
        if not 0 < count <= (size - table - 8) // _SECTION.size:
            return False
        sections = [_SECTION.unpack(file.read(_SECTION.size)) for _ in range(count)]
        starts = [start for name, start, _ in sections if name.rstrip(b"\0") == b"PATHS"]
        if not starts or not 0 <= starts[0] <= size - 8:
            return False
        file.seek(starts[0])
        (paths,) = struct.unpack("<q", file.read(8))
    return bool(paths > 1)
