# SPDX-License-Identifier: GPL-3.0-or-later
"""Feet that stand and a floor nobody sinks into, as terms of the solver."""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    Floor,
    FootContacts,
    InputError,
    Keypoints2D,
    Keypoints3D,
    Measurements,
    Options,
    Priors,
    State,
    fit,
    load_body,
    make_tree,
    rotations,
)

BODY = load_body("scope")
NAMES = list(BODY.keypoint_names)
SOLES = ("left_heel", "left_foot_index", "right_heel", "right_foot_index")
FEET = np.array([NAMES.index(f"blazepose/{name}") for name in SOLES])
# a camera that looks down and is not quite level
UP = rotations.exp([0.2, 0.0, 0.1]) @ np.array([0.0, -1.0, 0.0])
INTRINSICS = np.array([[1000.0, 0.0, 500.0], [0.0, 1000.0, 500.0], [0.0, 0.0, 1.0]])


def points(state):
    """All keypoints in the camera frame, straight from the definition."""
    tree = make_tree(BODY)
    pose = state.pose(tree)
    n = len(NAMES)
    local = tree.V[:n, :, : tree.shape_count] @ state.beta + tree.v_bar[:n]
    return np.einsum("mij,mj->mi", pose.R[tree.point_part[:n]], local) + pose.t[tree.point_part[:n]]


def standing(seed=0):
    rng = np.random.default_rng(seed)
    state = State.rest(23, 10, 4.0)
    Omega = rotations.exp(0.15 * rng.standard_normal((23, 3)))
    return State(state.R_camera_root, state.t_camera_root, Omega, 0.5 * rng.standard_normal(10))


def seen(state, noise=0.0, seed=0, **more):
    """All keypoints in space with noise in metres."""
    rng = np.random.default_rng(seed)
    p = points(state)
    return Measurements(
        keypoints3d=Keypoints3D(
            np.arange(len(p)), p + noise * rng.standard_normal(p.shape), np.full(len(p), 0.02)
        ),
        **more,
    )


def feet(m, start):
    """The soles (4, 3) of a fit from a state."""
    return points(fit(BODY, m, init=start).state)[FEET]


def test_a_standing_foot_stays_where_it_stands_although_it_is_seen_to_slide():
    state = standing()
    p = points(state)
    slid = seen(state)
    slid.keypoints3d.points[FEET[:2]] += [0.06, 0.0, 0.03]
    free = feet(slid, state)
    contacts = FootContacts(FEET[:2], p[FEET[:2]], [1.0, 1.0])
    held = feet(replace(slid, foot_contacts=contacts), state)
    off_free, off_held = (
        np.linalg.norm((each - p[FEET])[:2], axis=1).max() for each in (free, held)
    )
    assert off_free > 0.025
    assert off_held < 0.25 * off_free
    # The other foot stays where the same points lead it without the contact.
    np.testing.assert_allclose(held[2:], free[2:], atol=0.015)


def test_nobody_sinks_into_the_floor_and_nobody_in_the_air_is_pulled_down():
    state = standing()
    p = points(state)
    height = (p[FEET] @ UP).min()
    raised = Floor(FEET, UP, height + 0.05, np.zeros(4))
    assert (feet(seen(state, floor=raised), state) @ UP).min() - (height + 0.05) > -0.01
    far_below = Floor(FEET, UP, height - 0.3, np.zeros(4))
    free = feet(seen(state), state)
    np.testing.assert_array_equal(feet(seen(state, floor=far_below), state), free)
    touching = Floor(FEET, UP, height - 0.03, np.ones(4))
    held = feet(seen(state, floor=touching), state)
    off_held, off_free = (np.abs(each @ UP - (height - 0.03)).max() for each in (held, free))
    assert off_held < 0.3 * off_free


def test_points_may_be_left_free_below_the_floor():
    """On a stair that leads down, or where the floor is uncertain: no weight below, no contact, no
    pull.
    """
    state = standing()
    height = (points(state)[FEET] @ UP).min() + 0.05
    none, half, full = (
        feet(seen(state, floor=Floor(FEET, UP, height, np.zeros(4), below=np.full(4, w))), state)
        for w in (0.0, 0.02, 1.0)
    )
    np.testing.assert_array_equal(none, feet(seen(state), state))
    low = [(each @ UP - height).min() for each in (none, half, full)]
    assert low[0] < low[1] - 1e-3 < low[2] - 2e-3


