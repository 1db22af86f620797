# SPDX-License-Identifier: GPL-3.0-or-later
"""The clips of the pictures, captured with default settings, and the error of a frame against
ground truth.
"""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np

from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.pipeline import capture
from ...scope_addon.kinematics.face import body_with_mouth
from ...scope_addon.motion import Motion
from ...solver import Body, load_body
from ...solver.body_file import ASSETS
from ..render_talk.shot import FOLDER, VIDEO
from .shapes import joints, true_joints

DATA = ASSETS.parent.parent / "shared" / "data"
SAMPLE = ASSETS / "sample" / "sample.mp4"
SAMPLE_TRUTH = ASSETS / "sample" / "sample_truth.npz"
_LIMBS = {  # name in the ground truth: SMPL's joint
    "LShoulder": 16, "RShoulder": 17, "LElbow": 18, "RElbow": 19, "LWrist": 20, "RWrist": 21,
    "LHip": 1, "RHip": 2, "LKnee": 4, "RKnee": 5, "LAnkle": 7, "RAnkle": 8,
}  # fmt: skip


@cache
def default_body() -> Body:
    """Load Scope's own body."""
    return load_body("scope")


@cache
def body_with_fingers() -> Body:
    """Load Scope's own body with fingers."""
    return load_body("scope_h")


@cache
def body_with_face() -> Body:
    """Load the body with fingers as its face is shown, with teeth and tongue."""
    return body_with_mouth(load_body("scope_h"))


@cache
def captured(video: Path, everybody: bool = False) -> list[Motion]:
    """Capture a clip with default settings: everyone, or the most prominent person only."""
    return capture(
        video, default_body(), CaptureOptions(people="all" if everybody else "largest")
    ).motions


@cache
def captured_in_total(video: Path) -> Motion:
    """Capture the most prominent person of a clip, with fingers and face."""
    return capture(video, body_with_fingers(), CaptureOptions(hands="on", face=True)).motions[0]


def talk() -> Path:
    """Return the clip of a person who talks and gestures, which is rendered if it is missing."""
    if not (FOLDER / VIDEO).is_file():
        command = (sys.executable, "-m", "scope.tools.render_talk")
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return FOLDER / VIDEO


def camera(number: int) -> tuple[Motion, Path]:
    """Return the motion captured from one of the four pose2sim cameras, and the file of its ground
    truth.
    """
    folder = DATA / "pose2sim"
    return captured(folder / f"cam{number}.mp4")[0], folder / f"truth_cam{number}.npz"


def error_mm(motion: Motion, row: int, truth: Path) -> float:
    """Return the mean distance of the twelve limb joints from ground truth, with the middle of the
    hips aligned.
    """
    true = true_joints(motion, row, truth)
    found = joints(motion, row)
    return 1000 * float(
        np.mean(
            [np.linalg.norm(found[k] - true[name]) for name, k in _LIMBS.items() if name in true]
        )
    )


def distance_cm(motion: Motion, row: int, truth: Path, name: str) -> float:
    """Return the distance of one joint from ground truth, aligned in the same way."""
    return 100 * float(
        np.linalg.norm(joints(motion, row)[_LIMBS[name]] - true_joints(motion, row, truth)[name])
    )
