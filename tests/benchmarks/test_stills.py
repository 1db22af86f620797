# SPDX-License-Identifier: GPL-3.0-or-later
"""Single frames as images: the right frames, their errors against the truth of these frames, and
the table.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scope.benchmarks import stills
from scope.scope_addon.errors import NoPersonError
from scope.solver import Body
from scope.solver.body_file import ASSETS

from ..made_motion import made_motion

SAMPLE = stills.Clip(ASSETS / "sample" / "sample.mp4", ASSETS / "sample" / "sample_truth.npz")


def test_the_truth_of_a_frame_has_no_error(monkeypatch: pytest.MonkeyPatch, body: Body) -> None:
    """A capture that returns the truth of one frame is wrong by the motion since then in the
    others.
    """
    with np.load(SAMPLE.truth) as file:
        joints = file["joints_cam"]
        names = file["joint_names"].tolist()
    assert tuple(names) == body.joint_names
    true = made_motion(body, np.zeros((1, body.K + 1, 3)), np.zeros((1, 3)))
    asked = [37, 74, 111]  # a quarter, half and three quarters of 150 frames
    monkeypatch.setattr(
        stills, "frames_as_images", lambda _, frames: [(k, Path(f"{k}.png")) for k in frames]
    )

    def captured(image: Path, *_: object) -> SimpleNamespace:
        if image.stem == "111":
            raise NoPersonError("nobody")
        return SimpleNamespace(motions=[replace(true, joints_cam=joints[37:38])])

    monkeypatch.setattr(stills, "capture", captured)
    first, second, third = stills.errors_of_clip(body, SAMPLE, len(asked), "best")
    limbs = [
        names.index(f"{side}_{at}")
        for at in ("knee", "ankle", "elbow", "wrist")
        for side in ("left", "right")
    ]
    moved = [joints[k, limbs] - joints[k, [1, 2]].mean(axis=0) for k in (37, 74)]
    assert first == pytest.approx((0.0, 0.0), abs=1e-3)
    assert second[0] > 300 * np.linalg.norm(moved[1] - moved[0], axis=1).mean()
    assert np.isnan(third).all()
