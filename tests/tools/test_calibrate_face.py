# SPDX-License-Identifier: GPL-3.0-or-later
"""The measured response, of faces whose landmarks move as is known."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.capture.perception.face_landmarks import EXPRESSION_POINTS, FACE_POINTS
from scope.scope_addon.capture.tracking.face.expression_fit import aligned, fit_units
from scope.scope_addon.expression_names import EXPRESSIONS
from scope.tools.calibrate_face.observe import SeenFaces
from scope.tools.calibrate_face.response import measure_response, units_of_expression
from scope.tools.render_faces.sequences import INDEX, random_poses, talk_and_grimaces

RNG = np.random.default_rng(0)
FACE = RNG.standard_normal((FACE_POINTS, 3)) * [0.06, 0.08, 0.03]
MOVES = (
    0.01
    * RNG.standard_normal((len(EXPRESSIONS), FACE_POINTS, 3))
    * (RNG.uniform(size=(1, FACE_POINTS, 1)) < 0.5)
)
for _one, _other in (
    ("OutLeft", "InRight"),
    ("InLeft", "OutRight"),
    ("UpLeft", "UpRight"),
    ("DownLeft", "DownRight"),
):
    MOVES[INDEX[f"eyeLook{_other}"]] = MOVES[INDEX[f"eyeLook{_one}"]]


def seen(clip, noise):
    """Pictures of faces of different people, with gaze as the keys turn it."""
    own = 0.004 * RNG.standard_normal((clip.person.max() + 1, FACE_POINTS, 3))
    points = FACE + own[clip.person] + np.einsum("tk,knx->tnx", clip.weights, MOVES)
    points = points + noise * RNG.standard_normal(points.shape)
    pixels = 900 * np.einsum("tij,tnj->tni", clip.R_camera_head, points) + [128, 128, 0]
    left, up = (
        clip.weights[:, INDEX[f"eyeLook{a}Left"]] - clip.weights[:, INDEX[f"eyeLook{b}Left"]]
        for a, b in (("Out", "In"), ("Up", "Down"))
    )
    gaze = np.stack([0.3 * left, 0.2 * up, np.ones(len(left))], axis=1)
    truth = dict(vars(clip)) | {"gaze": np.repeat(gaze[:, None], 2, axis=1)}
    return SeenFaces(truth, pixels, np.ones(len(pixels)), np.zeros_like(clip.weights))


def test_a_known_response_is_measured_and_finds_the_weights_again():
    poses = seen(random_poses(np.random.default_rng(1), 30, 20), 0.0005)
    moving = seen(talk_and_grimaces(np.random.default_rng(2), 3, 4.0), 0.0005)
    response = measure_response(poses, moving, moving)
    units = units_of_expression()
    jaw = np.flatnonzero(units[:, INDEX["jawOpen"]])[0]
    points = np.array(EXPRESSION_POINTS)
    at_half = (FACE + 0.5 * MOVES[INDEX["jawOpen"]])[points] * [1, -1, -1]
    moved, rest = (
        aligned(p[None], response.reference, response.shares).points
        for p in (at_half, FACE[points] * [1, -1, -1])
    )
    expected = ((moved - rest) / 0.5).ravel()
    cosine = (
        expected
        @ response.response[jaw]
        / np.linalg.norm(expected)
        / np.linalg.norm(response.response[jaw])
    )
    assert cosine > 0.97
    left = np.flatnonzero(units[:, INDEX["eyeLookOutLeft"]])[0]
    np.testing.assert_allclose(response.gaze[left], [0.3, 0], atol=1e-6)

    held_out = seen(talk_and_grimaces(np.random.default_rng(3), 1, 4.0), 0.0005)
    faces = aligned(held_out.landmarks[:, points], response.reference, response.shares)
    T = len(faces.points)
    found = (
        fit_units(response, faces.points.reshape(T, -1), faces.turns, np.ones(T), np.ones(T, bool))
        @ units
    )
    assert np.abs(found - held_out.truth["weights"]).mean() < 0.02
