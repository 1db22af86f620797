# SPDX-License-Identifier: GPL-3.0-or-later
"""Strips of a capture: footage, the overlay, and the body seen from the side, frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.media.video import open_video
from ...scope_addon.capture.overlay.overlay_video import body_colors, draw_overlay, painted_frames
from ...scope_addon.motion import Motion
from ...scope_addon.report.footage_pictures import small_picture, spread_rows
from ...scope_addon.report.page import Markup
from ...solver.body import Body
from ...solver.rotations import exp
from ...tools.readme_pictures.view import level_camera

SHOTS, SIDE_PX, SHOWN_M = 6, 360, 2.4  # of a strip; of a picture; height of what the view from the side shows
_GROUND = 236  # grey behind the body

Image = NDArray[np.uint8]


def strips(video: Path, motion: Motion, body: Body) -> Markup:
    """Return three rows of pictures at the same frames, with captions."""
    rows = spread_rows(len(motion), SHOTS)
    wanted = motion.frames[rows].tolist()
    footage = frames_of(video, wanted)
    overlay = dict(painted_frames(video, [motion], body, wanted))
    side = {frame: side_view(motion, body, int(row)) for frame, row in zip(wanted, rows, strict=True)}
    parts = []
    for name, pictures in (("footage", footage), ("overlay", overlay), ("turned by 90 degrees", side)):
        images = [(frame, small_picture(0, pictures[frame], SIDE_PX)) for frame in wanted if frame in pictures]
        shown = "".join(
            f'<img src="{picture.url}" width="{picture.width}" height="{picture.height}" '
            f'alt="{escape(name)}, frame {frame}" title="{escape(name)}, frame {frame}">'
            for frame, picture in images
        )
        parts.append(f'<div class="shots">{shown}</div>\n')
    return Markup("".join(parts))


def frames_of(video: Path, wanted: Sequence[int]) -> dict[int, Image]:
    """Return the images of some frames of the footage."""
    with open_video(video) as footage:
        return {frame.index: frame.image_rgb for frame in footage if frame.index in wanted}


def side_view(motion: Motion, body: Body, row: int) -> Image:
    """Return the body of a row as a camera sees it that went around it by a quarter turn, at the same height."""
    betas = motion.betas.astype(float)
    R, t = body.forward_kinematics(
        exp(motion.poses[row].reshape(-1, 3).astype(float)), motion.trans[row].astype(float), betas
    )
    R_camera_world, eye = turned_camera(motion.world_from_camera[row], t[0])
    vertices = (body.skin(R, t, betas) - eye) @ R_camera_world.T
    focal = SIDE_PX * float(np.linalg.norm(t[0] - eye)) / SHOWN_M
    K = np.array([[focal, 0, SIDE_PX / 2], [0, focal, SIDE_PX / 2], [0, 0, 1]])
    blank = np.full((SIDE_PX, SIDE_PX, 3), _GROUND, np.uint8)
    return draw_overlay(blank, [vertices], body.faces, K, None, [body_colors(body, 0)], 1.0)


def turned_camera(world_from_camera: NDArray[Any], target: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return rotation, world to camera in OpenCV's axes, and centre of a camera a quarter turn further around a target.

    It looks at the target with z up.
    """
    x, y, z = world_from_camera[:3, 3] - target
    eye = target + [-y, x, z]
    forward = (target - eye) / np.linalg.norm(target - eye)
    return level_camera(eye, forward)[:3, :3].T, eye
