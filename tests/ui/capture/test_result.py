# SPDX-License-Identifier: GPL-3.0-or-later
"""Review spans as the panel lists them."""

import numpy as np
from scope.scope_addon.ui.capture.result import frame_warnings

from ...made_motion import made_motion


def test_spans_are_listed_by_reason_in_scene_frames(body):
    motion = made_motion(body, np.zeros((30, body.K + 1, 3)), np.zeros((30, 3)))
    motion.valid[[0, 20]] = False
    under = np.zeros(30, bool)
    under[3:6] = True
    assert frame_warnings(motion, np.arange(30) + 10.0, under) == {"unseen": "10,30", "floor": "13-15"}
