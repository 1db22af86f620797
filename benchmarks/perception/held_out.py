# SPDX-License-Identifier: GPL-3.0-or-later
"""Shots of the takes that the lifter was not trained on: a section of each, with a random body and
a random camera.

The joint prior was trained on all of them but one: it is split by performer
(`assets/prior/README.md`). Some choices were made by looking at these shots.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.axes import R_WORLD_MODEL, world_from_level_camera
from ...solver import Body
from ...solver.rotations import exp
from ...tools.render_sample.truth import FEET, Shot
from ...tools.train_lifter.split import is_held_out

SEED = 7
SIZE = (640, 480)
SECONDS = 1.5
MIN_SECONDS = 0.7
# under the recorded floor: the fit left a hand there, which the performer's model lacks
SUNK_M = 0.12
MAX_BETA = 2.5  # of a standard normal distribution
# 0.73 to 1.56 of the width: a phone's main camera to twice its focal length
FOCAL_PX = (470.0, 1000.0)
# of the camera; it looks down
HEIGHT_M = (0.8, 2.0)
DISTANCE_M = (3.0, 6.5)
TILT_DEG = (0.0, 15.0)
MIN_FILL = 0.45  # longer side of the person's box over the image height, median of the frames
MARGIN_PX = 12.0  # around the person in all frames
FARTHEST_M = 1.7  # bench and wall are behind it
NEAREST_M = 1.2  # to the camera
FEW = 40  # every 40th point of the skin is tested first
FLOOR_QUANTILE = 0.05  # of the frames, ordered by the height of the lowest point of the feet's skin
# middle of heel and toe
STILL_M_PER_S = 0.15
STANDS_BELOW_M = 0.1
TRIES = 20000


@dataclass(frozen=True)
class Take:
    """One recording as fitted: joint states in a world with y up, and the performer's shape."""

    number: int
    name: str
    poses: NDArray[np.float64]  # (T, 3(K+1)) axis-angle
    trans: NDArray[np.float64]  # (T, 3) metres
    valid: NDArray[np.bool_]  # (T,) bool
    betas: NDArray[np.floating[Any]]  # (P,)
    fps: float
    performer: str = ""


def held_out_takes(path: Path) -> list[Take]:
    """Read the takes held out from the lifter's training, of a file written by
    ``tools.mocap.fit_body``.
    """
    return [take for take in all_takes(path) if is_held_out(np.array(take.number))]


def all_takes(path: Path) -> list[Take]:
    """Read all takes of a file written by ``tools.mocap.fit_body``."""
    with np.load(path) as data:
        arrays = {key: data[key] for key in ("poses", "trans", "valid")}
        keys = ("start", "name", "betas", "fps", "subject")
        start, names, betas, fps, performers = (data[f"take_{key}"] for key in keys)
    takes = []
    for k in range(len(names)):
        rows = {key: array[start[k] : start[k + 1]] for key, array in arrays.items()}
        takes.append(
            Take(
                k,
                str(names[k]),
                **rows,
                betas=betas[k],
                fps=round(float(fps[k]), 1),
                performer=str(performers[k]),
            )
        )
    return takes


def draw_shot(body: Body, take: Take, seed: int = SEED) -> Shot:
    """Return a section of the take with a random body in front of a random camera, reproducible by
    its seed.

    Camera, heading and place are drawn until the person is well inside the image and the room.

    :raises ValueError: when no such camera was found, or the take has no section of valid frames.
    """
    rng = np.random.default_rng([seed, take.number])
    frames = draw_section(rng, body, take, SECONDS)
    betas = np.clip(rng.standard_normal(body.P), -MAX_BETA, MAX_BETA)
    states, pelvis = states_and_pelvis(body, take, frames, betas)
    stands = np.zeros((len(frames), 2), bool)
    trans = pelvis - body.rest_joints(betas)[0]
    shot = Shot(states, trans, betas, np.eye(3), np.eye(4), SIZE, take.fps, stands)
    skin = np.array([shot.vertices_world(body, k) for k in range(len(shot))])
    low = skin.min((0, 1))
    high = skin.max((0, 1))
    floor = floor_under(body, skin)
    offset = np.append(-(low + high)[:2] / 2, -floor)
    shot, R_heading = _draw_camera(rng, shot, skin + offset)
    states[:, 0] = R_heading @ states[:, 0]
    shot = replace(shot, trans=(pelvis + offset) @ R_heading.T - body.rest_joints(betas)[0])
    return replace(shot, standing=standing_feet(body, shot))


def standing_feet(body: Body, shot: Shot) -> NDArray[np.bool_]:
    """Return (T, 2) bool: whether the midpoint of heel and toe of the left and the right foot is
    low and at rest.
    """
    feet = feet_world(body, shot.rotations, shot.trans, shot.betas)
    speed = np.linalg.norm(np.gradient(feet, axis=0), axis=-1) * shot.fps
    return (speed < STILL_M_PER_S) & (feet[..., 2] < STANDS_BELOW_M)


