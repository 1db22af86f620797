# SPDX-License-Identifier: GPL-3.0-or-later
"""Strips of a capture: footage, the overlay, and the body seen from the side, frame by frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.fitting.outline import spread
from ...scope_addon.capture.media.video import open_video
from ...scope_addon.capture.overlay_video import body_colors, draw_overlay, painted_frames
from ...scope_addon.motion import Motion
from ...scope_addon.report.page import Markup, Picture, small_picture
from ...solver.body import Body
from ...solver.rotations import exp
from ...tools.readme_pictures.view import level_camera

# of a strip; of a picture; height of what the view from the side shows
SHOTS = 6
SIDE_PX = 360
SHOWN_M = 2.4
# share of the picture that may be covered; what is nearer is not looked at
_FILLED = 0.95
_NEAREST_M = 0.3
# grey behind the body; opacity of a pose that is filled in
_GROUND = 236
_FAINT = 0.35

Image = NDArray[np.uint8]


def strips(
    video: Path,
    motions: Sequence[Motion],
    body: Body,
    first_s: float = 0.0,
    last_s: float = math.inf,
) -> Markup:
    """Return three rows of pictures at the same frames, spread over a part of the clip, each with a
    caption.
    """
    times = motions[0].timestamps
    part = np.flatnonzero((times >= first_s) & (times <= last_s))
    rows = spread(part, SHOTS)
    wanted = motions[0].frames[rows].tolist()
    footage = frames_of(video, wanted)
    overlay = dict(painted_frames(video, motions, body, wanted))
    side = {
        frame: side_view(motions, body, int(row)) for frame, row in zip(wanted, rows, strict=True)
    }
    at = dict(zip(wanted, times[rows].tolist(), strict=True))
    parts = []
    for name, pictures in (("footage", footage), ("overlay", overlay), ("turned by 90°", side)):
        shown = [frame for frame in wanted if frame in pictures]
        images = [small_picture(0, pictures[frame], SIDE_PX) for frame in shown]
        captions = [f"{name}, {at[frame]:.2f} s" for frame in shown]
        parts.append(figures(images, captions, [f"{name}, frame {frame}" for frame in shown]))
    return Markup("".join(parts))


def figures(
    pictures: Sequence[Picture],
    captions: Sequence[str],
    descriptions: Sequence[str] | None = None,
    large: bool = False,
) -> Markup:
    """Return pictures next to each other, each above its caption.

    :param descriptions: what is shown instead of the pictures; None: the captions.
    :param large: whether fewer fit into a row.
    """
    shown = "".join(
        f'<figure><img src="{picture.url}" width="{picture.width}" height="{picture.height}" '
        f'alt="{escape(description)}"><figcaption>{escape(caption)}</figcaption></figure>'
        for picture, caption, description in zip(
            pictures, captions, descriptions or captions, strict=True
        )
    )
    return Markup(f'<div class="shots{" large" if large else ""}">{shown}</div>\n')


def frames_of(video: Path, wanted: Sequence[int]) -> dict[int, Image]:
    """Return the images of some frames of the footage."""
    with open_video(video) as footage:
        return {frame.index: frame.image_rgb for frame in footage if frame.index in wanted}


def side_view(motions: Sequence[Motion], body: Body, row: int) -> Image:
    """Return the bodies of a row as a camera sees them that went a quarter turn around their
    middle, at its height.

    People who were not seen are faint. What is shown is `SHOWN_M` high, more where that does not
    hold everybody.
    """
    world = []
    roots = []
    for motion in motions:
        betas = motion.betas.astype(float)
        R, t = body.forward_kinematics(
            exp(motion.poses[row].reshape(-1, 3).astype(float)),
            motion.trans[row].astype(float),
            betas,
        )
        world.append(body.skin(R, t, betas))
        roots.append(t[0])
    middle = np.mean(roots, axis=0)
    R_camera_world, eye = turned_camera(motions[0].world_from_camera[row], middle)
    seen = [motion.valid[row] for motion in motions]
    vertices = [(points - eye) @ R_camera_world.T for points in world]
    ahead = np.concatenate(vertices)
    ahead = ahead[ahead[:, 2] > _NEAREST_M]
    widest = float(np.abs(ahead[:, :2] / ahead[:, 2:]).max(initial=0.0))
    focal = SIDE_PX * float(np.linalg.norm(middle - eye)) / SHOWN_M
    focal = min(focal, _FILLED * SIDE_PX / 2 / widest) if widest > 0 else focal
    K = np.array([[focal, 0, SIDE_PX / 2], [0, focal, SIDE_PX / 2], [0, 0, 1]])
    blank = np.full((SIDE_PX, SIDE_PX, 3), _GROUND, np.uint8)
    colors = [body_colors(body, k) for k in range(len(motions))]
    return draw_overlay(
        blank, vertices, body.faces, K, None, colors, [1.0 if each else _FAINT for each in seen]
    )


def turned_camera(
    world_from_camera: NDArray[Any], target: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return rotation, world to camera in OpenCV's axes, and centre of a camera a quarter turn
    further around a target.

    It looks at the target with z up.
    """
    x, y, z = world_from_camera[:3, 3] - target
    eye = target + [-y, x, z]
    forward = (target - eye) / np.linalg.norm(target - eye)
    return level_camera(eye, forward)[:3, :3].T, eye
