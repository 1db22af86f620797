# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of the ablation: means over people, medians of IoU, and a dash where nothing was
measured.

The rows of the ablation leave out what they say, and only as long as they are measured.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from scope.benchmarks import ablation
from scope.benchmarks.ablation import LANDMARKS_AS_LIFTED, ROWS, WITHOUT_OFFSETS, replaced
from scope.benchmarks.perception.outline import silhouette
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.fitting.prepared_track import PreparedTrack, prepare_track
from scope.scope_addon.capture.fitting.weights import WEIGHTS
from scope.scope_addon.capture.overlay.overlay_video import camera_vertices
from scope.scope_addon.capture.perception.observation import PersonMask
from scope.scope_addon.capture.perception.region import Region
from scope.solver import Body

from ..capture.silhouettes import K, seen_in
from ..made_motion import made_motion


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


CAMERA = Camera(K, np.zeros(5), "test")


def prepared_in(row: str, body: Body, betas: np.ndarray) -> PreparedTrack:
    """Somebody who is lifted exactly, prepared as in a row."""
    replacements = ROWS[row].get("replacements", ())
    with replaced([LANDMARKS_AS_LIFTED, WITHOUT_OFFSETS, *replacements]):
        return prepare_track(body, seen_in(body, betas, None), CAMERA)


def test_every_row_replaces_something_that_there_is_and_puts_it_back() -> None:
    for row in ROWS.values():
        replacements = row.get("replacements", ())
        before = [getattr(owner, name) for owner, name, _ in replacements]
        with replaced(replacements):
            assert all(getattr(owner, name) is value for owner, name, value in replacements)
        assert [getattr(owner, name) for owner, name, _ in replacements] == before


@pytest.mark.parametrize(
    ("row", "name"),
    [
        ("without 3D keypoints", "keypoints3d"),
        ("without the orientation field", "orientation_field"),
        ("without the joint prior", "joint_prior"),
    ],
)
def test_a_term_left_out_has_weight_zero_and_the_others_keep_theirs(
    row: str, name: str, body: Body
) -> None:
    left_out: dict[str, Any] = {name: 0.0}
    weights = prepared_in(row, body, np.zeros(body.P)).weights
    assert weights == dataclasses.replace(WEIGHTS, **left_out)
