# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench faces`: expression weights and gaze on rendered faces with known ones, by each
way to find them.

The people of the set ``talk_held_out`` are not among those that `tools.calibrate_face` measures the
response on, and another renderer draws them. The first half of each clip is talk, the second
grimaces; views are within 45°.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.perception.face_landmarks import FaceEstimate
from ...scope_addon.capture.perception.face_record import gaze, parts, record, with_expression
from ...scope_addon.capture.perception.region import Region
from ...scope_addon.capture.tracking.expression_fit import fitted
from ...scope_addon.capture.tracking.expression_motion import expression_motion
from ...scope_addon.kinematics.face import EXPRESSIONS
from ...tools.calibrate_face.observe import SeenFaces, seen_faces
from ...tools.render_faces.truth import FOLDER
from ..report import table

HELD_OUT = "talk_held_out"
CALIBRATION = "shaded_talk"
SMALL = 0.4  # of the pictures: faces of about 55 pixels
ACTIVE = 0.2
CLOSED = 0.5
LARGEST_SHIFT = 4  # frames, in which a blink may be early or late
BLINKS = [EXPRESSIONS.index(f"eyeBlink{side}") for side in ("Left", "Right")]
JAW = EXPRESSIONS.index("jawOpen")
TONGUE = EXPRESSIONS.index("tongueOut")
SHOWN = {
    "all": "all 51",
    "jaw": "jawOpen",
    "blinks": "blinks",
    "active": "those over 0.2",
    "rest": "at rest, mean weight",
    "closed_found": "closures found",
    "closed_false": "false ones",
    "closed_frames": "off by, frames",
    "gaze_deg": "gaze, degrees",
}
Found = tuple[NDArray[np.float64], NDArray[np.float64]]  # weights (T, 52), gaze (T, 2, 3)


def faces(quick: bool) -> dict[str, Any]:
    """Render what is missing, measure, print the tables as they come, return the figures by size
    and way.
    """
    for name in (CALIBRATION, HELD_OUT):
        render_missing(name)
    calibrate = monotone_maps(seen_faces(CALIBRATION))
    figures: dict[str, Any] = {}
    for label, scale in (("large faces", 1.0), ("small faces", SMALL))[: 1 if quick else 2]:
        seen = seen_faces(HELD_OUT, scale)
        ways: dict[str, Callable[[NDArray[np.float64], NDArray[np.float64]], Found]] = {
            "nothing moves": lambda rows, _: _values(0 * rows),
            "network": lambda rows, _: _values(rows),
            "network, calibrated": lambda rows, _: _values(
                _with_weights(rows, calibrate(parts(rows)[2]))
            ),
            "fit": lambda rows, _: _values(fitted(rows)),
            "network, smoothed": lambda rows, times: smoothed(rows, times),
            "fit, smoothed: the capture": lambda rows, times: smoothed(fitted(rows), times),
        }
        figures[label] = {way: measure(seen, scale, function) for way, function in ways.items()}
        rows = [[way, *(row[key] for key in SHOWN)] for way, row in figures[label].items()]
        print(table((label, *SHOWN.values()), rows), end="\n\n", flush=True)
        figures[f"{label}, fit_ms_per_frame"] = _fit_ms(seen, scale)
        print(f"fit: {figures[f'{label}, fit_ms_per_frame']:.2f} ms a frame\n", flush=True)
    return figures


def render_missing(name: str) -> None:
    """Render a set, unless it has been seen before."""
    if not list((FOLDER / name).glob("seen_1.npz")):
        command = (sys.executable, "-m", "scope.tools.render_faces", name)
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def measure(seen: SeenFaces, scale: float, way: Callable[..., Found]) -> dict[str, float]:
    """Return the figures of one way: mean absolute errors of weights, timing of closed eyes, and
    error of the gaze.
    """
    truth = seen.truth["weights"]
    person = seen.truth["person"]
    gaze = np.empty((len(truth), 2, 3))
    weights = np.empty_like(truth)
    for p in np.unique(person):
        rows = np.flatnonzero(person == p)
        weights[rows], gaze[rows] = way(rows_of(seen, rows, scale), seen.truth["seconds"][rows])
    error = np.delete(abs(weights - truth), TONGUE, axis=1)
    open_eyes = truth[:, BLINKS] < ACTIVE
    out = {
        "all": error.mean(),
        "jaw": abs(weights - truth)[:, JAW].mean(),
        "blinks": abs(weights - truth)[:, BLINKS].mean(),
        "active": abs(weights - truth)[truth > ACTIVE].mean(),
        "rest": weights[truth < 1e-3].mean(),
        "gaze_deg": _angles(gaze, _gaze_from_rest(seen))[open_eyes].mean(),
    }
    return {k: float(v) for k, v in out.items()} | closures(weights, truth, person)


