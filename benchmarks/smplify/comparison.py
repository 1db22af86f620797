# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench smplify`: accuracy and time of SMPLify's way beside Scope's, on the same frames
and keypoints.
"""

from __future__ import annotations

import sys
import time
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.overlay_video import body_colors, camera_vertices, draw_overlay
from ...scope_addon.capture.pipeline import capture
from ...scope_addon.motion import Motion
from ...solver import (
    Body,
    Measurements,
    Options,
    Priors,
    State,
    UnitsWarning,
    fit,
    load_body,
    load_joint_prior,
)
from ...solver.body_file import ASSETS
from ...solver.rotations import log
from ...tools.readme_pictures.__main__ import write_jpeg
from ...tools.render_sample.truth import LIMBS, project
from ..evaluation.metrics import mpjpe, pa_mpjpe, relative_to
from ..frames import CACHE, DATA, REPORTED, capture_options, prepare
from ..page.shots import frames_of
from ..perception.accuracy import CAMERAS
from ..perception.render_shots import fitted_motions
from ..report import table
from .objective import Frame, Objective, PosePrior

# of the frames
EVERY = 10
QUICK = 40
PRIOR_EVERY = 10  # of the recordings' frames
PEOPLE = ("labval_walk_ts.mp4", "opencap_squat_cam0.mov")
PEOPLE_END_S = 4.0  # of each
PEOPLE_EVERY = 20
PEOPLE_QUICK = 60
DRAWN = 5000
SHOWN_PX = 220
SIDES = {"L": "left", "R": "right"}
Points = NDArray[np.float64]
MS = "ms per frame: SMPLify's of the processor, Scope's by the clock"
# name, joints (F, K+1, 3) in the camera frame, ms per frame
Columns = tuple[tuple[str, Points, float], ...]


def smplify(quick: bool) -> dict[str, Any]:
    """Measure, print the tables, draw the pictures, and return the figures by clip."""
    if not DATA.is_dir():
        print(f"{DATA} does not exist: nothing was measured; put the clips there", file=sys.stderr)
        return {}
    # Nothing keeps a dense fit's root from several turns, which are rotations like others.
    warnings.simplefilter("ignore", UnitsWarning)
    body = load_body("scope")
    with np.load(fitted_motions()) as data:
        prior = PosePrior.of(data["poses"][data["valid"]][::PRIOR_EVERY, 3:].astype(float))
    sample = ASSETS / "sample"
    films = DATA / "pose2sim"
    clips = {camera: (films / f"{camera}.mp4", films / f"truth_{camera}.npz") for camera in CAMERAS}
    clips["sample"] = sample / "sample.mp4", sample / "sample_truth.npz"
    figures: dict[str, Any] = {}
    for clip, (video, truth) in clips.items():
        figures[clip] = _clip(body, prior, video, truth, QUICK if quick else EVERY)
        rows = [[name, *row.values()] for name, row in figures[clip].items()]
        print(table((clip, "MPJPE-root mm", "PA-MPJPE mm", MS), rows), end="\n\n", flush=True)
    figures["people"] = people(body, PEOPLE_QUICK if quick else PEOPLE_EVERY)
    rows = [[name, *row.values()] for name, row in figures["people"].items()]
    headings = ("people", "MPJPE-root mm", "PA-MPJPE mm", "ms of the processor per frame")
    print(table(headings, rows), end="\n\n", flush=True)
    return figures


def people(body: Body, every: int) -> dict[str, dict[str, float]]:
    """Compare optimizers and starts on real people, each frame alone; the means of the clips.

    The 3D keypoints are the lifting network's. The dense objective's prior is of poses drawn from
    Scope's own prior, so that all know the same. A body fitted to the 3D keypoints alone stands in
    for a regression network's estimate; Scope refines it with all that it sees of the frame.
    """
    rows: dict[str, list[dict[str, float]]] = {}
    prior = PosePrior.of(drawn_poses(body))
    cold = capture_options(True, REPORTED)
    warm = capture_options(False, REPORTED)
    for name in PEOPLE:
        prepared = prepare(DATA / "people" / "inputs" / name, body, PEOPLE_END_S)
        priors = prepared.priors
        with np.load(DATA / "people" / "truth" / f"{Path(name).stem}.npz") as data:
            true = data["joints"].astype(float)
            names = [str(joint) for joint in data["names"]]
            index = data["frame_index"]
        seen = np.flatnonzero(
            prepared.track.seen & np.isin(np.arange(len(prepared.track.seen)), index)
        )
        found: dict[str, list[Points]] = {}
        took: dict[str, float] = {}
        for k in seen[::every]:
            m = prepared.measure(int(k))
            alone = Measurements(keypoints3d=m.keypoints3d)
            start = fit(body, alone, priors=priors).state
            ways = {
                "SMPLify's objective": partial(_dense, body, prior, m, with_points=False),
                "the same with 3D keypoints": partial(_dense, body, prior, m, with_points=True),
                "3D keypoints alone, as of a regression": partial(_sparse, body, alone, priors),
                "the same, refined by Scope": partial(_sparse, body, m, priors, start, warm),
                "Scope": partial(_sparse, body, m, priors, None, cold),
            }
            for way, solve in ways.items():
                since = time.process_time()
                found.setdefault(way, []).append(solve())
                took[way] = took.get(way, 0.0) + 1e3 * (time.process_time() - since)
        wanted = true[np.searchsorted(index, seen[::every])]
        for way, joints in found.items():
            figures = errors(body, np.array(joints), wanted, names)
            rows.setdefault(way, []).append(figures | {"ms": took[way] / len(joints)})
    return {
        way: {key: float(np.mean([each[key] for each in clips])) for key in clips[0]}
        for way, clips in rows.items()
    }


def drawn_poses(body: Body) -> Points:
    """Return poses (n, 3K), rotation vectors, every joint drawn from the joint prior."""
    prior = load_joint_prior()
    rng = np.random.default_rng(0)
    vectors = np.zeros((DRAWN, body.K, 3))
    for k, name in enumerate(body.joint_names[1:]):
        if name in prior.names:
            vectors[:, k] = log(prior.sample(name, DRAWN, rng))
    return vectors.reshape(DRAWN, -1)


def _sparse(
    body: Body,
    m: Measurements,
    priors: Priors,
    start: State | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
) -> Points:
    """Return the joints (K+1, 3) of Scope's fit."""
    return fit(body, m, init=start, priors=priors, options=options).t_camera_part


