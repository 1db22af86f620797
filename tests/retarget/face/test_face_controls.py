# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions on the bones of a face: where each control goes, whatever the rig's size and axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.kinematics.face import EXPRESSIONS
from scope.scope_addon.retarget.expression_map import ExpressionMap
from scope.scope_addon.retarget.face_controls import (
    RestBone,
    built_in,
    control_motions,
    guess_control_map,
    measure_face,
)
from scope.solver.errors import InputError
from scope.solver.rotations import exp

# A face that looks along -y with the person's left along +x, as Blender's characters do; metres.
PLACES = {
    "ORG-eye.L": (0.03, 0, 1.7),
    "ORG-eye.R": (-0.03, 0, 1.7),
    "eye.L": (0.03, -0.5, 1.7),
    "eye.R": (-0.03, -0.5, 1.7),
    "lips.L": (0.025, 0, 1.6),
    "lips.R": (-0.025, 0, 1.6),
    "lip.B": (0, -0.02, 1.59),
    "lid.T.L.002": (0.03, -0.01, 1.706),
    "lid.B.L.002": (0.03, -0.01, 1.694),
    "brow.T.L.003": (0.02, -0.01, 1.72),
    "jaw_master": (0, 0.05, 1.65),
}
RIGS = ("rigify", "rigify_skin", "mpfb")


def face(size=1.0):
    """The face, whose bones have any axes."""
    random = np.random.default_rng(0)
    return {
        name: RestBone(size * np.array(place), exp(random.normal(size=3)))
        for name, place in PLACES.items()
    }


def weights(**values):
    out = np.zeros((1, len(EXPRESSIONS)))
    for name, value in values.items():
        out[0, EXPRESSIONS.index(name)] = value
    return out


def posed(bones, motions):
    """Where each control's head is, (3,), and how it is turned, (3, 3), in the armature's space."""
    return {
        m.bone: (
            bones[m.bone].head + bones[m.bone].rotation @ m.locations[0],
            bones[m.bone].rotation @ m.rotations[0] @ bones[m.bone].rotation.T,
        )
        for m in motions
    }


def test_a_control_whose_location_is_not_along_its_own_axes_moves_the_same_way():
    bones = face()
    chosen = ExpressionMap({}, {"lip.B": {"up": {"jawOpen": -0.5}, "left": {"jawOpen": 0.1}}})
    (expected,) = posed(bones, control_motions(chosen, weights(jawOpen=0.5), bones)).values()
    axes = exp(np.array([0.3, -0.8, 1.1]))
    bones["lip.B"] = replace(bones["lip.B"], location_axes=axes)
    (motion,) = control_motions(chosen, weights(jawOpen=0.5), bones)
    head = bones["lip.B"].head + axes @ motion.locations[0]
    np.testing.assert_allclose(head, expected[0], atol=1e-9)


def test_amounts_are_shares_of_the_faces_lengths_along_its_axes():
    bones = face()
    amounts = {
        "lip.B": {"up": {"jawOpen": -0.5}, "forward": {"jawOpen": 0.1}},
        "lid.T.L.002": {"up": {"jawOpen": -1.0}},
        "brow.T.L.003": {"left": {"jawOpen": 0.1}},
    }
    found = posed(bones, control_motions(ExpressionMap({}, amounts), weights(jawOpen=0.5), bones))
    mouth = 0.05
    lids = 0.012
    eyes = 0.06
    np.testing.assert_allclose(
        found["lip.B"][0], (0, -0.02 - 0.05 * mouth, 1.59 - 0.25 * mouth), atol=1e-12
    )
    np.testing.assert_allclose(
        found["lid.T.L.002"][0], (0.03, -0.01, 1.706 - 0.5 * lids), atol=1e-12
    )
    np.testing.assert_allclose(
        found["brow.T.L.003"][0], (0.02 + 0.05 * eyes, -0.01, 1.72), atol=1e-12
    )


