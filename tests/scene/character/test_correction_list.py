# SPDX-License-Identifier: GPL-3.0-or-later
"""The corrections of a motion file are listed with the armature that is built from it."""

import json
from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.edit.corrected_motion import with_corrections
from scope.scope_addon.edit.corrections import (
    Contact,
    DepthFlip,
    Exchange,
    FeetOnFloor,
    Interpolation,
    Pin,
)
from scope.scope_addon.errors import UsageError
from scope.scope_addon.motion import Motion
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.character.corrected_keys import (
    frames_that_show,
    scene_frame,
    source_frame,
    whole_span,
)
from scope.scope_addon.scene.character.correction_list import listed_corrections

from ...edit.walking import BODY, motion_of, walk

ENTRY = {
    "kind": "PIN",
    "text": "Left Wrist",
    "joint": "left_wrist",
    "first": 4,
    "last": 4,
    "missed": "",
}


def test_a_corrected_file_brings_its_list(tmp_path):
    plain = motion_of(walk(2.0))
    changes = (
        Pin(20, "left_wrist", (300.0, 200.0)),
        Contact(30, 34, "right"),
        Contact(36, 38, "left_hand"),
        Exchange(3, 5, "legs"),
        DepthFlip(6, 8, "right_forearm"),
        DepthFlip(9, 10, "body"),
    )
    changes = (*changes, Interpolation(40, 42), FeetOnFloor())
    with_corrections(plain, BODY, changes).save(tmp_path / "a.npz")
    bpy.context.scene.render.fps = 60  # twice the motion's rate
    options = BuildOptions(start_frame=11.0)
    rig = build_scene([Motion.load(tmp_path / "a.npz")], BODY, None, options).people[0].armature
    assert [(e["text"], e["first"], e["last"]) for e in listed_corrections(rig)] == [
        ("Left Wrist", 51, 52),
        ("Right Foot Stands", 71, 79),
        ("Left Hand", 83, 87),
        ("Legs Exchanged", 17, 21),
        ("Right Forearm", 23, 27),
        ("Turned Around", 29, 31),
        ("Interpolated", 91, 95),
        ("Feet on the Floor", 11, 131),
    ]
    assert listed_corrections(build_scene([plain], BODY, None, options).people[0].armature) == []


@pytest.mark.parametrize("rate", [24, 30, 60])
def test_a_pin_is_listed_at_the_scene_frame_where_it_was_placed(rate):
    """In footage of variable frame rate, whose keys lie between whole frames of the scene."""
    plain = motion_of(walk(2.0))
    rng = np.random.default_rng(4)
    times = plain.timestamps + rng.uniform(-0.012, 0.012, len(plain))
    times[30:] += 0.1  # The footage lacks three frames.
    motion = replace(plain, timestamps=times)
    rig = bpy.data.objects.new("person", None)
    first, last = whole_span(rig, motion, rate)
    for frame in range(first, last + 1):
        try:
            source = source_frame(rig, motion, frame, rate)
        except UsageError:  # A gap.
            continue
        shown = frames_that_show(rig, motion, source, rate)
        assert shown[0] <= frame <= shown[1]
        exact = scene_frame(rig, motion, source, rate)
        assert shown[0] - 1 < exact < shown[1] + 1


def test_what_is_no_correction_is_left_out():
    armature = bpy.data.objects.new("person", None)
    assert listed_corrections(armature) == []
    damaged = [{"kind": "PIN"}, 7, dict(ENTRY, first="4"), dict(ENTRY, text=None)]
    armature["scope_corrections"] = json.dumps([ENTRY, *damaged])
    assert listed_corrections(armature) == [ENTRY]
    for stored in (json.dumps({"kind": "PIN"}), "[" * 100_000, "no json", 5, [1, 2]):
        armature["scope_corrections"] = stored
        assert listed_corrections(armature) == []
