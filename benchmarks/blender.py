# SPDX-License-Identifier: GPL-3.0-or-later
"""Times for which an animator waits: writing keys, editing a captured motion, opening Blender, and
capturing in it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from . import frames
from .report import table

ROOT = Path(__file__).resolve().parents[1]
REAL = ROOT / "build" / "blender" / "root" / "scope" / "out"  # what ./scripts/blender writes
TARGETS = {"writing": 1.5, "working again": 1.0, "opening": 50.0, "timer gaps": 100.0}


def blender(quick: bool) -> dict[str, Any]:
    """Measure, print the table and return the figures; those that cannot be measured on this
    machine are None.
    """
    figures = _work(3 if quick else 11)
    figures["opening"] = _in_real_blender("startup", "startup.json")
    panel = None if quick else _in_real_blender("panel", "report.json")
    figures["timer_gap_ms"] = panel and panel["timer_gap_ms"]
    rows: list[list[object]] = [
        ["10,000 frames, 24 bones: keys, s", figures["writing"]["keys_s"], TARGETS["writing"]],
        [
            "the same and 52 expressions that all move, s",
            figures["writing"]["keys_with_face_s"],
            TARGETS["writing"],
        ],
        ["without the face, but the whole scene, s", figures["writing"]["whole_scene_s"], None],
    ]
    for length, found in figures["working_again"].items():
        target = TARGETS["working again"]
        rows += [
            [f"{what} again, {length.replace('_', ' ')}, s", seconds, target]
            for what, seconds in found.items()
        ]
    if figures["opening"]:
        opening = figures["opening"]
        rows.append(["opening Blender, with the extension, s", opening["enabled_s"], None])
        rows.append(["more than without, ms", opening["more_ms"], TARGETS["opening"]])
        rows.append(
            [
                "of that, for an empty extension with the same packages, ms",
                opening["empty_more_ms"],
                None,
            ]
        )
    if figures["timer_gap_ms"]:
        gap = figures["timer_gap_ms"]["p99"]
        rows.append(["gaps between timers while capturing, p99, ms", gap, TARGETS["timer gaps"]])
    print(table((f"Blender {figures['blender']}, medians", "measured", "target"), rows), end="\n\n")
    return figures


def _work(rounds: int) -> dict[str, Any]:
    """Return the figures of ``blender_work``, run in a separate process because Blender's module
    can hang at exit.
    """
    frames.CACHE.mkdir(parents=True, exist_ok=True)
    motion = frames.CACHE / "sample.npz"
    if not motion.is_file():
        command = (
            "scope.scope_addon",
            "capture",
            "--quality",
            "fast",
            "--quiet",
            "-o",
            str(motion),
        )
        subprocess.run([sys.executable, "-m", *command], check=True)
    work = ("scope.benchmarks.blender_work", str(motion), str(rounds))
    done = subprocess.run(
        [sys.executable, "-m", *work], stdout=subprocess.PIPE, text=True, check=True
    )
    figures: dict[str, Any] = json.loads(
        next(line for line in done.stdout.splitlines() if line.startswith("{"))
    )
    return figures


def _in_real_blender(part: str, file: str) -> dict[str, Any] | None:
    """Run one part of ./scripts/blender, which needs root and Debian; return None, and print why,
    if it fails.
    """
    environment = {
        name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")
    }
    command = [str(ROOT / "scripts" / "blender"), "--part", part]
    done = subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=False)
    if done.returncode:
        print(f"{part}: not measured, see above", file=sys.stderr)
        return None
    figures: dict[str, Any] = json.loads((REAL / file).read_text("utf-8"))
    return figures