def test_turns_go_down_to_the_left_and_left_side_up():
    bones = face()
    ahead = np.array([0.0, -1, 0])
    left = np.array([1.0, 0, 0])
    for channel, from_, to in (
        ("pitch", ahead, (0, 0, -1)),
        ("yaw", ahead, (1, 0, 0)),
        ("roll", left, (0, 0, 1)),
    ):
        amounts = ExpressionMap({}, {"jaw_master": {channel: {"jawOpen": 90.0}}})
        (_, R) = posed(bones, control_motions(amounts, weights(jawOpen=1), bones))["jaw_master"]
        np.testing.assert_allclose(R @ from_, to, atol=1e-12)


def test_an_eye_looks_at_its_target_by_the_angle():
    bones = face()
    amounts = ExpressionMap(
        {}, {"eye.L": {"yaw": {"eyeLookOutLeft": 20.0}, "pitch": {"eyeLookDownLeft": 10.0}}}
    )
    for name, angle in (("eyeLookOutLeft", 20), ("eyeLookDownLeft", 10)):
        (motion,) = control_motions(amounts, weights(**{name: 1}), bones)
        assert np.allclose(motion.rotations, np.eye(3), atol=1e-15)
        seen = posed(bones, [motion])["eye.L"][0] - PLACES["ORG-eye.L"]
        side = (
            (np.sin(np.radians(20)), 0)
            if name == "eyeLookOutLeft"
            else (0, -np.sin(np.radians(10)))
        )
        np.testing.assert_allclose(seen[[0, 2]] / 0.5, side, atol=1e-9)
        assert np.linalg.norm(seen) == pytest.approx(0.5), f"{angle} degrees about the eye"


def test_a_neutral_face_is_at_rest_exactly():
    bones = face()
    for motion in control_motions(built_in("rigify"), weights(), bones):
        assert not motion.locations.any()
        assert np.allclose(motion.rotations, np.eye(3), atol=1e-15)


@pytest.mark.parametrize("rig", RIGS)
def test_built_in_maps_are_symmetric_and_know_all_expressions(rig):
    found = built_in(rig)
    found.check()
    mirrored = {
        (_other(bone), channel, _other_expression(name)): -f
        if channel in ("left", "yaw", "roll")
        else f
        for bone, channels in found.controls.items()
        for channel, factors in channels.items()
        for name, f in factors.items()
    }
    plain = {
        (b, c, n): f
        for b, channels in found.controls.items()
        for c, fs in channels.items()
        for n, f in fs.items()
    }
    assert plain.keys() == mirrored.keys()
    assert all(plain[entry] == pytest.approx(mirrored[entry], abs=0.011) for entry in plain)
    assert {name for _, _, name in plain} == set(EXPRESSIONS)


def _other(bone):
    swapped = bone.replace(".L", ".#").replace(".R", ".L").replace(".#", ".R")
    return swapped


def _other_expression(name):
    if name.endswith("Left"):
        return name[:-4] + "Right"
    return name[:-5] + "Left" if name.endswith("Right") else name


@pytest.mark.parametrize(
    ("rig", "sign"),
    [
        (("jaw_master", "lips.L", "lips.R", "ORG-eye.L"), "jaw_master"),
        (("jaw", "levator05.L", "orbicularis03.L", "eye.L"), "jaw"),
    ],
)
def test_the_map_of_a_rig_is_guessed_by_its_bones(rig, sign):
    found = guess_control_map([*rig, "spine"])
    assert set(found.controls) <= set(rig)
    assert "jawOpen" in found.controls[sign]["pitch"]
    assert not guess_control_map(rig[1:]).controls


def test_faces_that_cannot_be_measured_say_why():
    for missing, says in (("ORG-eye.R", "eyes"), ("lips.L", "corners of the mouth")):
        bones = {name: bone for name, bone in face().items() if name not in (missing, "eye.R")}
        with pytest.raises(InputError, match=f"no bones for the {says}"):
            measure_face(bones)
    with pytest.raises(InputError, match="in one place"):
        measure_face(face(size=0.0))
