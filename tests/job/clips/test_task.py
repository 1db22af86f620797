# SPDX-License-Identifier: GPL-3.0-or-later
"""What the key of a clip depends on, besides the footage."""

from __future__ import annotations

from pathlib import Path

from scope.scope_addon.job.clip_task import CaptureSettings


def basis(**options: str | None) -> str:
    return CaptureSettings(
        {f"--{name}": value for name, value in options.items()}, (".npz",)
    ).basis("version")


def test_files_count_by_their_content_and_threads_do_not(tmp_path: Path) -> None:
    network = tmp_path / "net.onnx"
    description = tmp_path / "net.json"
    network.write_text("network")
    first = basis(keypoints=str(network), threads="1")
    assert basis(keypoints=str(network), threads="2") == first
    description.write_text("{}")
    assert basis(keypoints=str(network), threads="1") != first


def test_a_value_that_is_too_long_for_a_name_is_no_file() -> None:
    heights = ",".join(["170"] * 100)
    assert basis(height=heights) != basis(height=heights + ",171")
