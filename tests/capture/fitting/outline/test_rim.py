# SPDX-License-Identifier: GPL-3.0-or-later
"""The outline alone brings back the shape of a body of known pose, and loose clothes do not fatten it without bound."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.fitting.outline.rim import OutlineMeasurer
from scope.scope_addon.capture.perception.observation import PersonMask
from scope.scope_addon.capture.perception.region import Region
from scope.solver import Body, ClipFit, Options, PosePriors, Priors, Stage, State, Weights, fit_clip
from scope.solver.measurements import Measurements
from scope.solver.rotations import exp

SIZE = (640, 480)
K = np.array([[700.0, 0, 320], [0, 700, 240], [0, 0, 1]])
REGION = Region((320.0, 240.0), 480.0, 0.0)
FINER = 8  # OpenCV fills every pixel that a triangle touches, so masks are drawn finer
CLOTHES_PX = 12  # of the mask: 17 cm at this distance
WEIGHTS = Weights(keypoints2d=0.0, joint_prior=0.0, joint_limits=0.0, shape=1.0, tables={"outline": 3e5})


@pytest.fixture(scope="module")
def states(body: Body) -> list[State]:
    """A person standing with arms out to the sides and legs apart, at six headings."""
    found = []
    for heading in np.linspace(0, np.pi, 6, endpoint=False):
        rotations = np.tile(np.eye(3), (body.K + 1, 1, 1))
        for side, sign in (("left", 1.0), ("right", -1.0)):
            rotations[body.joint_names.index(f"{side}_shoulder")] = exp(np.array([0, 0, -0.7 * sign]))
            rotations[body.joint_names.index(f"{side}_hip")] = exp(np.array([0, 0, 0.15 * sign]))
        R_root = np.diag([1.0, -1.0, -1.0]) @ exp(np.array([0, heading, 0]))
        found.append(State(R_root, np.array([0.0, 0.0, 3.6]), rotations[1:], np.zeros(body.P)))
    return found


def posed(body: Body, state: State, betas: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Part poses with the pelvis at the state's position, whatever the shape."""
    rotations = np.concatenate([state.R_camera_root[None], state.Omega])
    return body.forward_kinematics(rotations, state.t_camera_root - body.rest_joints(betas)[0], betas)


def mask_of(body: Body, state: State, betas: NDArray[np.float64]) -> NDArray[np.float32]:
    """The true silhouette in the region, by filled triangles of OpenCV's projection, with soft edges."""
    skin = body.skin(*posed(body, state, betas), betas)
    pixels = cv2.projectPoints(skin, np.zeros(3), np.zeros(3), K, np.zeros(5))[0][:, 0].astype(float)
    at = (REGION.crop_from_image(pixels) * 256 * FINER - 0.5) * 16
    image = np.zeros((256 * FINER, 256 * FINER), np.uint8)
    for triangle in np.rint(at).astype(np.int32)[body.triangles()]:
        cv2.fillConvexPoly(image, np.ascontiguousarray(triangle), (255,), cv2.LINE_8, 4)
    small = cv2.resize(image, (256, 256), interpolation=cv2.INTER_AREA)
    soft: NDArray[np.float32] = cv2.GaussianBlur(small, (0, 0), 1.0).astype(np.float32) / np.float32(255)
    return soft


def fitted(body: Body, states: list[State], masks: list[NDArray[np.float32]], rounds: int = 3) -> ClipFit:
    """The shape by the outline alone: rotations and pelvis are held by strong priors."""
    camera = Camera(K, np.zeros(5), "test")
    outline = OutlineMeasurer(body, camera)
    parts = np.arange(body.K + 1)
    held = []
    for state in states:
        R, t = posed(body, state, np.zeros(body.P))
        free = np.where(parts == 0, 1e8, 0.0)
        held.append(Measurements(K, pose_priors=PosePriors(parts, R, t, np.full(body.K + 1, 1e6), free)))
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


