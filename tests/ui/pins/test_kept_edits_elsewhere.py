# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits are on the rig that the smoothed motion is retargeted to, and in the files that are
exported.

The capture is wrong where it is edited, so that with its edits it is the walk again from which it
was made.
"""

import bpy
import numpy as np
import pytest
from scope.scope_addon.edit.spans import swap_sides
from scope.scope_addon.ui.captured_person import set_motion_of
from scope.solver.rotations import exp

from ...edit.walking import BETAS, BODY, NAMES, motion_of, walk
from ...scene import made_rigs
from ...scene.exported import read_back
from ...scene.made_rigs import captured

# rows
BAD = slice(40, 45)
EXCHANGED = slice(62, 71)
FRAMES = range(5, 86, 2)  # of the scene; the capture starts at frame 1
SUFFIXES = {"GLB": "glb", "FBX": "fbx", "BVH": "bvh"}


def wrong_walk():
    clip = walk(3.0)
    clip = swap_sides(
        clip, BODY, clip.times[EXCHANGED.start], clip.times[EXCHANGED.stop - 1], "legs"
    )
    clip.rotations[BAD, 1:] = clip.rotations[BAD, 1:] @ exp(np.array([0.5, 0.3, -0.4]))
    clip.root = clip.root + [0.0, 0.0, 0.3]
    return clip


@pytest.fixture
def rig():
    """A capture of that walk, edited and smoothed again."""
    armature = captured(motion := motion_of(wrong_walk()))
    set_motion_of(armature, motion)
    assert off(made_rigs.seen(armature, NAMES, FRAMES)) > 0.3
    bpy.ops.scope.exchange_sides(start=EXCHANGED.start + 1, end=EXCHANGED.stop, limbs="legs")
    bpy.ops.scope.interpolate_span(start=39, end=47)
    bpy.ops.scope.refloor()
    for strength in (0.0, 1.0):
        bpy.ops.scope.smooth(strength=strength)
    return armature


def off(places):
    """The largest distance of joints (T, K+1, 3) in `FRAMES` from those of the walk, metres."""
    truth = walk(3.0).joints(BODY, BETAS)[np.array(FRAMES) - 1]
    return np.linalg.norm(places - truth, axis=-1).max()


def test_the_rig_that_the_motion_is_retargeted_to_has_the_edits(rig):
    names = [f"mixamorig:{name}" for name in NAMES]
    own = made_rigs.renamed(rig, dict(zip(NAMES, names, strict=True)))
    settings = bpy.context.scene.scope_retarget
    settings.rig = own
    bpy.ops.scope.guess_bones()
    for feet in (False, True):
        settings.feet = feet
        bpy.context.view_layer.objects.active = rig
        bpy.ops.scope.retarget()
        assert off(made_rigs.seen(own, names, FRAMES)) < 0.1


@pytest.mark.parametrize("kind", SUFFIXES)
def test_exported_files_have_the_edits(rig, tmp_path, kind):
    path = tmp_path / f"walk.{SUFFIXES[kind]}"
    bpy.ops.scope.export(filepath=str(path), format=kind, which="ALL")
    first = read_back(path)
    (imported,) = (o for o in bpy.data.objects if o.type == "ARMATURE")
    assert (
        off(made_rigs.seen(imported, NAMES, [round(first) + frame - 1 for frame in FRAMES])) < 0.1
    )


def test_the_exported_motion_file_has_the_edits(rig, tmp_path):
    bpy.ops.scope.export(filepath=str(tmp_path / "walk.npz"), format="NPZ", which="ALL")
    with np.load(tmp_path / "walk.npz") as file:
        assert file["exchange_spans"].tolist() == [[62, 70]]
        assert file["interpolated_spans"].tolist() == [[38, 46]]
        assert file["snap_lift"].tolist() == [True]
        trans = file["trans"]
    assert np.abs(trans - (walk(3.0).root - BODY.rest_joints(BETAS)[0])).max() < 0.1
