# SPDX-License-Identifier: GPL-3.0-or-later
"""The outline alone brings back the shape of a body of known pose, and loose clothes do not fatten
it without bound.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.fitting.outline import OutlineMeasurer
from scope.scope_addon.capture.perception.observation import PersonMask
from scope.solver import Body, ClipFit, Options, PosePriors, Priors, Stage, State, Weights, fit_clip
from scope.solver.measurements import Measurements

from ..silhouettes import REGION, SIZE, K, mask_of, posed, standing, surface_error

CLOTHES_PX = 14  # of the mask: 20 cm at this distance
WEIGHTS = Weights(
    keypoints2d=0.0, joint_prior=0.0, joint_limits=0.0, shape=1.0, tables={"outline": 3e5}
)


@pytest.fixture(scope="module")
def states(body: Body) -> list[State]:
    return standing(body)


def fitted(
    body: Body, states: list[State], masks: list[NDArray[np.float32]], rounds: int = 3
) -> ClipFit:
    """The shape by the outline alone: rotations and pelvis are held by strong priors."""
    camera = Camera(K, np.zeros(5), "test")
    outline = OutlineMeasurer(body, camera)
    parts = np.arange(body.K + 1)
    held = []
    for state in states:
        R, t = posed(body, state, np.zeros(body.P))
        free = np.where(parts == 0, 1e8, 0.0)
        held.append(
            Measurements(K, pose_priors=PosePriors(parts, R, t, np.full(body.K + 1, 1e6), free))
        )
    options = Options(stages=(Stage(WEIGHTS, 1e-7, 30),))
    found = fit_clip(outline.body, held, init=states, priors=Priors(), options=options)
    for _ in range(rounds):
        rows = [
            replace(m, tables={"outline": outline.measure(fit, PersonMask(REGION, mask, SIZE))})
            for m, fit, mask in zip(held, found.frames, masks, strict=True)
        ]
        now = [fit.state for fit in found.frames]
        found = fit_clip(outline.body, rows, init=now, priors=Priors(), options=options)
    return found


def test_outline_alone_brings_back_the_shape(body: Body, states: list[State]) -> None:
    betas = np.random.default_rng(0).uniform(-1.5, 1.5, body.P)
    found = fitted(body, states, [mask_of(body, state, betas) for state in states])
    assert surface_error(body, found.beta, betas) < 0.15 * surface_error(
        body, np.zeros(body.P), betas
    )
    assert abs(body.stature(found.beta) - body.stature(betas)) < 0.005


def test_clothes_fatten_a_person_little(body: Body, states: list[State]) -> None:
    """The mask grows by 20 cm on both sides, from the shoulders to the knees, as by a coat."""
    knee_y, neck_y = (
        int(256 * REGION.crop_from_image(np.array([320.0, 240.0 - 700 * up / 3.6]))[1])
        for up in (-0.4, 0.45)
    )
    worn = []
    for state in states:
        mask = mask_of(body, state, np.zeros(body.P))
        dressed = cv2.morphologyEx(mask, cv2.MORPH_DILATE, np.ones((1, 2 * CLOTHES_PX + 1)))
        mask[neck_y:knee_y] = dressed[neck_y:knee_y]
        worn.append(mask)
    found = fitted(body, states, worn)
    assert surface_error(body, found.beta, np.zeros(body.P)) < 0.03
    assert abs(body.stature(found.beta) - body.stature()) < 0.04


def test_rows_of_a_true_body_have_small_distances(body: Body, states: list[State]) -> None:
    """Each row's contour point lies on the line through the projected rim point, within a third of
    a mask's pixel.
    """
    outline = OutlineMeasurer(body, Camera(K, np.zeros(5), "test"))
    options = Options(stages=(Stage(WEIGHTS, 1e-6, 1),))
    state = states[1]
    R, t = posed(body, state, np.zeros(body.P))
    held = Measurements(K, pose_priors=PosePriors([0], R[:1], t[:1], [1e8], [1e8]))
    fit = fit_clip(outline.body, [held], init=[state], priors=Priors(), options=options).frames[0]
    nobody = np.zeros((256, 256), np.float32)
    ints, floats = outline.measure(fit, PersonMask(REGION, nobody, SIZE))
    assert (ints.shape, floats.shape) == ((0, 1), (0, 11))
    mask = mask_of(body, state, np.zeros(body.P))
    ints, floats = outline.measure(fit, PersonMask(REGION, mask, SIZE))
    points = outline.body.keypoints(
        fit.R_camera_part, fit.t_camera_part, fit.state.beta, ints[:, 0].tolist()
    )
    part = outline.body.keypoint_part[ints[:, 0]]
    points += np.einsum("nij,nj->ni", fit.R_camera_part[part], floats[:, :3])
    distance = ((points[:, :2] / points[:, 2:] - floats[:, 3:5]) * floats[:, 5:7]).sum(axis=1)
    pixel = REGION.side_px / 256 / K[0, 0]
    assert len(ints) > 60
    assert np.median(np.abs(distance)) < 0.4 * pixel
    assert np.quantile(np.abs(distance), 0.9) < 1.5 * pixel
