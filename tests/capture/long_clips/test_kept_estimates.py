# SPDX-License-Identifier: GPL-3.0-or-later
"""Kept estimates are found again bit for bit, only for the same network, pixels and region; damage
costs only time.
"""

from __future__ import annotations

import gc
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.long_clips import kept_estimates
from scope.scope_addon.capture.long_clips.kept_estimates import KeptEstimates
from scope.scope_addon.capture.perception.region import Region

REGION = Region((100.25, 50.5), 64.0, 0.1)
CROP = np.arange(256 * 256 * 3, dtype=np.uint32).astype(np.uint8).reshape(256, 256, 3)


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every estimate is written when it is added."""
    monkeypatch.setattr(kept_estimates, "INTERVAL_S", 0.0)


def keep(folder: Path, rows: int = 3) -> np.ndarray:
    """Keep some estimates, of which the regions differ, and return them."""
    values = np.random.default_rng(0).normal(size=(rows, 7))
    kept = KeptEstimates(folder)
    for side, row in enumerate(values):
        kept.add(kept.key("net", CROP, replace(REGION, side_px=side)), row)
    return values


def found(folder: Path, rows: int = 3) -> list[np.ndarray | None]:
    kept = KeptEstimates(folder)
    return [kept.find(kept.key("net", CROP, replace(REGION, side_px=side))) for side in range(rows)]


def test_estimates_are_found_again(tmp_path):
    values = keep(tmp_path / "new" / "folder")
    assert np.array_equal(found(tmp_path / "new" / "folder"), values)


def test_only_the_same_network_region_and_pixels_count(tmp_path):
    kept = KeptEstimates(tmp_path)
    other = CROP.copy()
    other[128, 128] += 1
    key = kept.key("net", CROP, REGION)
    kept.add(key, np.ones(7))
    kept = KeptEstimates(tmp_path)
    assert kept.find(key) is not None
    for different in (
        kept.key("other", CROP, REGION),
        kept.key("net", other, REGION),
        kept.key("net", CROP, replace(REGION, rotation=0.1 + 1e-6)),
    ):
        assert kept.find(different) is None


@pytest.mark.parametrize("part", [0.0, 0.95])
def test_a_damaged_file_is_ignored(tmp_path, part):
    keep(tmp_path)
    damaged = sorted(tmp_path.iterdir())[1]
    content = damaged.read_bytes()
    damaged.write_bytes(content[: int(part * len(content))])
    assert [row is None for row in found(tmp_path)] == [False, True, False]


@pytest.mark.parametrize(
    "arrays",
    [
        {"keys": np.zeros((3, 16)), "values": np.zeros((3, 7))},
        {"keys": np.zeros((3, 16), np.uint8)},
        {"keys": np.zeros((3, 16), np.uint8), "values": np.full((3, 7), np.nan)},
        {"keys": np.zeros((3, 16), np.uint8), "values": np.zeros((2, 7))},
    ],
)
def test_a_file_of_something_else_is_ignored(tmp_path, arrays):
    np.savez(tmp_path / "0.npz", **arrays)
    assert KeptEstimates(tmp_path).find(bytes(16)) is None


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path):
    (tmp_path / "file").write_text("")
    keep(tmp_path / "file")
    assert (tmp_path / "file").read_text("utf-8") == ""


@pytest.mark.skipif(os.name == "nt", reason="Windows needs a privilege for links")
def test_nothing_is_kept_where_a_link_in_the_place_of_the_folder_leads(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "mine")
    keep(tmp_path / "link")
    assert list((tmp_path / "mine").iterdir()) == []


def test_no_more_than_so_much_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(kept_estimates, "LARGEST", 1000)
    keep(tmp_path, rows=9)
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 2000


@pytest.mark.skipif(sys.platform == "win32", reason="there is no limit on the size of a file")
def test_on_a_full_disk_nothing_is_kept_and_nothing_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A half-written zip file printed a traceback when it was destroyed."""
    resource = pytest.importorskip("resource")
    unraisable = list[object]()
    gc.collect()  # what other tests have left
    monkeypatch.setattr(sys, "unraisablehook", unraisable.append)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    kept = KeptEstimates(tmp_path)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        kept.add(kept.key("net", CROP, REGION), np.ones(9000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    gc.collect()
    assert list(tmp_path.iterdir()) == []
    assert unraisable == []
