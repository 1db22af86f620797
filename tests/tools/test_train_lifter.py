# SPDX-License-Identifier: GPL-3.0-or-later
"""The lifter's training data against geometry worked out by hand, its training, and its export
against PyTorch.
"""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.fitting.keypoint_offsets import offset
from scope.scope_addon.capture.perception import lifter
from scope.scope_addon.capture.perception.lifter import (
    HIPS,
    MIDDLE,
    OFFSETS_S,
    SPACING_S,
    WINDOW,
    Lifter,
)
from scope.scope_addon.capture.tracking.left_right import MIRROR_PARTNER
from scope.solver.names import BLAZEPOSE
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

from scope.tools.train_lifter import augment, detector_noise, measure, network_input, train
from scope.tools.train_lifter.augment import PoseSampler, rotation_matrices
from scope.tools.train_lifter.dataset import (
    HEIGHTS_M,
    Batch,
    Dataset,
    Variety,
    cameras,
    cut_short,
    lines_of_sight,
)
from scope.tools.train_lifter.detector_noise import Persistence
from scope.tools.train_lifter.network import BONES, DIRECTION_WEIGHT, LiftingNetwork, loss


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


def test_proportions_without_spread_are_the_body_with_its_shapes(body, motions, monkeypatch):
    monkeypatch.setattr(augment, "BONE_SPREAD", 0.0)
    sampler = PoseSampler(body, motions)
    torch.manual_seed(1)
    bones, _ = sampler.proportions(3)
    torch.manual_seed(1)
    betas = torch.randn(3, body.P).clamp(-2.5, 2.5).numpy().astype(float)
    for k in range(3):
        J = body.rest_joints(betas[k])
        assert np.allclose(bones[k, 1:], J[1:] - J[body.parents[1:]], atol=1e-5)


def test_arms_legs_and_trunk_vary_in_length_each_as_a_whole(body, motions, monkeypatch):
    monkeypatch.setattr(augment, "BONE_SPREAD", 0.0)
    monkeypatch.setattr(augment, "SHAPE_LIMIT", 0.0)
    bones, _ = PoseSampler(body, motions, segment_spread=0.1).proportions(4000)
    factor = np.log(np.linalg.norm(bones[:, 1:], axis=-1) / np.linalg.norm(body.l[1:], axis=-1))
    at = {name: factor[:, k] for k, name in enumerate(body.joint_names[1:])}
    groups = (
        ("left_elbow", "right_elbow", "left_wrist", "right_wrist"),
        ("left_knee", "right_knee", "left_ankle", "right_ankle"),
        ("spine1", "neck", "left_shoulder", "right_hip"),
    )
    for first, *others in groups:
        assert np.isclose(at[first].std(), 0.1, rtol=0.1)
        assert all(np.allclose(at[first], at[other], atol=1e-5) for other in others)
    correlations = np.corrcoef([at[group[0]] for group in groups])
    assert np.abs(correlations - np.eye(3)).max() < 0.1


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


def as_recorded(Omega, motions, sampler):
    """(n,) bool: whether all joints but the root of (n, 24, 3, 3) are those of one frame or of its
    mirror image.
    """
    frames = torch.tensor(motions.Omega)
    candidates = torch.cat([frames, sampler.mirror(frames)])[:, 1:].flatten(1)
    return (torch.cdist(Omega[:, 1:].flatten(1), candidates).amin(1) < 1e-2).numpy()


def test_natural_samples_are_the_recordings_up_to_mirroring_and_lean_less(body, motions):
    """With a root that stands upright in the recordings, the tilt of its y axis is the lean."""
    tilt = {}
    for share in (0.0, 0.6, 1.0):
        sampler = PoseSampler(body, motions, natural_share=share)
        Omega = sampler.motion_windows(3000)[:, MIDDLE]
        found = as_recorded(Omega, motions, sampler).mean()
        # Of the others, 25 % are not rotated, and of those 0.5 · 0.6² · 0.8² keep all their limbs.
        assert np.isclose(found, share + (1 - share) * 0.25 * 0.115, atol=0.03)
        tilt[share] = np.median(np.degrees(np.arccos(Omega[:, 0, 1, 1].clamp(-1, 1))))
    assert np.isclose(tilt[1.0] / tilt[0.0], 0.4, rtol=0.15)


