# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages to open in a browser, and the comparison of what it shows with the body model's own
results.

``compare_pages.py expect FOLDER`` writes a page about a made motion, a run of ./scripts/report with
made measurements, from which its page is written, and ``expected.json``: what joints, vertices and
silhouettes of these and of the captured sample are. ``compare_pages.py compare FOLDER`` compares
what the browser found: joints and vertices to 1 mm, silhouettes in the view through the capture's
camera by their overlap.
"""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scope.benchmarks.page.commands import Command, Outcome
from scope.benchmarks.page.recorded import Run, write_run
from scope.benchmarks.report import experiment_lines, table
from scope.scope_addon.capture.overlay_video import camera_vertices, draw_overlay
from scope.scope_addon.capture_report import Report
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.motion import Motion
from scope.scope_addon.notices import notice
from scope.scope_addon.report.capture_page import CapturedClip, write_capture_page
from scope.scope_addon.untrusted.body_file import load_body
from scope.solver.body import Body
from scope.solver.rotations import exp

CAPTURED = "captured.html"
MADE = "made <b>&amp; 'two'.html"
REPORT = "report.html"
ROWS = (40, 0, 77, 100)
VERTICES = tuple(range(0, 12972, 300))
LIMIT_MM = 1.0
OVERLAP = 0.9


def made_people(motion: Motion) -> list[Motion]:
    """Return two people before a camera that moves sideways, from a captured person; the second is
    lost for a while.
    """
    T = len(motion)
    world = motion.world_from_camera.copy()
    world[:, 0, 3] += np.linspace(-0.5, 0.5, T)
    other = replace(
        motion,
        trans=motion.trans + [0.9, 0.4, 0],
        valid=np.arange(T) % 50 > 9,
        world_from_camera=world,
    )
    return [replace(motion, world_from_camera=world), other]


def posed(motion: Motion, body: Body, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Return joints and vertices of a row in the world by the solver's body model."""
    betas = motion.betas.astype(float)
    states = exp(motion.poses[row].reshape(-1, 3).astype(float))
    R, t = body.forward_kinematics(states, motion.trans[row].astype(float), betas)
    return t, body.skin(R, t, betas)


def people_of(folder: Path) -> dict[str, list[Motion]]:
    """Return the motions of each page."""
    captured = Motion.load(folder / "captured.npz")
    return {CAPTURED: [captured], MADE: made_people(captured), REPORT: [captured]}


def made_run(report: dict[str, Any]) -> Run:
    """Return a run of the report: the captured sample, made measurements with every kind of table
    and plot, a failure.

    :param report: of the capture.
    """
    rows = [
        {"K": K, "P": P, "N": 3 * (K + 1), "sparse": K + P, "dense": 3.0 * K * (K + P)}
        for K in (23, 51)
        for P in range(0, 11, 5)
    ]
    clip = [
        {"K": K, "frames": T, "linearize_ms": K / 100, "step_ms": K / 50}
        for K in (23, 51)
        for T in (75, 150, 600)
    ]
    methods = {
        "<dense> & slow": {"mpjpe_root": 120.0, "ms": 400.0},
        "Scope": {"mpjpe_root": 60.0, "ms": 4.0},
    }
    worse = table(
        ("figure", "recorded", "now"),
        [("sample pa_mpjpe", 48.1, 60.0), ("<b>&amp;</b>", 1.0, None)],
    )
    return Run(
        [
            (
                "sample",
                SAMPLE,
                Outcome(Command(SAMPLE.name, "capture", (str(SAMPLE),)), "", "", report, 9.0, 0),
            )
        ],
        [
            Outcome(
                Command("Gate", "gate", ()), worse, "gate: pa_mpjpe is worse </script>", {}, 30.0, 1
            ),
            Outcome(
                Command("Solver", "bench", ("solver", "--quick")),
                experiment_lines(3, rows),
                "",
                {"experiments": {"3": rows}, "clip": clip},
                60.0,
                0,
            ),
            Outcome(
                Command("SMPLify", "bench", ("smplify",)),
                "",
                "",
                {"a": methods, "b": methods},
                60.0,
                0,
            ),
        ],
        "2026-01-02 03:04",
        {"Machine": "made", "Load before": "none"},
        quick=True,
    )


