# SPDX-License-Identifier: GPL-3.0-or-later
"""The n-th system call of an export or a batch fails: old or new files, no others."""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from scope.scope_addon.job.batch import REPORT_NAME, Batch
from scope.scope_addon.scene.export.export import ExportOptions, export_motions
from scope.solver.body import Body
from scope.solver.errors import ScopeError

from ..made_motion import made_motion
from .faults import failing

OLD = b"an earlier result"
# Instead of a capture: writes its outputs, and reports.
PROGRAM = """
import json, sys, pathlib
outputs = [sys.argv[i + 1] for i, a in enumerate(sys.argv) if a == "-o"]
for path in outputs:
    pathlib.Path(path).write_text("result")
print(json.dumps({"frames": 3, "outputs": outputs, "warnings": []}))
"""


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture
def small(body: Body) -> Body:
    """The body with every fortieth of its faces: Blender builds and writes it sooner."""
    assert body.uv_faces is not None
    assert body.face_material is not None
    some = np.arange(0, len(body.faces), 40)
    used, faces = np.unique(body.faces[some], return_inverse=True)
    return replace(
        body,
        faces=faces.reshape(len(some), -1).astype(body.faces.dtype),
        uv_faces=body.uv_faces[some],
        face_material=body.face_material[some],
        v_template=body.v_template[used],
        shapedirs=body.shapedirs[used],
        skin_joints=body.skin_joints[used],
        skin_weights=body.skin_weights[used],
    )


@pytest.fixture
def motion(body: Body):
    return made_motion(body, np.zeros((2, 72)), np.zeros((2, 3)))


def some_of(count: int, how_many: int) -> list[int]:
    """Calls to fail, from the first of them to the last, and one that does not come any more."""
    return [*np.linspace(1, count, min(how_many, count)).astype(int), 2 * count]


@pytest.mark.parametrize("suffix", [".glb", ".bvh", ".usdc"])
def test_an_export_is_the_old_or_the_new_one(tmp_path, temporary, small, motion, suffix):
    """At more calls of the cheapest format; the others differ by Blender's writer alone."""
    path = tmp_path / f"walk{suffix}"
    path.write_bytes(OLD)
    with failing(0) as calls:
        export_motions([motion], small, path, export_options=ExportOptions(shape="baked"))
    whole = path.stat().st_size  # some formats state times and addresses, which change
    objects = len(bpy.data.objects), len(bpy.data.scenes)
    path.write_bytes(OLD)
    said = []
    for n in some_of(len(calls), 40 if suffix == ".bvh" else 9):
        with failing(n):
            try:
                export_motions([motion], small, path, export_options=ExportOptions(shape="baked"))
            except ScopeError as error:
                said.append(str(error))
        is_new = path.read_bytes() != OLD
        assert not is_new or abs(path.stat().st_size - whole) < 0.02 * whole, (
            f"after a fault at call {n}"
        )
        assert sorted(p.name for p in tmp_path.iterdir()) == ["temporary", path.name], (
            f"after a fault at call {n}"
        )
        assert list(temporary.iterdir()) == [], f"after a fault at call {n}"
        assert (len(bpy.data.objects), len(bpy.data.scenes)) == objects
        path.write_bytes(OLD)
    assert is_new
    assert len(said) > 2
    assert not any("\n" in text for text in said)


def test_a_batch_keeps_what_it_had(tmp_path, temporary):
    clips = tmp_path / "clips"
    out = tmp_path / "out"
    program = [sys.executable, "-c", PROGRAM]
    clips.mkdir()
    (clips / "a.mp4").write_text("a")
    n = 0
    failed = 0
    said = []
    while True:
        n += 2
        with failing(n, without=("close",)) as calls:  # closing the pipes of a process never fails
            try:
                failed += Batch(clips, out, program, {}, [".npz"]).run(1)["exit_status"]
            except ScopeError as error:
                said.append(str(error))
        found = {p.name: p.read_text("utf-8") for p in out.iterdir()} if out.is_dir() else {}
        assert set(found) <= {"a.npz", REPORT_NAME}, f"after a fault at call {n}"
        assert found.get("a.npz", "result") == "result"
        assert all(json.loads(text) for name, text in found.items() if name.endswith(".json"))
        assert list(temporary.iterdir()) == [], f"after a fault at call {n}"
        report = Batch(clips, out, program, {}, [".npz"]).run(1)
        assert report["exit_status"] == 0, f"after a fault at call {n}"
        assert (out / "a.npz").read_text("utf-8") == "result"
        if len(calls) < n:
            break
        for path in out.iterdir():
            path.unlink()
    assert failed + len(said) > 2
    assert not any("\n" in text for text in said)
