# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions fitted to landmarks: of the model's own faces, and of rendered ones as the networks
see them.

Expressions and gaze of a face that is seen briefly: what the networks make of it; of others,
the fit's.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.perception.face_landmarks import (
    EXPRESSION_POINTS,
    FACE_POINTS,
    ExpressionNetwork,
    FaceEstimate,
    FaceNetwork,
)
from scope.scope_addon.capture.perception.face_record import RECORD, gaze, parts, record
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking import expression_fit
from scope.scope_addon.capture.tracking.expression_fit import (
    fitted,
    is_known,
    load_response,
    view_terms,
    with_expressions,
)
from scope.scope_addon.kinematics.face import EXPRESSIONS
from scope.scope_addon.scene_gaps import SCENE_GAP_S
from scope.solver.body_file import load_body
from scope.solver.errors import ModelFileError
from scope.solver.rotations import exp
from scope.tools.render_faces.looks import draw_look
from scope.tools.render_faces.sequences import INDEX, FaceClip
from scope.tools.render_faces.shaded import ShadedStage
from scope.tools.render_faces.truth import SIZE, camera_vertices, focal_px

T = 90


FPS = 30


JAW = INDEX["jawOpen"]


BLINKS = [INDEX["eyeBlinkLeft"], INDEX["eyeBlinkRight"]]


REGION = Region((0.0, 0.0), 1.0, 0.0)


TIMES = np.arange(T) / FPS


def talk(count: int = T) -> np.ndarray:
    """Weights (T, 52): the mouth opens three times, and the eyes blink twice."""
    weights = np.zeros((count, len(EXPRESSIONS)))
    t = np.arange(count)
    weights[:, JAW] = 0.7 * np.maximum(0, np.sin(2 * np.pi * t / 30)) * (t > 10)
    for start in (18, 50):
        weights[start : start + 5, BLINKS] = np.array([0.4, 0.9, 1.0, 0.8, 0.3])[
            : count - start, None
        ]
    return weights


def modelled(weights: np.ndarray, noise: float, size: float = 120.0) -> np.ndarray:
    """Rows of a person whose landmarks are as the model says, with another face at rest, who turns
    his head.
    """
    response = load_response()
    rng = np.random.default_rng(3)
    share = response.units / response.units.sum(axis=1, keepdims=True)
    turns = np.stack([0.05 * np.sin(TIMES), 0.2 * np.sin(2 * TIMES), 0 * TIMES], axis=1)
    own = 0.03 * rng.standard_normal(response.mean.shape)
    x = (
        response.mean
        + own
        + view_terms(turns) @ response.view
        + weights @ share.T @ response.response
    )
    x = (x + noise * rng.standard_normal(x.shape)).reshape(T, -1, 3)
    pixels = size / 3 * np.einsum("tij,tnj->tni", exp(turns), x) * [1, -1, -1] + [300, 200, 0]
    landmarks = np.zeros((T, FACE_POINTS, 3))
    landmarks[:] = pixels[:, :1]  # elsewhere, all of them in one place
    landmarks[:, response.landmarks] = pixels
    return np.array([record(FaceEstimate(p, 0.99, REGION)) for p in landmarks])


def test_expressions_are_found_whatever_the_face_at_rest():
    truth = talk()
    truth[60:, INDEX["browDownLeft"]] = truth[60:, INDEX["browDownRight"]] = 0.6
    _, _, weights, gaze, _ = parts(fitted(modelled(truth, 0.002)))
    np.testing.assert_allclose(weights[:, [JAW, *BLINKS]], truth[:, [JAW, *BLINKS]], atol=0.12)
    assert np.abs(weights - truth).mean() < 0.01
    assert (
        weights[62:, INDEX["browDownLeft"]].mean()
        > weights[:58, INDEX["browDownLeft"]].mean() + 0.2
    )
    np.testing.assert_allclose(gaze, np.tile([0, 0, 1.0], (T, 2, 1)), atol=0.05)


def test_a_damaged_file_says_what_to_do(tmp_path, monkeypatch):
    path = tmp_path / "response.npz"
    np.savez(path, landmarks=np.arange(3))
    monkeypatch.setattr(expression_fit, "FILE", path)
    with pytest.raises(ModelFileError, match="install Scope again"):
        expression_fit.load_response.__wrapped__()


