# SPDX-License-Identifier: GPL-3.0-or-later
"""The lifter's training data against geometry worked out by hand, and its export against PyTorch."""

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.fitting.keypoint_offsets import offset
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.lifter import HIPS, Lifter
from scope.scope_addon.capture.perception.lifter_window import MIDDLE, OFFSETS_S, SPACING_S, WINDOW
from scope.solver.names import BLAZEPOSE
from scope.solver.rotations import exp
from scope.tools.train_lifter import detector_noise
from scope.tools.train_lifter.augment import Motions, PoseSampler, arms_hang, small_rotations
from scope.tools.train_lifter.dataset import (
    HEIGHTS_M,
    WIDE,
    Dataset,
    Variety,
    cameras,
    cut_short,
    lines_of_sight,
    pitches,
)
from scope.tools.train_lifter.detector_noise import Persistence

from ..required import missing, package


@pytest.fixture(scope="module")
def motions(body):
    rng = np.random.default_rng(3)
    Omega = exp(rng.normal(0, 0.2, (40, body.K + 1, 3))).astype(np.float32)
    return Motions(Omega, np.repeat(np.arange(4), 10), np.full(40, 30.0))


@pytest.fixture(scope="module")
def dataset(body, motions):
    return Dataset(body, motions)


def test_small_rotations_are_the_exponential():
    phi = np.random.default_rng(0).normal(0, 1, (50, 3))
    assert np.allclose(small_rotations(phi), exp(phi), atol=1e-6)


def test_keypoints_are_those_of_the_body(body, dataset, motions):
    at = list(body.keypoint_set("blazepose").values())
    bones, local = body.l[None].astype(np.float32), body.v_bar[at][None].astype(np.float32)
    displaced = np.random.default_rng(0).normal(0, 0.1, (1, len(at), 3)).astype(np.float32)
    ours, seen = dataset.keypoints(motions.Omega[None, :2], bones, local, displaced)
    for k in range(2):
        R, t = body.forward_kinematics(motions.Omega[k].astype(float), -body.rest_joints()[0])
        assert np.allclose(ours[0, k], body.keypoints(R, t)[at], atol=1e-5)
        assert np.allclose(seen[0, k] - ours[0, k], np.einsum("kij,kj->ki", R[dataset.part], displaced[0]), atol=1e-5)


def test_proportions_without_spread_are_the_body_with_its_shapes(body, motions, monkeypatch):
    monkeypatch.setattr("scope.tools.train_lifter.augment.BONE_SPREAD", 0.0)
    rng, same = np.random.default_rng(1), np.random.default_rng(1)
    bones, _ = PoseSampler(body, motions).proportions(rng, 3)
    betas = np.clip(same.standard_normal((3, body.P)), -2.5, 2.5)
    for k in range(3):
        J = body.rest_joints(betas[k])
        assert np.allclose(bones[k, 1:], J[1:] - J[body.parents[1:]], atol=1e-5)


def test_a_mirrored_pose_has_mirrored_keypoints(body, dataset, motions):
    at = list(body.keypoint_set("blazepose").values())
    symmetric = body.v_bar[at].copy()
    symmetric[detector_noise.MIRROR_PARTNER] = (symmetric[detector_noise.MIRROR_PARTNER] + symmetric * [-1, 1, 1]) / 2
    symmetric = (symmetric + symmetric[detector_noise.MIRROR_PARTNER] * [-1, 1, 1]) / 2
    bones = (body.l + body.l[dataset.sampler.partner] * [-1, 1, 1]) / 2
    give = [np.repeat(a[None], 5, 0).astype(np.float32) for a in (bones, symmetric, 0 * symmetric)]
    Omega = motions.Omega[:5, None]
    plain, _ = dataset.keypoints(Omega, *give)
    mirrored, _ = dataset.keypoints(dataset.sampler.mirror(Omega), *give)
    assert np.allclose(mirrored, plain[:, :, detector_noise.MIRROR_PARTNER] * [-1, 1, 1], atol=1e-5)


def test_left_and_right_are_exchanged_by_name():
    other = {"left": "right", "right": "left"}
    for k, name in enumerate(KEYPOINT_NAMES):
        partner = "_".join(other.get(word, word) for word in name.split("_"))
        assert KEYPOINT_NAMES[detector_noise.MIRROR_PARTNER[k]] == partner


def test_a_camera_that_looks_down_sees_the_world_s_up_tip_towards_it():
    rng = np.random.default_rng(0)
    R = cameras(rng, 2000, pitches(rng, 2000))
    assert np.allclose(R @ np.swapaxes(R, 1, 2), np.eye(3), atol=1e-5)
    assert np.allclose(np.linalg.det(R), 1, atol=1e-5)
    up = R[:, :, 1]  # the world's up in camera axes: y down, z forward
    pitch = np.degrees(np.arcsin(np.clip(-up[:, 2], -1, 1)))
    assert (up[:, 1] < 0).all()
    assert np.median(pitch) > 5
    assert np.quantile(pitch, 0.99) < 46


