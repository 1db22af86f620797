# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits that a motion keeps: frames that are interpolated, and feet that are put on the floor.

They change what was captured, in whatever smoothing. Feet that stand and pins are measurements and
are applied to the result, so that they hold.

A correction of the world moves everything, the camera too, by a rigid transform.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ...solver.rotations import exp, log
from ..motion import Motion
from .clip import Clip
from .corrections import (
    Correction,
    FeetOnFloor,
    Interpolation,
    feet_on_floor,
    floor_height,
    world_of,
)
from .floor import refloor
from .solve_pins import Shot, keys_of_span
from .spans import interpolate


def edited(
    clip: Clip,
    body: Body,
    betas: NDArray[np.floating[Any]],
    corrections: Iterable[Correction],
    shot: Shot,
) -> Clip:
    """Apply the edits among the corrections, in the captured world: interpolations in their order,
    then the feet.

    :param betas: (P,) shape coefficients.
    """
    corrections = tuple(corrections)
    out = interpolated(clip, [c for c in corrections if isinstance(c, Interpolation)], shot)
    feet = feet_on_floor(corrections)
    world = world_of(corrections)
    if feet is None:
        return out
    height = floor_above(corrections, feet)
    if world is None:
        return on_floor(out, body, betas, feet, height)
    return moved_clip(
        on_floor(moved_clip(out, world), body, betas, feet, height), np.linalg.inv(world)
    )


def interpolated(
    clip: Clip, spans: Iterable[Interpolation], shot: Shot, *, strict: bool = False
) -> Clip:
    """Interpolate spans of source frames, one after the other, where they have a key on both sides.

    Other spans stay as they are.

    :param shot: the footage's frames and times, on the clip's clock.
    :param strict: refuse the other spans.
    :raises UsageError: ``strict``, and a span has no key, or none on one side.
    """
    out = clip.copy()
    for each in spans:
        span = keys_of_span(clip, each.first, each.last, shot)
        if not len(span) or span[0] == 0 or span[-1] == len(clip) - 1:
            if strict:  # This raises, and says why the span cannot be interpolated.
                out = interpolate(out, shot.time(each.first), shot.time(each.last))
            continue
        # Two keys on each side give the velocities at both ends.
        around = slice(max(span[0] - 2, 0), span[-1] + 3)
        part = interpolate(out.rows(around), out.times[span[0]], out.times[span[-1]])
        out.rotations[around] = part.rotations
        out.root[around] = part.root
    return out


def floor_above(corrections: Iterable[Correction], feet: FeetOnFloor) -> float:
    """Return the z of the floor that feet are put on, metres, in the world that the corrections
    have moved.
    """
    return feet.height - floor_height(corrections)


def on_floor(
    clip: Clip, body: Body, betas: NDArray[np.floating[Any]], feet: FeetOnFloor, height: float
) -> Clip:
    """Put the feet on a floor at a ``height`` z, metres, in the clip's world.

    :param betas: (P,) shape coefficients.
    """
    return refloor(clip, body, betas, level=feet.level, lift=feet.lift, height=height)


def moved_motion(motion: Motion, body: Body, transform: NDArray[np.float64]) -> Motion:
    """Move a motion and its camera in the world; what its corrections say stays as it is.

    :param transform: (4, 4) rigid.
    """
    rest = body.rest_joints(motion.betas)[0]
    changed: dict[str, Any] = {"world_from_camera": transform @ motion.world_from_camera}
    for poses, trans in (("poses", "trans"), ("poses_raw", "trans_raw")):
        changed[poses], changed[trans] = _moved(
            getattr(motion, poses), getattr(motion, trans), rest, transform
        )
    return replace(motion, **changed)


def moved_clip(clip: Clip, transform: NDArray[np.float64]) -> Clip:
    """Move a clip in the world; ``transform`` (4, 4) is rigid."""
    rotations = clip.rotations.copy()
    rotations[:, 0] = transform[:3, :3] @ rotations[:, 0]
    return Clip(clip.times, rotations, clip.root @ transform[:3, :3].T + transform[:3, 3])


def _moved(
    poses: NDArray[np.floating[Any]],
    trans: NDArray[np.floating[Any]],
    rest: NDArray[np.float64],
    transform: NDArray[np.float64],
) -> tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]]:
    """Move poses (T, 3(K+1)) and translations (T, 3) of a body whose pelvis rests at ``rest``
    (3,).
    """
    new = poses.copy()
    new[:, :3] = log(transform[:3, :3] @ exp(poses[:, :3].astype(float)))
    pelvis = (rest + trans) @ transform[:3, :3].T + transform[:3, 3]
    return new, (pelvis - rest).astype(trans.dtype)
