# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench renders`: captures of rendered clips with exact ground truth, given focal
length, height or neither.

The clips are the shots of `held_out` and the sample clip, which the means leave out.
"""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.errors import NoPersonError
from ...scope_addon.motion import Motion
from ...solver import Body, load_body
from ...solver.body_file import ASSETS
from ...solver.rotations import exp
from ..frames import DATA
from ..report import table
from ..scenes.statistics import mean_over_people
from .accuracy import evaluate_clip
from .depth_flips import BONES, FITS, depth_flips, flips_table, total
from .held_out import feet_world, held_out_takes
from .perception import PRESETS
from .render_shots import MOTIONS, video_and_truth

SHOWN = {
    "mpjpe_root": "MPJPE-root mm",
    "pa_mpjpe": "PA-MPJPE mm",
    "up_deg": "up off by, degrees",
    "floor_cm": "floor off by, cm",
    "foot_slide_cm": "foot sliding cm",
    "size": "size / true",
    "height_off": "height off by, %",
    "focal": "focal / true",
    "coverage": "coverage",
}


KNOWN = ("nothing given", "focal length given", "height given")


def renders(quick: bool) -> dict[str, Any]:
    """Render what is missing, measure, print the tables as they come, return the figures by preset
    and by ``KNOWN``.
    """
    if not DATA.is_dir():
        print(f"{DATA} does not exist: nothing was measured; put the clips there", file=sys.stderr)
        return {}
    command = (sys.executable, "-m", "scope.benchmarks.perception.render_shots")
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    body = load_body("scope")
    clips = {take.name: video_and_truth(take.name) for take in held_out_takes(MOTIONS)}
    sample = ASSETS / "sample" / "sample.mp4"
    clips["sample"] = sample, sample.with_name("sample_truth.npz")
    figures: dict[str, Any] = {}
    for quality in (CaptureOptions().quality,) if quick else PRESETS[::-1]:  # best first
        figures[quality] = {}
        for known in KNOWN:
            found = {
                name: evaluate_render(body, *files, quality, known) for name, files in clips.items()
            }
            shots = [row for name, row in found.items() if name != "sample"]
            figures[quality][known] = found | {"mean": mean_of(shots)}
            rows = [
                [name, *(row.get(key) for key in SHOWN)]
                for name, row in figures[quality][known].items()
            ]
            print(table((f"{quality}, {known}", *SHOWN.values()), rows), end="\n\n", flush=True)
            flips = {
                fit: total(row["flips"][fit] for row in shots if "flips" in row) for fit in FITS
            }
            figures[quality][known]["mean"]["flips"] = flips
            print(flips_table(f"{quality}, {known}", flips), end="\n\n", flush=True)
    print(presets_table(figures), end="\n\n", flush=True)
    print(intervals_table(figures), end="\n\n", flush=True)
    return figures


def presets_table(figures: dict[str, Any]) -> str:
    """Return the errors of every clip with every preset, nothing given, the clip with the least
    first.

    :param figures: by preset, then by what is given, then by clip.
    """
    by_preset = {quality: by_known[KNOWN[0]] for quality, by_known in figures.items()}
    first = next(iter(by_preset.values()))
    names = sorted(
        (name for name in first if name != "mean"),
        key=lambda name: first[name].get("mpjpe_root", math.inf),
    )
    rows = [
        [name, *(_pair(clips.get(name, {})) for clips in by_preset.values())]
        for name in (*names, "mean")
    ]
    return table((f"MPJPE-root / PA-MPJPE mm, {KNOWN[0]}", *by_preset), rows)


def intervals_table(figures: dict[str, Any]) -> str:
    """Return the means of the errors, with 95 % intervals by the bootstrap over the clips, each of
    another person.

    The last column is by how much MPJPE-root is larger than the default preset's with the same
    given, clip by clip.

    :param figures: by preset, then by what is given, then by clip.
    """
    rows = []
    for quality, by_known in figures.items():
        for known, clips in by_known.items():
            errors = [
                mean_over_people(list(_of_clips(clips, key).values()))
                for key in ("mpjpe_root", "pa_mpjpe")
            ]
            default = _of_clips(
                figures.get(CaptureOptions().quality, {}).get(known, {}), "mpjpe_root"
            )
            ours = _of_clips(clips, "mpjpe_root")
            more = mean_over_people(
                [ours[name] - default[name] for name in ours if name in default]
            )
            same = quality == CaptureOptions().quality or not more.people
            rows.append(
                [
                    f"{quality}, {known}",
                    errors[0].people,
                    *(e.text for e in errors),
                    "" if same else more.text,
                ]
            )
    return table(
        ("preset", "clips", "MPJPE-root mm", "PA-MPJPE mm", "more than the default, mm"), rows
    )


def _of_clips(clips: dict[str, Any], key: str) -> dict[str, float]:
    """Return a figure of every clip but the sample, in which somebody was found."""
    return {
        name: row[key]
        for name, row in clips.items()
        if name not in ("sample", "mean") and key in row
    }


def _pair(row: dict[str, Any]) -> str:
    known = [row.get(key) for key in ("mpjpe_root", "pa_mpjpe")]
    return "not found" if None in known else " / ".join(f"{value:.1f}" for value in known)


def evaluate_render(
    body: Body, video: Path, truth: Path, quality: str, known: str
) -> dict[str, Any]:
    """Return the figures of the evaluation tool for one clip, ``size`` and more, and those of
    ``against_world``.

    ``known``: one of ``KNOWN``. If nobody was found, only ``coverage``. ``size``: captured over
    true size, median of the frames. ``height``: captured over true stature. ``flips``: as of
    `depth_flips`.
    """
    with np.load(truth) as data:
        true = {key: data[key] for key in data.files}
    options = CaptureOptions(
        quality=quality,
        fov_deg=_field_of_view(true) if known == "focal length given" else None,
        heights_m=(body.stature(true["betas"].astype(float)),) if known == "height given" else (),
    )
    try:
        motion, figures = evaluate_clip(body, video, truth, options)
    except NoPersonError:
        return {"coverage": 0.0}
    joints = {
        n: true["joints_cam"][:, body.joint_names.index(n)].astype(float)
        for bone in BONES
        for n in bone
    }
    figures |= {"size": 1 / figures["pa_scale"], "flips": depth_flips(body, motion, joints)}
    stature = body.stature(motion.betas.astype(float)) / body.stature(true["betas"].astype(float))
    return (
        figures
        | {"height": stature, "height_off": 100 * abs(stature - 1)}
        | against_world(body, motion, true)
    )


def against_world(
    body: Body, motion: Motion, truth: dict[str, NDArray[Any]]
) -> dict[str, float | None]:
    """Compare a motion's world and camera with ground truth, over the frames that both have.

    ``up_deg``: mean angle between the two upward directions, seen from the camera. ``floor_cm``:
    mean error of the height above the floor of standing feet (midpoint of heel and toe), None if no
    foot stands. ``focal``: the ratio of the focal lengths.
    """
    rows = np.flatnonzero(motion.valid & np.isin(motion.frames, truth["frame_index"]))
    at = np.searchsorted(truth["frame_index"], motion.frames[rows])
    up = motion.world_from_camera[rows, 2, :3] @ truth["world_from_camera"][2, :3]
    heights = []
    for poses, trans, betas in (
        (motion.poses[rows], motion.trans[rows], motion.betas),
        (truth["poses"][at], truth["trans"][at], truth["betas"]),
    ):
        states = exp(poses.reshape(len(rows), -1, 3).astype(float))
        heights.append(feet_world(body, states, trans.astype(float), betas)[..., 2])
    off = np.abs(heights[0] - heights[1])[truth["standing"][at]]
    return {
        "up_deg": float(np.degrees(np.arccos(np.clip(up, -1, 1))).mean()),
        "floor_cm": float(100 * off.mean()) if len(off) else None,
        "focal": float(motion.intrinsics[0, 0] / truth["intrinsics"][0, 0]),
    }


def mean_of(rows: list[dict[str, Any]]) -> dict[str, float | None]:
    """Return the mean of every figure that is shown, over the rows that have it."""
    means: dict[str, float | None] = {}
    for key in SHOWN:
        values = [row[key] for row in rows if row.get(key) is not None]
        means[key] = float(np.mean(values)) if values else None
    return means


def _field_of_view(truth: dict[str, NDArray[Any]]) -> float:
    """Return the field of view along the longer side of the image, in degrees."""
    return math.degrees(2 * math.atan(max(truth["size"]) / (2 * truth["intrinsics"][0, 0])))
