# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever is measured, of whatever body: a finite pose, an honest status, and the same bits
again.
"""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    Floor,
    FootContacts,
    Keypoints2D,
    Keypoints3D,
    Measurements,
    Options,
    PosePriors,
    Stage,
    State,
    Status,
    Weights,
    fit,
    fit_clip,
)
from scope.solver.measurements import LARGEST

from ..synthetic import random_body, random_state
from .test_frame_solver import INTRINSICS, measured

STOPPED = {Status.CONVERGED, Status.STALLED, Status.MAX_ITERATIONS}
FREE = Weights(joint_prior=0.0, shape=0.0, joint_limits=0.0)
UNGUARDED = Options(
    stages=[Stage(FREE, 1e-5, 50)], robust_keypoints2d=np.inf, robust_keypoints3d=np.inf
)
BODIES = {
    "P0": (23, 0, Options()),
    "P30": (23, 30, Options()),
    "one joint": (1, 0, Options()),
    "without priors and kernels": (23, 10, UNGUARDED),
}


def masked(m, value):
    """Every kind of measurement with `value` in place of its confidence."""
    kinds = ("keypoints2d", "keypoints3d", "orientation_field")
    fields = {
        k: replace(getattr(m, k), confidence=np.full(len(getattr(m, k).confidence), value))
        for k in kinds
    }
    return replace(m, **fields)


def placed(m, change):
    """The 3D keypoints changed: in contradiction to the image, unless it says so little."""
    return replace(m, keypoints3d=replace(m.keypoints3d, points=change(m.keypoints3d.points)))


def contradiction(m):
    k = m.keypoints3d
    indices = np.tile(k.indices, 2)
    ones = np.ones(2 * len(k.indices))
    return replace(
        m, keypoints3d=Keypoints3D(indices, np.concatenate([k.points, 1.0 - k.points[::-1]]), ones)
    )


def beneath_its_own_floor(m):
    """A floor above the head, and feet that are said to stand still far away in two places at
    once.
    """
    feet = np.array([0, 1, 0, 1])
    where = np.array([[5.0, 0, 0], [-5.0, 0, 0], [-5.0, 0, 0], [5.0, 0, 0]])
    floor = Floor(np.arange(2), [0.0, -1.0, 0.0], 50.0, np.ones(2))
    return replace(m, floor=floor, foot_contacts=FootContacts(feet, where, np.ones(4)))


def half_turned(m):
    """A pose prior against the measurements: half a turn away, and stronger."""
    return replace(
        m,
        pose_priors=PosePriors([0], np.diag([-1.0, -1.0, 1.0])[None], [[0.0, 0, -3]], [1e7], [1e7]),
    )


def zero_directions(m):
    o = m.orientation_field
    return Measurements(orientation_field=replace(o, directions=np.zeros((len(o.starts), 3))))


def with_pixels(m, factor):
    return Measurements(INTRINSICS, replace(m.keypoints2d, pixels=m.keypoints2d.pixels * factor))


SPOILED = {
    "nothing": (lambda m: Measurements(), {Status.NO_MEASUREMENTS}),
    "no confidence": (lambda m: masked(m, 0.0), {Status.NO_MEASUREMENTS}),
    "pixels not a number": (lambda m: with_pixels(m, np.nan), {Status.NO_MEASUREMENTS}),
    "directions without a length": (zero_directions, {Status.NO_MEASUREMENTS}),
    "one point": (
        lambda m: Measurements(INTRINSICS, Keypoints2D([0], [[100.0, 100.0]], [1.0])),
        STOPPED,
    ),
    "all in one place": (lambda m: placed(m, lambda p: 0.0 * p + [0.0, 0.0, 2.0]), STOPPED),
    "behind the camera": (lambda m: placed(m, lambda p: -p), STOPPED),
    "all in the camera": (lambda m: placed(m, lambda p: 0.0 * p), STOPPED),
    "far away": (lambda m: placed(m, lambda p: p + 1e9), STOPPED),
    "huge pixels": (lambda m: with_pixels(m, 1e12), STOPPED),
    "contradictory": (contradiction, STOPPED),
    "beneath its own floor": (beneath_its_own_floor, STOPPED),
    "against its prior": (half_turned, STOPPED),
}


@pytest.fixture(scope="module", params=BODIES.values(), ids=list(BODIES))
def scene(request):
    K, P, options = request.param
    rng = np.random.default_rng(K + P)
    body = random_body(rng, K, P, 2 * (K + 1))
    return body, measured(body, random_state(rng, K, P, 0.4)), State.rest(K, P), options


@pytest.mark.filterwarnings("error", "ignore::scope.solver.errors.ScopeWarning")
@pytest.mark.parametrize("warm", [True, False], ids=["warm", "cold"])
@pytest.mark.parametrize("spoiled", SPOILED.values(), ids=SPOILED)
def test_any_body_ends_in_a_finite_pose(scene, spoiled, warm):
    body, m, rest, options = scene
    spoil, allowed = spoiled
    init = rest if warm else None
    found, again = (fit(body, spoil(m), init=init, options=options) for _ in range(2))
    s = found.state
    for array in (
        s.R_camera_root,
        s.t_camera_root,
        s.Omega,
        s.beta,
        found.R_camera_part,
        found.t_camera_part,
        found.beta_information,
    ):
        assert np.isfinite(array).all()
    assert np.isfinite(found.cost)
    assert np.abs(s.Omega @ np.swapaxes(s.Omega, 1, 2) - np.eye(3)).max() < 1e-9
    assert found.status in allowed
    assert found.rejected <= found.iterations
    np.testing.assert_array_equal(found.state.Omega, again.state.Omega)
    assert (found.cost, found.status, found.iterations) == (
        again.cost,
        again.status,
        again.iterations,
    )


@pytest.mark.parametrize("bad", [np.nan, -np.inf, 1e160])
def test_one_bad_value_masks_its_own_measurement_and_nothing_else(bad):
    rng = np.random.default_rng(4)
    body = random_body(rng, 23, 10, 48)
    m = measured(body, random_state(rng, 23, 10, 0.4))
    spoiled = masked(m, 1.0)
    without = masked(m, 1.0)
    for name, field in (
        ("keypoints2d", "pixels"),
        ("keypoints3d", "points"),
        ("orientation_field", "directions"),
    ):
        broken = np.array(getattr(getattr(m, name), field))
        broken[5, 1] = bad
        getattr(without, name).confidence[5] = 0.0
        spoiled = replace(spoiled, **{name: replace(getattr(spoiled, name), **{field: broken})})
    a = fit(body, spoiled)
    b = fit(body, without)
    assert a.measurements == b.measurements
    np.testing.assert_array_equal(a.t_camera_part, b.t_camera_part)


@pytest.mark.parametrize("size", [1e29, 1e160])
def test_no_value_however_large_spoils_the_frames_of_a_clip(size):
    """Robust or not; below the largest they may draw a frame away, but leave the cost finite."""
    rng = np.random.default_rng(5)
    body = random_body(rng, 23, 10, 48)
    m = measured(body, random_state(rng, 23, 10, 0.4))
    ones = np.ones(1)
    far = np.array([[size, 0.0, size]])
    image = np.array(m.keypoints2d.pixels)
    space = np.array(m.keypoints3d.points)
    image[3] = size * INTRINSICS[0, 0]
    space[4] = size
    spoiled = replace(
        m,
        keypoints2d=replace(m.keypoints2d, pixels=image),
        keypoints3d=replace(m.keypoints3d, points=space),
        foot_contacts=FootContacts([0], far, ones),
        pose_priors=PosePriors([0], np.eye(3)[None], far, ones, ones),
        floor=Floor([0], [0.0, -1.0, 0.0], size, ones),
    )
    for robust in (0.01, np.inf):
        options = Options(robust_keypoints2d=robust, robust_keypoints3d=robust)
        found = fit_clip(body, [m, spoiled, m], options=options)
        assert found.status in STOPPED
        assert np.isfinite(found.cost)
        if size >= LARGEST:
            assert found.iterations > 0
            assert found.frames[1].measurements == found.frames[0].measurements
            np.testing.assert_allclose(
                found.frames[1].t_camera_part, found.frames[0].t_camera_part, atol=0.05
            )
