# SPDX-License-Identifier: GPL-3.0-or-later
"""Review spans as the panel lists them."""

from types import SimpleNamespace

import numpy as np
from scope.scope_addon.scene.build import build_scene
from scope.scope_addon.ui.capture import capture_panel
from scope.scope_addon.ui.capture.result import frame_warnings, show_result
from scope.scope_addon.ui.reporting import sentence

from ...made_motion import made_motion


def test_spans_are_listed_by_reason_in_scene_frames(body):
    motion = made_motion(body, np.zeros((30, body.K + 1, 3)), np.zeros((30, 3)))
    motion.valid[[0, 20]] = False
    under = np.zeros(30, bool)
    under[3:6] = True
    assert frame_warnings(motion, np.arange(30) + 10.0, under) == {
        "unseen": "10,30",
        "floor": "13-15",
    }


def test_heights_and_joints_with_their_deviations(body):
    motion = made_motion(body, np.zeros((5, body.K + 1, 3)), np.zeros((5, 3)))
    motion.joint_sigma_m[1:4] = 0.052
    result = build_scene([motion], body)
    shown = result.collection.scope_result
    heights = (
        {"height_m": 1.741, "height_sigma_m": 0.0913},
        {"height_m": 1.5, "height_sigma_m": 0.005},
    )
    show_result(
        shown, "", {"per_person": [*heights, {"height_m": 1.62, "height_sigma_m": None}]}, result
    )
    assert shown.heights == "1.74 m ± 0.09, 1.50 m ± 0.005, 1.62 m"
    assert np.isclose(shown.sigma_cm, 5.2, atol=1e-5)
    show_result(shown, "", {}, result)
    assert shown.heights == ""


def test_a_warning_keeps_the_name_of_the_footage(body):
    motion = made_motion(body, np.zeros((5, body.K + 1, 3)), np.zeros((5, 3)))
    motion.source = "my walk.mp4"
    result = build_scene([motion], body)
    shown = result.collection.scope_result
    show_result(
        shown,
        "",
        {"warnings": ["my walk.mp4: the person was not seen", "the lens is a guess"]},
        result,
    )
    assert [w.text for w in shown.warnings][:2] == [
        "my walk.mp4: the person was not seen",
        "The lens is a guess",
    ]


def test_a_sentence_begins_with_a_capital_but_not_a_file_name():
    assert sentence("walk_side.mp4 contains no person") == "walk_side.mp4 contains no person"
    assert sentence("the file is empty.") == "The file is empty."
    assert sentence("stop. Then go on") == "Stop. Then go on"


def test_figures_are_wrapped_to_the_width_of_the_sidebar(body):
    motion = made_motion(body, np.zeros((5, body.K + 1, 3)), np.zeros((5, 3)))
    motion.joint_sigma_m[:] = 0.041
    result = build_scene([motion], body)
    shown = result.collection.scope_result
    drawn = []
    heights = [{"height_m": 1.7, "height_sigma_m": 0.1}] * 4
    show_result(shown, "", {"camera": "estimated, 52 degrees", "per_person": heights}, result)
    layout = SimpleNamespace(label=lambda text="", icon="NONE": drawn.append(text))
    layout.column = lambda align=False: layout
    region = SimpleNamespace(width=260)
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))
    capture_panel._draw_figures(
        SimpleNamespace(region=region, preferences=preferences), layout, shown
    )
    assert "standard deviation, median" in " ".join(drawn)
    assert max(map(len, drawn)) <= 28  # as wide as the panel's other sentences
