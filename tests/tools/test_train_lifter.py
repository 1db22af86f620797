# SPDX-License-Identifier: GPL-3.0-or-later
"""What the lifter learns from is what captures give it, and what is exported is what was
trained.
"""

import numpy as np
import pytest
from scope.scope_addon.capture.perception import lifter
from scope.scope_addon.capture.perception.lifter import (
    WINDOW,
    Lifter,
)

from ..required import missing, package


@pytest.fixture
def torch():
    """PyTorch, which takes seconds to load: not while tests are collected."""
    try:
        import torch
    except ImportError:
        missing(
            "torch is not installed, which trains the lifting network: pip install torch",
            "SCOPE_WITHOUT_TRAINING",
        )
    torch.set_num_threads(1)  # With more, small batches wait for other processes' threads.
    torch.manual_seed(0)
    return torch


def test_the_input_is_that_of_captures(torch):
    """`network_input` of the product is the second implementation."""
    from scope.tools.train_lifter import network_input

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


def test_the_exported_network_is_the_trained_one(torch, tmp_path):
    package("onnx")
    from scope.tools.train_lifter.export import export, read_exported
    from scope.tools.train_lifter.network import LiftingNetwork

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
