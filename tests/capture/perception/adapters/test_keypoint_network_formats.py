# SPDX-License-Identifier: GPL-3.0-or-later
"""Heatmap and SimCC networks on small graphs: coloured spots at known pixels, and maxima between
cells.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.perception.adapters.keypoint_network import KeypointNetwork
from scope.scope_addon.capture.perception.region import Region

from ...small_graphs import fixed, heatmaps, simcc
from .spots_in_picture import REGIONS, SIZES, assert_finds_the_spots


@pytest.mark.parametrize("region", REGIONS.values(), ids=REGIONS)
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_known_pixels_are_found_in_heatmaps(
    tmp_path: Path, region: Region, size: tuple[int, int]
) -> None:
    assert_finds_the_spots(heatmaps(tmp_path / "m.onnx", 17, *size), region, atol=1.0)


@pytest.mark.parametrize("how", ["dark", "quarter"])
@pytest.mark.parametrize("udp", [False, True])
def test_heatmap_peaks_between_cells(tmp_path: Path, how: str, udp: bool) -> None:
    """Gaussians with known sub-cell centres: DARK finds them exactly, the quarter offset
    roughly.
    """
    rng = np.random.default_rng(3)
    middle = rng.uniform([6, 6], [41, 57], (17, 2))
    y, x = np.mgrid[:64, :48]
    maps = [np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * 2.0**2)) for u, v in middle]
    path = fixed(
        tmp_path / "m.onnx", 192, 256, {"heatmaps": np.stack(maps)[None].astype(np.float32)}
    )
    path.with_suffix(".json").write_text(json.dumps({"decode": how, "udp": udp}))
    network = KeypointNetwork(path, threads=1)
    points, scores = network._format.decode(
        network._graph.trial_outputs, network._graph, network._description
    )
    pixels = middle * ([191 / 47, 255 / 63] if udp else 4.0)
    assert np.abs(points - pixels).max() < (0.05 if how == "dark" else 1.1)
    assert scores.min() > 0.9


@pytest.mark.parametrize("region", REGIONS.values(), ids=REGIONS)
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_known_pixels_are_found_by_simcc(
    tmp_path: Path, region: Region, size: tuple[int, int]
) -> None:
    assert_finds_the_spots(simcc(tmp_path / "m.onnx", 17, *size), region, atol=0.8)
