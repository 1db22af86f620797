# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures: the extension registered in a fresh Blender, with its own cache, and scripted
workers.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import bpy
import numpy as np
import pytest
import scope
from scope.scope_addon import ui
from scope.scope_addon.job.process import WorkerProcess
from scope.scope_addon.machine_code import code_folders
from scope.scope_addon.motion import Motion
from scope.scope_addon.ui import (
    capture_job,
    capture_operators,
    live_operators,
    pin_tool,
    preferences,
    translations,
)
from scope.scope_addon.untrusted import body_file
from scope.solver.body import Body
from scope.solver.body_file import load_body

from ..made_motion import made_motion

ROOT = Path(scope.__file__).resolve().parent


@cache
def built_in_body(name: str) -> Body:
    """A built-in body with the faces of its feet and few others: Blender builds and writes it
    sooner.
    """
    whole = load_body(name)
    assert whole.uv_faces is not None
    assert whole.face_material is not None
    feet = [
        whole.joint_names.index(f"{side}_{part}")
        for side in ("left", "right")
        for part in ("ankle", "foot")
    ]
    of_feet = np.isin(whole.strongest_joints, feet)[whole.faces].all(axis=1)
    number = np.arange(len(whole.faces))
    chosen = np.flatnonzero(of_feet | (number % 48 == 0))
    used, faces = np.unique(whole.faces[chosen], return_inverse=True)
    return replace(
        whole,
        faces=faces.reshape(len(chosen), -1).astype(whole.faces.dtype),
        uv_faces=whole.uv_faces[chosen],
        face_material=whole.face_material[chosen],
        v_template=whole.v_template[used],
        shapedirs=whole.shapedirs[used],
        skin_joints=whole.skin_joints[used],
        skin_weights=whole.skin_weights[used],
    )


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="module", autouse=True)
def registered_classes() -> Iterator[None]:
    """Register the extension once for all tests of a module: it takes longer than most of them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            translations, "blender_translations", cache(translations.blender_translations)
        )
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        scope.register()
        yield
        scope.unregister()


@pytest.fixture(autouse=True)
def registered(tmp_path, monkeypatch):
    """Give a test the extension in a fresh Blender, and its own cache. All share the compiled
    solver.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    monkeypatch.setattr(body_file, "load_trusted_body", built_in_body)
    monkeypatch.setattr(preferences, "user_folder", lambda: tmp_path / "user")
    # What this process compiles later would lie in a test's folder, where nobody finds it again.
    monkeypatch.setattr(code_folders, "keep_in", lambda folder: None)
    monkeypatch.setattr(
        capture_job,
        "WorkerProcess",
        lambda request, folder, kernels, *rest: WorkerProcess(request, folder, None, *rest),
    )
    yield
    # All that ends when the extension is disabled, and is attached when it is enabled again.
    capture_operators.end_capture()
    live_operators.end_live()
    pin_tool.detach()
    for _, detach in reversed(ui._attachments()):
        detach()
    for attach, _ in ui._attachments():
        attach()


@pytest.fixture(scope="session")
def first_frame() -> bytes:
    """The first frame of the sample as a PNG file."""
    import cv2

    ok, image = cv2.VideoCapture(str(ROOT / "assets" / "sample" / "sample.mp4")).read()
    assert ok
    return cv2.imencode(".png", image)[1].tobytes()


@pytest.fixture
def footage(tmp_path, first_frame) -> Path:
    """The first frame of the sample as a picture file."""
    path = tmp_path / "person.png"
    path.write_bytes(first_frame)
    return path


@pytest.fixture(scope="session")
def standing() -> Motion:
    """A body at rest for ten frames, three of which are not valid."""
    body = load_body("scope")
    count = 10
    poses = np.zeros((count, 3 * (body.K + 1)))
    poses[:, 0] = np.pi / 2
    valid = np.ones(count, bool)
    valid[[3, 4, 7]] = False
    return made_motion(
        body,
        poses,
        np.tile([0, 0, 1.0], (count, 1)),
        25.0,
        valid=valid,
        joints_cam=np.ones((count, body.K + 1, 3)),
        residual_px=np.full(count, 2.0),
        source="person.png",
    )


@pytest.fixture
def fake_worker(tmp_path, monkeypatch, standing):
    """Replace the worker of the next captures by a script.

    The script may use ``folder``, ``request``, ``send(event, **values)`` and ``finish()``, which
    sends ``standing``.
    """
    from scope.scope_addon.ui import capture_job

    standing.save(tmp_path / "standing.npz")

    def use(body: str) -> None:
        script = tmp_path / "fake_worker.py"
        script.write_text(
            textwrap.dedent(f"""
                import json, os, shutil, sys, time
                folder, request = sys.argv[2], json.loads(sys.stdin.readline())
                def send(event, **values):
                    print(json.dumps(dict(values, event=event)), flush=True)
                def finish(people=1, warnings=("a warning",)):
                    names = [f"person{{i + 1}}.npz" for i in range(people)]
                    for name in names:
                        shutil.copy({str(tmp_path / "standing.npz")!r}, os.path.join(folder, name))
                    report = {{"people": 1, "reprojection_px": 2.5, "fps": {{"total": 5.0}}}}
                    report["notices"] = [
                        {{"code": "other", "values": {{"text": text}}}} for text in warnings
                    ]
                    send("result", motions=names, report=report)
            """)
            + textwrap.dedent(body)
        )
        monkeypatch.setattr(capture_job, "START_SCRIPT", script)

    return use


@pytest.fixture(scope="session")
def file_of_one(tmp_path_factory) -> Path:
    """Where the first test that asks for `one` saves it."""
    return tmp_path_factory.mktemp("captures") / "one.blend"


@pytest.fixture
def one(fake_worker, footage, file_of_one) -> bpy.types.Collection:
    """The capture of a file with one, of one person, which is built once."""
    if not file_of_one.exists():
        fake_worker("finish()")
        bpy.context.scene.scope.footage = str(footage)
        assert bpy.ops.scope.capture() == {"FINISHED"}
        bpy.ops.wm.save_as_mainfile(filepath=str(file_of_one))
    bpy.ops.wm.open_mainfile(filepath=str(file_of_one))
    return bpy.context.scene.scope.capture


def inventory() -> dict:
    """Return the names of the file's data-blocks, and settings of the scene."""
    kinds = (
        "objects",
        "meshes",
        "armatures",
        "cameras",
        "actions",
        "collections",
        "images",
        "movieclips",
        "materials",
    )
    scene = bpy.context.scene
    blocks = {kind: sorted(b.name for b in getattr(bpy.data, kind)) for kind in kinds}
    return blocks | {
        "range": (scene.frame_start, scene.frame_end),
        "rate": (scene.render.fps, scene.render.fps_base),
    }


@pytest.fixture
def contents():
    return inventory