def test_each_point_may_have_a_plane_of_its_own():
    """One plane for all points is the same as a copy for each; a point below its own plane alone is
    raised.
    """
    state = standing()
    p = points(state)
    height = (p[FEET] @ UP).min() + 0.05
    one = feet(seen(state, floor=Floor(FEET, UP, height, np.zeros(4))), state)
    copies = Floor(FEET, np.tile(UP, (4, 1)), np.full(4, height), np.zeros(4))
    np.testing.assert_array_equal(feet(seen(state, floor=copies), state), one)
    sideways = np.array([1.0, 0.0, 0.0])
    normals = np.array([sideways, -sideways])
    offsets = np.array([1.0, -1.0]) * (p[FEET[:2], 0] + [0.05, 0.05])
    found = feet(seen(state, floor=Floor(FEET[:2], normals, offsets, np.zeros(2))), state)
    moved = (found - feet(seen(state), state))[:2, 0]
    assert moved[0] > 0.02
    assert abs(moved[1]) < 0.5 * moved[0]


@pytest.mark.parametrize("size", [-1.5, 1.5])
def test_the_floor_tells_the_depth_that_a_picture_does_not(size):
    """With 2D alone, distance and size are one; a floor of known height below somebody small or
    tall decides.
    """
    state = replace(standing(3), beta=size * np.eye(10)[0])
    p = points(state)
    pixels = p @ INTRINSICS.T
    image = Keypoints2D(np.arange(len(p)), pixels[:, :2] / pixels[:, 2:], np.ones(len(p)))
    priors = Priors(shape_mean=state.beta * 0.0)
    far = State(state.R_camera_root, state.t_camera_root * 1.15, state.Omega, np.zeros(10))
    height = float(np.mean(p[FEET] @ UP))
    ground = Floor(FEET, UP, height, np.ones(4))
    error = []
    for floor in (None, ground):
        found = fit(BODY, Measurements(INTRINSICS, image, floor=floor), init=far, priors=priors)
        # Of the feet: the rest of the body may lean towards the camera or away.
        error.append(np.linalg.norm((points(found.state) - p)[FEET].mean(axis=0)))
    assert error[1] < 0.1 * error[0]


def test_a_point_that_is_not_finite_is_left_out_and_no_probability_is_no_contact():
    state = standing()
    m = seen(state)
    plain = feet(m, state)
    stand = points(state)[FEET[:2]] + 1.0
    for ignored in (
        {"foot_contacts": FootContacts(FEET[:2], stand, [0.0, 0.0])},
        {"foot_contacts": FootContacts(FEET[:2], stand * np.nan, [1.0, 1.0])},
        {"foot_contacts": FootContacts(FEET[:2], stand, [np.nan, np.nan])},
        {"floor": Floor(FEET, UP, 100.0, np.full(4, np.nan))},
    ):
        np.testing.assert_array_equal(feet(replace(m, **ignored), state), plain)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"floor": Floor(FEET, UP, np.nan, np.zeros(4))}, "offset nan"),
        (
            {"floor": Floor(FEET, UP, 0.0, np.zeros(4), below=np.zeros(5))},
            r"\(4,\), but got shape \(5,\)",
        ),
        (
            {"floor": Floor(FEET, np.tile(UP, (3, 1)), np.zeros(4), np.zeros(4))},
            r"Normal .* \(4, 3\)",
        ),
        ({"floor": Floor(FEET, np.tile(UP, (4, 1)), 0.0, np.zeros(4))}, r"Offset .* \(4,\)"),
        ({"floor": Floor(FEET, np.outer([1, 1, 3, 1], UP), np.zeros(4), np.zeros(4))}, "length 3"),
        ({"foot_contacts": FootContacts(FEET, np.zeros((3, 3)), np.ones(4))}, r"\(4, 3\)"),
    ],
)
def test_what_does_not_fit_is_refused(more, message):
    with pytest.raises(InputError, match=message):
        fit(BODY, seen(standing(), **more), options=Options())
