# SPDX-License-Identifier: GPL-3.0-or-later
r"""`./scripts/bench outline`: how well captured bodies cover people, against the landmark network's
person mask.

    IoU = |B ∩ M| / |B ∪ M|,   outside the mask = |B \ M| / |B|,   outside the body = |M \ B| / |M|
with B the pixels of the captured body and M those of the mask (probability at least 0.5), both in
the 256 × 256 region that the network saw, and only where the region lies in the image. Medians over
the frames in which the person was seen. The clips are those next to the checkout and, once
`./scripts/bench renders` has made them, the renders; for these the true body is measured against
the mask as well, which says what IoU a perfect capture has.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.fitting.live_body import LiveBody
from ...scope_addon.capture.fitting.rasterizer import Canvas, rasterize
from ...scope_addon.capture.media.frame import Frame
from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.overlay_video import camera_vertices
from ...scope_addon.capture.perception.landmark_network import INPUT_SIZE, LandmarkNetwork
from ...scope_addon.capture.perception.observation import Observation
from ...scope_addon.capture.perception.region import Region
from ...scope_addon.capture.perception.sessions import landmark_network_name
from ...scope_addon.capture.pipeline import capture
from ...scope_addon.errors import NoPersonError
from ...scope_addon.motion import Motion
from ...solver import Body, load_body
from ...solver.rotations import exp
from ..frames import CLIPS, DATA
from ..report import table
from .render_shots import RENDERS

SHOWN = {
    "iou": "IoU",
    "body_outside": "body outside the mask",
    "mask_outside": "mask outside the body",
    "height_m": "height m",
    "true_iou": "IoU of the true body",
}
FIGURES = ("iou", "body_outside", "mask_outside")
MORE_CLIPS = tuple(f"clips/{name}.mp4" for name in ("two_people_portrait", "sit_stand_close"))
# probability from which a pixel is the person's, and of presence from which there is one
SURE = 0.5
FRAMES_PER_CLIP = 100  # about; a mask takes as long as the lite network


@dataclass
class Seen:
    """The masks of a clip's largest person, by source frame index."""

    network: LandmarkNetwork
    stride: int
    frames: int = 0
    masks: dict[int, tuple[Region, NDArray[np.bool_], NDArray[np.float64]]] = field(
        default_factory=dict
    )
    size: tuple[int, int] = (0, 0)

    def watch(self, frame: Frame, people: Sequence[Observation], _: LiveBody) -> None:
        """Keep the mask of this frame, if it is due; a region in which nobody may be has none."""
        self.frames += 1
        height, width = frame.image_rgb.shape[:2]
        self.size = width, height
        if not people or (self.frames - 1) % self.stride or people[0].presence < SURE:
            return
        largest = people[0]
        mask = self.network.mask(frame.image_rgb, largest.region) >= SURE
        self.masks[frame.index] = largest.region, mask, largest.keypoints_px


def outline(quick: bool) -> dict[str, Any]:
    """Measure every clip, print the tables as they come, return the figures by preset and clip."""
    if not DATA.is_dir():
        print(f"{DATA} does not exist: nothing was measured; put the clips there", file=sys.stderr)
        return {}
    body = load_body("scope")
    clips = [DATA / name for name in CLIPS + MORE_CLIPS] + sorted(RENDERS.glob("*.mp4"))
    figures: dict[str, Any] = {}
    for quality in (CaptureOptions().quality,) if quick else ("fast", "balanced", "best"):
        rows: dict[str, dict[str, float]] = {}
        for path in clips:
            print(f"capturing {path.name}", file=sys.stderr, flush=True)
            rows[path.stem] = measure_clip(body, path, quality)
        rows["median"] = {}
        for key in (*FIGURES, "true_iou"):
            rows["median"] |= _median_of([rows[path.stem] for path in clips], key)
        figures[quality] = rows
        lines = [[name, *(row.get(key) for key in SHOWN)] for name, row in rows.items()]
        print(table((quality, *SHOWN.values()), lines), end="\n\n", flush=True)
    return figures


