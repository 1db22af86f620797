# SPDX-License-Identifier: GPL-3.0-or-later
"""Which files of a folder are clips, and that each clip's results have a name of their own."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from scope.scope_addon.job.clip_task import find_clips, videos_of_take


def found_in(
    folder: Path, *, recursive: bool = False, several_people: bool = False, **given: bool
) -> dict[str, Path]:
    return find_clips(
        folder, folder / "out", recursive=recursive, several_people=several_people, **given
    )


def test_videos_images_and_sequences_are_found_and_results_are_not(tmp_path):
    (tmp_path / "below" / "deep").mkdir(parents=True)
    for name in (
        "a.mp4",
        "a.mov",
        "b.mp4",
        "b.overlay.mp4",
        "below/c.mp4",
        "below/deep/d.mp4",
        ".hidden.mp4",
    ):
        (tmp_path / name).write_text("x")
    (tmp_path / "e.HEIC").write_bytes(b"cannot be read")
    for folder, names in {
        "walk": [f"frame{i:03}.png" for i in range(3)],
        "photos": ["tree_1.png", "house_2.png"],
        "out": ["old.mp4"],
    }.items():
        (tmp_path / folder).mkdir()
        for name in names:
            (tmp_path / folder / name).write_text("x")
    flat = found_in(tmp_path)
    assert list(flat) == ["a.mov", "a.mp4", "b", "e", "walk"]
    assert flat["walk"] == tmp_path / "walk"
    below = ["below/c", "below/deep/d", "e", "photos/house_2", "photos/tree_1"]
    assert list(found_in(tmp_path, recursive=True)) == ["a.mov", "a.mp4", "b", *below, "walk"]


def test_numbered_pictures_are_one_clip_if_a_rate_is_given(tmp_path):
    """With a rate, a capture of the first one reads all that continue it, and each of the others
    was captured with the rest as well.
    """
    loose = [f"IMG_{number:04}.jpg" for number in range(8, 12)]
    others = ["IMG_0009.png", "walk_2.jpg", "walk_3.JPG", "still.jpg", "take2.mp4", "take3.mp4"]
    below = ["below/a_2.png", "below/a_3.png"]
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "cut.mp4").touch()  # so that it is no folder of one sequence
    for name in [*loose, *others, *below]:
        (tmp_path / name).touch()
    found = found_in(tmp_path, recursive=True, rate_given=True)
    names = {path.relative_to(tmp_path).as_posix() for path in found.values()}
    assert names == {loose[0], *others, below[0], "below/cut.mp4"}
    assert len(found_in(tmp_path, recursive=True)) == len([*loose, *others, *below]) + 1


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows keeps its pipes in no folder")
def test_a_pipe_is_not_a_clip_and_a_broken_link_is(tmp_path):
    os.mkfifo(tmp_path / "pipe.mp4")
    (tmp_path / "gone.mp4").symlink_to(tmp_path / "nowhere.mp4")
    found = found_in(tmp_path)
    assert sorted(found) == ["gone.mp4"]


def test_results_are_different_files_also_where_case_does_not_count(tmp_path):
    clips = tmp_path / "clips"
    names = ("Walk.mp4", "walk.mp4", "Run.mov", "run.mp4", "A/x.mp4", "a/x.mp4")
    paths = [clips / name for name in names]
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
    if len(list(clips.iterdir())) < 6:
        pytest.skip("case does not count in this folder")
    found = found_in(clips, recursive=True)
    assert sorted(found.values()) == sorted(paths)
    assert len({name.casefold() for name in found}) == 6


def test_names_are_unique_where_one_equals_another_without_suffix(tmp_path):
    clips = tmp_path / "clips"
    (clips / "b.mp4").mkdir(parents=True)
    for i in range(3):
        (clips / "b.mp4" / f"frame{i:03}.png").write_text("x")
    names = ["A.mp4.mp4.mov", "a.mov", "a.mp4", "a.mp4.mp4", "b.mp4.mov", "c.mp4.mov"]
    for name in names:
        (clips / name).write_text("x")
    found = found_in(clips)
    assert {name: path.name for name, path in found.items()} == {
        n: n for n in [*names[:5], "b.mp4"]
    } | {"c.mp4": "c.mp4.mov"}


def test_links_to_a_folder_above_are_not_followed(tmp_path):
    """They would lead round and round, and each clip be found again each time."""
    below = tmp_path / "clips" / "day"
    below.mkdir(parents=True)
    (below / "walk.mp4").touch()
    (below / "up").symlink_to(tmp_path / "clips")
    (below / "here").symlink_to(below)
    found = find_clips(tmp_path / "clips", tmp_path / "out", recursive=True, several_people=False)
    assert found == {"day/walk": below / "walk.mp4"}


def test_videos_of_a_subfolder_are_one_clip_if_they_are_views(tmp_path):
    for name in (
        "alone.mp4",
        "walk/right.mp4",
        "walk/left.mov",
        "walk/.hidden.mp4",
        "walk/left.overlay.mp4",
        "single/only.mp4",
        "day/jump/a.mp4",
        "day/jump/b.mp4",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x")
    found = found_in(tmp_path, views=True)
    assert sorted(found) == ["alone", "single/only", "walk"]
    assert [path.name for path in videos_of_take(found["walk"])] == ["left.mov", "right.mp4"]
    for name in ("again/c.mp4", "again/d.mp4", "close/e.mp4", "frames/1.png", "frames/2.png"):
        (tmp_path / "walk" / name).parent.mkdir(exist_ok=True)
        (tmp_path / "walk" / name).write_text("x")
    (tmp_path / "walk" / "poster.png").write_text("x")  # no view, and no clip of its own
    assert sorted(found_in(tmp_path, views=True)) == ["alone", "single/only", "walk"]
    within = ["walk/again", "walk/close/e", "walk/frames"]
    deep = ["alone", "day/jump", "single/only", "walk", *within]
    assert sorted(found_in(tmp_path, views=True, recursive=True)) == deep
    assert sorted(found_in(tmp_path)) == ["alone"]