def closures(
    weights: NDArray[np.float64], truth: NDArray[np.float64], person: NDArray[np.intp]
) -> dict[str, float]:
    """Return the share of eye closures that were found, false ones per true one, and their mean
    offset in frames.

    An eye closes where its weight rises over `CLOSED`.
    """
    found = 0
    false = 0
    count = 0
    off: list[float] = []
    for p in np.unique(person):
        for blink in BLINKS:
            true, seen = (_rises(w[person == p, blink]) for w in (truth, weights))
            nearest = [np.abs(seen - float(t)).min(initial=np.inf) for t in true]
            hits = [d for d in nearest if d <= LARGEST_SHIFT]
            found = found + len(hits)
            count = count + len(true)
            off = off + hits
            false += sum(np.abs(true - float(t)).min(initial=np.inf) > LARGEST_SHIFT for t in seen)
    return {
        "closed_found": found / count,
        "closed_false": false / count,
        "closed_frames": float(np.mean(off)) if off else float("nan"),
    }


def monotone_maps(seen: SeenFaces) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Return the best non-decreasing map from each of the network's weights to the true one."""
    maps = []
    for found, true in zip(seen.weights.T, seen.truth["weights"].T, strict=True):
        order = np.argsort(found)
        maps.append((found[order], pooled(true[order])))
    return lambda w: np.stack(
        [np.interp(c, x, y) for c, (x, y) in zip(w.T, maps, strict=True)], axis=1
    )


def pooled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the non-decreasing sequence with least squared distance, by pooling adjacent
    violators.
    """
    blocks: list[tuple[float, int]] = []
    for value in values:
        blocks.append((float(value), 1))
        while len(blocks) > 1 and blocks[-2][0] >= blocks[-1][0]:
            (a, n), (b, m) = blocks[-2:]
            blocks[-2:] = [((a * n + b * m) / (n + m), n + m)]
    return np.repeat([value for value, _ in blocks], [n for _, n in blocks])


def rows_of(seen: SeenFaces, rows: NDArray[np.intp], scale: float) -> NDArray[np.float64]:
    """Return what a capture keeps (n, RECORD) of these pictures (n,)."""
    region = Region((0.0, 0.0), 1.0, 0.0)
    light = np.ones(len(seen.presence)) if seen.eye_light is None else seen.eye_light
    estimates = [
        FaceEstimate(scale * seen.landmarks[t], float(seen.presence[t]), region, float(light[t]))
        for t in rows
    ]
    directions = np.array([gaze(estimate.landmarks) for estimate in estimates])
    found = np.array([record(estimate) for estimate in estimates])
    return np.asarray(with_expression(found, seen.weights[rows], directions))


def _values(rows: NDArray[np.float64]) -> Found:
    _, _, weights, directions, _ = parts(rows)
    return weights, np.where(directions.any(axis=-1, keepdims=True), directions, [0.0, 0.0, 1.0])


def _with_weights(rows: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    out = rows.copy()
    out[:, 2 : 2 + weights.shape[1]] = weights
    return out


def smoothed(rows: NDArray[np.float64], times: NDArray[np.float64]) -> Found:
    """Return weights and gaze as the capture writes them, from rows (T, RECORD) with weights."""
    face = expression_motion(rows, times, smoothing=True)
    return face["expressions"], face["gaze"]


def _gaze_from_rest(seen: SeenFaces) -> NDArray[np.float64]:
    """Return the true gaze (T, 2, 3), from where each person's eyes point at weights of 0:
    ahead.
    """
    gaze = seen.truth["gaze"]
    turning = [k for k, name in enumerate(EXPRESSIONS) if name.startswith("eyeLook")]
    tangents = gaze[..., :2] / gaze[..., 2:]
    for p in np.unique(seen.truth["person"]):
        rows = seen.truth["person"] == p
        ahead = rows & ~seen.truth["weights"][:, turning].any(axis=1)
        tangents[rows] -= tangents[ahead].mean(axis=0)
    return np.concatenate([tangents, np.ones((*tangents.shape[:2], 1))], axis=-1)


def _angles(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    cosine = (a * b).sum(axis=-1) / np.linalg.norm(a, axis=-1) / np.linalg.norm(b, axis=-1)
    angles: NDArray[np.float64] = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    return angles


def _rises(weight: NDArray[np.float64]) -> NDArray[np.intp]:
    return np.flatnonzero((weight[1:] > CLOSED) & (weight[:-1] <= CLOSED)) + 1


def _fit_ms(seen: SeenFaces, scale: float) -> float:
    rows = rows_of(seen, np.arange(len(seen.presence)), scale)
    begin = time.perf_counter()
    fitted(rows)
    return 1000 * (time.perf_counter() - begin) / len(rows)
