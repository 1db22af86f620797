# SPDX-License-Identifier: GPL-3.0-or-later
"""What the key of a clip depends on, besides the footage, and when a clip counts as finished."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from scope.scope_addon.errors import NO_PERSON
from scope.scope_addon.footage import is_sequence, pictures_in
from scope.scope_addon.job.clip_task import CaptureSettings, ClipTask, Extras, capture_clip
from scope.scope_addon.job.request import program_version


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


def arguments_of(footage: Path, out: Path, settings: CaptureSettings) -> list[str]:
    """Return the arguments with which a clip is captured, which fails at once."""
    found: list[str] = []

    def run(arguments: list[str]) -> tuple[int, str, str]:
        found.extend(arguments)
        return 1, "", ""

    task = ClipTask("clip", footage.name, str(footage), str(out), "basis", settings)
    capture_clip(task, ["scope"], run)
    return found


def captured(
    footage: Path, settings: CaptureSettings, meanwhile: Callable[[], object], status: int = 0
) -> dict[str, Any]:
    """Return the entry of a clip in its folder, during whose capture something happens."""
    out = footage.parent
    result = out / "clip.npz"
    basis = settings.basis(program_version())

    def run(arguments: list[str]) -> tuple[int, str, str]:
        meanwhile()
        result.touch()
        return status, json.dumps({"outputs": [str(result)]}), ""

    task = ClipTask("clip", footage.name, str(footage), str(out), basis, settings)
    return capture_clip(task, ["scope"], run)


@pytest.mark.parametrize(("changed", "status"), [("a.mp4", 0), ("body.npz", NO_PERSON)])
def test_a_clip_is_not_finished_if_what_it_is_made_of_changed_after_its_key_was_made(
    tmp_path: Path, changed: str, status: int
) -> None:
    """Where that was undone later, the next batch skipped it."""
    for name in ("a.mp4", "body.npz"):
        (tmp_path / name).write_text("old")
    settings = CaptureSettings({"--body": str(tmp_path / "body.npz")}, (".npz",))
    change = partial((tmp_path / changed).write_text, "new")
    entry = captured(tmp_path / "a.mp4", settings, change, status)
    assert (entry["status"], "was changed" in entry["message"]) == ("failed", True)


def test_a_file_manager_that_looks_at_pictures_changes_no_footage(tmp_path: Path) -> None:
    frames = tmp_path / "frames"
    frames.mkdir()
    for name in ("f_1.png", "f_2.png"):
        (frames / name).write_text(name)

    def look() -> None:
        for name in (".DS_Store", "Thumbs.db", "._f_1.png"):
            (frames / name).write_text("thumbnails")

    assert captured(frames, CaptureSettings({}, (".npz",)), look)["status"] == "done"


@pytest.mark.parametrize(
    ("name", "options", "suffix"),
    [
        ("f_1.png", {"--fps": "30"}, ".mp4"),  # with f_2.png
        ("f_1.png", {}, ".png"),
        ("still.png", {"--fps": "30"}, ".png"),
        ("frames", {}, ".mp4"),
    ],
)
def test_the_overlay_of_a_sequence_is_a_video(
    tmp_path: Path, name: str, options: dict[str, str | None], suffix: str
) -> None:
    (tmp_path / "frames").mkdir()
    for each in ("f_1.png", "f_2.png", "still.png", "a.mp4"):
        (tmp_path / each).touch()
    settings = CaptureSettings(options, (".npz",), Extras(overlays=True))
    found = arguments_of(tmp_path / name, tmp_path, settings)
    assert found[found.index("--overlay") + 1] == str(tmp_path / f"clip.overlay{suffix}")


@pytest.mark.parametrize("first_alone", [False, True])
def test_the_numbers_of_pictures_count_since_they_are_times(
    tmp_path: Path, first_alone: bool
) -> None:
    """A batch skipped a sequence whose pictures had got other numbers, or, where the first one
    stands for all, other content.
    """
    frames = tmp_path / "frames"
    frames.mkdir()
    for number in (1, 2, 3):
        (frames / f"f_{number}.png").write_bytes(b"picture %d" % number)
    assert is_sequence(pictures_in(frames))
    footage = frames / "f_1.png" if first_alone else frames
    settings = CaptureSettings({"--fps": "30"} if first_alone else {}, (".npz",))

    def key() -> str:
        return arguments_of(footage, tmp_path, settings)[-1]

    keys = [key()]
    assert key() == keys[0]
    (frames / "f_3.png").rename(frames / "f_9.png")
    keys.append(key())
    (frames / "f_9.png").write_bytes(b"picture X")
    keys.append(key())
    assert len(set(keys)) == 3
