# SPDX-License-Identifier: GPL-3.0-or-later
"""Smoothing against its documented frequency response, and gaps against known values."""

import numpy as np
from scope.scope_addon.kinematics.smoothing import (
    continuous_quaternions,
    fill_gaps,
    fill_rotation_gaps,
    gaussian_smooth,
    smooth_root,
    smooth_rotations,
)
from scope.solver.rotations import exp, log, matrix_from_quaternion


def turn(angle):
    """Return rotations (..., 3, 3) about z by angles (...)."""
    return exp(np.multiply.outer(angle, [0.0, 0.0, 1.0]))


def test_the_gain_at_the_cutoff_is_minus_3_db_and_the_phase_zero():
    cutoff = 2.0
    times = np.arange(600) / 120
    wave = np.sin(2 * np.pi * cutoff * times)
    middle = slice(150, 450)
    smooth = gaussian_smooth(wave[:, None], times, cutoff)[middle, 0]
    gain = (smooth @ wave[middle]) / (wave[middle] @ wave[middle])
    assert np.isclose(gain, 1 / np.sqrt(2), atol=0.01)
    assert np.abs(smooth - gain * wave[middle]).max() < 0.01


def test_frames_at_uneven_times_are_averaged_with_the_weights_of_the_gaussian():
    times = np.array([0, 0.02, 0.05, 0.06, 0.1, 0.13])
    values = np.random.default_rng(5).normal(size=(6, 2, 2))
    sigma = np.sqrt(np.log(2)) / (2 * np.pi * 2.0)  # 66 ms
    w = np.exp(-0.5 * ((times[:, None] - times) / sigma) ** 2)
    expected = np.einsum("st,tij->sij", w, values) / w.sum(axis=1)[:, None, None]
    assert np.allclose(gaussian_smooth(values, times, 2.0), expected, atol=1e-12)


def test_quaternions_are_of_unit_length_and_have_no_jumps():
    R = turn(np.stack([np.linspace(0, 6 * np.pi, 50), np.linspace(3, -9, 50)], axis=1))
    q = continuous_quaternions(R)
    assert np.allclose(np.linalg.norm(q, axis=-1), 1)
    assert (np.sum(q[1:] * q[:-1], axis=-1) > 0.9).all()
    assert np.allclose(matrix_from_quaternion(q), R)


def test_rotations_stay_rotations_and_cross_pi_without_a_jump():
    times = np.arange(240) / 60
    R = turn(np.linspace(0, 4 * np.pi, 240) + 0.05 * np.random.default_rng(1).normal(size=240))[
        :, None
    ]
    smooth = smooth_rotations(R, times)
    assert np.allclose(smooth @ np.swapaxes(smooth, -1, -2), np.eye(3), atol=1e-9)
    steps = log(np.swapaxes(smooth[:-1, 0], -1, -2) @ smooth[1:, 0])
    assert np.linalg.norm(steps, axis=-1).max() < 2.0 * (4 * np.pi / 239)


def test_the_root_keeps_its_image_position_while_depth_is_smoothed():
    times = np.arange(120) / 30
    depth = 4 + 0.3 * np.random.default_rng(2).normal(size=120)
    root = np.stack([0.2 * depth, -0.1 * depth, depth], 1)
    smooth = smooth_root(root, times)
    assert np.allclose(smooth[:, 0] / smooth[:, 2], 0.2)
    assert np.allclose(smooth[:, 1] / smooth[:, 2], -0.1)
    assert smooth[20:-20, 2].std() < 0.35 * depth.std()


def test_gaps_are_interpolated_in_time_and_extended_at_the_ends():
    times = np.array([0, 1, 2, 4, 5.0])
    valid = np.array([False, True, False, True, False])
    got = fill_gaps(np.array([[9.0], [1], [9], [4], [9]]), valid, times)
    assert np.allclose(got[:, 0], [1, 1, 2, 4, 4])
    R = turn(np.array([9, 0.2, 9, 0.8, 9]))[:, None]
    filled = fill_rotation_gaps(R, valid, times)
    angle = np.arctan2(filled[:, 0, 1, 0], filled[:, 0, 0, 0])
    assert np.allclose(angle[[0, 1, 3, 4]], [0.2, 0.2, 0.8, 0.8])
    assert np.isclose(angle[2], 0.4, atol=0.01)
