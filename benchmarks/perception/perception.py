# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench perception`: accuracy against ground truth, frames per second."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from ...scope_addon.capture.options import CaptureOptions
from ...solver import Body, load_body
from ..frames import DATA
from ..report import table
from .accuracy import CAMERAS, SHOWN, calibration, evaluate_all
from .throughput import decoding, end_to_end, looped, side_by_side, warm_up

LONG_CLIP = "clips/run_moving_camera.mp4"
TWO_PEOPLE = "clips/two_people_portrait.mp4"
PRESETS = ("fast", "balanced", "best")
SPEED_TARGETS = {"fast": 60.0, CaptureOptions().quality: 30.0}


def perception(quick: bool) -> dict[str, Any]:
    """Measure everything, print the tables as they come, return the figures."""
    if not DATA.is_dir():
        print(f"{DATA} does not exist: nothing was measured; put the clips there", file=sys.stderr)
        return {}
    body = load_body("scope")
    warm_up(body)
    figures = _speed(body, quick)
    figures |= _accuracy(body)
    if not quick:
        presets = {q: evaluate_all(body, _always(CaptureOptions(quality=q))) for q in PRESETS}
        figures["presets"] = {q: _show(q, found) for q, found in presets.items()}
    return figures


def _speed(body: Body, quick: bool) -> dict[str, Any]:
    default = CaptureOptions().quality
    frames, rounds = (450, 1) if quick else (1800, 3)
    video = looped(LONG_CLIP, frames)
    presets = {}
    for quality in (default,) if quick else PRESETS:
        presets[quality] = side_by_side(body, video, quality, 300, rounds)
    # The clip has 12 frames per second, so detection and left-right decisions take a larger share
    # of each frame.
    pairs = {
        name: end_to_end(body, looped(TWO_PEOPLE, 300 if quick else 600, fps), "fast", 2)
        for name, fps in (("30 a second", 30.0), ("12 a second", None))
    }
    pair = pairs["30 a second"]
    chosen = presets[default]
    fps = {
        key: chosen[key]
        for key in ("end_to_end", "mediapipe", "networks", "solver", "over_mediapipe")
    }
    fps |= {"decode": decoding(video), "two_people_fast": pair["end_to_end"]}
    rows = [
        [
            q,
            f["end_to_end"],
            SPEED_TARGETS.get(q),
            f["networks"],
            f["solver"],
            f["cpu_ms_per_frame"],
            f["mediapipe"],
            f["over_mediapipe"],
        ]
        for q, f in presets.items()
    ]
    rows += [
        ["fast, two people, "
         f"{name}", f["end_to_end"], 35.0, f["networks"], f["solver"], f["cpu_ms_per_frame"], None,
         None]
        for name, f in pairs.items()
    ]  # fmt: skip
    head = (
        "preset",
        "end to end",
        "target",
        "networks",
        "solver",
        "CPU ms/frame",
        "MediaPipe",
        "ratio, target 1.5",
    )
    print(
        f"Frames per second, {frames} frames of 1080p; decoding alone {fps['decode']:.0f}; "
        f"default: {default}\n"
    )
    print(table(head, rows), end="\n\n", flush=True)
    both = {"two_people_fast": pair, "two_people_fast_12": pairs["12 a second"]}
    return {"fps": fps, "fps_presets": {**presets, **both}, "default": default}


def _accuracy(body: Body) -> dict[str, Any]:
    estimated = evaluate_all(body, lambda _: CaptureOptions())
    given = evaluate_all(body, lambda camera: CaptureOptions(calibration=calibration(camera)))
    head = ("default preset", *(heading for heading, _ in SHOWN.values()))
    rows: list[list[object]] = [["target", *(target for _, target in SHOWN.values())]]
    for name, found in (("estimated", estimated), ("given", given)):
        rows += [
            [f"{camera}, {name} intrinsics", *_row(found[camera])] for camera in (*CAMERAS, "mean")
        ]
    print(table(head, rows), end="\n\n", flush=True)
    return {"clips": estimated, "clips_given_intrinsics": given}


def _always(options: CaptureOptions) -> Callable[[str], CaptureOptions]:
    return lambda _: options


def _show(quality: str, found: dict[str, dict[str, Any]]) -> dict[str, Any]:
    print(
        table(
            (quality, *(heading for heading, _ in SHOWN.values())), [["mean", *_row(found["mean"])]]
        ),
        end="\n\n",
    )
    return found["mean"]


def _row(figures: dict[str, Any]) -> list[float]:
    return [figures[key] for key in SHOWN]
