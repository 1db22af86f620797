# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading the learned prior, and how a body comes to use it."""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    Keypoints3D,
    Measurements,
    Priors,
    ShapeError,
    State,
    default_priors,
    fit,
    load_joint_prior,
    rotations,
)
from scope.solver.errors import ModelFileError
from scope.solver.learned_prior import BUILT_IN
from scope.solver.residuals import joint_flow

from .synthetic import random_body


def test_default_priors_use_the_flow_for_known_joints_and_the_rest_pose_for_others(body):
    priors = default_priors(body)
    assert sorted(priors.flow[0][priors.flow[0] > 0]) == list(range(1, 24))
    assert not np.any(priors.joint_weights)

    class Other:
        joint_names = ("pelvis", "left_knee", "tail")

    priors = default_priors(Other())
    assert priors.flow[0].ravel().tolist() == [1] + [0] * (joint_flow.INTS - 1)
    assert np.ravel(priors.joint_weights).tolist() == [0.0, 1.0]
    assert default_priors(object()).flow is None


def test_a_hidden_forearm_takes_a_likely_state(body):
    """Measured to the elbow only, the elbow joint goes to where 1/2 |z|^2 is least, not to the
    straight arm.
    """
    rng = np.random.default_rng(0)
    prior = load_joint_prior()
    elbow = body.joint_names.index("left_elbow")
    state = State.rest(body.K, body.P)
    state.Omega = np.array([prior.sample(name, 1, rng)[0] for name in body.joint_names[1:]])
    R = np.concatenate([state.R_camera_root[None], state.Omega])
    _, t = body.forward_kinematics(R, state.t_camera_root, np.zeros(body.P))
    seen = [i for i, name in enumerate(body.joint_names) if name not in ("left_wrist", "left_hand")]
    points = Keypoints3D(len(body.keypoint_part) + np.array(seen), t[seen], np.ones(len(seen)))
    with_flow = fit(body, Measurements(keypoints3d=points), init=state)
    z = joint_flow.transform(prior.of("left_elbow"), with_flow.state.Omega[elbow - 1])[0]
    assert np.linalg.norm(z) < 0.05
    plain = replace(default_priors(body), flow=None, joint_weights=None)
    straight = fit(body, Measurements(keypoints3d=points), init=state, priors=plain)
    assert np.linalg.norm(rotations.log(straight.state.Omega[elbow - 1])) < 0.05


def test_likely_elbows_bend_forwards_and_knees_backwards():
    rng = np.random.default_rng(1)
    prior = load_joint_prior()
    forearm = prior.sample("left_elbow", 2000, rng) @ [1.0, 0.0, 0.0]  # rest: to the left
    assert (forearm[:, 2] > -0.2).mean() > 0.98
    shin = prior.sample("right_knee", 2000, rng) @ [0.0, -1.0, 0.0]
    assert (shin[:, 2] < 0.2).mean() > 0.98


def test_a_missing_or_foreign_file_is_named(tmp_path):
    with pytest.raises(ModelFileError, match="does not exist"):
        load_joint_prior(tmp_path / "none.npz")
    arrays = dict(np.load(BUILT_IN))
    for change, message in (
        ({"layers": 3}, "layers = 3"),
        ({"parameters": arrays["parameters"][:, :-1]}, "shape"),
        ({"parameters": np.full_like(arrays["parameters"], np.nan)}, "finite"),
    ):
        path = tmp_path / f"{message.split()[0]}.npz"
        np.savez(path, **{**arrays, **change})
        with pytest.raises(ModelFileError, match=message):
            load_joint_prior(path)
    np.savez(tmp_path / "without.npz", joint_names=arrays["joint_names"])
    with pytest.raises(ModelFileError, match="parameters"):
        load_joint_prior(tmp_path / "without.npz")


def test_flow_tables_of_another_body_are_refused(body):
    another = random_body(np.random.default_rng(0), K=5)
    with pytest.raises(ShapeError, match=r"'joint_flow' must lie in 0\.\.5"):
        fit(another, Measurements(), priors=Priors(flow=default_priors(body).flow))


def test_a_prior_is_read_anew_where_its_file_is_another_and_belongs_to_its_reader(
    tmp_path, monkeypatch
):
    once = load_joint_prior()
    with np.load(BUILT_IN) as file:
        arrays = dict(file)
    for folder, factor, more in (("a", 1.0, 0), ("b", 2.0, 0), ("b", 4.0, 1)):
        (tmp_path / folder).mkdir(exist_ok=True)
        monkeypatch.chdir(tmp_path / folder)
        changed = {**arrays, "parameters": factor * arrays["parameters"]}
        np.savez("prior.npz", **changed, more=np.zeros(more))
        for _ in range(2):
            found = load_joint_prior("prior.npz").parameters
            np.testing.assert_array_equal(found, factor * once.parameters)
            found[:] = 0.0
    np.testing.assert_array_equal(load_joint_prior().parameters, once.parameters)
