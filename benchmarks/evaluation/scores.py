# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of captured clips: who is who, frame by frame errors, and their means over a data
set.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.motion import Motion
from ...solver.body import Body
from . import metrics
from .clips import Clip, Person, Truth
from .joint_sets import LIMBS, SMPL24
from .protocols import Protocol
from .subjects import PosedBody, Subject

_SHARES = {
    "pck": metrics.pck,
    "auc": metrics.auc,
    "pa_pck": metrics.pck,
    "pa_auc": metrics.auc,
    "pck_50": metrics.challenge_pck,
    "auc_200": metrics.challenge_auc,
}
# of the size of a person in the image: the farthest that a captured person may be from the true one
NEAR = 0.5


@dataclass
class Scores:
    """Values of all frames for each measure, and how many frames of the protocol there are and were
    captured.
    """

    values: dict[str, list[NDArray[np.float64]]] = field(default_factory=dict)
    frames: int = 0
    seen: int = 0  # frames in which the person was found
    people: int = 0
    missed: int = 0  # people who were not found at all

    def add(self, other: Scores) -> None:
        """Add the values of another clip."""
        for key, arrays in other.values.items():
            self.values.setdefault(key, []).extend(arrays)
        self.frames = self.frames + other.frames
        self.seen = self.seen + other.seen
        self.people = self.people + other.people
        self.missed = self.missed + other.missed

    def means(self) -> dict[str, float]:
        """Return the mean over all frames of each measure; NaN where no frame has a value."""
        found = {}
        for key, arrays in self.values.items():
            flat = np.concatenate(arrays)
            flat = flat[np.isfinite(flat)]
            found[key] = float(flat.mean()) if len(flat) else float("nan")
        return found


def score_clip(
    clip: Clip,
    truth: Truth,
    body: Body,
    motions: Sequence[Motion],
    protocol: Protocol,
    regressor: NDArray[np.float64] | None = None,
) -> Scores:
    """Return the scores of one captured clip by one protocol.

    :param truth: of the clip.
    :param body: that was captured.
    :param regressor: (17, V), for that body's vertices.
    """
    scores = Scores()
    for person, motion in zip(truth.people, assign(clip, truth, motions), strict=True):
        scores.frames = scores.frames + len(person.rows)
        scores.people = scores.people + 1
        if motion is None:
            scores.missed += 1
            continue
        scores.add(_score_person(person, motion, body, protocol, clip.rate, regressor))
    return scores


def assign(clip: Clip, truth: Truth, motions: Sequence[Motion]) -> list[Motion | None]:
    """Return the captured motion of each person with ground truth, None where nobody was captured
    close enough.

    A person who is alone is the most prominent one that was captured. Else the distance is that of
    the limbs' joints in the image, relative to the person's size there, its median over the frames
    that both have; the nearest pair is assigned first.
    """
    if clip.alone or truth.intrinsics is None:
        return [motions[0] if k == 0 and motions else None for k in range(len(truth.people))]
    pairs = []
    for p, person in enumerate(truth.people):
        for m, motion in enumerate(motions):
            distance = _distance(person, motion, truth.intrinsics)
            if distance <= NEAR:
                pairs.append((distance, p, m))
    chosen: dict[int, int] = {}
    for _, p, m in sorted(pairs):
        if p not in chosen and m not in chosen.values():
            chosen[p] = m
    return [motions[chosen[p]] if p in chosen else None for p in range(len(truth.people))]


def _distance(person: Person, motion: Motion, K: NDArray[np.float64]) -> float:
    true_rows, captured_rows = _common(person, motion)
    valid = motion.valid[captured_rows]
    true_rows = true_rows[valid]
    captured_rows = captured_rows[valid]
    if not len(true_rows):
        return np.inf
    limbs = [SMPL24.index(name) for name in LIMBS]
    true = _project(person.camera.select(true_rows).joints(LIMBS), K)
    captured = _project(motion.joints_cam[captured_rows][:, limbs].astype(float), motion.intrinsics)
    size = np.maximum(np.ptp(true, axis=1).max(axis=1), 1.0)
    return float(np.median(np.linalg.norm(captured - true, axis=-1).mean(axis=1) / size))


