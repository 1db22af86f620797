# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench scenes`: errors of captures of the rendered scenes, by groups of frames and of
people.
"""

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
from ...scope_addon.options.body_choice import chosen_body
from ...solver import Body, load_body
from ...tools.render_sample.truth import project
from ..evaluation.metrics import mpjpe, pa_mpjpe, relative_to
from ..frames import DATA
from ..perception.depth_flips import FITS, DepthFlips, depth_flips, flips_table, total
from ..report import table
from .people import LIMB_JOINTS
from .scene import FOLDER, NEW_PERFORMERS, SPLITS
from .statistics import Estimate, mean_over_people, mean_over_performers

HIPS = [LIMB_JOINTS.index("left_hip"), LIMB_JOINTS.index("right_hip")]
# of the picture's longer side: the most that a captured person's hips may be off, median
FOUND_PX = 0.15
VARIANTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("default preset", {}),
    ("default preset, statures given", {"statures_given": True}),
    ("preset balanced", {"quality": "balanced"}),
    ("preset fast", {"quality": "fast"}),
)
Truth = dict[str, NDArray[Any]]


@dataclass
class Result:
    """Errors of one true person of a clip, frame by frame; NaN in frames in which the person was
    not found.
    """

    clip: str
    mpjpe_root: NDArray[np.float64]  # (T,) mm
    pa_mpjpe: NDArray[np.float64]  # (T,) mm
    size: float  # captured over true stature; NaN for people that were not found
    frames: dict[str, NDArray[Any]] = field(default_factory=dict)  # (T,) what groups are made of
    person: dict[str, Any] = field(default_factory=dict)
    # as of `depth_flips`; empty for people not found
    flips: dict[str, DepthFlips] = field(default_factory=dict)


def scenes(quick: bool) -> dict[str, Any]:
    """Render what is missing, measure, print the tables as they come, return the figures by split.

    `quick` measures the clips that are there, without rendering.
    """
    if not quick:
        if not DATA.is_dir():
            print(
                f"{DATA} does not exist: nothing was rendered; put the recordings there",
                file=sys.stderr,
            )
        else:
            command = (sys.executable, "-m", "scope.benchmarks.scenes.render")
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    clips = sorted(FOLDER.glob("*_truth.npz"))
    if not clips:
        print(f"{FOLDER} has no clips: run ./scripts/bench scenes without --quick", file=sys.stderr)
    figures: dict[str, Any] = {}
    for split in SPLITS:
        of_split = [truth for truth in clips if truth.name.startswith(split)]
        if of_split:
            figures[split] = _measure(split, of_split, quick)
    return figures


def _measure(split: str, clips: list[Path], quick: bool) -> dict[str, Any]:
    """Capture the clips of one split with every variant, print the tables and return the
    figures.
    """
    body = load_body("scope")
    by_variant = dict[str, list[Result]]()
    for name, options in VARIANTS[:1] if quick else VARIANTS:
        results = by_variant[name] = []
        for truth in clips:
            video = truth.with_name(truth.name.replace("_truth.npz", ".mp4"))
            with np.load(truth) as data:
                results += evaluate_scene(
                    body, video, {key: data[key] for key in data.files}, **options
                )
            print(
                f"{video.stem}, {name}: {_mean(results[-1].mpjpe_root):.0f} mm",
                file=sys.stderr,
                flush=True,
            )
    return _tables(split, by_variant)


def _tables(split: str, by_variant: dict[str, list[Result]]) -> dict[str, Any]:
    """Print the tables of one split and return their figures, and those of every person."""
    default, *others = by_variant.items()
    found = groups(default[1])
    variants = {name: groups(results)["all"] for name, results in by_variant.items()}
    for head, rows in ((split, found), (f"{split}: variants", variants)):
        columns: tuple[str, ...] = (
            f"{head}: people",
            "number",
            "MPJPE-root mm",
            "PA-MPJPE mm",
            "found",
            "size off, %",
        )
        print(
            table(columns, [_row(name, row) for name, row in rows.items()]), end="\n\n", flush=True
        )
    more = {name: more_than(default[1], results) for name, results in others}
    columns = (f"{split}: MPJPE-root, more than the default, mm", "people", "mean")
    print(
        table(columns, [(name, each.people, each.text) for name, each in more.items()]), end="\n\n"
    )
    flips = {}
    for name, results in by_variant.items():
        flips[name] = {fit: total(r.flips[fit] for r in results if r.flips) for fit in FITS}
        print(flips_table(f"{split}, {name}: depth flips", flips[name]), end="\n\n", flush=True)
    people = {name: [_figures(r) for r in results] for name, results in by_variant.items()}
    figures: dict[str, Any] = {
        "groups": found,
        "variants": variants,
        "more_than_default": more,
        "flips": flips,
    }
    figures["people"] = people
    if split == NEW_PERFORMERS:
        figures["performers"] = {
            name: by_performer(results) for name, results in by_variant.items()
        }
        for name, rows in figures["performers"].items():
            columns = (
                f"{split}, {name}: performers",
                "people",
                "MPJPE-root mm",
                "PA-MPJPE mm",
                "found",
                "size off, %",
            )
            print(
                table(columns, [_row(who, row) for who, row in rows.items()]),
                end="\n\n",
                flush=True,
            )
    return figures


def evaluate_scene(
    body: Body,
    video: Path,
    truth: Truth,
    quality: str = CaptureOptions().quality,
    statures_given: bool = False,
) -> list[Result]:
    """Capture a clip and return the errors of each of its true people."""
    count = len(truth["limbs"])
    heights = _heights(truth) if statures_given else ()
    if heights:
        body = load_body(chosen_body({"body": body.name, "heights_m": heights}))
    try:
        motions = capture(
            video, body, CaptureOptions(quality=quality, people=count, heights_m=heights)
        ).motions
    except NoPersonError:
        motions = []
    return score_people(body, motions, video.stem, truth)


def score_people(body: Body, motions: list[Motion], clip: str, truth: Truth) -> list[Result]:
    """Return the errors of each true person of a clip."""
    matched = match_people(body, motions, truth)
    return [_result(body, clip, matched.get(k), truth, k) for k in range(len(truth["limbs"]))]


def _heights(truth: Truth) -> tuple[float, ...]:
    """Return the true statures, of who appears tallest first."""
    tall = np.median(
        np.ptp(project(truth["limbs_cam"], truth["intrinsics"])[..., 1], axis=2), axis=1
    )
    return tuple(truth["stature_m"][np.argsort(-tall)].tolist())


def _result(body: Body, clip: str, motion: Motion | None, truth: Truth, k: int) -> Result:
    true = truth["limbs_cam"][k]
    T = len(true)
    names = [body.joint_names.index(name) for name in LIMB_JOINTS]
    frames = {"view_deg": truth["view_deg"][k], "hidden": truth["hidden"][k].sum(axis=1)}
    frames["distance_m"] = np.linalg.norm(true[:, HIPS].mean(axis=1), axis=1)
    pelvis = truth["limbs"][k][:, HIPS].mean(axis=1)
    frames["speed"] = np.linalg.norm(np.gradient(pelvis, axis=0), axis=1) * float(truth["fps"])
    pixels = project(true, truth["intrinsics"])
    frames["height_px"] = np.ptp(pixels[..., 1], axis=1)
    person = {key: truth[key][k].item() for key in ("stature_m", "mass_index", "loose_m")}
    person |= {key: truth[key].item() for key in ("camera", "surroundings")} | {
        "people": len(truth["limbs"])
    }
    person["take"] = str(truth["takes"][k])
    result = Result(clip, np.full(T, np.nan), np.full(T, np.nan), np.nan, frames, person)
    if motion is not None:
        rows = np.flatnonzero(motion.valid & (motion.frames < T))
        at = motion.frames[rows]
        captured = motion.joints_cam[rows][:, names].astype(float)
        result.pa_mpjpe[at] = pa_mpjpe(captured, true[at])
        roots = [points[:, HIPS].mean(axis=1) for points in (captured, true[at])]
        result.mpjpe_root[at] = mpjpe(
            relative_to(captured, roots[0]), relative_to(true[at], roots[1])
        )
        result.size = body.stature(motion.betas.astype(float)) / person["stature_m"]
        result.flips = depth_flips(
            body, motion, dict(zip(LIMB_JOINTS, np.moveaxis(true, 1, 0), strict=True))
        )
    return result


def match_people(body: Body, motions: list[Motion], truth: Truth) -> dict[int, Motion]:
    """Return the motion of each true person that was found: nearest hips in the picture first, each
    motion once.
    """
    pixels = project(truth["limbs_cam"], truth["intrinsics"])[:, :, HIPS].mean(axis=2)
    pairs = []
    for n, motion in enumerate(motions):
        rows = np.flatnonzero(motion.valid & (motion.frames < pixels.shape[1]))
        if not len(rows):
            continue
        at = [body.joint_names.index(LIMB_JOINTS[hip]) for hip in HIPS]
        seen = project(motion.joints_cam[rows][:, at].astype(float), motion.intrinsics).mean(axis=1)
        off = np.median(np.linalg.norm(pixels[:, motion.frames[rows]] - seen, axis=-1), axis=1)
        pairs += [(float(off[k]), k, n) for k in range(len(off))]
    matched: dict[int, Motion] = {}
    used: set[int] = set()
    for off_px, k, n in sorted(pairs):
        if off_px < FOUND_PX * float(truth["size"].max()) and k not in matched and n not in used:
            matched[k] = motions[n]
            used.add(n)
    return matched


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
    """Return the figures of every group that has people: of each person the mean over the group's
    frames.

    Frames in which nothing of a person can be seen are left out.
    """
    found = {}
    for name, chosen in GROUPS.items():
        inside = [(r, chosen(r) & (r.frames["hidden"] < len(LIMB_JOINTS))) for r in results]
        inside = [(r, rows) for r, rows in inside if rows.any()]
        if not inside:
            continue
        found[name] = {
            "mpjpe_root": mean_over_people([_mean(r.mpjpe_root[rows]) for r, rows in inside]),
            "pa_mpjpe": mean_over_people([_mean(r.pa_mpjpe[rows]) for r, rows in inside]),
            "found": mean_over_people(
                [float(np.isfinite(r.mpjpe_root[rows]).mean()) for r, rows in inside]
            ),
            "size_off": mean_over_people([100 * abs(r.size - 1) for r, rows in inside]),
        }
    return found


def by_performer(results: list[Result]) -> dict[str, dict[str, Estimate]]:
    """Return the figures of people who move as each performer does, and of all, for whom performers
    are drawn.

    A performer's recordings are named PERFORMER_NUMBER.
    """
    rows = {"all, performers drawn": results}
    rows |= {
        name: [r for r in results if _performer(r) == name]
        for name in sorted({_performer(r) for r in results})
    }
    found = {}
    for name, of in rows.items():
        visible = [r.frames["hidden"] < len(LIMB_JOINTS) for r in of]
        values = {
            "mpjpe_root": [_mean(r.mpjpe_root[rows]) for r, rows in zip(of, visible, strict=True)],
            "pa_mpjpe": [_mean(r.pa_mpjpe[rows]) for r, rows in zip(of, visible, strict=True)],
            "found": [
                _mean(np.isfinite(r.mpjpe_root[rows]) * 1.0)
                for r, rows in zip(of, visible, strict=True)
            ],
            "size_off": [100 * abs(r.size - 1) for r in of],
        }
        if of is results:
            who = [_performer(r) for r in of]
            found[name] = {key: mean_over_performers(each, who) for key, each in values.items()}
        else:
            found[name] = {key: mean_over_people(each) for key, each in values.items()}
    return found


def _performer(result: Result) -> str:
    return str(result.person["take"]).rpartition("_")[0]


def _mean(values: NDArray[np.float64]) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else np.nan


def more_than(reference: list[Result], results: list[Result]) -> Estimate:
    """Return by how much MPJPE-root is larger than the reference's, over the frames of a person
    that both found.
    """
    return mean_over_people(
        [_mean(r.mpjpe_root - ref.mpjpe_root) for ref, r in zip(reference, results, strict=True)]
    )


def _figures(result: Result) -> dict[str, Any]:
    """Return what is known of one person, for the JSON file."""
    visible = result.frames["hidden"] < len(LIMB_JOINTS)
    errors = {
        "mpjpe_root": _mean(result.mpjpe_root[visible]),
        "pa_mpjpe": _mean(result.pa_mpjpe[visible]),
    }
    found = float(np.isfinite(result.mpjpe_root[visible]).mean()) if visible.any() else np.nan
    return {
        "clip": result.clip,
        **errors,
        "found": found,
        "size": result.size,
        "flips": result.flips,
        **result.person,
    }


def _row(name: str, row: dict[str, Estimate]) -> list[object]:
    people = row["found"].people
    share = f"{100 * row['found'].mean:.0f} %"
    return [name, people, row["mpjpe_root"].text, row["pa_mpjpe"].text, share, row["size_off"].text]