def test_input_without_noise_is_the_projection_of_the_target(body, motions, monkeypatch):
    """With the detector's errors off, the virtual camera at the right distance projects the target onto the input."""
    monkeypatch.setattr(detector_noise, "PLACEMENT", np.zeros(33))
    monkeypatch.setattr(detector_noise, "IMAGE_NOISE", 0.0)
    monkeypatch.setattr(detector_noise, "CUT_SHARE", 0.0)
    monkeypatch.setattr(detector_noise, "SWAP_SHARE", 0.0)
    batch = Dataset(body, motions, Variety(focal_spread=0.0, mean_offsets=False)).batch((0, 0), 20)
    for x, P in zip(batch.input[:, MIDDLE].astype(float), batch.points.astype(float), strict=True):
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


def test_keypoints_are_placed_around_where_networks_see_them():
    placed = detector_noise.placements(np.random.default_rng(0), 4000)
    expected = np.array([offset(name) for name in BLAZEPOSE])
    assert np.allclose(placed.mean(axis=0), expected, atol=0.002)
    assert np.allclose(placed.std(axis=0), detector_noise.PLACEMENT[:, None], rtol=0.05)
    without = detector_noise.placements(np.random.default_rng(0), 4000, mean_offsets=False)
    assert np.allclose(without.mean(axis=0), 0, atol=0.002)


def test_a_batch_depends_on_its_seed_alone(dataset):
    a, b, c = dataset.batch((0, 5), 8), dataset.batch((0, 5), 8), dataset.batch((0, 6), 8)
    assert np.array_equal(a.input, b.input)
    assert not np.array_equal(a.input, c.input)
    assert np.isfinite(a.input).all()


def test_world_landmarks_are_hip_centred_and_distorted_as_much_as_landmark_networks_do(dataset):
    rng = np.random.default_rng(0)
    scene = dataset.scene(rng, 500)
    truth = scene.points - scene.points[:, :, HIPS].mean(axis=2, keepdims=True)
    world = detector_noise.world_landmarks(rng, truth, Persistence.draw(rng, 500))
    assert np.abs(world[:, :, HIPS].mean(axis=2)).max() < 1e-5
    error = np.linalg.norm(world - truth, axis=-1)[..., 11:].mean()
    assert 0.06 < error < 0.21  # metres; hands, which are off most, hang on arms of 0.6 m


def test_a_window_is_a_recording_at_the_lifter_s_moments(body, monkeypatch):
    """A root that turns by 1 rad/s, recorded 30 times a second: from moment to moment it turns by the spacing."""
    monkeypatch.setattr("scope.tools.train_lifter.augment.SPEED_SPREAD", 0.0)
    pose = np.zeros((300, body.K + 1, 3))
    pose[:, 0, 1] = np.arange(300) / 30
    motions = Motions(exp(pose).astype(np.float32), np.zeros(300, int), np.full(300, 30.0))
    Omega = PoseSampler(body, motions).motion_windows(np.random.default_rng(0), 200)[:, :, 0]
    steps = np.linalg.norm(Omega[:, 1:] - Omega[:, :-1], axis=(-2, -1)) / np.sqrt(2)  # 2 sin(θ/2)
    expected = 2 * np.sin(SPACING_S / 2)
    assert steps.max() < expected + 1e-3
    assert np.isclose(steps, expected, atol=1e-3).mean() > 0.9  # the others lie at the ends of the recording


def test_windows_do_not_run_into_the_next_take(body):
    pose = np.zeros((20, body.K + 1, 3))
    pose[10:, 1:, 0] = 1.0
    motions = Motions(exp(pose).astype(np.float32), np.repeat([4, 7], 10), np.full(20, 10.0))
    Omega = PoseSampler(body, motions)._windows(np.random.default_rng(0), 50)
    assert np.array_equal(Omega, np.repeat(Omega[:, MIDDLE : MIDDLE + 1], WINDOW, axis=1))


def test_errors_last_as_they_do_on_footage():
    """Correlation with themselves 0.1, 0.2 and 0.4 s later: ρ + (1 − ρ) a^k, for constant ρ and a exactly so."""
    rng, n = np.random.default_rng(0), 20000
    errors = Persistence(np.full(n, 0.5, np.float32), np.full(n, 0.6, np.float32)).normal(rng, 2)
    assert errors.shape == (n, WINDOW, 2)
    assert np.allclose(errors.std(axis=0), 1, atol=0.03)
    for lag in (1, 2, 4):
        assert np.isclose((errors[:, lag] * errors[:, 0]).mean(), 0.5 + 0.5 * 0.6**lag, atol=0.03)
    drawn = Persistence.draw(rng, n).normal(rng)
    found = [(drawn[:, lag] * drawn[:, 0]).mean() for lag in (1, 2, 4)]
    assert np.allclose(found, [0.8, 0.7, 0.6], atol=0.1)  # as measured, see `detector_noise`


