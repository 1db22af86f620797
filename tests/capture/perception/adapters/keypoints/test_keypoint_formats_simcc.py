# SPDX-License-Identifier: GPL-3.0-or-later
"""SimCC networks on small graphs that detect coloured spots at known pixels, in various regions and sizes."""

from __future__ import annotations

from pathlib import Path

import pytest
from scope.scope_addon.capture.perception.region import Region

from ....small_graphs import simcc
from .spots_in_picture import REGIONS, SIZES, assert_finds_the_spots


@pytest.mark.parametrize("region", REGIONS.values(), ids=REGIONS)
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_known_pixels_are_found(tmp_path: Path, region: Region, size: tuple[int, int]) -> None:
    assert_finds_the_spots(simcc(tmp_path / "m.onnx", 17, *size), region, atol=0.8)