def _dense(body: Body, prior: PosePrior, m: Measurements, *, with_points: bool) -> Points:
    """Return the joints (K+1, 3) of SMPLify's objective."""
    assert m.keypoints2d is not None
    numbers = {number: name for name, number in body.keypoint_set("blazepose").items()}
    frame = Frame(
        tuple(numbers[int(k)] for k in np.asarray(m.keypoints2d.indices)),
        np.asarray(m.keypoints2d.pixels, dtype=float),
        np.clip(np.asarray(m.keypoints2d.confidence, dtype=float), 0.0, 1.0),
        np.asarray(m.intrinsics, dtype=float),
        m.keypoints3d if with_points else None,
    )
    objective = Objective(body, prior, frame)
    return objective.joints(objective.fit().x)


def _clip(
    body: Body, prior: PosePrior, video: Path, truth: Path, every: int
) -> dict[str, dict[str, float]]:
    """Return the figures of each optimizer on every so many frames of a clip."""
    raw = capture(video, body, CaptureOptions(smoothing=False))
    whole = capture(video, body, CaptureOptions())
    motion = raw.motions[0]
    with np.load(truth) as data:
        true = data["joints"].astype(float)
        names = [str(name) for name in data["names"]]
        rows = np.flatnonzero(motion.valid & np.isin(motion.frames, data["frame_index"]))[::every]
        true = true[np.searchsorted(data["frame_index"], motion.frames[rows])]
    fits = []
    took = []
    for row in rows:
        since = time.process_time()
        objective = Objective(body, prior, frame_of(motion, int(row)))
        fits.append(objective.fit().x)
        took.append(1e3 * (time.process_time() - since))
    ours = 1e3 / whole.report.fps["solver"]
    columns: Columns = (
        (
            "SMPLify's objective, dense, each frame",
            np.array([objective.joints(x) for x in fits]),
            float(np.median(took)),
        ),
        (
            "Scope, each frame",
            motion.joints_cam[rows].astype(float),
            1e3 / raw.report.fps["solver"],
        ),
        ("Scope, the clip", whole.motions[0].joints_cam[rows].astype(float), ours),
    )
    _draw(body, video, motion, rows, np.array(fits), objective, whole.motions[0])
    return {name: errors(body, joints, true, names) | {"ms": ms} for name, joints, ms in columns}


