# SPDX-License-Identifier: GPL-3.0-or-later
"""Points by name are those of their numbers, and a clip's arrays those of a list of frames."""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    Floor,
    FootContacts,
    InvalidValueError,
    Keypoints2D,
    Keypoints3D,
    Measurements,
    OrientationField,
    PosePriors,
    ShapeError,
    StandingPoints,
    View,
    fit,
    fit_batch,
    fit_clip,
    fit_motion,
    frames_of,
)

from .small_problem import BODY, POINTS, K, M
from .synthetic import INTRINSICS, project

T = 3


class Named:
    """The small body, whose points have names."""

    keypoint_names = tuple(f"set/{j}" for j in range(M))
    joint_names = tuple(f"joint{i}" for i in range(K + 1))

    def __getattr__(self, name):
        return getattr(BODY, name)


NAMED = Named()
NAMES = list(NAMED.keypoint_names)
NUMBERS = np.arange(M)
MOVING = POINTS + 0.01 * np.arange(T)[:, None, None]


def same(a, b):
    assert a.cost == b.cost
    np.testing.assert_array_equal(a.t_camera_part, b.t_camera_part)


def test_a_point_is_found_by_its_name(body):
    assert body.point("coco/nose") == body.keypoint_names.index("coco/nose")
    assert body.point("left_wrist") == len(body.keypoint_names) + 20
    with pytest.raises(InvalidValueError, match="no point named 'nose'; did you mean 'coco/nose'"):
        body.point("nose")
    with pytest.raises(InvalidValueError, match="must be a text, but is an int"):
        body.point(3)


def test_names_give_what_their_numbers_give():
    pixels = project(POINTS)
    for named, numbered in (
        (Keypoints3D(NAMES, POINTS), Keypoints3D(NUMBERS, POINTS)),
        (Keypoints3D(np.array(NAMES, object), POINTS), Keypoints3D(NUMBERS, POINTS)),
        (
            Keypoints3D(["joint1", 3, "set/5"], POINTS[:3]),
            Keypoints3D([M + 1, 3, 5], POINTS[:3]),
        ),
    ):
        same(
            fit(NAMED, Measurements(keypoints3d=named)),
            fit(BODY, Measurements(keypoints3d=numbered)),
        )
    named = Measurements(
        INTRINSICS,
        Keypoints2D(np.array(NAMES), pixels),
        None,
        OrientationField(["joint0"], ["joint1"], [[0.0, 1.0, 0.0]]),
        PosePriors(["joint1"], np.eye(3)[None], POINTS[:1], [1.0], [1.0]),
        FootContacts(["set/2"], POINTS[2:3], [1.0]),
        Floor(["set/3"], [0.0, -1.0, 0.0], -1.0, [0.5]),
    )
    numbered = frames_of(NAMED, [named])[0]
    assert numbered.orientation_field.starts.tolist() == [M]
    assert numbered.orientation_field.ends.tolist() == [M + 1]
    assert numbered.pose_priors.parts.tolist() == [1]
    assert numbered.foot_contacts.indices.tolist() == [2]
    assert numbered.floor.indices.tolist() == [3]
    assert frames_of(BODY, [numbered])[0] is numbered


def test_a_body_without_names_says_so():
    with pytest.raises(
        InvalidValueError,
        match="Indices of 3D keypoints: the body has no point named 'nose'; its points",
    ):
        fit(BODY, Measurements(keypoints3d=Keypoints3D(["nose"], POINTS[:1])))
    with pytest.raises(InvalidValueError, match=r"no point named 'sat/3'; did you mean 'set/3'"):
        fit(NAMED, Measurements(keypoints3d=Keypoints3D(["sat/3"], POINTS[:1])))


@pytest.mark.parametrize("confidence", [1.0, np.ones(M), np.ones((T, M))])
def test_a_clips_arrays_are_its_frames(confidence):
    clip = Measurements(keypoints3d=Keypoints3D(NAMES, MOVING, confidence))
    frames = [Measurements(keypoints3d=Keypoints3D(NUMBERS, points)) for points in MOVING]
    assert fit_clip(NAMED, clip).cost == fit_clip(BODY, frames).cost
    for found, expected in zip(
        fit_batch(NAMED, clip, threads=1), fit_batch(BODY, frames, threads=1), strict=True
    ):
        same(found, expected)


def test_a_motions_arrays_are_its_frames_and_its_cameras_views():
    times = np.arange(T) / 30.0
    seen = Keypoints2D(NAMES, np.array([project(points) for points in MOVING]))
    clip = Measurements(INTRINSICS, seen, Keypoints3D(NAMES, MOVING))
    frames = frames_of(NAMED, clip)
    stands = StandingPoints(["set/1", 2], np.ones((T, 2)))
    numbers = replace(stands, indices=[1, 2])
    expected = fit_motion(BODY, frames, times, stands=numbers)
    for given in (clip, [View(clip)], [[View(m)] for m in frames], [[View(m)] for m in frames]):
        found = fit_motion(NAMED, given, times, stands=stands)
        assert found.cost == expected.cost
        np.testing.assert_array_equal(found.t_world_part, expected.t_world_part)


def test_arrays_that_are_no_clip_are_refused():
    one = Measurements(keypoints3d=Keypoints3D(NUMBERS, POINTS))
    with pytest.raises(
        InvalidValueError,
        match=r"is a Measurements of one frame; those of a clip have pixels \(T, n, 2\)",
    ):
        fit_clip(BODY, one)
    with pytest.raises(ShapeError, match="points of keypoints3d have 3, confidence of keypoints3d"):
        fit_clip(BODY, Measurements(keypoints3d=Keypoints3D(NUMBERS, MOVING, np.ones((2, M)))))
    with pytest.raises(ShapeError, match=r"must have shape \(12, 3\)"):
        fit(BODY, Measurements(keypoints3d=Keypoints3D(NUMBERS, MOVING)))
    shorter = Measurements(keypoints3d=Keypoints3D(NUMBERS, MOVING[:2]))
    longer = Measurements(keypoints3d=Keypoints3D(NUMBERS, MOVING))
    with pytest.raises(ShapeError, match=r"same number of frames, but have \[2, 3\]"):
        fit_motion(BODY, [View(shorter), View(longer)], [0.0, 0.1])
    with pytest.raises(InvalidValueError, match="must be a list"):
        fit_clip(BODY, 3)
