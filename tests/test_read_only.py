# SPDX-License-Identifier: GPL-3.0-or-later
"""Solving, editing and retargeting change none of their arguments.

Edits and transfers get arrays that cannot be written. For the solver these would be another type,
for which it would have to be compiled, so its arguments are compared with copies.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass

import numpy as np
import pytest
from scope.scope_addon.edit.clip import (
    floor_trajectory,
    relative_to_trajectory,
    resample,
    with_trajectory,
)
from scope.scope_addon.edit.corrections import FeetOnFloor
from scope.scope_addon.edit.edits import refloor
from scope.scope_addon.edit.loop import best_cycle, close_cycle
from scope.scope_addon.edit.smooth import smoothed
from scope.scope_addon.edit.spans import interpolate, swap_sides
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.scope_addon.retarget.bone_map import BoneMap
from scope.scope_addon.retarget.rest_pose import Skeleton
from scope.scope_addon.retarget.transfer import Transfer
from scope.solver import fit
from scope.solver.body import Body
from scope.solver.motion.fit import fit_motion

from .edit.walking import BETAS, BODY, motion_of, walk
from .solver.motion.clips import FLAT, noisy_clip


def arrays_in(value: object, seen: set[int] | None = None) -> Iterator[np.ndarray]:
    """All arrays that a value holds, at any depth, but those of bodies, which the tests share."""
    seen = set() if seen is None else seen
    if id(value) in seen or isinstance(value, Body):
        return
    seen.add(id(value))
    if isinstance(value, np.ndarray):
        yield value
    elif is_dataclass(value):
        for each in fields(value):
            yield from arrays_in(getattr(value, each.name), seen)
    elif isinstance(value, dict):
        yield from arrays_in(list(value.values()), seen)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from arrays_in(item, seen)


def frozen(value):
    """The value, with all its arrays set to read-only."""
    for array in list(arrays_in(value)):
        array.setflags(write=False)
    return value


@contextmanager
def unchanged(*values: object) -> Iterator[None]:
    """Check that a block changes no array of these values."""
    arrays = list(arrays_in(values))
    assert arrays
    before = [array.copy() for array in arrays]
    yield
    for array, copy in zip(arrays, before, strict=True):
        np.testing.assert_array_equal(array, copy)


@pytest.fixture(scope="module")
def clip():
    return frozen(walk(2.0))


EDITS = {
    "resample": lambda clip: resample(clip, 24.0),
    "refloor": lambda clip: refloor(clip, BODY, BETAS, FeetOnFloor(level=True)),
    "loop": lambda clip: close_cycle(clip, best_cycle(clip, BODY, BETAS, 0.0, 2.0)),
    "relative": lambda clip: relative_to_trajectory(clip, *floor_trajectory(clip)),
    "trajectory": lambda clip: with_trajectory(clip, *frozen(floor_trajectory(clip))),
    "interpolate": lambda clip: interpolate(clip, 0.5, 1.0),
    "swap": lambda clip: swap_sides(clip, BODY, 0.5, 1.0),
}


@pytest.mark.parametrize("edit", EDITS.values(), ids=EDITS)
def test_an_edit_returns_another_clip(clip, edit):
    assert edit(clip) is not clip


@pytest.mark.parametrize("strength", [0.0, 1.0])
def test_smoothing_keeps_the_motion(clip, strength):
    motion = frozen(motion_of(clip, noise=0.02))
    assert len(smoothed(BODY, motion, strength)) == len(motion)


def test_a_transfer_keeps_clip_and_rig(clip):
    heads = BODY.rest_joints(BETAS) @ R_WORLD_MODEL.T
    names = list(BODY.joint_names)
    parents = np.array(BODY.parents)
    rig = Skeleton(
        names, parents, parents, heads, heads + [0, 0, 0.1], np.tile(np.eye(3), (len(names), 1, 1))
    )
    pose = Transfer(
        BODY, frozen(BETAS.copy()), frozen(rig), BoneMap({name: name for name in names})
    ).pose(clip)
    assert len(list(arrays_in(pose))) > 0


def test_the_solver_keeps_measurements_and_initial_states():
    clip = noisy_clip(5)
    frames = clip.frames()
    with unchanged(clip.starts, frames, clip.stands, clip.times):
        fit_motion(
            clip.body, frames, clip.times, init=clip.starts, options=FLAT, stands=clip.stands
        )
        fit(clip.body, frames[0][0].measurements, init=clip.starts[0], options=FLAT)