def test_a_window_is_a_recording_at_the_lifter_s_moments(body, monkeypatch):
    """A root that turns by 1 rad/s, recorded 30 times a second: from moment to moment it turns by
    the spacing.
    """
    monkeypatch.setattr(augment, "SPEED_SPREAD", 0.0)
    pose = np.zeros((300, body.K + 1, 3))
    pose[:, 0, 1] = np.arange(300) / 30
    turning = motions_of(pose, np.zeros(300, int), 30.0)
    Omega = PoseSampler(body, turning).motion_windows(200)[:, :, 0].numpy()
    steps = np.linalg.norm(Omega[:, 1:] - Omega[:, :-1], axis=(-2, -1)) / np.sqrt(2)  # 2 sin(θ/2)
    expected = 2 * np.sin(SPACING_S / 2)
    assert steps.max() < expected + 1e-3
    # the others lie at the ends of the recording
    assert np.isclose(steps, expected, atol=1e-3).mean() > 0.9


def test_windows_do_not_run_into_the_next_take(body):
    pose = np.zeros((20, body.K + 1, 3))
    pose[10:, 1:, 0] = 1.0
    two = motions_of(pose, np.repeat([4, 7], 10), 10.0)
    Omega = PoseSampler(body, two, natural_share=1.0).motion_windows(50)[:, :, 1:]
    assert torch.equal(Omega, Omega[:, MIDDLE : MIDDLE + 1].expand_as(Omega))
    assert 0 < Omega[:, MIDDLE, 0, 2, 1].gt(0.5).float().mean() < 1  # both takes are drawn


def test_a_camera_that_looks_down_sees_the_world_s_up_tip_towards_it():
    pitch = torch.linspace(-0.2, 0.8, 4000)
    for share, spread in ((0.0, 3.0), (1.0, 15.0)):
        R = cameras(pitch, share).numpy()
        assert np.allclose(R @ np.swapaxes(R, 1, 2), np.eye(3), atol=1e-5)
        assert np.allclose(np.linalg.det(R), 1, atol=1e-5)
        up = R[:, :, 1]  # the world's up in camera axes: y down, z forward
        assert np.allclose(np.arcsin(-up[:, 2]), pitch, atol=1e-4)
        assert np.isclose(np.degrees(np.arctan2(up[:, 0], -up[:, 1])).std(), spread, rtol=0.1)


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


def test_offsets_are_those_of_a_person_and_on_request_around_those_of_the_landmark_network(
    body, motions
):
    deviation = torch.tensor(detector_noise.PLACEMENT, dtype=torch.float32)
    expected = np.array([offset(name) for name in BLAZEPOSE])
    none = detector_noise.placements(4000, deviation).numpy()
    assert np.allclose(none.mean(axis=0), 0, atol=0.002)
    assert np.allclose(none.std(axis=0), detector_noise.PLACEMENT[:, None], rtol=0.05)
    given = detector_noise.placements(4000, 0 * deviation, torch.tensor(expected)).numpy()
    factor = (given * expected).sum((1, 2)) / np.square(expected).sum()
    assert np.allclose(given, factor[:, None, None] * expected, atol=1e-6)
    assert np.allclose([factor.min(), factor.mean(), factor.max()], [-0.5, 0.5, 1.5], atol=0.05)
    scene = Dataset(body, motions, Variety(random_offsets=True)).scene(4000)
    usual = Dataset(body, motions).scene(4000)
    # Of one person's hips, which the network places lower than the body's.
    down = [(s.seen - s.points)[:, :, 23:25].norm(dim=-1).mean().item() for s in (scene, usual)]
    assert down[0] > down[1] + 0.001


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