def frame_of(motion: Motion, row: int) -> Frame:
    """Return what a capture saw in one frame."""
    seen = motion.keypoints2d[row].astype(float)
    names = tuple(str(name) for name in motion.keypoints2d_names)
    return Frame(names, seen[:, :2], np.clip(seen[:, 2], 0.0, 1.0), motion.intrinsics)


def errors(body: Body, joints: Points, true: Points, names: list[str]) -> dict[str, float]:
    """Return mean errors of the twelve limb joints, mm: ``mpjpe_root``, relative to the hips, and
    ``pa_mpjpe``.

    :param joints: (F, K+1, 3), those of the body, in the camera frame.
    :param true: (F, J, 3), as ``names``, in the camera frame; frames that lack a joint (NaN) do not
        count.
    """
    limbs = [side + limb for limb in LIMBS for side in SIDES]
    at = [body.joint_names.index(f"{SIDES[limb[0]]}_{LIMBS[limb[1:]]}") for limb in limbs]
    captured = joints[:, at]
    wanted = true[:, [names.index(limb) for limb in limbs]]
    known = np.isfinite(wanted).all(axis=(1, 2))
    captured = captured[known]
    wanted = wanted[known]
    hips = [limbs.index("LHip"), limbs.index("RHip")]
    relative = [relative_to(points, points[:, hips].mean(axis=1)) for points in (captured, wanted)]
    return {
        "mpjpe_root": float(mpjpe(*relative).mean()),
        "pa_mpjpe": float(pa_mpjpe(captured, wanted).mean()),
    }


def _draw(
    body: Body,
    video: Path,
    motion: Motion,
    rows: NDArray[np.intp],
    fits: Points,
    objective: Objective,
    whole: Motion,
) -> None:
    """Write a picture of three frames: SMPLify's body and Scope's over the footage, and both turned
    by 90 degrees.
    """
    shown = rows[np.linspace(0, len(rows) - 1, 3).round().astype(int)]
    images = frames_of(video, motion.frames[shown].tolist())
    strips = []
    for row in shown:
        k = int(np.flatnonzero(rows == row)[0])
        states, trans, betas = (each[0] for each in objective.pose(fits[k][None]))
        R, t = body.forward_kinematics(states, trans, betas)
        theirs = body.skin(R, t, betas)
        ours = camera_vertices(whole, body, int(row))
        image = images[int(motion.frames[row])]
        pictures = [image]
        for person, skin in enumerate((theirs, ours)):
            colors = [body_colors(body, person)]
            for ground, shape in ((image, skin), (np.full_like(image, 236), turned(skin))):
                pictures.append(
                    draw_overlay(
                        ground, [shape], body.faces, motion.intrinsics, None, colors, [1.0]
                    )
                )
        strips.append(
            np.hstack([_cropped(picture, project(ours, motion.intrinsics)) for picture in pictures])
        )
    CACHE.mkdir(parents=True, exist_ok=True)
    write_jpeg(CACHE / f"smplify_{video.stem}.jpg", np.vstack(strips))


def turned(skin: Points) -> Points:
    """Return the vertices turned by 90 degrees about the camera's vertical through their middle."""
    middle = skin.mean(axis=0)
    x, y, z = (skin - middle).T
    around: Points = np.stack([-z, y, x], axis=1) + middle
    return around


def _cropped(image: NDArray[np.uint8], pixels: Points) -> NDArray[np.uint8]:
    """Return the square around the person, all at one size."""
    low = pixels.min(axis=0)
    high = pixels.max(axis=0)
    half = 0.6 * float((high - low).max())
    (x, y) = (low + high) / 2
    M = np.array([[1, 0, half - x], [0, 1, half - y]]) * (SHOWN_PX / (2 * half))
    cropped = cv2.warpAffine(
        image, M, (SHOWN_PX, SHOWN_PX), flags=cv2.INTER_AREA, borderValue=(236, 236, 236)
    )
    return cropped.astype(np.uint8, copy=False)
