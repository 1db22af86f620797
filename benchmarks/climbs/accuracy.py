# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench climbs`: people who climb onto boxes, captured on one floor and with
`--uneven-ground`.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.pipeline import capture
from ...scope_addon.errors import NoPersonError
from ...scope_addon.motion import Motion
from ...solver import Body, load_body
from ...solver.rotations import exp
from ..evaluation.metrics import mpjpe
from ..frames import CACHE
from ..report import table
from ..scenes.accuracy import Truth, score_people
from ..scenes.people import LIMB_JOINTS, Points
from .draw import rise_m

FOLDER = CACHE / "climbs"  # of the clips and their ground truth
WAYS = {"one floor": False, "uneven ground": True}
SHOWN = {
    "true_rise_m": "true rise, m",
    "rise_share": "captured share of it",
    "mpjpe_root": "MPJPE-root mm",
    "pa_mpjpe": "PA-MPJPE mm",
    "world_mm": "in the world, mm",
    "found": "found",
}


def climbs(quick: bool) -> dict[str, Any]:
    """Render what is missing, measure, print the tables as they come, return the figures by way and
    clip.

    `quick` measures the clips that are there, without rendering.
    """
    if not quick:
        command = (sys.executable, "-m", "scope.benchmarks.climbs.render")
        try:
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        except subprocess.CalledProcessError:  # it has said why, as where there is no connection
            print("nothing was rendered", file=sys.stderr)
    videos = [video for video in sorted(FOLDER.glob("*.mp4")) if truth_of(video).is_file()]
    if not videos:
        print(f"{FOLDER} has no clips: run ./scripts/bench climbs without --quick", file=sys.stderr)
        return {}
    body = load_body("scope")
    figures = dict[str, Any]()
    for way, uneven in WAYS.items():
        rows = {video.stem: measure(body, video, uneven) for video in videos}
        rows["mean"] = {
            key: _mean([row[key] for row in rows.values() if key in row]) for key in SHOWN
        }
        figures[way] = rows
        print(
            table(
                (way, *SHOWN.values()),
                [[name, *(row.get(key) for key in SHOWN)] for name, row in rows.items()],
            ),
            end="\n\n",
            flush=True,
        )
    return figures


def truth_of(video: Path) -> Path:
    """Return the ground truth of a clip."""
    return video.with_name(f"{video.stem}_truth.npz")


def measure(body: Body, video: Path, uneven: bool) -> dict[str, float]:
    """Capture a clip, with the person's stature given, and return its figures."""
    with np.load(truth_of(video)) as data:
        truth = {key: data[key] for key in data.files}
    options = CaptureOptions(uneven_ground=uneven, heights_m=(float(truth["stature_m"][0]),))
    try:
        motion = capture(video, body, options).motions[0]
    except NoPersonError:
        return {"true_rise_m": rise_m(truth["limbs"][0]), "found": 0.0}
    return compare(body, motion, video.stem, truth)


def compare(body: Body, motion: Motion, clip: str, truth: Truth) -> dict[str, float]:
    """Return the figures of one captured person: `SHOWN`."""
    result = score_people(body, [motion], clip, truth)[0]
    true = truth["limbs"][0]
    R = exp(motion.poses.reshape(len(motion.poses), -1, 3).astype(float))
    joints = body.forward_kinematics(R, motion.trans.astype(float), motion.betas.astype(float))[1]
    limbs = joints[:, [body.joint_names.index(name) for name in LIMB_JOINTS]]
    return {
        "true_rise_m": rise_m(true),
        "rise_share": rise_m(limbs) / rise_m(true),
        "mpjpe_root": _mean(result.mpjpe_root),
        "pa_mpjpe": _mean(result.pa_mpjpe),
        "world_mm": world_mm(limbs, true[motion.frames]),
        "found": float(np.isfinite(result.mpjpe_root).mean()),
    }


def world_mm(limbs: Points, true: Points) -> float:
    """Return the mean distance of joints (T, J, 3), both z up, after one turn about z and one shift
    of the clip.
    """
    x = limbs - limbs.mean((0, 1))
    y = true - true.mean((0, 1))
    H = np.einsum("tji,tjk->ik", x[..., :2], y[..., :2])
    angle = np.arctan2(H[0, 1] - H[1, 0], H[0, 0] + H[1, 1])
    return float(mpjpe(x @ exp(np.array([0.0, 0.0, angle])).T, y).mean())


def _mean(values: Any) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")