def feet_world(
    body: Body,
    rotations: NDArray[np.float64],
    trans: NDArray[np.float64],
    betas: NDArray[np.floating[Any]],
) -> NDArray[np.float64]:
    """Return (T, 2, 3), the midpoints of heel and toe, left and right, in the world, in metres."""
    points = body.keypoints(*body.forward_kinematics(rotations, trans, betas), betas)
    at = body.keypoint_set("blazepose")
    sides = [[at[f"{side}_{point}"] for point in FEET.values()] for side in ("left", "right")]
    return points[:, sides].mean(axis=2)


def draw_section(
    rng: np.random.Generator, body: Body, take: Take, seconds: float
) -> NDArray[np.intp]:
    """Return the indices (n,) of consecutive valid frames: as many as wanted, or fewer if the take
    has no more.

    :raises ValueError: when the take has no section of valid frames.
    """
    states = exp(take.poses.reshape(len(take.poses), -1, 3).astype(float))
    points = body.keypoints(*body.forward_kinematics(states, take.trans, take.betas), take.betas)
    unsound = np.concatenate([[0], np.cumsum(~take.valid | (points[..., 1].min(axis=1) < -SUNK_M))])
    least, most = (round(length * take.fps) for length in (MIN_SECONDS, seconds))
    for count in range(min(most, len(take.valid)), least - 1, -1):
        starts = np.flatnonzero(unsound[count:] == unsound[: len(unsound) - count])
        if len(starts):
            return rng.choice(starts) + np.arange(count)
    raise ValueError(f"take {take.name} has no {least} sound frames in a row")


def states_and_pelvis(
    body: Body, take: Take, frames: NDArray[np.intp], betas: NDArray[np.floating[Any]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the take's joint states (n, K+1, 3, 3) and pelvis (n, 3) in a world with z up, for a
    body of that shape.

    The root trajectory is the performer's times the ratio of leg lengths, so that feet at rest
    remain at rest.
    """
    states = exp(take.poses[frames].reshape(len(frames), -1, 3).astype(float))
    states[:, 0] = R_WORLD_MODEL @ states[:, 0]
    share = _leg_length(body, betas) / _leg_length(body, take.betas)
    return states, share * (
        body.rest_joints(take.betas)[0] + take.trans[frames].astype(float)
    ) @ R_WORLD_MODEL.T


def floor_under(body: Body, skin: NDArray[np.float64]) -> float:
    """Return the height of the floor under the feet of a skin in motion (T, V, 3), z up."""
    return float(np.quantile(skin[:, _skin_of_feet(body), 2].min(axis=1), FLOOR_QUANTILE))


def _leg_length(body: Body, betas: NDArray[np.floating[Any]]) -> float:
    J = body.rest_joints(betas)
    chain = [body.joint_names.index(f"left_{part}") for part in ("hip", "knee", "ankle")]
    return float(np.linalg.norm(np.diff(J[chain], axis=0), axis=1).sum())


def _skin_of_feet(body: Body) -> NDArray[np.intp]:
    """Return the indices (n,) of the vertices whose largest skinning weight is a foot's."""
    part = body.strongest_joints
    feet = [k for k, name in enumerate(body.joint_names) if name.endswith(("_ankle", "_foot"))]
    return np.flatnonzero(np.isin(part, feet))


def _draw_camera(
    rng: np.random.Generator, shot: Shot, skin: NDArray[np.float64]
) -> tuple[Shot, NDArray[np.float64]]:
    """Draw a camera, and a heading by which the world is turned, with all of the skin (T, V, 3) in
    the image.
    """
    few = skin[:, ::FEW]
    for _ in range(TRIES):
        R_heading = exp(np.array([0.0, 0.0, rng.uniform(0, 2 * np.pi)]))
        tilt = np.radians(rng.uniform(*TILT_DEG))
        focal, height, distance = (
            rng.uniform(*limits) for limits in (FOCAL_PX, HEIGHT_M, DISTANCE_M)
        )
        world_from_camera = world_from_level_camera(
            np.array([0.0, -np.cos(tilt), -np.sin(tilt)]), height
        )
        world_from_camera[1, 3] = -distance
        K = np.array([[focal, 0, SIZE[0] / 2 - 0.5], [0, focal, SIZE[1] / 2 - 0.5], [0, 0, 1]])
        drawn = replace(shot, intrinsics=K, world_from_camera=world_from_camera)
        if _well_inside(drawn, few @ R_heading.T) and _well_inside(drawn, skin @ R_heading.T):
            return drawn, R_heading
    raise ValueError("no camera was found: the person moves too far, or the limits are too narrow")


def _well_inside(shot: Shot, skin: NDArray[np.float64]) -> bool:
    camera = shot.to_camera(skin)
    if camera[..., 2].min() < NEAREST_M or skin[..., 1].max() > FARTHEST_M:
        return False
    uv = shot.project(camera)
    if uv.min() < MARGIN_PX or (uv.max((0, 1)) > np.subtract(shot.size, 1 + MARGIN_PX)).any():
        return False
    longer_side = np.ptp(uv, axis=1).max(axis=1)
    return bool(np.median(longer_side) >= MIN_FILL * shot.size[1])
