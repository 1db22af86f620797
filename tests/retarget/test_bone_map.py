# SPDX-License-Identifier: GPL-3.0-or-later
"""Bone maps as files: what was saved is read again, and nothing that no rig could have."""

from __future__ import annotations

import json

import pytest
from scope.scope_addon.retarget.bone_map import BoneMap, load_bone_map, save_bone_map
from scope.solver.errors import InputError

LEGS = {"a": "left_hip", "b": "left_knee", "c": "right_hip", "d": "right_knee"}


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            {**LEGS, "hips": "pelvis", "tail": "tail"},
            "'tail' is mapped to 'tail', which is not a body part",
        ),
        ({**LEGS, "hips": "pelvis", "e": "left_hip"}, "'left_hip' has 2 bones, a and e"),
        (
            {"hips": "pelvis", "a": "left_hip", "b": "left_knee"},
            "no bone for right_hip, right_knee",
        ),
    ],
)
def test_maps_that_no_motion_fits_are_neither_used_nor_written(tmp_path, parts, message):
    with pytest.raises(InputError, match=message):
        BoneMap(parts).check()
    with pytest.raises(InputError, match=message):
        save_bone_map(BoneMap(parts), tmp_path / "map.json")
    assert list(tmp_path.iterdir()) == []


def _with_pelvis(bone):
    """A map of all required parts."""
    bones = LEGS | {"PELVIS": "pelvis"}
    text = json.dumps({"format": "scope bone map", "version": 1, "bones": bones})
    return text.replace("PELVIS", bone)


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100000,
        '{"format": "scope bone map", "version": 1, "bones": {"a": 3}}',
        '{"format": "scope bone map", "version": 1, "bones": {}}',
        _with_pelvis(r"\ud800"),
        _with_pelvis(""),
    ],
)
def test_hostile_maps_are_refused(tmp_path, text):
    path = tmp_path / "map.json"
    path.write_text(text)
    with pytest.raises(InputError, match="map.json"):
        load_bone_map(path)