def test_some_windows_are_cut_short_and_some_stand_still():
    x = np.tile(OFFSETS_S, (5000, 1))
    cut = cut_short(np.random.default_rng(0), x)
    assert np.array_equal(cut[:, MIDDLE], x[:, MIDDLE])
    still = (np.ptp(cut, axis=1) == 0).mean()
    whole = (cut == x).all(axis=1).mean()
    assert 0.03 < still < 0.1
    assert 0.75 < whole < 0.95


def test_held_cameras_look_down_on_hips_below_them_and_less_so_from_afar():
    rng = np.random.default_rng(0)
    near, far = (lines_of_sight(rng, np.full(4000, 0.9), np.full(4000, d)) for d in (2.0, 10.0))
    assert np.median(near) > np.median(far) > 0
    # The middle half of cameras 10 m away, 1.3 ± 0.4 m above the floor: about 2 ± 2 degrees and some of any pitch.
    assert np.subtract(*np.degrees(np.quantile(far, [0.6, 0.1]))) < 12


def test_cameras_at_any_height_look_further_down_and_up():
    rng = np.random.default_rng(0)
    usual, wide = (lines_of_sight(rng, np.full(8000, 0.9), np.full(8000, 6.0), share) for share in (0.0, 1.0))
    low, high = (np.arcsin((height - 0.9) / 6.0) for height in HEIGHTS_M)
    assert np.mean((wide > low) & (wide < high)) > 0.7  # those that are not held have any pitch
    beyond = np.arcsin((2.6 - 0.9) / 6.0)  # of a camera higher than people hold it
    assert np.mean((wide > beyond) & (wide < high)) > np.mean((usual > beyond) & (usual < high)) + 0.05


def test_arms_of_the_share_that_was_asked_for_hang(body):
    """The default body rests with its arms out; turned down at the shoulders by what its own bones say, they hang."""
    at = body.joint_names.index
    out, down = (np.tile(np.eye(3), (20, body.K + 1, 1, 1)).astype(np.float32) for _ in range(2))
    for side in ("left", "right"):
        bone = body.l[at(f"{side}_wrist")] + body.l[at(f"{side}_elbow")]
        turn = np.cross(bone, [0.0, -1.0, 0.0])
        angle = np.arccos(-bone[1] / np.linalg.norm(bone))
        down[:, at(f"{side}_shoulder")] = exp(turn / np.linalg.norm(turn) * angle)
        out[:, at(f"{side}_shoulder")] = exp(turn / np.linalg.norm(turn) * (angle - np.pi / 2))
    poses = np.concatenate([out, down])
    assert arms_hang(body, poses).tolist() == 20 * [False] + 20 * [True]
    with pytest.raises(ValueError, match="hang"):
        PoseSampler(body, Motions(out, np.zeros(20, int), np.full(20, 30.0)), 0.6)
    motions = Motions(poses, np.repeat([0, 1], 20), np.full(40, 30.0))
    shares = []
    for share in (0.0, 0.6):
        windows = PoseSampler(body, motions, share).motion_windows(np.random.default_rng(0), 2000)
        shares.append(arms_hang(body, windows[:, MIDDLE]).mean())
    assert shares[1] > shares[0] + 0.2


def test_wide_data_shows_nearer_people_farther_from_the_centre(body, motions):
    near, off, assumed = [], [], []
    for variety in (Variety(), replace(WIDE, hanging_share=0.0)):
        scene = Dataset(body, motions, variety).scene(np.random.default_rng(0), 2000)
        hips = scene.points[:, MIDDLE, HIPS].mean(axis=1)
        near.append(np.linalg.norm(hips, axis=1).min())
        off.append(np.abs(hips[:, 0] / hips[:, 2]).max())
        assumed.append(np.log(scene.focal_ratio).std())
    assert np.allclose(near, [1.8, 1.2], atol=0.05)
    assert np.allclose(off, [0.5, 0.75], atol=0.02)
    assert np.allclose(assumed, [0.1, 0.35], rtol=0.1)


def test_the_exported_network_is_the_trained_one(tmp_path):
    try:
        import torch
    except ImportError:
        missing("torch is not installed, which trains the lifting network: pip install torch", "SCOPE_WITHOUT_TRAINING")
    package("onnx")
    from scope.tools.train_lifter.export import export, read_exported
    from scope.tools.train_lifter.network import LiftingNetwork

    torch.manual_seed(0)
    network = LiftingNetwork(width=32, blocks=2)
    for p in network.parameters():
        torch.nn.init.normal_(p, 0, 0.2)
        p.data = p.data.half().float()
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
        again, sigma_again = (a.numpy() for a in read_exported(tmp_path / "lifter.onnx")(torch.from_numpy(x)))
    assert np.abs(again - points).max() < 1e-5 * np.abs(points).max()
    assert np.abs(sigma_again - log_sigma).max() < 1e-5
