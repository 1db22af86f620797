# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the files written by the real Blender with the shell's results: ``compare.py VIDEO
WORK_FOLDER PART...``.
"""

from __future__ import annotations

import json
import sys
import zipfile
from pathlib import Path

import numpy as np
from scope.scope_addon.cli import main as shell

TOLERANCE_M = 0.001  # median over joints; another build of the same libraries rounds differently


def apart(a: Path, b: Path) -> dict[str, float]:
    """Return the distances between two motions' joints, in millimetres."""
    with np.load(a) as one, np.load(b) as other:
        distance = np.abs(one["joints_cam"] - other["joints_cam"]).max(axis=-1)
    return {"median": float(np.median(distance) * 1e3), "largest": float(distance.max() * 1e3)}


def missing(folder: Path, names: list[str]) -> list[str]:
    """Return a message for each file that is missing or empty."""
    sizes = {
        name: (folder / name).stat().st_size if (folder / name).is_file() else 0 for name in names
    }
    return [f"{name} was not written" for name, size in sizes.items() if not size]


def written_into_the_extension(work: Path) -> list[str]:
    """Return a message for each file in an installed extension's folder that the zip did not bring.

    The byte code of a module is Python's own, also half of it where a process was killed; no other
    file may be there, such as a result or compiled kernel.
    """
    with zipfile.ZipFile(work / "scope.zip") as file:
        shipped = set(file.namelist())
    problems = []
    inside_home = ".config/blender/*/extensions/user_default/scope"
    for folder in [*work.glob(f"home/{inside_home}"), *work.glob(f"homes/*/{inside_home}")]:
        found = {
            str(p.relative_to(folder))
            for p in folder.rglob("*")
            if p.is_file() and ".pyc" not in p.name
        }
        problems += [f"{name} was written into {folder}" for name in sorted(found - shipped)]
        problems += [
            f"{name} is gone from {folder}"
            for name in sorted(n for n in shipped - found if n[-1] != "/")
        ]
    return problems


def panel(video: Path, out: Path, shell_out: Path, report: dict) -> list[str]:
    """Return the report of the session in the window."""
    report |= json.loads((out / "report.json").read_text("utf-8"))
    shell(
        ["capture", str(video), "--quality", "fast", "--quiet", "-o", str(shell_out / "panel.npz")]
    )
    distance = report["window_from_shell_mm"] = apart(out / "motion.npz", shell_out / "panel.npz")
    problems = missing(out, report["exports"])
    if distance["median"] > 1e3 * TOLERANCE_M:
        problems.append("the window's motion is not the shell's")
    if report["lowest_skin_m"] < -0.0105:
        problems.append(f"the body goes {-100 * report['lowest_skin_m']:.1f} cm under the floor")
    if report["mouse_chose"] != "FAST":
        problems.append("the mouse did not reach the panel's buttons")
    if report["after_escape_elsewhere"] != {"capturing": True}:
        problems.append(f"Escape over the viewport: {report['after_escape_elsewhere']}")
    if report["left_after_cancel"]:
        problems.append(f"cancelling left {report['left_after_cancel']}")
    # Below 100 on a quiet machine. Without a graphics card, drawing has to wait for what else runs.
    if report["timer_gap_ms"]["p99"] > 1000 * max(1.0, report["load_per_core"]):
        problems.append("the window hung")
    if report["main_thread_ms"]["p99"] > 100:
        problems.append(f"Blender's main thread was busy: {report['main_thread_ms']}")
    return problems


def headless(clips: Path, out: Path, shell_out: Path, report: dict) -> list[str]:
    """Check Blender's command line: one clip, and a folder with a broken file, an image of a wall
    and a clip.
    """
    arguments = [
        "batch",
        str(clips),
        "--out",
        str(shell_out / "batch"),
        "--quality",
        "fast",
        "--quiet",
        "--again",
    ]
    status = shell([*arguments, "--formats", "npz"])
    theirs = json.loads((out / "batch.json").read_text("utf-8"))
    ours = json.loads((shell_out / "batch" / "scope-batch.json").read_text("utf-8"))
    problems = missing(out, ["command.npz", "command.glb", "batch/walk.npz", "batch/walk.glb"])
    if problems:
        return problems
    fates = [[entry["status"] for entry in batch["files"]] for batch in (ours, theirs)]
    if fates[0] != fates[1] or status != theirs["exit_status"]:
        problems.append(
            f"the shell's batch ends with {status}, {fates[0]}; Blender's with {fates[1]}"
        )
    for one, other in zip(ours["files"], theirs["files"], strict=True):
        said = other.get("message", "")
        expected = one.get("message", "").replace(str(clips), "/scope/clips")
        if said != expected:
            problems.append(f"of {one['file']} Blender says {said!r} and the shell {expected!r}")
    for name in ("command.npz", "batch/walk.npz"):
        distance = report[f"{name}_from_shell_mm"] = apart(
            out / name, shell_out / "batch" / "walk.npz"
        )
        if distance["median"] > 1e3 * TOLERANCE_M:
            problems.append(f"{name} is not the shell's motion")
    return problems


def main(video: Path, work: Path, parts: list[str]) -> int:
    """Print the figures; 1 where something is wrong."""
    shell_out = work / "shell"
    shell_out.mkdir(exist_ok=True)
    report: dict = {}
    problems = written_into_the_extension(work)
    if "panel" in parts:
        problems += panel(video, work / "out", shell_out, report)
    if "headless" in parts:
        problems += headless((work / "clips").resolve(), work / "out", shell_out, report)
    for part in (
        "undo",
        "trouble",
        "stored",
        "pins",
        "details",
        "live",
        "first",
        "update",
        "startup",
        "reload",
        "walk",
        "tour",
    ):
        if part in parts:
            report[part] = json.loads((work / "out" / f"{part}.json").read_text("utf-8"))
    print(json.dumps(report, indent=1))
    for problem in problems:
        print(f"blender: {problem}", file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:]))
