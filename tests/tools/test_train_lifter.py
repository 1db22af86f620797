# SPDX-License-Identifier: GPL-3.0-or-later
"""The lifter's training data against geometry worked out by hand, its training, and its export
against PyTorch.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.perception import lifter
from scope.scope_addon.capture.perception.lifter import (
    HIPS,
    MIDDLE,
    WINDOW,
    Lifter,
)
from scope.scope_addon.capture.tracking.left_right import MIRROR_PARTNER
from scope.solver.rotations import exp
from scope.tools.train_lifter.motions import Motions

from ..required import missing, package

try:
    import torch
except ImportError:
    missing(
        "torch is not installed, which trains the lifting network: pip install torch",
        "SCOPE_WITHOUT_TRAINING",
    )

from scope.tools.train_lifter import detector_noise, measure, network_input, train
from scope.tools.train_lifter.augment import rotation_matrices
from scope.tools.train_lifter.dataset import (
    Batch,
    Dataset,
    Variety,
)
from scope.tools.train_lifter.detector_noise import Persistence
from scope.tools.train_lifter.network import DIRECTION_WEIGHT, LiftingNetwork, loss


@pytest.fixture(autouse=True)
def _seed():
    torch.set_num_threads(1)  # with more, small batches wait for other processes' threads
    torch.manual_seed(0)


def motions_of(pose, take, fps):
    """Frames of one performer, of one kind and set."""
    n = len(pose)
    same = (np.full(n, value) for value in (fps, "cmu_01", "other", "cmu_asf_amc"))
    return Motions(exp(pose).astype(np.float32), take, *same)


def made_motions(body, frames, takes):
    """Random poses with an upright root, at 30 fps, of performers who are not held out."""
    rng = np.random.default_rng(3)
    pose = rng.normal(0, 0.2, (frames, body.K + 1, 3))
    pose[:, 0] = 0
    take = np.repeat(np.arange(takes), frames // takes)
    return motions_of(pose, take, 30.0)


@pytest.fixture(scope="module")
def motions(body):
    return made_motions(body, 40, 4)


@pytest.fixture(scope="module")
def plain(body, motions):
    return Dataset(body, motions)


def test_rotation_matrices_are_the_exponential():
    phi = np.random.default_rng(0).normal(0, 1, (50, 3))
    phi[0] = 0
    assert np.allclose(rotation_matrices(torch.tensor(phi)), exp(phi), atol=1e-6)


def test_the_input_is_that_of_captures():
    """`network_input` of the product is the second implementation."""
    rng = np.random.default_rng(0)
    rays = rng.normal(0, 0.3, (6, 33, 2))
    world = rng.normal(0, 0.4, (6, 33, 3))
    confidence = rng.uniform(0, 1, (6, 33))
    known = np.array([1.0, 0, 1, 0, 1, 1])
    expected, R = lifter.network_input(rays, confidence, world, known)
    x, R_ours = network_input.network_input(
        *(torch.tensor(a)[None] for a in (rays, confidence, world, known))
    )
    assert np.allclose(x[0], expected, atol=1e-9)
    assert np.allclose(R_ours[0], R, atol=1e-9)


def test_keypoints_are_those_of_the_body(body, plain, motions):
    at = list(body.keypoint_set("blazepose").values())
    displaced = np.random.default_rng(0).normal(0, 0.1, (1, len(at), 3))
    given = [
        torch.tensor(a, dtype=torch.float32)
        for a in (body.l[None], body.v_bar[at][None], displaced)
    ]
    ours, seen = plain.keypoints(torch.tensor(motions.Omega[None, :2]), *given)
    for k in range(2):
        R, t = body.forward_kinematics(motions.Omega[k].astype(float), -body.rest_joints()[0])
        assert np.allclose(ours[0, k], body.keypoints(R, t)[at], atol=1e-5)
        expected = np.einsum("kij,kj->ki", R[body.keypoint_part[at]], displaced[0])
        assert np.allclose(seen[0, k] - ours[0, k], expected, atol=1e-5)


def test_a_mirrored_pose_has_mirrored_keypoints(body, plain, motions):
    at = list(body.keypoint_set("blazepose").values())
    symmetric = body.v_bar[at].copy()
    symmetric = (symmetric + symmetric[MIRROR_PARTNER] * [-1, 1, 1]) / 2
    bones = (body.l + body.l[plain.sampler.partner] * [-1, 1, 1]) / 2
    give = [
        torch.tensor(np.repeat(a[None], 5, 0), dtype=torch.float32)
        for a in (bones, symmetric, 0 * symmetric)
    ]
    Omega = torch.tensor(motions.Omega[:5, None])
    straight, _ = plain.keypoints(Omega, *give)
    mirrored, _ = plain.keypoints(plain.sampler.mirror(Omega), *give)
    assert np.allclose(mirrored, straight.numpy()[:, :, MIRROR_PARTNER] * [-1, 1, 1], atol=1e-5)


def test_input_without_noise_is_the_projection_of_the_target(body, motions, monkeypatch):
    """With the detector's errors off, the virtual camera at the right distance projects the target
    onto the input.
    """
    monkeypatch.setattr(detector_noise, "PLACEMENT", np.zeros(33))
    for name in ("IMAGE_NOISE", "CUT_SHARE", "SWAP_SHARE"):
        monkeypatch.setattr(detector_noise, name, 0.0)
    batch = Dataset(body, motions, Variety(focal_spread=0.0)).batch(20)
    for x, P in zip(
        batch.input[:, MIDDLE].numpy().astype(float),
        batch.points.numpy().astype(float),
        strict=True,
    ):
        u = x[:66].reshape(33, 2) * np.exp(x[-1])
        # u (P_z + t_z) = P_xy + t_xy, linear in t
        A = np.zeros((66, 3))
        A[0::2, 0] = A[1::2, 1] = 1
        A[:, 2] = -u.ravel()
        b = (u * P[:, 2:] - P[:, :2]).ravel()
        t, *_ = np.linalg.lstsq(A, b, rcond=None)
        assert np.abs(A @ t - b).max() < 2e-3
        assert 1.5 < t[2] < 13
        assert np.abs(P[HIPS].mean(axis=0)).max() < 1e-5


def test_a_batch_depends_on_the_seed_alone(plain):
    batches = []
    for seed in (5, 5, 6):
        torch.manual_seed(seed)
        batches.append(plain.batch(8))
    a, b, c = batches
    assert torch.equal(a.input, b.input)
    assert torch.equal(a.points, b.points)
    assert not torch.equal(a.input, c.input)
    assert a.input.isfinite().all()


def test_errors_last_as_they_do_on_footage():
    """Correlation with themselves 0.1, 0.2 and 0.4 s later: ρ + (1 − ρ) a^k, for constant ρ and a
    exactly so.
    """
    n = 20000
    errors = Persistence(torch.full((n,), 0.5), torch.full((n,), 0.6)).normal(2)
    assert errors.shape == (n, WINDOW, 2)
    assert np.allclose(errors.std(dim=0), 1, atol=0.03)
    for lag in (1, 2, 4):
        assert np.allclose((errors[:, lag] * errors[:, 0]).mean(0), 0.5 + 0.5 * 0.6**lag, atol=0.03)
    drawn = Persistence.draw(n, "cpu").normal()
    found = [(drawn[:, lag] * drawn[:, 0]).mean() for lag in (1, 2, 4)]
    assert np.allclose(found, [0.8, 0.7, 0.6], atol=0.1)  # as measured, see `detector_noise`


def test_the_loss_is_the_laplace_density_s_and_the_bones_directions():
    """All errors 0.1 in x and −0.2 in z; the bones keep their directions, until all of them are
    reversed.
    """
    truth = torch.randn(4, 33, 3)
    log_sigma = torch.tensor([-1.0, -2.0]).expand(4, 33, 2)
    points = truth + torch.tensor([0.1, 0.0, -0.2])
    expected = (np.sqrt(2) * (0.1 * np.e + 0.2 * np.e**2) - 1 - 1 - 2) / 3
    # a direction counts at least 0.001
    assert np.isclose(loss(points, log_sigma, truth), expected, atol=1e-3)
    small = torch.full((4, 33, 2), 0.0)
    difference = loss(-truth, small, truth) - np.sqrt(2) * 2 * truth.abs().mean()
    # the distance of opposite unit vectors
    assert np.isclose(difference, DIRECTION_WEIGHT * 2, atol=1e-4)


class KnownErrors:
    """Stands for a network: returns given points and deviations, a part of them after another."""

    def __init__(self, points, log_sigma):
        self.points = points
        self.log_sigma = log_sigma
        self.done = 0

    def __call__(self, x):
        part = slice(self.done, self.done + len(x))
        self.done += len(x)
        return self.points[part], self.log_sigma[part]


def test_measures_of_known_errors_are_those_worked_out_by_hand():
    n = 3000
    flat = torch.randn(n, 33, 3)
    log_sigma = torch.full((n, 33, 2), math.log(0.02))
    flat[..., 2] = 0
    x = torch.zeros(n, WINDOW, 200)
    x[: n // 2, :, -2] = 1
    angle = math.radians(30)
    R = torch.tensor(
        [[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]]
    )
    turned = measure.measure(KnownErrors(flat @ R, log_sigma), Batch(x, flat))
    assert np.isclose(turned["limb_deg"], 30, atol=0.1)
    assert np.isclose(turned["trunk_deg"], 30, atol=0.1)
    error = torch.randn(n, 33, 3) * torch.tensor([0.02, 0.02, 0.04])
    error[n // 2 :] *= 2
    found = measure.measure(KnownErrors(flat + error, log_sigma), Batch(x, flat))
    limbs = [11, 12, 13, 14, 15, 16, 25, 26, 27, 28]
    lengths = np.linalg.norm(error[:, limbs], axis=-1) * 1000
    assert np.isclose(found["with_world_mm"], lengths[: n // 2].mean(), rtol=1e-4)
    assert np.isclose(found["without_world_mm"], lengths[n // 2 :].mean(), rtol=1e-4)
    assert np.isclose(found["deviation_across"], np.sqrt((1 + 4) / 2), rtol=0.02)
    assert np.isclose(found["deviation_along"], 2 * np.sqrt((1 + 4) / 2), rtol=0.02)


def test_calibration_makes_the_stated_deviation_that_of_the_error():
    network = LiftingNetwork(width=16, blocks=1)
    x = torch.randn(4000, WINDOW, 200)
    points, log_sigma = measure.run(network, x)
    factor = torch.linspace(0.3, 3, 33)[:, None]
    sigma = torch.exp(torch.cat([log_sigma[..., :1], log_sigma], -1))
    truth = points + factor * sigma * torch.randn(4000, 33, 3)
    measure.calibrate(network, Batch(x, truth))
    # 99 % of a normal distribution, and 1 % at its quantile: 0.98 of its deviation.
    assert np.allclose(network.sigma_offset, (0.98 * factor).log().expand(-1, 2), atol=0.05)


@pytest.fixture
def small(monkeypatch):
    """Trainings of a small network with a few small batches."""
    monkeypatch.setattr(train, "LiftingNetwork", lambda: LiftingNetwork(width=64, blocks=1))
    monkeypatch.setattr(train, "COUNT", 64)
    monkeypatch.setattr(train, "NORMALIZATION_COUNT", 256)
    return train.Settings(Variety(natural_share=0.6, segment_spread=0.03), steps=4, batch=32)


def test_training_reduces_the_error_of_held_out_windows(body, small, monkeypatch):
    monkeypatch.setattr(train, "WARM_UP", 5)
    recorded = made_motions(body, 200, 20)
    held_out = measure.held_out_batches(body, recorded, "cpu", 256)["augmented"]
    trainer = train.Trainer(
        body, recorded, replace(small, steps=60, batch=64, rate=1e-2), None, "cpu"
    )
    before = measure.measure(trainer.network, held_out)["with_world_mm"]
    for step in range(60):
        trainer.step(step)
    after = measure.measure(trainer.network, held_out)["with_world_mm"]
    assert after < 0.7 * before
    # The exponential mean has the weights 10/(k+10)…: it lies between the first weights and the
    # last.
    assert after <= measure.measure(trainer.mean, held_out)["with_world_mm"] < before


def test_the_exported_network_is_the_trained_one(tmp_path):
    package("onnx")
    from scope.tools.train_lifter.export import export, read_exported

    network = LiftingNetwork(width=32, blocks=2)
    for p in network.parameters():
        torch.nn.init.normal_(p, 0, 0.2)
        if p.ndim == 2:  # to what 8 bits and a scale for each row can state
            step = p.data.abs().amax(dim=1, keepdim=True) / 127
            p.data = step * (p.data / step).round()
    network.mean.normal_()
    network.spread.uniform_(0.5, 2)
    network.sigma_offset.normal_(0, 0.1)
    export(network, tmp_path / "lifter.onnx")
    x = np.random.default_rng(0).normal(0, 1, (7, WINDOW, 200)).astype(np.float32)
    with torch.no_grad():
        points, log_sigma = (a.numpy() for a in network(torch.from_numpy(x)))
    ours, sigma = Lifter(tmp_path / "lifter.onnx").run(x)
    assert np.abs(ours - points).max() < 1e-3 * np.abs(points).max()
    assert np.abs(sigma - log_sigma).max() < 1e-3
    with torch.no_grad():
        again, sigma_again = (
            a.numpy() for a in read_exported(tmp_path / "lifter.onnx")(torch.from_numpy(x))
        )
    assert np.abs(again - points).max() < 1e-5 * np.abs(points).max()
    assert np.abs(sigma_again - log_sigma).max() < 1e-5
