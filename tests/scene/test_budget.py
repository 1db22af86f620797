# SPDX-License-Identifier: GPL-3.0-or-later
"""A small file that claims much is refused with one sentence, within the memory of a small motion;
what real captures need is permitted.
"""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray
from scope.scope_addon.errors import MotionFileError, OutputError
from scope.scope_addon.scene.actions import Channels, bone_path
from scope.scope_addon.scene.budget import (
    check_content,
    check_rows,
    check_samples,
)
from scope.scope_addon.scene.export.export import export_motions
from scope.scope_addon.scene.export.without_scene import write_without_scene
from scope.solver.body import Body

from ..made_motion import made_motion

MOST_BYTES = 2 << 30


def amass(path: Path, frames: int) -> Path:
    """A motion file as other tools write it, of a body that does not move."""
    np.savez_compressed(
        path,
        poses=np.zeros((frames, 72), np.float32),
        trans=np.zeros((frames, 3)),
        betas=np.zeros(10),
        mocap_framerate=60.0,
        gender="neutral",
    )
    return path


def limit_memory() -> None:
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_BYTES, MOST_BYTES))


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "scope.scope_addon", *map(str, arguments)]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, preexec_fn=limit_memory
    )


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="measures memory with a limit of Linux")
def test_an_hour_of_zeros_is_refused(tmp_path: Path) -> None:
    """Before Blender has a key of it, so for every format."""
    motion = amass(tmp_path / "zeros.npz", 45_000)
    assert motion.stat().st_size < 40_000
    done = run("import", motion, "-o", tmp_path / "out.glb")
    assert done.returncode == 1
    # Some versions of Blender's module say first where they look for colour spaces.
    said = [line for line in done.stderr.splitlines() if "color_management" not in line]
    assert len(said) == 1
    assert "hardly any movement" in said[0]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["zeros.npz"]


class Capture:
    """What a capture has: measured positions, whose last bits are noise."""

    joint_count = 24

    def __init__(self, frames: int, noise_rad: float) -> None:
        self.poses = np.zeros((frames, 72), np.float32)
        if noise_rad:
            random = np.random.default_rng(0)
            self.poses += noise_rad * np.abs(random.normal(size=(frames, 72)))
        self.trans = np.zeros((frames, 3), np.float32)
        self.timestamps = np.arange(frames) / 30.0
        self.mocap_framerate = 30.0

    def __len__(self) -> int:
        return len(self.poses)


def test_hours_of_a_real_motion_are_permitted() -> None:
    check_content(Capture(40_000, 1e-3))  # type: ignore[arg-type]
    check_content(Capture(20_000, 0.0))  # type: ignore[arg-type]
    with pytest.raises(MotionFileError, match="40000 frames, but hardly any movement"):
        check_content(Capture(40_000, 0.0))  # type: ignore[arg-type]


def test_rows_that_hardly_any_movement_fills_are_refused(whole_body: Body, tmp_path: Path) -> None:
    """Two frames with a day between them took all memory."""
    motion = made_motion(whole_body, np.zeros((2, 72)), np.zeros((2, 3)))
    motion.timestamps[:] = 0.0, 86400.0
    said = r"hardly any movement; in this format .* GB of memory"
    for suffix in (".trc", ".c3d", ".mot", ".csv", ".vrma"):
        with pytest.raises(OutputError, match=said):
            write_without_scene(tmp_path / f"out{suffix}", [motion], [whole_body])
    assert list(tmp_path.iterdir()) == []


def test_an_hour_of_a_recorded_screen_is_permitted() -> None:
    """Its images come when something changes, 4 each second here, at a rate of 60."""
    screen = Capture(14_400, 1e-3)
    screen.timestamps = np.arange(14_400) / 4.0
    screen.mocap_framerate = 60.0
    check_rows(screen)  # type: ignore[arg-type]


def test_few_keys_over_many_frames_are_refused_before_they_are_sampled(
    body: Body, tmp_path: Path
) -> None:
    motion = made_motion(body, np.zeros((12, 72)), np.zeros((12, 3)))
    motion.timestamps[:] = np.linspace(0.0, 20_000.0, len(motion))
    with pytest.raises(
        OutputError, match="^[0-9]{6} frames of 24 bones would need .* GB of memory"
    ):
        export_motions([motion], body, tmp_path / "out.glb")
    assert list(tmp_path.iterdir()) == []


def keyed_rig(bones: int, values: NDArray[np.float64]) -> bpy.types.Object:
    """A rig whose first bone has these keys (T, 4), one per frame of the scene."""
    data = bpy.data.armatures.new("Rig")
    rig = bpy.data.objects.new("Rig", data)
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for _ in range(bones):
        data.edit_bones.new("bone").tail = (0.0, 0.0, 1.0)
    bpy.ops.object.mode_set(mode="OBJECT")
    channels = Channels(rig, bpy.data.actions.new("Action"))
    frames = np.arange(len(values), dtype=float)
    channels.write(bone_path("bone", "rotation_quaternion"), frames, values)
    bpy.context.scene.frame_start = 0
    bpy.context.scene.frame_end = len(values) - 1
    return rig


def test_a_still_motion_on_a_rig_of_many_bones_is_refused_and_a_real_one_is_not() -> None:
    """The exporter of .glb samples all bones at all frames: 1.6 million times 1800 bytes."""
    random = np.random.default_rng(0)
    real = random.normal(size=(4000, 4))
    check_samples(bpy.context.scene, [keyed_rig(400, real)])
    check_samples(bpy.context.scene, [keyed_rig(180, np.zeros_like(real))])
    with pytest.raises(OutputError, match="4000 frames of 400 bones would need 5 GB of memory"):
        check_samples(bpy.context.scene, [keyed_rig(400, np.zeros_like(real))])


def test_a_motion_that_blender_has_no_frames_for_is_refused(body: Body, tmp_path: Path) -> None:
    motion = made_motion(body, np.zeros((12, 72)), np.zeros((12, 3)))
    motion.timestamps[:] = np.linspace(0.0, 127 * 86_400.0, len(motion))
    with pytest.raises(MotionFileError, match="Blender has only 1048574"):
        export_motions([motion], body, tmp_path / "out.blend")
