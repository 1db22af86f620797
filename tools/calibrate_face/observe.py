# SPDX-License-Identifier: GPL-3.0-or-later
"""What the face networks see in a set of rendered faces, kept beside the pictures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.perception.face_landmarks import (
    EXPRESSION_POINTS,
    ExpressionNetwork,
    FaceNetwork,
    eye_light,
)
from ...scope_addon.capture.perception.region import Region
from ..render_faces.truth import FOLDER, SIZE

_SIDE_PX = 0.9 * SIZE  # of the first region, in the middle of the picture
_QUALITY = 40  # of JPEG
_ROUNDS = 3  # of the landmark network, each in the region that the one before found


@dataclass(frozen=True)
class SeenFaces:
    """A set with T pictures: its truth by key, and what the networks see."""

    truth: dict[str, NDArray[Any]]
    landmarks: NDArray[np.float64]  # (T, 478, 3) pixels, and depth in pixels
    presence: NDArray[np.float64]  # (T,)
    weights: NDArray[np.float64]  # (T, 52) of the expression network
    eye_light: NDArray[np.float64] | None = None  # (T,); None: as of bare eyes


def seen_faces(name: str, scale: float = 1.0) -> SeenFaces:
    """Return a rendered set as the networks see it.

    :param scale: of the pictures before the networks see them; other than 1, they are also
        compressed, as in videos.
    """
    folder = FOLDER / name
    with np.load(folder / "truth.npz") as data:
        truth = {key: data[key] for key in data.files}
    kept = folder / f"seen_{scale:g}.npz"
    if not kept.is_file() or not _is_whole(kept, len(truth["weights"])):
        _observe(folder, len(truth["weights"]), scale, kept)
    with np.load(kept) as data:
        return SeenFaces(
            truth,
            data["landmarks"].astype(float),
            data["presence"],
            data["weights"],
            data["eye_light"],
        )


def _is_whole(kept: Path, count: int) -> bool:
    with np.load(kept) as data:
        return "eye_light" in data and len(data["presence"]) == count


def _observe(folder: Path, count: int, scale: float, out: Path) -> None:
    network = FaceNetwork()
    expressions = ExpressionNetwork()
    rows = []
    for t in range(count):
        image = cv2.imread(str(folder / f"{t:04d}.png"))
        if image is None:
            raise SystemExit(
                f"{folder} lacks {t:04d}.png; run python -m scope.tools.render_faces {folder.name}"
            )
        if scale != 1.0:
            image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            image = cv2.imdecode(
                cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1],
                cv2.IMREAD_COLOR,
            )
        rgb = np.ascontiguousarray(image[..., ::-1])
        region = Region((scale * SIZE / 2, scale * SIZE / 2), scale * _SIDE_PX, 0.0)
        for _ in range(_ROUNDS):
            estimate = network.estimate(rgb, region)
            region = estimate.next_region
        landmarks = estimate.landmarks / scale
        expression = expressions.estimate(estimate.landmarks[EXPRESSION_POINTS, :2])
        rows.append(
            (
                landmarks.astype(np.float32),
                estimate.presence,
                expression,
                eye_light(rgb, estimate.landmarks),
            )
        )
    landmarks, presence, weights, light = (np.array(column) for column in zip(*rows, strict=True))
    np.savez(out, landmarks=landmarks, presence=presence, weights=weights, eye_light=light)
