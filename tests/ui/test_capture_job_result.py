# SPDX-License-Identifier: GPL-3.0-or-later
"""Review spans as the panel lists them."""

from types import SimpleNamespace

import numpy as np
from scope.scope_addon.capture_report import Report
from scope.scope_addon.notices import OTHER, notice
from scope.scope_addon.report.capture_page import motion_figures
from scope.scope_addon.scene.build import build_scene
from scope.scope_addon.scene.stored_values import FrameSpan
from scope.scope_addon.ui import capture_panel
from scope.scope_addon.ui.capture_job import review_spans, show_result
from scope.scope_addon.ui.reporting import add_warning, sentence, stored_warning
from scope.solver import load_body
from scope.solver.names import BODY_JOINTS

from ..made_motion import made_motion


def at_rest(body, T=5):
    return made_motion(body, np.zeros((T, body.K + 1, 3)), np.zeros((T, 3)))


def shown_of(body, motion, report=None):
    """Build a motion; return the built scene, and the result that the panel shows of it."""
    built = build_scene([motion], body)
    shown = built.collection.scope_result
    show_result(shown, "", report or Report(), built)
    return built, shown


def test_spans_are_listed_by_reason_in_scene_frames(body):
    motion = at_rest(body, 30)
    motion.valid[[0, 20]] = False
    under = np.zeros(30, bool)
    under[3:6] = True
    assert review_spans(motion, np.arange(30) + 10.0, under) == {
        "unseen": [(10, 10), (30, 30)],
        "floor": [(13, 15)],
    }


def test_heights_and_joints_with_their_deviations(body):
    motion = at_rest(body)
    motion.joint_sigma_m[1:4] = 0.052
    heights = (
        {"height_m": 1.741, "height_sigma_m": 0.0913},
        {"height_m": 1.5, "height_sigma_m": 0.005},
    )
    unsure = {"height_m": 1.62, "height_sigma_m": None}
    built, shown = shown_of(body, motion, Report(per_person=[*heights, unsure]))
    assert shown.heights == "1.74 m ± 0.09, 1.50 m ± 0.005, 1.62 m"
    assert np.isclose(shown.sigma_cm, 5.2, atol=1e-5)
    show_result(shown, "", Report(), built)
    assert shown.heights == ""


def test_the_reprojection_error_is_that_of_frames_the_first_camera_sees(body):
    motion = at_rest(body, 6)
    motion.residual_px[3:] = 4.0
    _, shown = shown_of(body, motion)
    assert shown.reprojection_px == 4.0


def test_panel_and_page_say_the_same_of_joints_and_nothing_of_fingers():
    body = load_body("scope_h")
    motion = at_rest(body)
    motion.joint_sigma_m[:, : len(BODY_JOINTS)] = 0.03
    motion.joint_sigma_m[1, : len(BODY_JOINTS)] = 0.08
    motion.joint_sigma_m[:, len(BODY_JOINTS) :] = 0.2
    _, shown = shown_of(body, motion)
    assert np.isclose(shown.sigma_cm, 3.0, atol=1e-5)
    assert motion_figures(motion, body)["Standard deviation of joints, median"] == "3.0 cm"


def test_a_warning_keeps_the_name_of_the_footage(body):
    motion = at_rest(body)
    motion.source = "my walk.mp4"
    unseen = notice("unseen_legs", footage="my walk.mp4", person=0)
    _, shown = shown_of(body, motion, Report(warnings=[unseen, notice("pixel_aspect")]))
    texts = [stored.text for stored in shown.warnings]
    assert texts[0].startswith("my walk.mp4: the legs of the person were not seen")
    assert texts[1].startswith("The footage's pixels are not square")


def test_a_stored_warning_is_read_again_and_of_a_damaged_one_is_said_so(body):
    shown = build_scene([at_rest(body)], body).collection.scope_result
    drifts = notice("footage_drifts", frames=3.0)
    add_warning(shown, drifts, [FrameSpan(3, 5), FrameSpan(8, 8)])
    stored = shown.warnings[0]
    assert stored_warning(stored) == drifts
    assert stored.spans == "3-5,8"
    for record in ("", "[" * 100_000, "3", '{"code": "footage_drifts", "values": {}}'):
        stored.record = record
        assert stored_warning(stored).code == OTHER
        assert stored.text == "A warning of this result is damaged; capture again to see it"


def test_a_sentence_begins_with_a_capital_but_not_a_file_name():
    assert sentence("walk_side.mp4 contains no person") == "walk_side.mp4 contains no person"
    assert sentence("the file is empty.") == "The file is empty."
    assert sentence("stop. Then go on") == "Stop. Then go on"


def test_figures_are_wrapped_to_the_width_of_the_sidebar(body):
    motion = at_rest(body)
    motion.joint_sigma_m[:] = 0.041
    drawn = []
    heights = [{"height_m": 1.7, "height_sigma_m": 0.1}] * 4
    _, shown = shown_of(body, motion, Report(camera="estimated, 52 degrees", per_person=heights))
    layout = SimpleNamespace(label=lambda text="", icon="NONE": drawn.append(text))
    layout.column = lambda align=False: layout
    region = SimpleNamespace(width=260)
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))
    capture_panel._draw_figures(
        SimpleNamespace(region=region, preferences=preferences), layout, shown
    )
    assert "standard deviation, median" in " ".join(drawn)
    assert max(map(len, drawn)) <= 28  # as wide as the panel's other sentences
