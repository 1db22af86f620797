# SPDX-License-Identifier: GPL-3.0-or-later
"""Points that several cameras see, triangulated against where they are."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    Keypoints2D,
    Keypoints3D,
    Measurements,
    Options,
    default_priors,
    load_body,
    make_tree,
    rotations,
)
from scope.solver.motion.initial import initial_states, triangulated, warn_of_cameras
from scope.solver.motion.views import View

from .. import person

K = np.array([[800.0, 0, 320], [0, 800, 240], [0, 0, 1]])
POINTS = 12
CAMERAS = [
    (np.eye(3), np.array([0.0, 0.0, 4.0])),
    (rotations.exp(np.array([0.0, 0.9, 0.0])), np.array([0.2, 0.1, 4.5])),
    (rotations.exp(np.array([0.3, -0.7, 0.1])), np.array([-0.3, 0.0, 12.0])),
]


def seen(world, camera, index, noise=0.0, confidence=1.0):
    R, t = CAMERAS[camera]
    points = world[index] @ R.T + t
    pixels = (points / points[:, 2:] @ K.T)[:, :2]
    pixels += noise * np.random.default_rng(camera).normal(size=pixels.shape)
    found = Keypoints2D(index, pixels, np.full(len(index), confidence))
    return View(Measurements(K, keypoints2d=found), R, t)


def points_of(views):
    return triangulated(views, POINTS)


@pytest.fixture
def world():
    return np.random.default_rng(4).uniform(-1, 1, (POINTS, 3))


def test_exact_rays_meet_in_the_points(world):
    every = np.arange(POINTS)
    found = points_of([seen(world, c, every) for c in range(3)])
    np.testing.assert_array_equal(found.indices, every)
    np.testing.assert_allclose(found.points, world, atol=1e-9)


def test_points_that_one_camera_sees_or_whose_rays_are_parallel_are_left_out(world):
    first = np.arange(8)
    second = np.arange(4, POINTS)
    found = points_of([seen(world, 0, first), seen(world, 1, second)])
    np.testing.assert_array_equal(found.indices, np.arange(4, 8))
    twice = [seen(world, 0, first), seen(world, 0, first)]  # two cameras in one place
    assert len(points_of(twice).indices) == 0


def test_nothing_seen_and_nan_count_for_nothing(world):
    every = np.arange(POINTS)
    views = [seen(world, 0, every), seen(world, 1, every)]
    views.append(
        View(
            Measurements(
                K, keypoints2d=Keypoints2D(every, np.full((POINTS, 2), np.nan), np.ones(POINTS))
            )
        )
    )
    views.append(seen(world + 5.0, 2, every, confidence=0.0))
    np.testing.assert_allclose(points_of(views).points, world, atol=1e-9)


def pixel_errors(views, point, k):
    """Errors (2 views,) of point k in all views if it is at `point`."""
    errors = []
    for view in views:
        p = view.R_camera_world @ point + view.t_camera_world
        errors.append((p / p[2] @ K.T)[:2] - view.measurements.keypoints2d.pixels[k])
    return np.concatenate(errors)


def test_the_error_in_the_image_is_minimized(world):
    """Of cameras at different distances; against Gauss-Newton with numerical derivatives."""
    views = [seen(world, c, np.arange(POINTS), noise=0.5) for c in range(3)]
    found = points_of(views).points
    for k in range(POINTS):
        best = world[k].copy()
        for _ in range(5):
            steps = 1e-6 * np.eye(3)
            J = (
                np.stack(
                    [
                        pixel_errors(views, best + h, k) - pixel_errors(views, best - h, k)
                        for h in steps
                    ],
                    1,
                )
                / 2e-6
            )
            best -= np.linalg.lstsq(J, pixel_errors(views, best, k), rcond=None)[0]
        assert np.linalg.norm(found[k] - best) < 0.03 * np.linalg.norm(world[k] - best)


def test_3d_keypoints_of_a_camera_are_moved_to_the_world(world):
    R, t = CAMERAS[2]
    given = Measurements(keypoints3d=Keypoints3D(np.array([3]), world[[3]] @ R.T + t, np.ones(1)))
    found = points_of([View(given, R, t)])
    np.testing.assert_array_equal(found.indices, [3])
    np.testing.assert_allclose(found.points, world[[3]], atol=1e-12)


BODY = load_body("scope")
INDEX = np.array(list(BODY.keypoint_set("blazepose").values()))


def filmed(frame, *cameras):
    """One frame of a person who moves, as some cameras see it, and the person's joints in the
    world.
    """
    start = person.pose(BODY, seed=9)
    state = replace(start, t_camera_root=np.array([0.1 * frame, 0.0, 0.0]))
    R, joints = person.place(BODY, state)
    points = BODY.keypoints(R, joints, state.beta)
    return [seen(points, camera, INDEX) for camera in cameras], joints


def started(clip):
    """How far the joints (T, K+1) of the states are from the true ones, where a clip's optimization
    starts.
    """
    states = initial_states(
        make_tree(BODY), [views for views, _ in clip], default_priors(BODY), Options()
    )
    found = [person.place(BODY, state)[1] for state in states]
    return np.linalg.norm(np.array(found) - [joints for _, joints in clip], axis=-1)


def test_one_camera_that_does_not_see_the_person_holds_them_in_the_world():
    """They were held in the camera's axes, as if those were the world's."""
    clip = [filmed(0), filmed(0, 1), filmed(1), filmed(1), filmed(2, 1)]
    errors = started(clip)
    np.testing.assert_allclose(errors[0], errors[1], atol=1e-6)
    # depth is uncertain; elsewhere in the world they would be metres away
    assert errors.mean() < 0.25


def test_cameras_that_take_turns_start_from_one_person_in_the_world():
    """The state of the frame before was taken into the next frame's camera as it was, at another
    angle.
    """
    turns = started([filmed(f, f % 3) for f in range(6)]).mean(axis=1)
    for camera in range(3):
        alone = started([filmed(f, camera) for f in range(6)]).mean(axis=1)
        assert turns[camera::3].max() < 1.5 * alone.max()


def test_cameras_in_one_place_say_as_much_as_one_of_them():
    """Nothing can be triangulated: the clip started from the pose at rest, somewhere."""
    np.testing.assert_allclose(
        started([filmed(f, 1, 1) for f in range(2)]), started([filmed(f, 1) for f in range(2)])
    )


def test_cameras_may_have_joints_in_space_besides_points_in_the_image():
    """Points in the image have lower numbers than joints, which were taken for too high ones."""
    (first, second), joints = filmed(0, 0, 1)
    M = len(BODY.keypoint_names)
    in_camera = joints @ first.R_camera_world.T + first.t_camera_world
    space = Keypoints3D(M + np.arange(len(joints)), in_camera)
    first = replace(first, measurements=replace(first.measurements, keypoints3d=space))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_cameras([[first, second]], M + len(joints))
