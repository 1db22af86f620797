# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses per second and latency of ./scripts/live on a paced 720p file, beside the rate of an
offline capture of it.

Both run as commands, in turns, so that other load on the machine affects both alike.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from .clips import there_and_back_clip

SIZE = (1280, 720)
SECONDS = 20.0
PRESETS = ("fast", "balanced")
# poses/s where the file is captured at the second rate; else a share
FULL_RATE = 28.0
OFFLINE_RATE = 45.0
SHARE = 0.6
BALANCED_RATE = 20.0
MEDIAN_MS = 90.0
P95_MS = 140.0


def rate(quick: bool) -> dict[str, Any]:
    """Measure, and return the figures."""
    video = there_and_back_clip(SECONDS, SIZE)
    rounds = 1 if quick else 3
    offline: list[float] = []
    live: dict[str, list[dict[str, Any]]] = {preset: [] for preset in PRESETS}
    load = []
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as folder:
            made = _command(
                "capture", str(video), "--quality", "fast", "-o", str(Path(folder) / "motion.npz")
            )
        offline.append(float(made["fps"]["total"]))
        for preset in PRESETS:
            load.append(os.getloadavg()[0])
            live[preset].append(_command("live", str(video), "--quality", preset))
    return {
        "cores": os.cpu_count(),
        "load": statistics.median(load),
        "offline_fast_fps": statistics.median(offline),
        "presets": {preset: _median(reports) for preset, reports in live.items()},
    }


def targets(offline_fps: float) -> dict[str, float]:
    """Return the poses per second that are to be reached, by preset."""
    return {
        "fast": FULL_RATE if offline_fps >= OFFLINE_RATE else SHARE * offline_fps,
        "balanced": BALANCED_RATE,
    }


def _median(reports: list[dict[str, Any]]) -> dict[str, float]:
    """Return the medians of some captures; the poses are divided by the footage's length, start-up
    included.
    """
    found = {
        "poses_per_second": [r["poses_per_second"] for r in reports],
        "poses_over_footage": [r["poses"] / SECONDS for r in reports],
        "median_ms": [r["latency_ms"]["median"] for r in reports],
        "p95_ms": [r["latency_ms"]["p95"] for r in reports],
        "dropped_share": [r["dropped"] / r["frames"] for r in reports],
    }
    return {name: statistics.median(values) for name, values in found.items()}


def _command(*arguments: str) -> dict[str, Any]:
    """Run a command of the shell and return its report; with the thread counts that users have."""
    environment = {
        name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")
    }
    command = [sys.executable, "-m", "scope.scope_addon", *arguments, "--json", "--quiet"]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    report: dict[str, Any] = json.loads(done.stdout)
    return report
