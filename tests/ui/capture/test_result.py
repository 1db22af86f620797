# SPDX-License-Identifier: GPL-3.0-or-later
"""Review spans as the panel lists them."""

import numpy as np
from scope.scope_addon.scene.build import build_scene
from scope.scope_addon.ui.capture.result import frame_warnings, show_result

from ...made_motion import made_motion


def test_spans_are_listed_by_reason_in_scene_frames(body):
    motion = made_motion(body, np.zeros((30, body.K + 1, 3)), np.zeros((30, 3)))
    motion.valid[[0, 20]] = False
    under = np.zeros(30, bool)
    under[3:6] = True
    assert frame_warnings(motion, np.arange(30) + 10.0, under) == {"unseen": "10,30", "floor": "13-15"}


def test_heights_and_joints_with_their_deviations(body):
    motion = made_motion(body, np.zeros((5, body.K + 1, 3)), np.zeros((5, 3)))
    motion.joint_sigma_m[1:4] = 0.052
    result = build_scene([motion], body)
    shown = result.collection.scope_result
    heights = ({"height_m": 1.741, "height_sigma_m": 0.0913}, {"height_m": 1.5, "height_sigma_m": 0.005})
    show_result(shown, "", {"per_person": [*heights, {"height_m": 1.62, "height_sigma_m": None}]}, result)
    assert shown.heights == "1.74 m ± 0.09, 1.50 m ± 0.005, 1.62 m"
    assert np.isclose(shown.sigma_cm, 5.2, atol=1e-5)
    show_result(shown, "", {}, result)
    assert shown.heights == ""
