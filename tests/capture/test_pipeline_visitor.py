# SPDX-License-Identifier: GPL-3.0-or-later
"""A capture of two people, one of whom enters after a while and leaves before the end."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.pipeline import capture
from scope.solver.body import Body

from .composites import visit

EDGE = 1200.0


@pytest.fixture
def footage(shared: Path, tmp_path: Path) -> tuple[Path, np.ndarray]:
    """A video, and the true positions of the two, (T, 2, 2) pixels."""
    path = tmp_path / "visit.avi"
    places = []
    writer = None
    for image, at in visit(shared):
        writer = writer or cv2.VideoWriter(
            str(path), cv2.VideoWriter.fourcc(*"MJPG"), 15, image.shape[1::-1]
        )
        writer.write(np.ascontiguousarray(image[:, :, ::-1]))
        places.append(at)
    assert writer is not None
    writer.release()
    return path, np.array(places)


@pytest.mark.slow
def test_the_visitor_is_valid_while_in_the_picture_and_only_then(
    footage: tuple[Path, np.ndarray], body: Body
) -> None:
    everybody = capture(footage[0], body, CaptureOptions(quality="fast", people="all"))
    places = footage[1]
    assert len(everybody.motions) == 2
    stays, visitor = everybody.motions
    assert stays.valid.mean() >= 0.98
    inside = places[:, 1, 0] < EDGE - 150
    outside = ~(places[:, 1, 0] < EDGE + 30)
    assert inside.sum() >= 8
    assert outside.sum() >= 6
    assert visitor.valid[inside][4:].all()  # a search every 0.27 s
    assert not visitor.valid[outside].any()
    for motion, at in zip(everybody.motions, np.moveaxis(places, 1, 0), strict=True):
        trunk = projected_trunk(motion)
        rows = motion.valid & np.isfinite(at).all(axis=1)
        assert np.percentile(np.linalg.norm(trunk - at, axis=1)[rows], 90) < 40
        # Nobody jumps when entering or leaving.
        steps = np.linalg.norm(np.diff(motion.joints_cam[:, 0], axis=0), axis=1)
        assert steps.max() < 0.38  # metres a frame; the visitor slides in and out at up to 0.3
        assert (motion.joints_cam[:, 0, 2] > 1.0).all()


def projected_trunk(motion) -> np.ndarray:
    """(T, 2) pixels, the middle of hips and shoulders."""
    middle = motion.joints_cam[:, [1, 2, 16, 17]].mean(axis=1) @ motion.intrinsics.T
    return middle[:, :2] / middle[:, 2:]
