# SPDX-License-Identifier: GPL-3.0-or-later
"""Training data, export and baselines of the joint-state prior, and the one in assets/. Nothing
needs PyTorch.
"""

from pathlib import Path

import numpy as np
import pytest
from scope.solver import load_body, rotations
from scope.solver.learned_prior import BUILT_IN, load_joint_prior
from scope.solver.residuals import joint_flow as jf
from scope.tools.train_prior.data import (
    ALWAYS,
    FOLDS,
    MIRROR,
    PAIRED,
    RESERVED,
    TEST,
    TRUNK,
    group_of,
    mirrored,
)
from scope.tools.train_prior.export import flat
from scope.tools.train_prior.export import mirrored as mirrored_parameters

FIXTURE = Path(__file__).with_name("flow_by_torch.npz")


def uniform_rotations(rng, n):
    return rotations.matrix_from_quaternion(rng.standard_normal((n, 4)))


@pytest.fixture(scope="module")
def prior():
    return load_joint_prior()


def test_export_evaluates_to_what_torch_computed():
    row = dict(np.load(FIXTURE))
    states = row.pop("states")
    z = row.pop("z")
    log_likelihood = row.pop("log_likelihood")
    parameters = flat(row, states)
    np.testing.assert_allclose(jf.transform(parameters, states)[0], z, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(
        jf.log_density(parameters, states), log_likelihood, rtol=1e-9, atol=1e-8
    )


def test_mirrored_parameters_are_the_flow_of_the_mirror_image():
    rng = np.random.default_rng(0)
    row = dict(np.load(FIXTURE))
    parameters = flat(row, row["states"])
    Omega = uniform_rotations(rng, 50)
    z, _, log_det = jf.transform(parameters, Omega)
    found = jf.transform(mirrored_parameters(parameters), MIRROR @ Omega @ MIRROR)
    np.testing.assert_allclose(found[0], z, atol=1e-9)
    np.testing.assert_allclose(found[2], log_det, atol=1e-9)
    turned = mirrored(rotations.exp([[0.3, 0.2, -0.1]]))
    np.testing.assert_allclose(rotations.log(turned), [[0.3, -0.2, 0.1]], atol=1e-12)


def test_performers_do_not_straddle_the_split():
    assert group_of("cmu_asf_amc", "cmu_02") in TEST
    assert (
        group_of("cmu_expmap", "expmap_train_soccer_3")
        == group_of("cmu_expmap", "expmap_test_soccer_1")
        in TEST
    )
    assert group_of("cmu_expmap", "expmap_train_running_2") == group_of(
        "cmu_expmap", "expmap_test_walking_12"
    )
    assert group_of("cmu_expmap", "expmap_train_basketball_signal_1") == "expmap_basketball"
    assert group_of("cmu_more", "cmu_06") == "expmap_basketball"
    assert group_of("cmu_more", "cmu_13") == group_of("cmu_more", "cmu_14") == "expmap_jumping"
    assert group_of("cmu_more", "cmu_08") in RESERVED
    assert group_of("markers", "btk_pig") in RESERVED
    assert group_of("reactidle", "reactidle_011") in RESERVED
    assert group_of("reactidle", "reactidle_012") in ALWAYS
    groups = [*TEST, *RESERVED, *ALWAYS, *(g for fold in FOLDS for g in fold)]
    assert len(set(groups)) == len(groups)


def test_built_in_prior_covers_the_default_body(prior):
    assert prior.names == load_body("scope").joint_names[1:]
    assert BUILT_IN.stat().st_size < 1e6
    names = load_body("scope_h").joint_names
    ints, floats = prior.tables(names)
    assert sorted(ints[ints > 0]) == [i for i, name in enumerate(names) if name in prior.names]
    assert (ints > 0).sum() == 21
    assert floats.shape == (len(ints), jf.FLOATS)


@pytest.mark.parametrize("joint", [*TRUNK[:2], f"left_{PAIRED[0]}", "right_elbow"])
def test_built_in_prior_is_a_density_of_each_joint(prior, joint):
    """Its mass, with samples of a wider flow as proposals: z scaled by 1.5."""
    rng = np.random.default_rng(3)
    wide = prior.of(joint).copy()
    wide[jf.LAST : jf.LAST + 12] /= 1.5
    wide[jf.CONSTANT] -= 3.0 * np.log(1.5)
    z = rng.standard_normal((20_000, 3))
    Omega = jf.invert(wide, z)
    np.testing.assert_allclose(jf.transform(wide, Omega)[0], z, atol=1e-4)
    ratio = np.exp(prior.log_density(joint, Omega) - jf.log_density(wide, Omega))
    assert ratio.mean() == pytest.approx(1.0, abs=5.0 * ratio.std() / np.sqrt(len(ratio)))
