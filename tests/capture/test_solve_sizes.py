# SPDX-License-Identifier: GPL-3.0-or-later
"""Two people on one floor, the height of one of them given: the other one's follows from the
floor.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.fitting.stature import with_stature
from scope.scope_addon.capture.several_views.bundle import CameraPlace
from scope.scope_addon.capture.several_views.person_in_views import PersonInViews
from scope.scope_addon.capture.solve import solve, solve_people
from scope.solver import default_priors
from scope.solver.rotations import exp

from .standing_people import BODY, T_CAMERA_WORLD, seen, steps

pytestmark = pytest.mark.usefixtures("exact_lifting")
TALL_M = 1.95
SHORT_M = 1.5


def shape(height_m: float) -> np.ndarray:
    """The proportions of the mean, as tall as that: nothing but the floor tells the size."""
    betas = np.asarray(with_stature(default_priors(BODY), BODY, height_m).shape_mean)
    assert BODY.stature(betas) == pytest.approx(height_m, abs=0.005)
    return betas


@pytest.mark.slow
def test_the_size_of_others_follows_from_a_given_height():
    tracks = [steps(0.0, shape(TALL_M), -0.6), steps(0.0, shape(SHORT_M), 0.6)]
    unknown = solve(seen(tracks[0]), tracks, lambda *_: None).motions[1]
    tall, short = solve(seen(tracks[0]), tracks, lambda *_: None, (TALL_M,)).motions
    assert BODY.stature(tall.betas) == pytest.approx(TALL_M, abs=0.01)
    off_m = abs(BODY.stature(short.betas) - SHORT_M)
    assert off_m < min(0.6 * abs(BODY.stature(unknown.betas) - SHORT_M), 0.03)
    # The deviation of such a size is not that of a given one.
    assert tall.height_sigma_m < 0.02
    assert short.height_sigma_m > 0.09


@pytest.mark.slow
@pytest.mark.parametrize("is_seen_by_both", [False, True])
def test_a_given_height_corrects_only_whom_no_second_camera_sees(is_seen_by_both):
    """A second camera at 90° to the first one."""
    R = exp(np.array([0.0, np.radians(90.0), 0.0]))
    place = CameraPlace(R, np.array([0.0, 0.0, 3.5]) - R @ np.array([0.0, 0.0, 3.5]))
    T_other_world = np.eye(4)
    T_other_world[:3, :3] = R @ T_CAMERA_WORLD[:3, :3]
    T_other_world[:3, 3] = R @ T_CAMERA_WORLD[:3, 3] + place.t_camera_first
    shapes = [(shape(TALL_M), -0.6), (shape(SHORT_M), 0.6)]
    tracks, theirs = (
        [steps(0.0, betas, right_m, T) for betas, right_m in shapes]
        for T in (T_CAMERA_WORLD, T_other_world)
    )
    shot = seen(tracks[0])
    resized = []

    class Counted(PersonInViews):
        def fit_with_height(self, height_m: float) -> None:
            resized.append(height_m)
            super().fit_with_height(height_m)

    people = [
        Counted(shot, own, others, height_m, lambda *_: None)
        for own, others, height_m in (
            (tracks[0], [(theirs[0], shot.camera, place)], TALL_M),
            (tracks[1], [(theirs[1], shot.camera, place)] if is_seen_by_both else [], None),
        )
    ]
    tall, short = (BODY.stature(motion.betas) for motion in solve_people(shot, people).motions)
    assert tall == pytest.approx(TALL_M, abs=0.01)
    assert short == pytest.approx(SHORT_M, abs=0.03)
    assert bool(resized) is not is_seen_by_both
