# SPDX-License-Identifier: GPL-3.0-or-later
"""A fresh Blender for every test, and synthetic motions with ground truth."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Quaternion, Vector
from scope.scope_addon.motion import Motion
from scope.solver.body import Body
from scope.solver.body_file import load_body

from ..made_motion import made_motion

BETAS = [1.7, -2.3, 0.5, -0.8, 1.2, 0.0, 0.3, -1.1, 0.9, -0.4]


@pytest.fixture(autouse=True)
def fresh_blender() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@pytest.fixture(scope="session")
def whole_body() -> Body:
    """The built-in body without fingers."""
    return load_body("scope")


@pytest.fixture(scope="session")
def body(whole_body: Body) -> Body:
    """The built-in body with some of its faces: Blender builds and writes it sooner."""
    whole = whole_body
    assert whole.uv_faces is not None
    assert whole.face_material is not None
    some = np.arange(0, len(whole.faces), 24)
    used, faces = np.unique(whole.faces[some], return_inverse=True)
    return replace(
        whole,
        faces=faces.reshape(len(some), -1).astype(whole.faces.dtype),
        uv_faces=whole.uv_faces[some],
        face_material=whole.face_material[some],
        v_template=whole.v_template[used],
        shapedirs=whole.shapedirs[used],
        skin_joints=whole.skin_joints[used],
        skin_weights=whole.skin_weights[used],
    )


def rotation_matrix(rotation_vector: np.ndarray) -> np.ndarray:
    angle = float(np.linalg.norm(rotation_vector))
    axis = Vector(rotation_vector / angle) if angle > 1e-12 else Vector((1, 0, 0))
    return np.array(Quaternion(axis, angle).to_matrix(), float)


@dataclass
class Truth:
    """Joints (T, K+1, 3) and the parts' rotations (T, K+1, 3, 3), world frame."""

    body: Body
    betas: np.ndarray
    R: np.ndarray
    joints: np.ndarray

    def vertices(self, t: int) -> np.ndarray:
        return self.body.skin(self.R[t], self.joints[t], self.betas)


def truth_of(body: Body, motion: Motion) -> Truth:
    w = motion.poses.reshape(len(motion), -1, 3)
    rotations = np.array([[rotation_matrix(v) for v in row] for row in w])
    R, t = body.forward_kinematics(rotations, motion.trans, motion.betas)
    return Truth(body, motion.betas, R, t)


def dance(
    body: Body,
    count: int = 12,
    rate: float = 30.0,
    seed: int = 0,
    timestamps: np.ndarray | None = None,
    betas: list[float] | None = None,
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
    moving_camera: bool = False,
    image_size: tuple[int, int] = (640, 480),
    intrinsics: np.ndarray | None = None,
    source: str = "walk.mp4",
) -> Motion:
    """A smooth random dance, turning while it walks towards the camera."""
    rng = np.random.default_rng(seed)
    timestamps = np.arange(count) / rate if timestamps is None else np.asarray(timestamps, float)
    count = len(timestamps)
    n = body.K + 1
    phase = rng.uniform(0, 2 * np.pi, (n, 3))
    speed = rng.uniform(1, 4, (n, 3))
    size = rng.uniform(-0.5, 0.5, (n, 3))
    w = size * np.sin(speed * timestamps[:, None, None] + phase)
    for t, time in enumerate(timestamps):
        heading = Quaternion((0, 0, 1), 2.8 + 1.5 * time)  # passes through half a turn
        upright = Quaternion((1, 0, 0), np.pi / 2)
        axis, angle = (heading @ upright).to_axis_angle()
        w[t, 0] = np.array(axis) * angle
    trans = np.array(offset) + np.stack(
        [0.3 * timestamps, -0.8 * timestamps, 1.1 + 0.05 * timestamps], axis=1
    )
    world_from_camera = np.tile(np.eye(4), (count, 1, 1))
    world_from_camera[:, :3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    world_from_camera[:, :3, 3] = [0.1, -4.0, 1.4]
    if moving_camera:
        for t, time in enumerate(timestamps):
            turn = np.array(Quaternion((0, 0, 1), 0.5 * time).to_matrix())
            world_from_camera[t, :3, :3] = turn @ world_from_camera[t, :3, :3]
            world_from_camera[t, :3, 3] += [0.4 * time, 0.1 * time, 0.0]
    width, height = image_size
    if intrinsics is None:
        intrinsics = np.array([[600.0, 0, width / 2], [0, 600.0, height / 2], [0, 0, 1]])
    chosen = np.zeros(body.P)
    chosen[:] = (BETAS + [0.0] * body.P)[: body.P] if betas is None else betas
    motion = made_motion(
        body,
        w,
        trans,
        rate,
        betas=chosen,
        timestamps=timestamps,
        intrinsics=intrinsics,
        world_from_camera=world_from_camera,
        image_size=np.array(image_size),
        source=source,
    )
    joints = truth_of(body, motion).joints
    R = world_from_camera[:, :3, :3]
    c = world_from_camera[:, :3, 3]
    motion.joints_cam = np.einsum("tji,tkj->tki", R, joints - c[:, None]).astype(np.float32)
    return motion


class Blender:
    """Reads joints and meshes from the open scene."""

    @staticmethod
    def go_to(frame: float) -> None:
        bpy.context.scene.frame_set(int(np.floor(frame)), subframe=float(frame - np.floor(frame)))

    @staticmethod
    def only(kind: str) -> bpy.types.Object:
        """Return the only object of a type in the scene."""
        found = [obj for obj in bpy.context.scene.objects if obj.type == kind]
        assert len(found) == 1, [obj.name for obj in bpy.context.scene.objects]
        return found[0]

    @staticmethod
    def joints(armature: bpy.types.Object, names: tuple[str, ...]) -> np.ndarray:
        """(len(names), 3) world positions of the posed bones' heads at the current frame."""
        posed = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return np.array([posed.matrix_world @ posed.pose.bones[name].head for name in names])

    @staticmethod
    def vertices(mesh: bpy.types.Object) -> np.ndarray:
        """(V, 3) world positions of the deformed mesh at the current frame."""
        posed = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
        data = posed.to_mesh()
        out = np.empty(3 * len(data.vertices), np.float32)
        data.vertices.foreach_get("co", out)
        world = np.array(posed.matrix_world)
        posed.to_mesh_clear()
        return out.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]