def _project(points: NDArray[np.float64], K: NDArray[np.float64]) -> NDArray[np.float64]:
    uv: NDArray[np.float64] = (points / np.maximum(points[..., 2:], 0.01) @ K.T)[..., :2]
    return uv


def _common(person: Person, motion: Motion) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the positions in the person's rows and in the motion of the frames that both have."""
    _, true_rows, captured_rows = np.intersect1d(
        person.rows, motion.frames, assume_unique=True, return_indices=True
    )
    return true_rows, captured_rows


def _score_person(
    person: Person,
    motion: Motion,
    body: Body,
    protocol: Protocol,
    rate: float,
    regressor: NDArray[np.float64] | None,
) -> Scores:
    true_rows, rows = _common(person, motion)
    scores = Scores(seen=int(motion.valid[rows].sum()))
    if not len(rows):
        scores.missed = 1
        return scores
    if "mpjpe" in protocol.measures:
        captured = PosedBody.of_motion(body, motion, regressor).select(rows)
        found = _in_camera(captured, person.camera.select(true_rows), protocol, rate)
        scores.values |= {key: [value] for key, value in found.items()}
    if "wa_mpjpe" in protocol.measures and person.world is not None:
        captured = PosedBody.of_motion(body, motion, regressor, in_world=True).select(rows)
        found = _in_world(captured, person.world.select(true_rows), protocol, rate)
        scores.values |= {key: [value] for key, value in found.items()}
    return scores


def _in_camera(
    captured: PosedBody, true: Subject, protocol: Protocol, rate: float
) -> Mapping[str, NDArray[np.float64]]:
    roots = [subject.joints(protocol.root).mean(axis=1) for subject in (captured, true)]
    x, y = (
        metrics.relative_to(subject.joints(protocol.joints), root)
        for subject, root in zip((captured, true), roots, strict=True)
    )
    found = {"mpjpe": metrics.mpjpe(x, y), "pa_mpjpe": metrics.pa_mpjpe(x, y)}
    if "acceleration" in protocol.measures:
        found["acceleration"] = metrics.acceleration_error(x, y, rate)
    if protocol.pck_joints:
        counted = [protocol.joints.index(name) for name in protocol.pck_joints]
        errors = metrics.joint_errors(x, y)[:, counted]
        aligned = metrics.aligned(x, metrics.similarity(x, y))
        errors_aligned = metrics.joint_errors(aligned, y)[:, counted]
        for key, share in _SHARES.items():
            if key in protocol.measures:
                found[key] = share(errors_aligned if key.startswith("pa_") else errors)
    if "mpvpe" in protocol.measures and isinstance(true, PosedBody) and _same_mesh(captured, true):
        found["mpvpe"] = _vertex_errors(captured, true, roots)
    return found


def _same_mesh(captured: PosedBody, true: PosedBody) -> bool:
    """Whether the vertices of both are the same points of a body: SMPL's own mesh on both sides, or
    SMPL-X's.
    """
    return captured.body.faces.shape == true.body.faces.shape and bool(
        (captured.body.faces == true.body.faces).all()
    )


def _vertex_errors(
    captured: PosedBody, true: PosedBody, roots: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    errors = []
    start = 0
    for x, y in zip(captured.vertex_blocks(), true.vertex_blocks(), strict=True):
        some = slice(start, start + len(x))
        errors.append(
            metrics.mpjpe(
                metrics.relative_to(x, roots[0][some]), metrics.relative_to(y, roots[1][some])
            )
        )
        start += len(x)
    return np.concatenate(errors)


def _in_world(
    captured: PosedBody, true: Subject, protocol: Protocol, rate: float
) -> Mapping[str, NDArray[np.float64]]:
    x = captured.joints(protocol.joints)
    y = true.joints(protocol.joints)
    pelvis = [subject.joints(("pelvis",))[:, 0] for subject in (captured, true)]
    found = {
        "wa_mpjpe": metrics.wa_mpjpe(x, y),
        "w_mpjpe": metrics.w_mpjpe(x, y),
        "rte": metrics.root_translation_error(*pelvis),
        "jitter": metrics.jitter(x, rate),
    }
    if isinstance(true, PosedBody):
        found["foot_slide"] = metrics.foot_slide(captured.feet(), true.feet())
    return found
