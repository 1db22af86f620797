# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench views`: walkers whom two cameras show, 60 degrees apart, captured together.

Errors of joints are against the truth in the first camera's axes, all 24 joints, relative to the
pelvis. Exchanged: frames of a captured person in which the other true person's pelvis is nearer.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...scope_addon.arrays import Float64Array
from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.pipeline import Capture, capture
from ...scope_addon.capture.several_views.capture_views import capture_views
from ...scope_addon.motion import Motion
from ...scope_addon.options.capture import ALL, LARGEST
from ...solver import load_body
from ...solver.rotations import log
from ..evaluation.metrics import MM, mpjpe, pa_mpjpe, relative_to
from ..frames import CACHE
from ..report import table
from .footage import truth_of
from .view_scenes import SCENES, draw_scene

FOLDER = CACHE / "views"
SHOWN = {
    "mpjpe_root": "MPJPE-root mm",
    "pa_mpjpe": "PA-MPJPE mm",
    "exchanged": "exchanged",
    "offset_ms": "offset, ms off",
    "rotation_deg": "rotation, ° off",
    "baseline_deg": "baseline, ° off",
    "scale": "baseline / true",
    "warnings": "warnings",
}

Truth = dict[str, Float64Array]


def views(quick: bool) -> dict[str, Any]:
    """Draw what is missing, measure, print the table, return the figures by scene.

    `quick` leaves out one camera alone, and given statures.
    """
    body = load_body("scope")
    figures = dict[str, Any]()
    for name, scene in SCENES.items():
        first, second = draw_scene(body, name, FOLDER)
        people = ALL if len(scene.walks) > 1 else LARGEST
        heights_m = (body.stature(),) * len(scene.walks)
        figures[name] = score(
            first, second, capture_views([first, second], body, CaptureOptions(people=people))
        )
        if quick:
            continue
        given = CaptureOptions(people=people, heights_m=heights_m)
        figures[f"{name}, height given"] = score(
            first, second, capture_views([first, second], body, given)
        )
        if name in ("together", "two_people"):
            figures[f"{name}, first camera alone"] = score(
                first, None, capture(first, body, CaptureOptions(people=people))
            )
    rows = [[name, *(row.get(key) for key in SHOWN)] for name, row in figures.items()]
    print(table(("scene", *SHOWN.values()), rows), flush=True)
    return figures


def score(first: Path, second: Path | None, captured: Capture) -> dict[str, Any]:
    """Return the figures of a capture: `SHOWN`.

    :param second: the second camera's clip; None: one camera was captured.
    """
    truth = _truth(first)
    true_joints = np.einsum(
        "ptjc,tcd->ptjd",
        truth["joints"] - truth["centers"][None, :, None],
        truth["R_world_camera"],
    )
    people = [_score_person(motion, true_joints) for motion in captured.motions]
    figures: dict[str, Any] = {
        key: float(np.mean([person[key] for person in people])) for key in people[0]
    }
    figures["warnings"] = ", ".join(sorted({each.code for each in captured.report.warnings}))
    about = captured.report.views[1] if second is not None else {}
    if second is not None and about.get("is_used"):
        figures |= _score_camera(about, truth, _truth(second))
    return figures


def _truth(clip: Path) -> Truth:
    with np.load(truth_of(clip)) as data:
        return {key: data[key] for key in data.files}


def _score_person(motion: Motion, true_joints: Float64Array) -> dict[str, float]:
    """Compare a captured person with the true one whose pelvis is nearest.

    :param true_joints: (people, T, K+1, 3) in the first camera's axes, metres.
    """
    joints = np.asarray(motion.joints_cam, float)
    true = true_joints[:, motion.frames]
    distance = np.linalg.norm(true[:, :, 0] - joints[None, :, 0], axis=-1)
    own = int(np.median(distance, axis=1).argmin())
    captured = relative_to(joints, joints[:, 0])
    of_own = relative_to(true[own], true[own][:, 0])
    return {
        "mpjpe_root": float(mpjpe(captured, of_own).mean()),
        "pa_mpjpe": float(pa_mpjpe(captured, of_own).mean()),
        "exchanged": float((distance.argmin(axis=0) != own).mean()),
    }


def _score_camera(about: Mapping[str, Any], first: Truth, second: Truth) -> dict[str, float]:
    """Compare what the report says about the second camera with the truth."""
    R_first = first["R_world_camera"][0]
    R_camera_first = second["R_world_camera"][0].T @ R_first
    true_baseline = R_first.T @ (second["centers"][0] - first["centers"][0])
    R = np.array(about["R_camera_first"])
    baseline = -R.T @ np.array(about["t_camera_first_m"])
    length = float(np.linalg.norm(baseline))
    true_length = float(np.linalg.norm(true_baseline))
    cosine = baseline @ true_baseline / (length * true_length)
    true_offset_s = float(first["start_s"] - second["start_s"])
    return {
        "offset_ms": MM * (about["offset_s"] - true_offset_s),
        "rotation_deg": float(np.degrees(np.linalg.norm(log(R @ R_camera_first.T)))),
        "baseline_deg": float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))),
        "scale": length / true_length,
    }
