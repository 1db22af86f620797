# SPDX-License-Identifier: GPL-3.0-or-later
"""Expression maps: guessed from names that programs give, written and read, and what they make of
weights.
"""

from __future__ import annotations

import json

import pytest
from scope.scope_addon.kinematics.face import EXPRESSIONS
from scope.scope_addon.retarget.expression_map import (
    ExpressionMap,
    guess_expression_map,
    load_expression_map,
    save_expression_map,
)
from scope.solver.errors import InputError

from .face.test_face_controls import weights

OCULUS = [f"viseme_{v}" for v in "sil PP FF TH DD kk CH SS nn RR aa E I O U".split()]
VRM0 = "A I U E O Blink Blink_L Blink_R Joy Angry Sorrow Fun LookUp LookLeft".split()
VRM1 = "aa ih ou ee oh blink blinkLeft blinkRight happy angry sad surprised".split()
VROID = [
    f"Face.M_F00_000_00_Fcl_{n}"
    for n in ("ALL_Joy", "EYE_Close", "EYE_Close_L", "EYE_Close_R", "MTH_A", "MTH_O")
]


@pytest.mark.parametrize(
    "spelled",
    [
        lambda n: n,
        lambda n: f"head.{n}",
        lambda n: n.replace("Left", ".L").replace("Right", ".R"),
        lambda n: "".join(f"_{c.lower()}" if c.isupper() else c for c in n),
    ],
)
def test_arkits_names_however_they_are_spelled(spelled):
    found = guess_expression_map(["Basis", *map(spelled, EXPRESSIONS), "chestSize"])
    assert found.keys == {spelled(name): {name: 1.0} for name in EXPRESSIONS}


@pytest.mark.parametrize(
    ("names", "closed", "open_mouth", "round_mouth"),
    [
        (OCULUS, (), "viseme_aa", "viseme_O"),
        (VRM0, ("Blink_L", "Blink_R"), "A", "O"),
        (VRM1, ("blinkLeft", "blinkRight"), "aa", "oh"),
        (VROID, (VROID[2], VROID[3]), VROID[4], VROID[5]),
        (["Blink", "Blink_L", "A", "O"], ("Blink",), "A", "O"),
    ],
)
def test_blinks_and_vowels_of_other_conventions(names, closed, open_mouth, round_mouth):
    found = guess_expression_map(names)
    found.check()
    shout = found.values(weights(jawOpen=0.8))
    assert shout[open_mouth] == 1
    assert shout[round_mouth] == 0
    ooh = found.values(weights(jawOpen=0.3, mouthFunnel=0.8))
    assert ooh[round_mouth] > 0.9
    assert ooh[open_mouth] == 0
    assert not any(found.values(weights())[key] for key in found.keys)
    blink = found.values(weights(eyeBlinkLeft=1, eyeBlinkRight=1))
    assert all(blink[key] == 1 for key in closed)


@pytest.mark.parametrize("names", [VRM0, VRM1, VROID, ["eyeBlinkLeft", "eyeBlinkRight", "Blink"]])
def test_no_key_closes_both_eyes_beside_keys_that_close_one_each(names: list[str]) -> None:
    """Lids that follow two keys would close twice as far, into the face."""
    found = guess_expression_map(names)
    for eye in ("eyeBlinkLeft", "eyeBlinkRight"):
        moved_by = [key for key, factors in found.keys.items() if eye in factors]
        assert len(moved_by) == 1
        assert found.keys[moved_by[0]] == {eye: 1.0}


def test_what_is_written_is_read(tmp_path):
    path = tmp_path / "face.json"
    written = ExpressionMap(
        {"mund": {"jawOpen": 1.5, "mouthClose": -1.0}, "auge": {"eyeBlinkLeft": 1.0}}
    )
    save_expression_map(written, path)
    assert load_expression_map(path).keys == written.keys


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"format": "scope bone map", "version": 1, "bones": {}}, "not a Scope expression map"),
        ({"shape_keys": {"a": {"jawOpen": True}}}, "correct the file"),
        ({"shape_keys": {"a\0b": {"jawOpen": 1}}}, "correct the file"),
        ({"shape_keys": {"a": {"jawopen": 1}}}, "'jawopen', which is not an expression"),
        ({"shape_keys": {"a": {"jawOpen": 1e9}}}, "use at most 10"),
        (
            {"shape_keys": {"a": {"jawOpen": 10**400}}},
            "not an expression map: .* a number of 401 digits",
        ),
        ({"controls": {"lip.B": {"up": {"jawOpen": "1"}}}}, "'controls' must be an object"),
        ({"controls": {"lip\0": {"up": {"jawOpen": 1}}}}, "'controls' must be an object"),
        (
            {"controls": {"lip.B": {"sideways": {"jawOpen": 1}}}},
            "'sideways'; use one of left, up, forward, pitch",
        ),
        ({"controls": {"jaw": {"pitch": {"jawOpen": -181}}}}, "use at most 180"),
        ({"controls": {"jaw": {"pitch": {}}}}, "no shape key and no control"),
    ],
)
def test_a_file_that_cannot_be_used_says_why(tmp_path, content, message):
    path = tmp_path / "face.json"
    path.write_text(json.dumps({"format": "scope expression map", "version": 1} | content))
    with pytest.raises(InputError, match=message):
        load_expression_map(path)