def test_world_landmarks_are_hip_centred_and_distorted_as_much_as_landmark_networks_do(plain):
    scene = plain.scene(500)
    truth = scene.points - scene.points[:, :, HIPS].mean(dim=2, keepdim=True)
    world = detector_noise.world_landmarks(truth, Persistence.draw(500, "cpu"))
    assert world[:, :, HIPS].mean(dim=2).abs().max() < 1e-5
    error = (world - truth).norm(dim=-1)[..., 11:].mean()
    assert 0.06 < error < 0.21  # metres; hands, which are off most, hang on arms of 0.6 m


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


def test_arms_or_legs_swap_sides_as_whole(monkeypatch):
    rays = torch.randn(200, WINDOW, 33, 2)
    monkeypatch.setattr(detector_noise, "SWAP_LASTS", 1.0)
    monkeypatch.setattr(detector_noise, "SWAP_SHARE", 0.5)
    swapped = detector_noise.swap_sides(rays)
    assert torch.equal(swapped[:, :, :11], rays[:, :, :11])
    both = []
    for group in (np.arange(11, 23), np.arange(23, 33)):
        kept = (swapped[:, :, group] == rays[:, :, group]).flatten(1).all(1)
        turned = (swapped[:, :, group] == rays[:, :, MIRROR_PARTNER[group]]).flatten(1).all(1)
        assert (kept ^ turned).all()
        both.append(turned)
    assert 0.1 < (both[0] & both[1]).float().mean() < 0.4


def test_beyond_the_image_s_border_keypoints_are_pulled_back_with_low_confidence(monkeypatch):
    rays = torch.randn(2000, WINDOW, 33, 2)
    ones = torch.ones(2000, WINDOW, 33)
    for share in (0.0, 1.0):
        monkeypatch.setattr(detector_noise, "CUT_SHARE", share)
        cut, confidence = detector_noise.cut_by_edge(rays, ones, Persistence.draw(2000, "cpu"))
        moved = (cut != rays).any(-1)
        assert torch.equal(moved, confidence < 1)
        assert moved.any() == bool(share)
    assert confidence[moved].max() <= 0.3
    x, y = (rays[..., k][moved] for k in (0, 1))
    below = ((y > 0) & (y > x.abs())).float().mean()
    above = ((y < 0) & (-y > x.abs())).float().mean()
    assert below > above > 0  # people are cut at the feet most often


def test_some_windows_are_cut_short_and_some_stand_still():
    x = torch.tensor(np.tile(OFFSETS_S, (5000, 1)))[..., None]
    cut = cut_short(x, torch.arange(WINDOW), 0.06)[..., 0].numpy()
    x = x[..., 0].numpy()
    assert np.array_equal(cut[:, MIDDLE], x[:, MIDDLE])
    assert (np.diff(cut, axis=1) >= 0).all()
    still = (np.ptp(cut, axis=1) == 0).mean()
    whole = (cut == x).all(axis=1).mean()
    assert 0.03 < still < 0.1
    assert 0.75 < whole < 0.95


def test_held_cameras_look_down_on_hips_below_them_and_less_so_from_afar():
    near, far = (
        lines_of_sight(torch.full((4000,), 0.9), torch.full((4000,), d)).numpy()
        for d in (2.0, 10.0)
    )
    assert np.median(near) > np.median(far) > 0
    # The middle half of cameras 10 m away, 1.3 ± 0.4 m above the floor: about 2 ± 2 degrees and
    # some of any pitch.
    assert np.subtract(*np.degrees(np.quantile(far, [0.6, 0.1]))) < 12


