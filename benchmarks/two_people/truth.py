# SPDX-License-Identifier: GPL-3.0-or-later
"""Joints of both people in space, triangulated from a landmark network's keypoints in all four
cameras.

Each camera's frames are observed twice. First, a person is followed from frame to frame, beginning
in a given region, and triangulated; where the network jumped onto the other person in one camera,
the robust triangulation leaves that camera out. Then, every frame is observed in the regions where
the triangulated person is, as it is and mirrored; the mean of both gives the keypoints, and their
difference lowers the confidence.

The woman was drawn with cameras that are not quite those of the footage: in camera 1, she is 27
pixels off. Her truth therefore has cameras of its own, by bundle adjustment. It holds for her pose
and size, but where she is relative to the man is known to a few centimetres only.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.atomic_write import write_npz
from ...scope_addon.capture.media.video import open_video
from ...scope_addon.capture.perception.landmark_network import (
    KEYPOINT_COUNT,
    KEYPOINT_NAMES,
    LandmarkNetwork,
)
from ...scope_addon.capture.perception.region import Region, region_from_points
from ..perception.accuracy import CAMERAS
from .footage import FPS, LATER, Camera, man_alone
from .triangulation import Triangulated, adjust_cameras, project, triangulate

PEOPLE = ("man", "woman")
NETWORK = "pose_landmark_heavy"
SECOND_NETWORK = "pose_landmark_full"
THREADS = 2
DRAWN = ("woman",)
# by which the cameras that she was drawn with may differ, each axis
SIGMA_RAD = np.radians(1.0)
SIGMA_M = 0.1
FIRST_REGIONS = {  # in frame 0: centre of the hips x, y; side; rotation
    ("man", "cam1"): (390, 720, 900, 0.1), ("woman", "cam1"): (773, 1250, 1100, 0.35),
    ("man", "cam2"): (560, 750, 900, 0.0), ("woman", "cam2"): (203, 1080, 1000, 0.0),
    ("man", "cam3"): (620, 980, 1000, -0.1), ("woman", "cam3"): (256, 790, 800, 0.0),
    ("man", "cam4"): (420, 1010, 1000, -0.4), ("woman", "cam4"): (800, 690, 700, -0.3),
}  # fmt: skip
NAMES = {  # of the evaluation tool, by the network's
    "nose": "Nose", "left_eye": "LEye", "right_eye": "REye", "left_ear": "LEar",
    "right_ear": "REar",
    "left_heel": "LHeel", "right_heel": "RHeel", "left_foot_index": "LBigToe",
    "right_foot_index": "RBigToe",
    **{f"{side}_{joint}": f"{side[0].upper()}{joint.title()}" for joint in
       ("shoulder", "elbow", "wrist", "hip", "knee", "ankle") for side in ("left", "right")},
}  # fmt: skip
_SHOULDERS = [11, 12]
_HIPS = [23, 24]
# radius of the body circle over the distance of the keypoint that is farthest from the hips
_CIRCLE = 1.1
_MIRRORED_PX = 15.0  # difference of the two views of a keypoint that halves its confidence
_SWAPPED = [
    KEYPOINT_NAMES.index(
        name.replace("left", "*").replace("right", "left").replace("*", "right")
        if "left" in name or "right" in name
        else name
    )
    for name in KEYPOINT_NAMES
]
Keypoints = NDArray[np.float64]  # (C, T, 33, 3): pixels, confidence


@dataclass(frozen=True)
class TruePerson:
    """``joints`` (T, 33, 3) metres, in the world of ``cameras``, NaN where not known; ``found``: T
    · 33 points.
    """

    joints: NDArray[np.float64]
    found: Triangulated
    keypoints: Keypoints
    cameras: dict[str, Camera]


def build(videos: dict[str, Path], cameras: dict[str, Camera]) -> dict[str, dict[str, TruePerson]]:
    """Return both people, by the network whose keypoints they are made of."""
    network = LandmarkNetwork(NETWORK, THREADS)
    followed = _stacked([follow(network, videos[name], name) for name in CAMERAS])
    rough = {
        person: solve(keypoints, cameras, person in DRAWN) for person, keypoints in followed.items()
    }
    people: dict[str, dict[str, TruePerson]] = {}
    for name, observer in (
        (NETWORK, network),
        (SECOND_NETWORK, LandmarkNetwork(SECOND_NETWORK, THREADS)),
    ):
        print(f"observing with {name}", file=sys.stderr, flush=True)
        seen = _stacked([observe(observer, videos[c], c, rough) for c in CAMERAS])
        people[name] = {
            person: solve(keypoints, cameras, person in DRAWN) for person, keypoints in seen.items()
        }
    return people


def follow(network: LandmarkNetwork, video: Path, camera: str) -> dict[str, Keypoints]:
    """Return the keypoints (T, 33, 3) of both people, each followed from frame to frame."""
    regions = [
        Region((x, y), side, turn)
        for x, y, side, turn in (FIRST_REGIONS[p, camera] for p in PEOPLE)
    ]
    seen: dict[str, list[NDArray[np.float64]]] = {person: [] for person in PEOPLE}
    for image in images(video):
        if not seen[PEOPLE[0]]:  # the given regions are rough
            regions = [estimate.next_region for estimate in network.estimate(image, regions)]
        estimates = network.estimate(image, regions)
        regions = [estimate.next_region for estimate in estimates]
        for person, e in zip(PEOPLE, estimates, strict=True):
            seen[person].append(np.column_stack([e.keypoints_px, e.keypoints_confidence]))
    return {person: np.array(rows) for person, rows in seen.items()}


def observe(
    network: LandmarkNetwork, video: Path, camera: str, people: dict[str, TruePerson]
) -> dict[str, Keypoints]:
    """Return the keypoints (T, 33, 3) of both people, observed where they are known to be, as it is
    and mirrored.
    """
    regions = {
        person: regions_of(truth.joints, truth.cameras[camera]) for person, truth in people.items()
    }
    seen: dict[str, list[NDArray[np.float64]]] = {person: [] for person in people}
    for k, image in enumerate(images(video)):
        width = image.shape[1]
        flipped = np.ascontiguousarray(image[:, ::-1])
        wanted = [regions[person][k] for person in people]
        plain = network.estimate(image, wanted)
        mirrored = network.estimate(flipped, [mirror(region, width) for region in wanted])
        for person, a, b in zip(people, plain, mirrored, strict=True):
            other_px = b.keypoints_px[_SWAPPED] * [-1.0, 1.0] + [width - 1.0, 0.0]
            difference = np.linalg.norm(a.keypoints_px - other_px, axis=1)
            confidence = 0.5 * (a.keypoints_confidence + b.keypoints_confidence[_SWAPPED])
            confidence /= 1 + (difference / _MIRRORED_PX) ** 2
            seen[person].append(np.column_stack([0.5 * (a.keypoints_px + other_px), confidence]))
    return {person: np.array(rows) for person, rows in seen.items()}


def mirror(region: Region, width: int) -> Region:
    """Return the region in the image that is mirrored left to right."""
    x, y = region.center_px
    return replace(region, center_px=(width - 1.0 - x, y), rotation=-region.rotation)


def solve(keypoints: Keypoints, cameras: dict[str, Camera], adjusts: bool) -> TruePerson:
    """Triangulate a person's keypoints (C, T, 33, 3).

    :param adjusts: whether the person was seen by slightly different cameras.
    """
    C, T, J, _ = keypoints.shape
    listed = [cameras[name] for name in CAMERAS]
    x = np.stack([
        cv2.undistortPoints(seen[..., :2].reshape(-1, 1, 2), camera.K, camera.dist).reshape(-1, 2)
        for seen, camera in zip(keypoints, listed, strict=True)
    ])  # fmt: skip
    poses = np.stack([c.T_camera_world for c in listed])
    focal = np.array([c.K[0, 0] for c in listed])
    confidence = keypoints[..., 2].reshape(C, -1)
    if adjusts:
        poses = adjust_cameras(x, confidence, poses, focal, SIGMA_RAD, SIGMA_M)
    found = triangulate(x, confidence, poses, focal)
    own = {c.name: replace(c, T_camera_world=T) for c, T in zip(listed, poses, strict=True)}
    return TruePerson(found.points.reshape(T, J, 3), found, keypoints, own)


def regions_of(joints: NDArray[np.float64], camera: Camera) -> list[Region]:
    """Return the region of a person in every frame; joints (T, 33, 3) that are not known are
    interpolated.
    """
    filled = joints.copy()
    rows = np.arange(len(joints))
    for j in range(KEYPOINT_COUNT):
        known = np.isfinite(joints[:, j, 0])
        for axis in range(3):
            if known.any():
                filled[:, j, axis] = np.interp(rows, rows[known], joints[known, j, axis])
    regions = []
    for points in pixels(filled.reshape(-1, 3), camera).reshape(len(joints), -1, 2):
        hips = points[_HIPS].mean(0)
        shoulders = points[_SHOULDERS].mean(0)
        radius = _CIRCLE * float(np.nanmax(np.linalg.norm(points - hips, axis=1)))
        up = (shoulders - hips) / np.linalg.norm(shoulders - hips)
        regions.append(region_from_points(hips, hips + radius * up))
    return regions


def pixels(X: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """Project points (N, 3), metres, world, into a camera's image: (N, 2) pixels, NaN where the
    point is not known.
    """
    x = project(X, camera.T_camera_world[None])[0]
    rays = np.column_stack([x, np.ones(len(x))])
    px = np.asarray(
        cv2.projectPoints(rays, np.zeros(3), np.zeros(3), camera.K, camera.dist)[0].reshape(-1, 2)
    )
    return np.where(np.isfinite(X).all(1)[:, None], px, np.nan)


def save(folder: Path, name: str, truth: TruePerson) -> None:
    """Write the person's truth for every camera in the evaluation tool's format:
    ``NAME_CAMERA.npz``.
    """
    columns = [KEYPOINT_NAMES.index(name) for name in NAMES]
    joints = truth.joints[:, columns]
    for camera in truth.cameras.values():
        path = folder / f"{name}_{camera.name}.npz"
        _write(path, joints, np.array(list(NAMES.values())), np.arange(len(joints)), camera)


def save_man(folder: Path, cameras: dict[str, Camera]) -> None:
    """Write the man's truth of the clips of him alone for these videos: ``man_CAMERA.npz``."""
    with np.load(man_alone(CAMERAS[0])) as truth:
        joints = truth["joints"]
        names = truth["names"]
        frames = truth["frame_index"] + LATER
    kept = frames < 100  # the last one is not in these videos
    for name, camera in cameras.items():
        _write(folder / f"man_{name}.npz", joints[kept], names, frames[kept], camera)


def _write(
    path: Path,
    joints: NDArray[np.float64],
    names: NDArray[np.str_],
    frames: NDArray[np.int64],
    camera: Camera,
) -> None:
    T = camera.T_camera_world
    uv = pixels(joints.reshape(-1, 3), camera).reshape(*joints.shape[:2], 2)
    arrays = {
        "joints": joints @ T[:3, :3].T + T[:3, 3], "names": names, "frame_index": frames,
        "intrinsics": camera.K,
        "dist": camera.dist, "fps": np.asarray(FPS), "size": np.asarray(camera.size), "uv": uv,
        "up": camera.up,
    }  # fmt: skip
    write_npz(path, arrays, compressed=True)


def images(video: Path) -> Iterator[NDArray[np.uint8]]:
    """Yield the frames of a video, RGB."""
    with open_video(video) as footage:
        for frame in footage:
            yield frame.image_rgb


def _stacked(seen: list[dict[str, Keypoints]]) -> dict[str, Keypoints]:
    return {person: np.stack([camera[person] for camera in seen]) for person in PEOPLE}