def measure_clip(body: Body, path: Path, quality: str) -> dict[str, float]:
    """Capture a clip and return the medians of `FIGURES` and the height; nothing if nobody was
    found.
    """
    stride = max(1, _frame_count(path) // FRAMES_PER_CLIP)
    seen = Seen(LandmarkNetwork(landmark_network_name("best"), os.cpu_count() or 1), stride)
    try:
        motions = capture(path, body, CaptureOptions(quality=quality), watch=seen.watch).motions
    except NoPersonError:
        return {}
    rows = [compare(body, motions[0], seen, index) for index in seen.masks]
    found = _medians([row for row in rows if row is not None]) | {
        "height_m": body.stature(motions[0].betas)
    }
    truth = path.with_name(f"{path.stem}_truth.npz")
    return found | ({"true_iou": true_iou(body, truth, seen)} if truth.is_file() else {})


def compare(body: Body, motion: Motion, seen: Seen, index: int) -> dict[str, float] | None:
    """Return the `FIGURES` of one source frame; None where the motion has not seen the person of
    the mask.
    """
    row = int(np.searchsorted(motion.frames, index))
    region, mask, keypoints_px = seen.masks[index]
    if row >= len(motion) or motion.frames[row] != index or not motion.valid[row]:
        return None
    own = motion.keypoints2d[row, : len(keypoints_px)]
    if np.median(np.linalg.norm(own[:, :2] - keypoints_px, axis=1)) > region.side_px / 10:
        return None  # somebody else was larger in this frame
    vertices = camera_vertices(motion, body, row)
    return overlap(
        silhouette(body, vertices, motion.intrinsics, motion.dist, seen.size, region), mask
    )


def true_iou(body: Body, truth: Path, seen: Seen) -> float:
    """Return the median IoU of a render's true body and the masks."""
    with np.load(truth) as data:
        true = {
            key: data[key]
            for key in ("poses", "trans", "betas", "intrinsics", "frame_index", "world_from_camera")
        }
    T = np.linalg.inv(true["world_from_camera"].astype(float))
    betas = true["betas"].astype(float)
    rows = []
    for index, (region, mask, _) in seen.masks.items():
        row = int(np.searchsorted(true["frame_index"], index))
        if row >= len(true["frame_index"]) or true["frame_index"][row] != index:
            continue
        R, t = body.forward_kinematics(
            exp(true["poses"][row].reshape(-1, 3).astype(float)), true["trans"][row], betas
        )
        vertices = body.skin(T[:3, :3] @ R, t @ T[:3, :3].T + T[:3, 3], betas)
        rows.append(
            overlap(silhouette(body, vertices, true["intrinsics"], None, seen.size, region), mask)
        )
    return _medians([row for row in rows if row is not None]).get("iou", float("nan"))


def silhouette(
    body: Body,
    vertices_cam: NDArray[np.float64],
    intrinsics: NDArray[np.float64],
    dist: NDArray[np.float64] | None,
    size: tuple[int, int],
    region: Region,
) -> NDArray[np.uint8]:
    """Return (256, 256) uint8: 2 where the body is, 1 where it is not, 0 outside the image.

    :param vertices_cam: (V, 3) metres, camera axes.
    :param size: of the image, width and height.
    """
    scale = min(1.0, 2 * INPUT_SIZE / region.side_px)
    width, height = (max(1, round(scale * side)) for side in size)
    K = intrinsics.astype(float).copy()
    K[:2] *= scale
    K[:2, 2] += (scale - 1) / 2  # pixel centres are at integers
    canvas = Canvas.blank(width, height)
    rasterize(canvas, vertices_cam, body.triangles(), np.ones(3), K, dist)
    shape = canvas.coverage.astype(np.uint8) + 1
    A = region.R_image_crop * (region.side_px / INPUT_SIZE)
    center = (np.asarray(region.center_px) + 0.5) * scale - 0.5
    affine = np.column_stack([scale * A, center + scale * A @ np.full(2, 0.5 - INPUT_SIZE / 2)])
    flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    cut: NDArray[np.uint8] = cv2.warpAffine(
        shape, affine, (INPUT_SIZE, INPUT_SIZE), flags=flags
    ).astype(np.uint8)
    return cut


def overlap(shape: NDArray[np.uint8], mask: NDArray[np.bool_]) -> dict[str, float] | None:
    """Return the `FIGURES` of a silhouette and a mask; None if one of them is empty."""
    body = shape == 2
    person = mask & (shape > 0)
    if not body.any() or not person.any():
        return None
    both = float(np.count_nonzero(body & person))
    areas = float(np.count_nonzero(body)), float(np.count_nonzero(person))
    return {
        "iou": both / (areas[0] + areas[1] - both),
        "body_outside": 1 - both / areas[0],
        "mask_outside": 1 - both / areas[1],
    }


def _medians(rows: list[dict[str, float]]) -> dict[str, float]:
    return {key: float(np.median([row[key] for row in rows])) for key in FIGURES} if rows else {}


def _median_of(rows: list[dict[str, float]], key: str) -> dict[str, float]:
    known = [row[key] for row in rows if key in row]
    return {key: float(np.median(known))} if known else {}


def _frame_count(path: Path) -> int:
    video = cv2.VideoCapture(str(path))
    count = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
    video.release()
    return count
