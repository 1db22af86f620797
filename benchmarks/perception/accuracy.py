# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors of captured bodies against ground truth of the four pose2sim cameras."""

from __future__ import annotations

import importlib.util
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.pipeline import capture
from ...scope_addon.motion import Motion
from ...solver import Body
from ..frames import DATA

CAMERAS = ("cam1", "cam2", "cam3", "cam4")
SHOWN = {  # key of the evaluation: heading, target
    "mpjpe_root": ("MPJPE-root mm", 75.0),
    "pa_mpjpe": ("PA-MPJPE mm", 52.0),
    "mpjpe_root_flat": ("without depth mm", None),
    "jitter_rel": ("jitter m/s³", 45.0),
    "accel_err_lp": ("accel error mm/frame²", 3.9),
    "foot_slide_cm": ("foot sliding cm", 1.5),
    "flipped": ("flipped share", 0.01),
    "coverage": ("coverage", 1.0),
}
FLIPS = ("lr_swap", "mirror", "mirror_swap")


def evaluate_camera(body: Body, camera: str, options: CaptureOptions) -> dict[str, Any]:
    """Return all figures of the evaluation tool for one camera."""
    folder = DATA / "pose2sim"
    return evaluate_clip(body, folder / f"{camera}.mp4", folder / f"truth_{camera}.npz", options)[1]


def evaluate_clip(
    body: Body, video: Path, truth: Path, options: CaptureOptions
) -> tuple[Motion, dict[str, Any]]:
    """Capture a clip; return its motion and all figures of the evaluation tool for it.

    :raises NoPersonError: when nobody was found.
    """
    motion = capture(video, body, options).motions[0]
    return motion, evaluate_motion(motion, truth)


def evaluate_motion(motion: Motion, truth: Path) -> dict[str, Any]:
    """Return all figures of the evaluation tool for a motion."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of means of no values, in the tool
        result = Path(folder) / "result.npz"
        motion.save(result)
        figures = _tool().evaluate(str(truth), str(result))
    return figures | {"flipped": max(figures[key] for key in FLIPS)}


def evaluate_all(body: Body, options: Callable[[str], CaptureOptions]) -> dict[str, dict[str, Any]]:
    """Return the figures of each camera under its name and, under "mean", the means of those in
    ``SHOWN``.

    ``flipped`` is the largest of the three shares of ``FLIPS``, and its mean is that of the worst
    camera.
    """
    found = {camera: evaluate_camera(body, camera, options(camera)) for camera in CAMERAS}
    mean = {key: float(np.mean([f[key] for f in found.values()])) for key in SHOWN}
    return {**found, "mean": mean | {"flipped": max(f["flipped"] for f in found.values())}}


def calibration(camera: str) -> Path:
    """Return the file with the camera's true intrinsics."""
    return DATA / "pose2sim" / f"calibration_{camera}.json"


def _tool() -> ModuleType:
    """Import the evaluation tool next to the checkout."""
    path = DATA.parent / "tools" / "evaluate.py"
    spec = importlib.util.spec_from_file_location("evaluate", path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
