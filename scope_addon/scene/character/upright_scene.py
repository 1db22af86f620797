# SPDX-License-Identifier: GPL-3.0-or-later
"""Turning the capture's camera with the captured world, and back to the bit."""

from __future__ import annotations

import json

import numpy as np
from bpy.types import FCurve, Object
from mathutils import Matrix, Quaternion

from ...arrays import Float64Array
from ...kinematics.smoothing import on_one_hemisphere
from ..actions import fcurves, read_keys, rewrite_keys
from ..visibility import world_matrix
from .root_object import parent_transform

# custom property of the camera: JSON of where it was before the first turn, and after the last
_TURNED = "scope_turned"
_LARGEST = 1e9  # of its numbers


def turn_camera(
    camera: Object, armature: Object, transform: Float64Array, *, to_captured: bool
) -> None:
    """Move the capture's camera together with a person; where it was at first if it was not moved
    since.

    :param transform: (4, 4) rigid, of the captured world, in which the armature's keys are.
    :param to_captured: whether the world is then again as it was captured.
    """
    now = _place(camera)
    try:
        before, after = json.loads(camera.get(_TURNED, ""))
    except (TypeError, ValueError, RecursionError):
        before = now
        after = now
    if after != now or not _is_like(before, now):
        before = None  # moved by the user, or a .blend file that somebody has prepared
    if to_captured and before is not None:
        _put(camera, before)
    else:
        move_camera(camera, armature, transform)
    if to_captured:
        camera.pop(_TURNED, None)
    else:
        camera[_TURNED] = json.dumps([before, _place(camera)])


def _place(camera: Object) -> list[list[float]]:
    """Return the camera's keys, or without keys its own transform, as exact numbers."""
    keys = _curves(camera)
    own = [*camera.location, *camera.rotation_quaternion, *camera.rotation_euler, *camera.scale]
    return [[] if keys else own, *(read_keys(c).ravel().tolist() for c in keys)]


def _is_like(place: object, now: list[list[float]]) -> bool:
    """Whether a place has as many numbers as the present one of each kind, and of keys any pairs of
    frame and value.
    """
    if (
        not isinstance(place, list)
        or len(place) != len(now)
        or not all(isinstance(part, list) for part in place)
    ):
        return False
    sizes = len(place[0]) == len(now[0]) and all(
        len(keys) and len(keys) % 2 == 0 for keys in place[1:]
    )
    return sizes and all(
        type(x) in (int, float) and abs(x) < _LARGEST for part in place for x in part
    )


def _put(camera: Object, place: list[list[float]]) -> None:
    """Put the camera where ``_place`` found it."""
    if own := place[0]:
        camera.location = own[:3]
        camera.rotation_quaternion = own[3:7]
        camera.rotation_euler = own[7:10]
        camera.scale = own[10:13]
    for curve, values in zip(_curves(camera), place[1:], strict=True):
        frames, numbers = np.array(values).reshape(-1, 2).T
        rewrite_keys(curve, frames, numbers)


def _curves(camera: Object) -> list[FCurve]:
    """Return the curves of a camera's place."""
    return [c for c in fcurves(camera) if c.data_path in ("location", "rotation_quaternion")]


def move_camera(camera: Object, armature: Object, transform: Float64Array) -> None:
    """Move the capture's camera, with its keys, together with a person.

    :param transform: (4, 4) rigid, of the captured world, in which the armature's keys are.
    """
    world = world_matrix(armature)
    above = parent_transform(camera)
    move = (
        above.inverted_safe() @ world @ Matrix(transform.tolist()) @ world.inverted_safe() @ above
    )
    curves = {(c.data_path, c.array_index): c for c in fcurves(camera)}
    wanted = [("location", k) for k in range(3)] + [("rotation_quaternion", k) for k in range(4)]
    if not all(key in curves for key in wanted):
        camera.matrix_basis = move @ camera.matrix_basis
        return
    keys = [read_keys(curves[key]) for key in wanted]
    frames = keys[0][:, 0].astype(float)
    values = np.stack([np.interp(frames, k[:, 0], k[:, 1]) for k in keys], axis=1)
    moved = [
        (move @ Matrix.LocRotScale(row[:3], Quaternion(row[3:]).normalized(), None)).decompose()[:2]
        for row in values.tolist()
    ]
    values[:, :3] = [tuple(location) for location, _ in moved]
    values[:, 3:] = on_one_hemisphere(np.array([tuple(rotation) for _, rotation in moved]))
    for column, key in enumerate(wanted):
        rewrite_keys(curves[key], frames, values[:, column])