def expect(folder: Path) -> None:
    """Write the page of the made motion, and what the pages must show."""
    body = load_body("scope")
    of_page = people_of(folder)
    report: dict[str, Any] = json.loads((folder / "captured.json").read_text("utf-8"))
    warnings = [notice("cuts", footage="</script><script>alert(1)</script>", times=[2.0, 3.5])]
    of_two = replace(Report.from_json(report), people=2, warnings=warnings)
    clip = CapturedClip(SAMPLE, of_page[MADE], body, of_two, "made & 'two'")
    write_capture_page(folder / MADE, clip)
    (folder / "run").mkdir(exist_ok=True)
    shutil.copyfile(folder / "captured.npz", folder / "run" / "sample.npz")
    write_run(folder / "run", made_run(report))
    wanted = {
        name: {"rows": ROWS, "people": len(people), "vertices": VERTICES}
        for name, people in of_page.items()
    }
    (folder / "expected.json").write_text(json.dumps(wanted))


def compare(folder: Path) -> list[str]:
    """Return what the browser shows differently."""
    body = load_body("scope")
    problems = []
    found = json.loads((folder / "found.json").read_text("utf-8"))
    for name, people in people_of(folder).items():
        of_page = found[name]
        worst = 0.0
        for n, motion in enumerate(people):
            for row in ROWS:
                joints, vertices = posed(motion, body, row)
                for what, wanted in (("joints", joints), ("vertices", vertices[list(VERTICES)])):
                    off = 1e3 * float(
                        np.linalg.norm(np.array(of_page[what][f"{n} {row}"]) - wanted, axis=1).max()
                    )
                    worst = max(worst, off)
                    if not off < LIMIT_MM:
                        problems.append(
                            f"{name}: {what} of person {n + 1} at row {row} are {off:.2f} mm off"
                        )
        share = overlap(folder, name, people, body, of_page["view"])
        print(
            f"{name}: joints and vertices at most {worst:.2f} mm off, silhouettes overlap by "
            f"{share:.3f}"
        )
        if not share > OVERLAP:
            problems.append(
                f"{name}: the view through the camera shows the people elsewhere: "
                f"overlap {share:.2f}"
            )
    return problems


def overlap(
    folder: Path, name: str, people: list[Motion], body: Body, view: dict[str, float]
) -> float:
    """Return intersection over union of the bodies in the browser's 3D view and those of the
    overlay's rasterizer.
    """
    picture = cv2.imread(str(folder / f"{Path(name).stem}.camera.png"))
    left, top, width, height = (round(view[key]) for key in ("left", "top", "width", "height"))
    drawn = picture[top : top + height, left : left + width].astype(int)
    shown = drawn.max(axis=2) - drawn.min(axis=2) > 40  # the ground and its shadows are grey
    size = people[0].image_size.tolist()
    scale = min(width / size[0], height / size[1])
    K = np.diag([scale, scale, 1.0]) @ people[0].intrinsics
    K[:2, 2] += [(width - scale * size[0]) / 2, (height - scale * size[1]) / 2]
    blank = np.zeros((height, width, 3), np.uint8)
    bodies = [camera_vertices(motion, body, ROWS[0]) for motion in people]
    colors = [np.ones(3)] * len(bodies)
    opacities = [1.0] * len(bodies)
    overlay = draw_overlay(blank, bodies, body.faces, K, None, colors, opacities)
    wanted = overlay.any(axis=2)
    # not the paths
    opened = cv2.morphologyEx(shown.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0
    return float((opened & wanted).sum() / (opened | wanted).sum())


def main() -> int:
    """Run the command line; return 1 if the browser shows something else than the body model
    says.
    """
    command = sys.argv[1]
    folder = Path(sys.argv[2])
    if command == "expect":
        expect(folder)
        return 0
    problems = compare(folder)
    for problem in problems:
        print(f"browser: {problem}", file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