def surface_error(body: Body, a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Root mean square distance of the two shapes' vertices, pelvis on pelvis, metres."""
    apart = (body.rest_vertices(a) - body.rest_joints(a)[0]) - (body.rest_vertices(b) - body.rest_joints(b)[0])
    return float(np.sqrt((apart**2).sum(axis=1).mean()))


@pytest.mark.parametrize("seed", [0, 1])
def test_outline_alone_brings_back_the_shape(body: Body, states: list[State], seed: int) -> None:
    betas = np.random.default_rng(seed).uniform(-1.5, 1.5, body.P)
    found = fitted(body, states, [mask_of(body, state, betas) for state in states])
    assert surface_error(body, found.beta, betas) < 0.15 * surface_error(body, np.zeros(body.P), betas)
    assert abs(body.stature(found.beta) - body.stature(betas)) < 0.005


@pytest.mark.parametrize("garment", ["skirt", "coat"])
def test_clothes_fatten_a_person_little(body: Body, states: list[State], garment: str) -> None:
    """The mask grows by 17 cm on both sides between the waist and the knees, or from the shoulders to the knees."""
    waist_y, knee_y, neck_y = (
        int(256 * REGION.crop_from_image(np.array([320.0, 240.0 - 700 * up / 3.6]))[1]) for up in (0.05, -0.4, 0.45)
    )
    worn = []
    for state in states:
        mask = mask_of(body, state, np.zeros(body.P))
        dressed = cv2.morphologyEx(mask, cv2.MORPH_DILATE, np.ones((1, 2 * CLOTHES_PX + 1)))
        low = waist_y if garment == "skirt" else neck_y
        mask[low:knee_y] = dressed[low:knee_y]
        worn.append(mask)
    found = fitted(body, states, worn)
    assert surface_error(body, found.beta, np.zeros(body.P)) < 0.03
    assert abs(body.stature(found.beta) - body.stature()) < 0.04


def test_rows_of_a_true_body_have_small_distances(body: Body, states: list[State]) -> None:
    """Each row's contour point lies on the line through the projected rim point, within a third of a mask's pixel."""
    outline = OutlineMeasurer(body, Camera(K, np.zeros(5), "test"))
    options = Options(stages=(Stage(WEIGHTS, 1e-6, 1),))
    state = states[1]
    R, t = posed(body, state, np.zeros(body.P))
    held = Measurements(K, pose_priors=PosePriors([0], R[:1], t[:1], [1e8], [1e8]))
    fit = fit_clip(outline.body, [held], init=[state], priors=Priors(), options=options).frames[0]
    ints, floats = outline.measure(fit, PersonMask(REGION, mask_of(body, state, np.zeros(body.P)), SIZE))
    points = outline.body.keypoints(fit.R_camera_part, fit.t_camera_part, fit.state.beta, ints[:, 0].tolist())
    part = outline.body.keypoint_part[ints[:, 0]]
    points += np.einsum("nij,nj->ni", fit.R_camera_part[part], floats[:, :3])
    distance = ((points[:, :2] / points[:, 2:] - floats[:, 3:5]) * floats[:, 5:7]).sum(axis=1)
    pixel = REGION.side_px / 256 / K[0, 0]
    assert len(ints) > 60
    assert np.median(np.abs(distance)) < 0.4 * pixel
    assert np.quantile(np.abs(distance), 0.9) < 1.5 * pixel


def test_a_mask_without_a_person_gives_no_rows(body: Body, states: list[State]) -> None:
    outline = OutlineMeasurer(body, Camera(K, np.zeros(5), "test"))
    R, t = posed(body, states[0], np.zeros(body.P))
    held = Measurements(K, pose_priors=PosePriors([0], R[:1], t[:1], [1e8], [1e8]))
    fit = fit_clip(outline.body, [held], init=[states[0]], priors=Priors()).frames[0]
    ints, floats = outline.measure(fit, PersonMask(REGION, np.zeros((256, 256), np.float32), SIZE))
    assert (ints.shape, floats.shape) == ((0, 1), (0, 11))
