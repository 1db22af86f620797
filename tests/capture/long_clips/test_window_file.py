# SPDX-License-Identifier: GPL-3.0-or-later
"""The file of a window holds everything, and one that is damaged or of another window counts for
nothing.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scope.scope_addon.capture.camera.background_record import BackgroundRecord
from scope.scope_addon.capture.camera.corner_tracks import CornerTracks
from scope.scope_addon.capture.camera.heading_drift import FrameEdges
from scope.scope_addon.capture.camera.line_segments import Segments
from scope.scope_addon.capture.frame_observer import Observed, Window
from scope.scope_addon.capture.long_clips.window_file import (
    _digest,
    known_reference,
    load_window,
    save_window,
    window_name,
)
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.perception.face_record import RECORD
from scope.scope_addon.capture.perception.observation import PersonMask
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.track import Tracklet
from scope.scope_addon.notices import notice

SIZE = (640, 480)
FRAMES = 12
WINDOW = Window(3, 7.5, 8.0, 12.0)


NOTICE = notice("cuts", footage="a.mp4", times=[0.5])


def record(seed: int = 0) -> Observed:
    rng = np.random.default_rng(seed)
    edges = [
        FrameEdges(0, Segments(rng.random((4, 2, 2)), rng.random(4))),
        FrameEdges(5, Segments.none()),
    ]
    times = 7.5 + np.arange(FRAMES) / 4
    background = BackgroundRecord(
        times,
        rng.random((FRAMES, 3, 3)),
        rng.random(FRAMES) > 0.5,
        [0.9, 0.8],
        edges,
        [rng.random(4)],
    )
    region = Region((100.0, 90.0), 80.0, 0.1)
    people = {}
    for number, rows in {0: range(FRAMES), 4: range(3, 9)}.items():
        n = len(rows)
        people[number] = Tracklet(
            list(rows),
            list(rng.random((n, 33, 6), np.float32)),
            list(rng.random((n, 2))),
            (1 + rng.random(n)).tolist(),
            rng.random(36),
            [(rows[1], known_reference(rng.random((33, 3)))), (rows[2], known_reference(None))],
            list(rng.random((n, 2, 21, 7), np.float32)),
            [(rows[0], PersonMask(region, rng.random((256, 256)).astype(np.float16), SIZE))],
            list(rng.random((n, RECORD), np.float32)),
        )
    sums = rng.integers(0, 2**32, FRAMES, np.uint32).tolist()
    indices = list(range(30, 30 + FRAMES))
    return Observed(
        indices,
        times.tolist(),
        [4],
        people,
        background,
        "CPU",
        [NOTICE],
        WINDOW,
        2,
        9,
        sums,
        [region],
        rng.random(FRAMES).tolist(),
    )


def plain(value: Any) -> Any:
    """The content of a record, for comparison."""
    if hasattr(value, "result"):
        return plain(value.result())
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return plain(vars(value)) if hasattr(value, "__dict__") else value


def test_everything_is_read_as_it_was_written(tmp_path: Path) -> None:
    made = record()
    nobody = replace(made, tracklets={}, anchor_regions=[], cut_rows=[], warnings=[])
    for each in (made, nobody):
        save_window(tmp_path, each)
        read = load_window(tmp_path, WINDOW)
        assert read is not None
        assert plain(read) == plain(each)


def test_the_file_of_another_window_counts_for_nothing(tmp_path: Path) -> None:
    assert load_window(tmp_path, WINDOW) is None
    save_window(tmp_path, record())
    assert load_window(tmp_path, replace(WINDOW, end_s=11.0)) is None


def test_a_file_without_an_array_or_with_another_version_s_text_counts_for_nothing(
    tmp_path: Path,
) -> None:
    path = save_window(tmp_path, record())
    arrays = dict(np.load(path))
    missing = {name: array for name, array in arrays.items() if name != "array0"}
    objects = arrays | {"array0": np.array([{}], object)}
    renamed = arrays["json"].tobytes().replace(b'"sides_px"', b'"sides"')
    other_version = arrays | {"json": np.frombuffer(renamed, np.uint8)}
    no_text = arrays | {"json": arrays["json"][:-1]}
    for damaged in (missing, objects, other_version, no_text):
        np.savez(path, **damaged)
        assert load_window(tmp_path, WINDOW) is None


@pytest.mark.parametrize(
    "change",
    [
        lambda r: r.tracklets[0].values[0].__setitem__((0, 0), np.nan),
        lambda r: r.tracklets[0].rows.__setitem__(-1, FRAMES),
        lambda r: r.tracklets[0].rows.__setitem__(1, 0),
        lambda r: r.tracklets[0].rows.__setitem__(0, 0.5),
        lambda r: r.tracklets[0].hands.pop(),
        lambda r: r.tracklets[4].sides_px.__setitem__(0, 0.0),
        lambda r: r.tracklets[4].references.__setitem__(0, (99, known_reference(None))),
        lambda r: r.anchor_regions.__setitem__(0, Region((0.0, 0.0), -1.0, 0.0)),
        lambda r: r.timestamps.__setitem__(4, 0.0),
        lambda r: r.picture_changes.__setitem__(4, np.nan),
        lambda r: r.picture_changes.pop(),
        lambda r: setattr(r, "background", None),
        lambda r: setattr(r, "first", FRAMES + 1),
        lambda r: r.cut_rows.__setitem__(0, 0),
        lambda r: r.background.bars.__setitem__(0, np.zeros(3)),
        lambda r: r.background.edge_frames.__setitem__(0, FrameEdges(FRAMES, Segments.none())),
        lambda r: setattr(
            r,
            "background",
            replace(
                r.background,
                corners=CornerTracks(
                    np.zeros(1, np.int64), np.full(1, 2**40), np.zeros((1, 2), np.float32)
                ),
            ),
        ),
    ],
)
def test_numbers_that_do_not_fit_make_a_file_worthless(
    tmp_path: Path, change: Callable[[Observed], object]
) -> None:
    made = record()
    change(made)
    save_window(tmp_path, made)
    assert load_window(tmp_path, WINDOW) is None


@pytest.mark.skipif(os.name == "nt", reason="Windows needs a privilege for links")
def test_what_a_link_of_a_windows_name_leads_to_stays(tmp_path: Path) -> None:
    mine = tmp_path / "mine.npz"
    mine.write_bytes(b"mine")
    (tmp_path / window_name(WINDOW.number)).symlink_to(mine)
    save_window(tmp_path, record())
    assert mine.read_bytes() == b"mine"
    assert load_window(tmp_path, WINDOW) is not None


@pytest.mark.parametrize("name", ["cameras.toml", "cameras.toml#left"])
def test_windows_of_another_calibration_are_not_continued(tmp_path: Path, name: str) -> None:
    """Also where the camera is named after its file."""
    file = tmp_path / "cameras.toml"
    options = CaptureOptions(calibration=tmp_path / name)
    digests = []
    for content in ("one", "one", "two"):
        file.write_text(content)
        digests.append(_digest(options))
    assert digests[0] == digests[1] != digests[2]
