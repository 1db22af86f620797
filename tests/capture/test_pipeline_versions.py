# SPDX-License-Identifier: GPL-3.0-or-later
"""The same clip gives the same take with other versions of Python and numpy."""

from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.motion import Motion
from scope.solver import Body

TAKE = Path(__file__).resolve().parents[2] / "build" / "take.npz"
TOLERANCE_M = 1e-3


def test_another_python_captures_the_same(body: Body) -> None:
    if not TAKE.is_file():
        pytest.skip("./scripts/matrix makes the take with another Python")
    found = capture(SAMPLE, body, CaptureOptions()).motions[0]
    other = Motion.load(TAKE)
    distances = np.linalg.norm(found.joints_cam - other.joints_cam, axis=-1)
    assert distances.max() < TOLERANCE_M
