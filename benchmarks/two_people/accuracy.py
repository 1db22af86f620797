# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench two_people`: Pose2Sim's man and a computer-generated woman, one camera at a
time.

Every captured person is compared with the truth of the true person whose joints are nearest in the
image, median over the frames. Coverage counts all of a true person's frames. Exchanged: frames of a
captured person in which the joints of the other true person are nearer. Outline: IoU with the
largest network's person mask in frames in which the people's bounding boxes are apart; area: the
body's over the mask's.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.overlay_video import camera_vertices
from ...scope_addon.capture.perception.landmark_network import KEYPOINT_COUNT, LandmarkNetwork
from ...scope_addon.capture.perception.region import Region, bounds, region_from_points
from ...scope_addon.capture.pipeline import capture
from ...scope_addon.motion import Motion
from ...scope_addon.options.capture import ALL
from ...solver import Body, load_body
from ..evaluation.metrics import aligned, similarity
from ..frames import DATA
from ..perception.accuracy import CAMERAS, evaluate_motion
from ..perception.outline import SURE, overlap, silhouette
from ..perception.perception import PRESETS
from ..report import table
from . import truth as truths
from .footage import FOLDER, extract, load_cameras

SHOWN = {
    "coverage": "found",
    "mpjpe_root": "MPJPE-root mm",
    "pa_mpjpe": "PA-MPJPE mm",
    "stature_m": "stature m",
    "iou": "outline IoU",
    "area": "area",
    "foot_slide_cm": "foot sliding cm",
    "exchanged": "exchanged",
    "sole_cm": "lowest sole cm",
    "apart": "distance / true",
}
LIMBS = tuple(
    f"{side}{joint}"
    for joint in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle")
    for side in ("L", "R")
)
_KEYPOINTS = [11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28]  # the same of the landmark network
# of a true person's height in the image: captured people who are farther off are somebody else
_FAR = 0.5
_MASK_STRIDE = 5
_SOLE_STRIDE = 10
_CIRCLE = 1.1
# rows' frames (T,), pixels of LIMBS (T, 12, 2)
True2D = dict[str, tuple[NDArray[np.int64], NDArray[np.float64]]]


def two_people(quick: bool) -> dict[str, Any]:
    """Make the truth where it is missing, measure, print the tables as they come, return the
    figures by preset.
    """
    if not DATA.is_dir():
        print(
            f"{DATA} does not exist: nothing was measured; put the calibrations there",
            file=sys.stderr,
        )
        return {}
    videos = extract()
    made = all(
        truth_file(person, camera).is_file() for person in truths.PEOPLE for camera in CAMERAS
    )
    figures: dict[str, Any] = {} if quick and made else {"truth": make_truth(videos)}
    body = load_body("scope")
    network = LandmarkNetwork("pose_landmark_heavy", truths.THREADS)
    for quality in (CaptureOptions().quality,) if quick else PRESETS[::-1]:  # best first
        rows: dict[str, dict[str, Any]] = {}
        for camera in CAMERAS:
            motions = capture(
                videos[camera], body, CaptureOptions(quality=quality, people=ALL)
            ).motions
            rows |= {
                f"{person}, {camera}": row
                for person, row in measure(motions, camera, body, network).items()
            }
        rows |= {
            f"{person}, mean": mean([rows[f"{person}, {c}"] for c in CAMERAS])
            for person in truths.PEOPLE
        }
        figures[quality] = rows
        lines = [[name, *(row.get(key) for key in SHOWN)] for name, row in rows.items()]
        print(table((quality, *SHOWN.values()), lines), end="\n\n", flush=True)
    return figures


def truth_file(person: str, camera: str) -> Path:
    """Return where the evaluation tool finds a person's truth."""
    return FOLDER / f"{person}_{camera}.npz"


def make_truth(videos: dict[str, Path]) -> dict[str, Any]:
    """Triangulate both people, write their truth, and print how consistent and how accurate it
    is.
    """
    cameras = load_cameras(videos)
    people = truths.build(videos, cameras)
    truths.save_man(FOLDER, cameras)
    truths.save(FOLDER, "woman", people[truths.NETWORK]["woman"])
    truths.save(FOLDER, "man_triangulated", people[truths.NETWORK]["man"])
    lines: list[list[object]] = []
    for network, of_network in people.items():
        for person, found in of_network.items():
            shape = len(CAMERAS), -1, KEYPOINT_COUNT
            error = found.found.error_px.reshape(shape)[..., _KEYPOINTS]
            good = found.found.good.reshape(shape)[..., _KEYPOINTS]
            known = np.isfinite(found.joints[:, _KEYPOINTS, 0])
            px = [float(np.median(e[g])) for e, g in zip(error, good, strict=True)]
            lines.append([f"{person}, {network}", float(known.mean()), float(good.mean()), *px])
    head = ("limb joints", "known", "views used", *(f"{camera} px" for camera in CAMERAS))
    print(table(head, lines), end="\n\n", flush=True)
    figures = {"reprojection": lines} | differences(people)
    print(
        table(("mm", "mean", "after one similarity"), figures["differences"]),
        end="\n\n",
        flush=True,
    )
    return figures