def test_cameras_at_any_height_look_further_down_and_up():
    hips = torch.full((8000,), 0.9)
    away = torch.full((8000,), 6.0)
    usual, wide = (lines_of_sight(hips, away, share).numpy() for share in (0.0, 1.0))
    low, high = (np.arcsin((height - 0.9) / 6.0) for height in HEIGHTS_M)
    assert np.mean((wide > low) & (wide < high)) > 0.7  # those that are not held have any pitch
    beyond = np.arcsin((2.6 - 0.9) / 6.0)  # of a camera higher than people hold it
    assert (
        np.mean((wide > beyond) & (wide < high)) > np.mean((usual > beyond) & (usual < high)) + 0.05
    )


def test_people_are_as_near_and_as_far_from_the_centre_as_was_asked_for(body, motions):
    near = []
    off = []
    assumed = []
    for variety in (Variety(), Variety(nearest_m=1.2, field=(0.75, 0.5), focal_spread=0.35)):
        scene = Dataset(body, motions, variety).scene(2000)
        hips = scene.points[:, MIDDLE, HIPS].mean(dim=1).numpy()
        near.append(np.linalg.norm(hips, axis=1).min())
        off.append(np.abs(hips[:, :2] / hips[:, 2:]).max(axis=0))
        assumed.append(scene.focal_ratio.log().std())
    assert np.allclose(near, [1.8, 1.2], atol=0.05)
    assert np.allclose(off, [(0.5, 0.4), (0.75, 0.5)], atol=0.02)
    assert np.allclose(assumed, [0.1, 0.35], rtol=0.1)


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


def test_the_rate_rises_and_falls_to_zero():
    rates = [train.schedule(step, 10_000) for step in (0, 149, 299, 5000, 9999)]
    assert np.allclose(rates, [1 / 300, 0.5, 1, 0.5, 0], atol=3e-3)
    assert max(train.schedule(step, 10_000) for step in range(10_000)) < 1


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


def test_a_training_writes_what_another_continues_from(body, small, tmp_path):
    package("onnx")
    recorded = made_motions(body, 200, 20)
    train.train(recorded, tmp_path / "a", small, None, "cpu", report_every=3)
    train.train(recorded, tmp_path / "b", small, None, "cpu")
    first, again = (torch.load(tmp_path / run / "lifter.pt") for run in "ab")
    assert all(torch.equal(first[name], again[name]) for name in first)
    log = json.loads((tmp_path / "a" / "log.json").read_text())
    assert [row["step"] for row in log["log"]] == [3, 4]
    assert log["variety"]["natural_share"] == 0.6
    assert set(log["held_out"]) == {"augmented", "as_recorded", "wide_cameras"}
    for start in ("lifter.pt", "lifter.onnx"):
        path = tmp_path / "a" / start
        train.train(recorded, tmp_path / "c", replace(small, rate=0.0), path, "cpu")
        kept = torch.load(tmp_path / "c" / "lifter.pt")
        for name, value in first.items():  # an exported matrix has 8 bits
            step = (
                value.abs().amax(dim=-1, keepdim=True) / 127
                if name.endswith("weight") and value.ndim == 2
                else 0.0
            )
            again = 0.01 if name == "sigma_offset" else 1e-6  # the calibration, which is made again
            assert ((kept[name] - value).abs() <= 0.501 * step + again).all(), name


def test_the_command_line_says_what_is_wrong(monkeypatch, tmp_path, capsys):
    absent = str(tmp_path / "absent.npz")
    for arguments in (
        [absent],
        [absent, "--natural", "2"],
        [absent, "--steps", "0"],
        [absent, "--start", absent],
    ):
        monkeypatch.setattr("sys.argv", ["train", *arguments, "-o", str(tmp_path)])
        with pytest.raises(SystemExit):
            train.main()
        told = capsys.readouterr().err
        assert "Traceback" not in told
        assert (arguments[1] if len(arguments) > 1 else "absent.npz") in told
    assert not list(tmp_path.iterdir())


def test_bones_are_symmetric():
    pairs = {tuple(sorted(bone)) for bone in BONES}
    assert {tuple(sorted(MIRROR_PARTNER[list(bone)].tolist())) for bone in BONES} == pairs


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
