# SPDX-License-Identifier: GPL-3.0-or-later
"""Bone maps as files: what was saved is read again, and nothing that no rig could have."""

from __future__ import annotations

import json

import pytest
from scope.scope_addon.errors import OutputError
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


def test_no_file_of_another_kind_is_overwritten(tmp_path):
    path = tmp_path / "map.json"
    path.write_text('{"mine": 1}')
    with pytest.raises(OutputError, match="map.json"):
        save_bone_map(BoneMap({**LEGS, "hips": "pelvis"}), path)
    assert path.read_text() == '{"mine": 1}'


def _legs_and(pelvis):
    """A map of all required parts."""
    bones = {
        "a": "left_hip",
        "b": "left_knee",
        "c": "right_hip",
        "d": "right_knee",
        "PELVIS": "pelvis",
    }
    text = json.dumps({"format": "scope bone map", "version": 1, "bones": bones})
    return text.replace("PELVIS", pelvis)


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{" * 5000, "[" * 100000, '{"format": "scope bone map", "version": 1, "bones": '
                                         '{"a": 3}}',
     '{"format": "scope bone map", "version": 1, "bones": {"a": "tail"}}',
     '{"format": "scope bone map", "version": 1, "bones": '
     '{}}', '{"format": 1}', _legs_and(r"\ud800"),
     _legs_and(r"a\u0000"), _legs_and("")],
)  # fmt: skip
def test_hostile_maps_are_refused(tmp_path, text):
    path = tmp_path / "map.json"
    path.write_text(text)
    with pytest.raises(InputError, match="map.json"):
        load_bone_map(path)
