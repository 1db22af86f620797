# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench live [--part PART]... [--minutes M]`: what live captures cost, and how good
their poses are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...solver import Body, load_body
from ..report import table
from .endurance import SLOW_RATE, observed, played
from .offline import against_offline, on_a_simulated_machine
from .rate import MEDIAN_MS, P95_MS, rate, targets

USUAL = ("rate", "offline")  # without a choice: the others take as long as is asked for
MEASURES = {
    "difference": ("joints, median difference, mm", 25.0),
    "jitter": ("jitter over offline's, relative to the pelvis", 1.5),
    "jitter_world": ("the same in the world", 1.5),
    "foot_slide_cm": ("standing feet slide, cm", 2.0),
    "lowest_sole": ("lowest sole, mm", None),
    "pa_mpjpe_mm": ("PA-MPJPE, mm", None),
    "frames": ("frames compared", None),
    "poses": ("poses", None),
    "dropped": ("frames dropped", None),
}
WORLD = (
    "time_s",
    "poses",
    "not_seen",
    "memory_mb",
    "height_m",
    "tilt_deg",
    "stature_m",
    "focal_px",
)


def live(quick: bool, parts: Sequence[str] = (), minutes: float = 60.0) -> dict[str, Any]:
    """Measure the parts, print their tables as they come, and return the figures."""
    body = load_body("scope")
    figures = {}
    measurements = {
        "rate": _rate,
        "offline": _offline,
        "simulated": _simulated,
        "world": _world,
        "hour": _hour,
    }
    for part in parts or USUAL:
        figures[part] = measurements[part](body, quick, minutes)
    return figures


def _rate(_body: Body, quick: bool, _minutes: float) -> dict[str, Any]:
    found = rate(quick)
    wanted = targets(found["offline_fast_fps"])
    rows = [
        [
            preset,
            f["poses_per_second"],
            wanted[preset],
            f["median_ms"],
            f["p95_ms"],
            100 * f["dropped_share"],
        ]
        for preset, f in found["presets"].items()
    ]
    head = (
        "720p at 30 fps",
        "poses/s",
        "target",
        f"latency ms, median (≤ {MEDIAN_MS:g} with fast)",
    )
    print(table((*head, f"95 % (≤ {P95_MS:g})", "dropped %"), rows), end="\n\n")
    print(
        f"The same file captured offline with fast: {found['offline_fast_fps']:.1f} frames/s; "
        f"{found['cores']} cores,"
        f" load {found['load']:.1f}",
        end="\n\n",
        flush=True,
    )
    return found


def _offline(body: Body, quick: bool, _minutes: float) -> dict[str, Any]:
    found = against_offline(body, quick, lambda text: print(text, flush=True))
    _print_compared(found, ("offline", "every_frame", "real_time", "there_and_back"))
    return found


def _simulated(body: Body, quick: bool, _minutes: float) -> dict[str, Any]:
    found = on_a_simulated_machine(body, quick, lambda text: print(text, flush=True))
    _print_compared(found, ("offline", "newest_frames", "even_frames"))
    return found


def _print_compared(found: dict[str, Any], ways: Sequence[str]) -> None:
    rows = [
        [f"{name}, {how.replace('_', ' ')}", *(of_clip[how].get(key) for key in MEASURES)]
        for name, of_clip in found.items()
        for how in ways
        if how in of_clip
    ]
    head = [
        name + ("" if target is None else f" (≤ {target:g})") for name, target in MEASURES.values()
    ]
    print(table(("clip", *head), rows), end="\n\n", flush=True)


def _world(body: Body, _quick: bool, minutes: float) -> dict[str, Any]:
    found = {}
    for rate_shown in (None, SLOW_RATE):
        title = "every frame" if rate_shown is None else f"{rate_shown:g} poses/s"
        print(f"{minutes:g} minutes of frames, {title}", flush=True)
        found[title] = observed(body, minutes, rate_shown, _say)
        _print_world(found[title])
    return found


def _hour(body: Body, _quick: bool, minutes: float) -> dict[str, Any]:
    found = played(body, minutes, _say)
    _print_world(found)
    print(
        f"{found['poses']} of {found['frames']} frames processed, {found['dropped']} counted as "
        "dropped;"
        f" {found['poses_per_second']} poses/s; {found['cores']} cores, load {found['load']:.1f}",
        end="\n\n",
    )
    return found


def _say(row: dict[str, float]) -> None:
    print("  ".join(f"{key} {row[key]:.5g}" for key in WORLD), flush=True)


def _print_world(found: dict[str, Any]) -> None:
    rows = [[f"{row[key]:.6g}" for key in WORLD] for row in found["rows"]]
    print(table(WORLD, rows), end="\n\n")
    print(
        "Moved after the first seconds: "
        + ", ".join(f"{k} {v:.2g}" for k, v in found["drift"].items()),
        end="\n\n",
    )
