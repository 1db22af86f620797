# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of the ablation: means over people, medians of IoU, and a dash where nothing was
measured.
"""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scope.benchmarks import ablation
from scope.benchmarks.perception.accuracy import CAMERAS, SHOWN
from scope.benchmarks.perception.outline import silhouette
from scope.scope_addon.capture.overlay.overlay_video import camera_vertices
from scope.scope_addon.capture.perception.observation import PersonMask
from scope.scope_addon.capture.perception.region import Region
from scope.solver import Body

from ..made_motion import made_motion


def test_a_table_has_means_of_people_and_medians_of_iou(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(ablation, "RENDERS", tmp_path)
    (tmp_path / "walks.mp4").touch()
    camera = dict.fromkeys(SHOWN, 1.0) | {"jitter_rel": 7.0, "foot_slide_cm": 0.25}
    clips: dict[str, dict[str, ablation.People]] = {
        name: {"row": [camera | {"mpjpe_root": 60.0 + k, "pa_mpjpe": 40.0, "iou": 0.8 + 0.01 * k}]}
        for k, name in enumerate(CAMERAS)
    }
    clips |= {"walks": {"row": [camera | {"mpjpe_root": 80.0, "pa_mpjpe": 50.0, "iou": 0.5}]}}
    clips |= {
        "development_00": {"row": [{"mpjpe_root": 90.0, "pa_mpjpe": 30.0}]},
        "development_03": {
            "row": [
                {"mpjpe_root": 100.0, "pa_mpjpe": 40.0},
                {"mpjpe_root": 110.0, "pa_mpjpe": 50.0},
            ]
        },
        "development_06": {"row": [None]},
        "jumps": {"row": [{"iou": 0.7}]},
        "nobody": {"row": [None]},
    }
    shown = ablation.ablation_table(clips, {"row": {}}).splitlines()
    assert "1 renders" in shown[0]
    cells = [cell.strip() for cell in shown[-1].strip("|").split("|")]
    expected = [
        "row",
        "61.5 / 40.0",
        "7",
        "0.25",
        "80.0 / 50.0",
        "100.0 / 40.0",
        "",
        "0.815",
        "0.700",
    ]
    assert cells == expected


def test_feet_that_never_stand_count_in_no_mean(
    monkeypatch: pytest.MonkeyPatch, body: Body, tmp_path: Path
) -> None:
    """The tool has no sliding for a clip in which nobody stands; the means are of the other
    clips.
    """
    motion = made_motion(body, np.zeros((1, body.K + 1, 3)), np.zeros((1, 3)))
    track = SimpleNamespace(masks=())
    observed = SimpleNamespace(
        solve=lambda **_: [motion], tracks=[track], shot=SimpleNamespace(image_size=(640, 480))
    )
    figures = dict.fromkeys(SHOWN, 50.0) | {"foot_slide_cm": None}
    monkeypatch.setattr(ablation, "observe_clip", lambda *_: observed)
    monkeypatch.setattr(ablation, "evaluate_motion", lambda *_: figures)
    rolls = ablation.measure_clip(
        body, tmp_path / "cam1.mp4", tmp_path / "truth_cam1.npz", {"row": {}}
    )
    first = rolls["row"][0]
    assert first is not None
    assert np.isnan(first["foot_slide_cm"])
    walks: dict[str, ablation.People] = {
        "row": [dict(first) | {"foot_slide_cm": 0.5, "mpjpe_root": 70.0}]
    }
    shown = ablation.ablation_table({"cam1": rolls, "cam2": walks}, {"row": {}}).splitlines()[-1]
    assert [cell.strip() for cell in shown.strip("|").split("|")][1:4] == [
        "60.0 / 50.0",
        "50",
        "0.50",
    ]


def test_what_was_not_measured_is_a_dash() -> None:
    shown = ablation.ablation_table({"jumps": {"row": [None]}}, {"row": {}}).splitlines()[-1]
    assert [cell.strip() for cell in shown.strip("|").split("|")] == ["row", *"–––––", "", "–", "–"]


def test_people_are_compared_with_themselves() -> None:
    """3 and 5 mm more, and 7 of the second of two people, whose other one is not found."""
    people = [{"mpjpe_root": 100.0, "pa_mpjpe": 40.0}, {"mpjpe_root": 200.0, "pa_mpjpe": 40.0}]
    worse = [people[0] | {"mpjpe_root": 103.0}, people[1] | {"mpjpe_root": 205.0}]
    clips: dict[str, dict[str, ablation.People]] = {
        "development_00": {ablation.ALL_PARTS: people, "row": worse},
        "development_03": {
            ablation.ALL_PARTS: people,
            "row": [None, people[1] | {"mpjpe_root": 207.0}],
        },
    }
    shown = ablation.ablation_table(clips, {ablation.ALL_PARTS: {}, "row": {}}).splitlines()
    assert "+5.0 (" in shown[-1]
    assert "(" not in shown[-2]


def test_iou_is_of_the_frames_that_have_masks(body: Body) -> None:
    """A mask of the body itself has 1, of its left half about a half, and one of an unseen frame
    does not count.
    """
    turned = np.tile(np.array([[0.0, 0.0, np.pi]] + [[0.0] * 3] * body.K), (3, 1, 1))
    seen = np.array([True, True, False])
    camera = np.tile(np.eye(4), (3, 1, 1))
    trans = np.tile([0.0, 0.0, 3.0], (3, 1))
    motion = made_motion(body, turned, trans, valid=seen, world_from_camera=camera)
    region = Region((320.0, 240.0), 480.0, 0.0)
    size = (640, 480)
    whole = (
        silhouette(body, camera_vertices(motion, body, 0), motion.intrinsics, None, size, region)
        == 2
    )
    assert whole.sum() > 1000
    half = whole & (np.arange(256) < np.median(np.nonzero(whole)[1]))
    wrong = np.ones((256, 256))
    masks = [PersonMask(region, picture.astype(float), size) for picture in (whole, whole, wrong)]
    assert ablation.mask_iou(body, motion, tuple(enumerate(masks)), size) == 1.0
    masks[1] = PersonMask(region, half.astype(float), size)
    assert 0.7 < ablation.mask_iou(body, motion, tuple(enumerate(masks)), size) < 0.8
    assert np.isnan(ablation.mask_iou(body, motion, (), size))