def differences(people: dict[str, dict[str, truths.TruePerson]]) -> dict[str, Any]:
    """Return mean distances of limb joints in mm, as they are and after one similarity of the whole
    clip.
    """
    first, second = people.values()
    pairs = {f"{p}: heavy, full": (first[p].joints, second[p].joints) for p in truths.PEOPLE}
    rows = [
        [name, *_difference(a[:, _KEYPOINTS], b[:, _KEYPOINTS])] for name, (a, b) in pairs.items()
    ]
    with (
        np.load(truth_file("man", CAMERAS[0])) as true,
        np.load(truth_file("man_triangulated", CAMERAS[0])) as ours,
    ):
        a, b = (data["joints"][:, columns_of(data, LIMBS)] for data in (true, ours))
        rows.append(["man: his truth, triangulated", *_difference(a, b[true["frame_index"]])])
    return {"differences": rows}


def _difference(a: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[float, float]:
    known = np.isfinite(a).all(-1) & np.isfinite(b).all(-1)
    a = a[known]
    b = b[known]
    moved = aligned(b, similarity(b, a))
    return 1000 * float(np.linalg.norm(a - b, axis=1).mean()), 1000 * float(
        np.linalg.norm(a - moved, axis=1).mean()
    )


def measure(
    motions: list[Motion], camera: str, body: Body, network: LandmarkNetwork
) -> dict[str, dict[str, Any]]:
    """Return the figures of both people in a capture of one camera; of somebody who was not found,
    the coverage.
    """
    true = true_pixels(camera)
    owners = [owner(motion, true) for motion in motions]
    rows: dict[str, dict[str, Any]] = {}
    chosen: dict[str, Motion] = {}
    for person in truths.PEOPLE:
        of_person = [m for m, who in zip(motions, owners, strict=True) if who == person]
        if not of_person:
            rows[person] = {"coverage": 0.0}
            continue
        motion = chosen[person] = max(of_person, key=lambda m: int(m.valid.sum()))
        row = evaluate_motion(motion, truth_file(person, camera))
        row["exchanged"] = exchanged(motion, person, true)
        row["stature_m"] = body.stature(motion.betas)
        row |= outline_of(motion, person, true, body, network, camera)
        row["sole_cm"] = lowest_sole_cm(motion, body)
        rows[person] = row
    if len(chosen) == 2:
        ratio = distance_ratio(chosen, camera)
        for row in rows.values():
            row["apart"] = ratio
    return rows


def columns_of(data: Mapping[str, NDArray[Any]], names: Sequence[str]) -> list[int]:
    """Return the columns of joints in a file of truth."""
    all_names = data["names"].tolist()
    return [all_names.index(name) for name in names]


def true_pixels(camera: str) -> True2D:
    """Return the frames, and the pixels of `LIMBS`, of both people."""
    found = {}
    for person in truths.PEOPLE:
        with np.load(truth_file(person, camera)) as data:
            found[person] = (
                data["frame_index"].astype(np.int64),
                data["uv"][:, columns_of(data, LIMBS)],
            )
    return found


def distances(motion: Motion, person: str, true: True2D) -> NDArray[np.float64]:
    """Return the mean distance (T,) of the motion's keypoints from a true person, over the person's
    median height.

    NaN where one of them is not known.
    """
    frames, uv = true[person]
    height = float(np.nanmedian(np.nanmax(uv[..., 1], 1) - np.nanmin(uv[..., 1], 1)))
    out = np.full(len(motion), np.nan)
    rows = np.searchsorted(frames, motion.frames).clip(max=len(frames) - 1)
    known = (
        (frames[rows] == motion.frames)
        & motion.valid
        & np.isfinite(uv[rows]).all(-1).sum(1).astype(bool)
    )
    px = motion.keypoints2d[:, _KEYPOINTS, :2]
    out[known] = np.nanmean(np.linalg.norm(px[known] - uv[rows[known]], axis=-1), axis=1) / height
    return out


def owner(motion: Motion, true: True2D) -> str | None:
    """Return which true person a motion is of; None if of neither."""
    off = {}
    for person in true:
        found = distances(motion, person, true)
        off[person] = (
            float(np.median(found[np.isfinite(found)])) if np.isfinite(found).any() else np.inf
        )
    nearest = min(off, key=lambda person: off[person])
    return nearest if off[nearest] < _FAR else None


def exchanged(motion: Motion, person: str, true: True2D) -> float:
    """Return the share of frames in which the other true person is nearer."""
    (other,) = set(true) - {person}
    own = distances(motion, person, true)
    others = distances(motion, other, true)
    known = np.isfinite(own) & np.isfinite(others)
    return float((others < own)[known].mean()) if known.any() else 0.0


def outline_of(
    motion: Motion, person: str, true: True2D, body: Body, network: LandmarkNetwork, camera: str
) -> dict[str, float]:
    """Return the medians of IoU and of the body's area over the mask's where the two people are
    apart.
    """
    (other,) = set(true) - {person}
    found = []
    for k, image in enumerate(truths.images(FOLDER / f"{camera}.mp4")):
        row = int(np.searchsorted(motion.frames, k))
        seen = row < len(motion) and motion.frames[row] == k and motion.valid[row]
        points = {who: uv[frames == k] for who, (frames, uv) in true.items()}
        if k % _MASK_STRIDE or not seen or any(len(p) == 0 for p in points.values()):
            continue
        if not are_apart(points[person][0], points[other][0]):
            continue
        region = region_around(points[person][0])
        mask = network.mask(image, region) >= SURE
        size = image.shape[1], image.shape[0]
        shape = silhouette(
            body, camera_vertices(motion, body, row), motion.intrinsics, motion.dist, size, region
        )
        compared = overlap(shape, mask)
        if compared is not None:
            area = (1 - compared["mask_outside"]) / max(1 - compared["body_outside"], 1e-9)
            found.append((compared["iou"], area))
    return (
        dict(zip(("iou", "area"), np.median(found, axis=0).tolist(), strict=True)) if found else {}
    )


def are_apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Return whether the bounding boxes of two people's joints (12, 2) do not overlap."""
    p, q = (bounds(points[np.isfinite(points).all(1)]) for points in (a, b))
    return bool((p[:2] > q[2:]).any() or (q[:2] > p[2:]).any())


def region_around(points: NDArray[np.float64]) -> Region:
    """Return the region of a person whose `LIMBS` (12, 2) are known in the image; NaN where they
    are not.
    """
    hips = np.nanmean(points[6:8], axis=0)
    shoulders = np.nanmean(points[:2], axis=0)
    radius = _CIRCLE * float(np.nanmax(np.linalg.norm(points - hips, axis=1)))
    return region_from_points(
        hips, hips + radius * (shoulders - hips) / np.linalg.norm(shoulders - hips)
    )


def lowest_sole_cm(motion: Motion, body: Body) -> float:
    """Return the height above the captured floor of a body's lowest vertex, median over frames,
    cm.
    """
    heights = []
    for row in range(0, len(motion), _SOLE_STRIDE):
        T = motion.world_from_camera[row]
        heights.append(float((camera_vertices(motion, body, row) @ T[2, :3] + T[2, 3]).min()))
    return 100 * float(np.median(heights))


def distance_ratio(motions: dict[str, Motion], camera: str) -> float:
    """Return the distance between the people's hips over the true one, median over the frames in
    which both were.
    """
    captured = {}
    true = {}
    frames = None
    for person, motion in motions.items():
        at = {
            int(f): motion.joints_cam[k, 1:3].mean(0)
            for k, f in enumerate(motion.frames)
            if motion.valid[k]
        }
        captured[person] = at
        with np.load(truth_file(person, camera)) as data:
            hips = data["joints"][:, columns_of(data, ("LHip", "RHip"))].mean(1)
            true[person] = dict(zip(data["frame_index"].tolist(), hips, strict=True))
        frames = (
            set(at) & set(true[person]) if frames is None else frames & set(at) & set(true[person])
        )
    ratios = []
    for frame in sorted(frames or ()):
        (a, b), (c, d) = (
            [positions[frame] for positions in of.values()] for of in (captured, true)
        )
        ratios.append(float(np.linalg.norm(a - b) / np.linalg.norm(c - d)))
    return float(np.nanmedian(ratios)) if ratios else float("nan")


def mean(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the means of what the rows have in `SHOWN`."""
    found = {key: [row[key] for row in rows if row.get(key) is not None] for key in SHOWN}
    return {key: float(np.mean(values)) for key, values in found.items() if values}
