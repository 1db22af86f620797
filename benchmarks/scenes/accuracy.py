# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench scenes`: errors of captures of the rendered scenes, by groups of frames and of people."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.pipeline import capture
from ...scope_addon.errors import NoPersonError
from ...scope_addon.motion import Motion
from ...solver import Body, load_body
from ...tools.render_sample.truth import project
from ..evaluation.metrics import mpjpe, pa_mpjpe, relative_to
from ..frames import DATA
from ..report import table
from .people import LIMB_JOINTS
from .scene import FOLDER
from .statistics import Estimate, mean_over_people

HIPS = [LIMB_JOINTS.index("left_hip"), LIMB_JOINTS.index("right_hip")]
FOUND_PX = 0.15  # of the picture's longer side: the most that a captured person's hips may be off, median
Truth = dict[str, NDArray[Any]]


@dataclass
class Result:
    """Errors of one true person of a clip, frame by frame; NaN in frames in which the person was not found."""

    clip: str
    mpjpe_root: NDArray[np.float64]  # (T,) mm
    pa_mpjpe: NDArray[np.float64]  # (T,) mm
    size: float  # captured over true stature; NaN for people that were not found
    frames: dict[str, NDArray[Any]] = field(default_factory=dict)  # (T,) what groups are made of
    person: dict[str, Any] = field(default_factory=dict)


def scenes(quick: bool) -> dict[str, Any]:
    """Render what is missing, measure, print the tables as they come, return the figures by split.

    `quick` measures the clips that are there, without rendering.
    """
    if not quick:
        if not DATA.is_dir():
            print(f"{DATA} does not exist: nothing was rendered; put the recordings there", file=sys.stderr)
        else:
            command = (sys.executable, "-m", "scope.benchmarks.scenes.render")
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    body, results = load_body("scope"), dict[str, list[Result]]()
    for truth in sorted(FOLDER.glob("*_truth.npz")):
        video = truth.with_name(truth.name.replace("_truth.npz", ".mp4"))
        with np.load(truth) as data:
            of_clip = evaluate_scene(body, video, {key: data[key] for key in data.files})
        results.setdefault("test" if video.name.startswith("test") else "development", []).extend(of_clip)
        print(f"{video.stem}: {np.nanmean(of_clip[0].mpjpe_root):.0f} mm", file=sys.stderr, flush=True)
    figures: dict[str, Any] = {}
    for split, of_split in sorted(results.items()):
        rows = figures[split] = groups(of_split)
        head = (f"{split}: people", "number", "MPJPE-root mm", "PA-MPJPE mm", "found", "size off, %")
        print(table(head, [_row(name, row) for name, row in rows.items()]), end="\n\n", flush=True)
    return figures


def evaluate_scene(body: Body, video: Path, truth: Truth, quality: str = CaptureOptions().quality) -> list[Result]:
    """Capture a clip and return the errors of each of its true people."""
    count = len(truth["limbs"])
    try:
        motions = capture(video, body, CaptureOptions(quality=quality, people=count)).motions
    except NoPersonError:
        motions = []
    return [_result(body, video.stem, motions, truth, k) for k in range(count)]


def _result(body: Body, clip: str, motions: list[Motion], truth: Truth, k: int) -> Result:
    true = truth["limbs_cam"][k]
    T, names = len(true), [body.joint_names.index(name) for name in LIMB_JOINTS]
    frames = {"view_deg": truth["view_deg"][k], "hidden": truth["hidden"][k].sum(axis=1)}
    frames["distance_m"] = np.linalg.norm(true[:, HIPS].mean(axis=1), axis=1)
    pelvis = truth["limbs"][k][:, HIPS].mean(axis=1)
    frames["speed"] = np.linalg.norm(np.gradient(pelvis, axis=0), axis=1) * float(truth["fps"])
    pixels = project(true, truth["intrinsics"])
    frames["height_px"] = np.ptp(pixels[..., 1], axis=1)
    person = {key: truth[key][k].item() for key in ("stature_m", "mass_index", "loose_m")}
    person |= {key: truth[key].item() for key in ("camera", "surroundings")} | {"people": len(truth["limbs"])}
    result = Result(clip, np.full(T, np.nan), np.full(T, np.nan), np.nan, frames, person)
    motion = _nearest(motions, pixels, names, truth)
    if motion is not None:
        rows = np.flatnonzero(motion.valid & (motion.frames < T))
        at = motion.frames[rows]
        captured = motion.joints_cam[rows][:, names].astype(float)
        result.pa_mpjpe[at] = pa_mpjpe(captured, true[at])
        roots = [points[:, HIPS].mean(axis=1) for points in (captured, true[at])]
        result.mpjpe_root[at] = mpjpe(relative_to(captured, roots[0]), relative_to(true[at], roots[1]))
        result.size = body.stature(motion.betas.astype(float)) / person["stature_m"]
    return result