@pytest.mark.slow
def test_a_rendered_face_that_the_network_sees(tmp_path):
    """The default body, which nothing was calibrated on, turned by 20°, through the real landmark
    network.
    """
    body = load_body("scope")
    rng = np.random.default_rng(8)
    truth = talk(66)
    R = np.diag([1.0, -1.0, -1.0]) @ exp(np.radians([0, 20.0, 0]))
    times = np.arange(66) / FPS
    clip = FaceClip(
        truth, np.tile(R, (66, 1, 1)), np.full(66, 0.8), np.zeros(66, int), times, np.zeros((66, 3))
    )
    stage = ShadedStage(body)
    network = FaceNetwork()
    rows = []
    stage.dress(draw_look(body, rng), rng)
    region = Region((SIZE / 2, SIZE / 2), 0.8 * SIZE, 0.0)
    for t in range(66):
        stage.render(
            camera_vertices(body, clip, np.zeros((1, *body.v_template.shape)), t),
            focal_px(0.8),
            tmp_path / "face.png",
        )
        image = np.ascontiguousarray(cv2.imread(str(tmp_path / "face.png"))[..., ::-1])
        estimate = network.estimate(image, region)
        region = estimate.next_region
        rows.append(record(estimate))
    _, _, weights, _, _ = parts(fitted(np.array(rows)))
    error = np.abs(weights - truth)
    assert error[:, JAW].mean() < 0.06
    assert error[:, BLINKS].mean() < 0.06
    assert np.delete(error, [JAW, *BLINKS], axis=1).mean() < 0.02
    for blink in BLINKS:
        closed = [np.flatnonzero(w[:, blink] > 0.5)[0] for w in (truth, weights)]
        assert abs(int(closed[1] - closed[0])) <= 1


EXPRESSIONS_FPS = 5


BEFORE = np.zeros(RECORD)  # a frame without a face


@pytest.fixture(scope="module")
def clip(frames):
    """Two and a half seconds of a real face: the network's estimates, and a track's rows of
    them.
    """
    network = FaceNetwork()
    region = Region((256.0, 118.0), 200.0, 0.0)
    estimates = []
    for image in frames("clips/squats_5fps", stop=13):
        estimates.append(network.estimate(image, region))
        region = estimates[-1].next_region
    return estimates, np.array([BEFORE, *(record(estimate) for estimate in estimates)], np.float32)


@pytest.mark.parametrize("seen", [1, 9])
def test_a_face_that_was_seen_briefly_gets_the_networks_weights_and_the_gaze_of_its_irises(
    clip, seen
):
    estimates = clip[0][:seen]
    rows = clip[1][: seen + 1]
    out = with_expressions(rows, np.arange(seen + 1) / EXPRESSIONS_FPS)
    _, _, weights, directions, _ = parts(out)
    assert not out[0].any()
    network = ExpressionNetwork()
    of_network = [network.estimate(e.landmarks[list(EXPRESSION_POINTS), :2]) for e in estimates]
    np.testing.assert_allclose(weights[1:], of_network, atol=1e-5)
    np.testing.assert_allclose(directions[1:], [gaze(e.landmarks) for e in estimates], atol=1e-5)
    assert weights[1:].any()
    others = np.ones(RECORD, bool)
    others[2 : 2 + weights.shape[1] + 6] = False
    np.testing.assert_array_equal(out[:, others], rows[:, others])


def test_the_expression_network_is_not_opened_for_a_face_that_is_seen_for_longer_or_not_at_all(
    clip, monkeypatch
):
    monkeypatch.setattr(expression_fit, "ExpressionNetwork", None)
    rows = clip[1]
    times = np.arange(len(rows)) / EXPRESSIONS_FPS
    np.testing.assert_array_equal(with_expressions(rows, times), fitted(rows))
    assert not with_expressions(np.zeros_like(rows), times).any()


@pytest.mark.parametrize(("fps", "known"), [(30, False), (6, True)])
def test_the_gap_at_a_cut_is_no_time_for_which_a_face_was_seen(fps, known):
    """It is seen in 13 frames, from the first one after a cut on."""
    rows = np.zeros((20, RECORD))
    rows[7:, 0] = 1.0
    times = np.arange(20) / fps
    times[7:] += SCENE_GAP_S
    assert is_known(rows, times) == known