@pytest.fixture(scope="session")
def blender() -> type[Blender]:
    return Blender


@pytest.fixture(scope="session")
def make_motion():
    return dance


@pytest.fixture(scope="session")
def truth():
    return truth_of


@pytest.fixture(scope="session")
def joints_world():
    """(T, K+1, 3) joints from the camera's view of them, without body or poses."""

    def joints(motion: Motion) -> np.ndarray:
        T = motion.world_from_camera
        return np.einsum("tij,tkj->tki", T[:, :3, :3], motion.joints_cam) + T[:, None, :3, 3]

    return joints


@pytest.fixture(scope="session")
def rigify_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with Rigify's metarig and a rig generated from it without the face, whose bones take
    nearly all the time.

    Once for all processes.
    """
    import addon_utils  # bpy puts it on the path

    path = tmp_path_factory.mktemp("rigify") / "rigs.blend"
    # this process's folder lies in the one of the whole run
    if "PYTEST_XDIST_WORKER" in os.environ:
        path = tmp_path_factory.getbasetemp().parent / "rigify.blend"
    if path.is_file():
        return path
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    addon_utils.enable("rigify", default_set=True)
    bpy.ops.object.armature_human_metarig_add()
    bpy.ops.object.armature_human_metarig_add()
    faceless = bpy.context.object
    bpy.ops.object.mode_set(mode="EDIT")
    face = faceless.data.edit_bones["face"]
    for bone in [*face.children_recursive, face]:
        faceless.data.edit_bones.remove(bone)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.pose.rigify_generate()
    bpy.data.objects.remove(faceless)
    made = tmp_path_factory.mktemp("rigify") / "rigs.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(made))
    os.replace(made, path)
    return path


@pytest.fixture(scope="session")
def rigify_face_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with a rig that Rigify has generated from spine, head and face of its metarig, in a
    few seconds.
    """
    import addon_utils  # bpy puts it on the path

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    addon_utils.enable("rigify", default_set=True)
    bpy.ops.object.armature_human_metarig_add()
    metarig = bpy.context.object
    bpy.ops.object.mode_set(mode="EDIT")
    bones = metarig.data.edit_bones
    kept = {"face", *(bone.name for bone in bones["face"].children_recursive)}
    for bone in list(bones):
        if bone.name not in kept and not bone.name.startswith("spine"):
            bones.remove(bone)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.pose.rigify_generate()
    bpy.data.objects.remove(metarig)
    path = tmp_path_factory.mktemp("rigify") / "face.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture
def rigify_face(rigify_face_file: Path) -> bpy.types.Object:
    """The rig, in the scene."""
    with bpy.data.libraries.load(str(rigify_face_file)) as (found, wanted):
        wanted.objects = ["rig"]
    (rig,) = wanted.objects
    bpy.context.scene.collection.objects.link(rig)
    return rig


@pytest.fixture
def rigify_rigs(rigify_file: Path) -> list[tuple[bpy.types.Object, str]]:
    """Rigify's metarig and the rig generated from it, each with what its deforming bones' names
    begin with.
    """
    with bpy.data.libraries.load(str(rigify_file)) as (found, wanted):
        wanted.scenes = found.scenes
    (scene,) = wanted.scenes
    rigs = [o for o in scene.objects if o.type == "ARMATURE"]
    for rig in rigs:
        bpy.context.scene.collection.objects.link(rig)
    bpy.data.scenes.remove(scene)
    metarig = next(o for o in rigs if "torso" not in o.data.bones)
    generated = next(o for o in rigs if "torso" in o.data.bones)
    return [(metarig, ""), (generated, "ORG-")]