def _nearest(motions: list[Motion], pixels: NDArray[np.float64], names: list[int], truth: Truth) -> Motion | None:
    """Return the motion whose hips are nearest to a person's (T, 12, 2) in the picture; None if none is near."""
    best, least = None, FOUND_PX * float(truth["size"].max())
    for motion in motions:
        rows = np.flatnonzero(motion.valid & (motion.frames < len(pixels)))
        if not len(rows):
            continue
        seen = project(motion.joints_cam[rows][:, names].astype(float), motion.intrinsics)[:, HIPS].mean(axis=1)
        off = float(np.median(np.linalg.norm(seen - pixels[motion.frames[rows]][:, HIPS].mean(axis=1), axis=1)))
        if off < least:
            best, least = motion, off
    return best


Chosen = Callable[[Result], Any]  # of frames (T,) bool, or of the whole person, a bool
GROUPS: dict[str, Chosen] = {
    "all": lambda r: True,
    "seen from the front, < 45°": lambda r: r.frames["view_deg"] < 45,
    "from the side": lambda r: (r.frames["view_deg"] >= 45) & (r.frames["view_deg"] <= 135),
    "from behind, > 135°": lambda r: r.frames["view_deg"] > 135,
    "nearer than 4.5 m": lambda r: r.frames["distance_m"] < 4.5,
    "4.5 to 6.5 m": lambda r: (r.frames["distance_m"] >= 4.5) & (r.frames["distance_m"] <= 6.5),
    "farther than 6.5 m": lambda r: r.frames["distance_m"] > 6.5,
    "in place, < 0.3 m/s": lambda r: r.frames["speed"] < 0.3,
    "walking": lambda r: (r.frames["speed"] >= 0.3) & (r.frames["speed"] <= 2),
    "faster than 2 m/s": lambda r: r.frames["speed"] > 2,
    "all joints in view": lambda r: r.frames["hidden"] == 0,
    "one to four joints hidden": lambda r: (r.frames["hidden"] > 0) & (r.frames["hidden"] <= 4),
    "more joints hidden": lambda r: r.frames["hidden"] > 4,
    "shorter than 200 px": lambda r: r.frames["height_px"] < 200,
    "200 px and more": lambda r: r.frames["height_px"] >= 200,
    "stature below 1.5 m": lambda r: r.person["stature_m"] < 1.5,
    "1.5 to 1.75 m": lambda r: 1.5 <= r.person["stature_m"] <= 1.75,
    "above 1.75 m": lambda r: r.person["stature_m"] > 1.75,
    "slender, below 19 kg/m²": lambda r: r.person["mass_index"] < 19,
    "19 to 23 kg/m²": lambda r: 19 <= r.person["mass_index"] <= 23,
    "heavy, above 23 kg/m²": lambda r: r.person["mass_index"] > 23,
    "tight clothes": lambda r: r.person["loose_m"] == 0,
    "loose clothes": lambda r: r.person["loose_m"] > 0,
    "indoors": lambda r: r.person["surroundings"] == "indoors",
    "outdoors": lambda r: r.person["surroundings"] == "outdoors",
    "static camera": lambda r: r.person["camera"] == "static",
    "panning camera": lambda r: r.person["camera"] == "panning",
    "travelling camera": lambda r: r.person["camera"] == "travelling",
    "alone": lambda r: r.person["people"] == 1,
    "one of two": lambda r: r.person["people"] == 2,
}


def groups(results: list[Result]) -> dict[str, dict[str, Estimate]]:
    """Return the figures of every group that has people: of each person the mean over the group's frames."""
    found = {}
    for name, chosen in GROUPS.items():
        inside = [(r, np.broadcast_to(chosen(r), r.mpjpe_root.shape)) for r in results]
        inside = [(r, rows) for r, rows in inside if rows.any()]
        if not inside:
            continue
        found[name] = {
            "mpjpe_root": mean_over_people([_mean(r.mpjpe_root[rows]) for r, rows in inside]),
            "pa_mpjpe": mean_over_people([_mean(r.pa_mpjpe[rows]) for r, rows in inside]),
            "found": mean_over_people([float(np.isfinite(r.mpjpe_root[rows]).mean()) for r, rows in inside]),
            "size_off": mean_over_people([100 * abs(r.size - 1) for r, rows in inside]),
        }
    return found


def _mean(values: NDArray[np.float64]) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else np.nan


def _row(name: str, row: dict[str, Estimate]) -> list[object]:
    def shown(estimate: Estimate) -> str:
        interval = f" ({estimate.low:.1f} to {estimate.high:.1f})" if estimate.people > 1 else ""
        return f"{estimate.mean:.1f}{interval}"

    share = f"{100 * row['found'].mean:.0f} %"
    return [name, row["found"].people, shown(row["mpjpe_root"]), shown(row["pa_mpjpe"]), share, shown(row["size_off"])]
