# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes of people who stand on one floor, from those of them whose stature is known.

One camera sees no absolute size: a person who is taken for r times their stature seems r times as
far away, and their floor r times as far below the camera. People on one floor have it at the same
height C below the camera, so the heights h_k at which each of them alone would have it tell their
sizes relative to each other. With log r_k = log C − log h_k, C maximizes

    Σ_k log(w_a N(log r_k; 0, σ_k² + n_k²) + w_s [S_min ≤ r_k S_k ≤ S_k] + w_f),

where a person of estimated stature S_k is an adult as estimated, σ_k apart (0 of a known stature),
or somebody small, as children are, or somebody on another floor. n_k is the relative error of h_k.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Float64Array, FloatArray
from ...kinematics.contact_points import SOLES
from ...scene_gaps import usual_step_s
from .placement import PlacedTrack
from .world_frame import floor_height

STATURE_SIGMA = 0.06  # σ, of adults: 10 cm
# The noise n_k is the hypotenuse of the first and of the second over h_k.
HEIGHT_SIGMA = 0.03
FLOOR_SIGMA_M = 0.05
# Densities per unit of log r: a tenth of all people is small, anywhere between adults and S_min;
# one in fifty of those who are seen together stands on another floor.
ADULTS = 0.88
SMALL = 0.15
OTHER_FLOOR = 0.02
SHORTEST_M = 0.8  # S_min
MIN_CAMERA_M = 0.4  # of a camera nearer to the floor, errors of depth are as large as h_k
MIN_CONTACT_S = 0.2
_STEPS = np.arange(-0.8, 0.8, 0.004)  # of log C
# Rows of `_log_densities`, after those who are as estimated.
_SMALL = 1
_ELSEWHERE = 2


@dataclass(frozen=True)
class Stander:
    """A person as captured alone: height h of the camera above their floor, and stature S, both in
    metres.
    """

    height_m: float  # NaN where their feet say nothing of the floor
    stature_m: float
    is_known: bool  # the stature was given


def relative_sizes(people: Sequence[Stander]) -> Float64Array:
    """Return the (n,) factors r on the people's sizes; 1 without anybody of known stature, and on
    another floor.

    A factor is C / h where somebody is small, and as far from 1 as both errors explain where not.
    Without a known stature, nothing tells who of two people has the wrong size.
    """
    factors = np.ones(len(people))
    usable = [k for k, each in enumerate(people) if each.height_m >= MIN_CAMERA_M]
    if not any(people[k].is_known for k in usable):
        return factors
    heights = np.log([people[k].height_m for k in usable])
    log_c = heights.mean() + _STEPS
    models = [_log_densities(people[k], log_c - at) for k, at in zip(usable, heights, strict=True)]
    best = int(np.argmax(sum(np.logaddexp.reduce(model, axis=0) for model in models)))
    for k, at, model in zip(usable, heights, models, strict=True):
        kind = int(np.argmax(model[:, best]))
        log_r = log_c[best] - at
        if kind == _ELSEWHERE or people[k].is_known:
            continue
        share = (
            1.0
            if kind == _SMALL
            else STATURE_SIGMA**2 / (STATURE_SIGMA**2 + _noise(people[k]) ** 2)
        )
        factors[k] = np.exp(share * log_r)
    return factors


def _noise(person: Stander) -> float:
    return float(np.hypot(HEIGHT_SIGMA, FLOOR_SIGMA_M / person.height_m))


def _log_densities(person: Stander, log_r: Float64Array) -> Float64Array:
    """Return (3, n): as estimated, small, on another floor."""
    sigma = np.hypot(0.0 if person.is_known else STATURE_SIGMA, _noise(person))
    adult = np.log(ADULTS / (sigma * np.sqrt(2 * np.pi))) - 0.5 * (log_r / sigma) ** 2
    stature = person.stature_m * np.exp(log_r)
    small = np.where(
        (stature >= SHORTEST_M) & (log_r < 0) & (not person.is_known), np.log(SMALL), -np.inf
    )
    return np.stack([adult, small, np.full(len(log_r), np.log(OTHER_FLOOR))])


def stander(placed: PlacedTrack, up: FloatArray, is_known: bool) -> Stander:
    """Return what one person alone tells of the floor.

    :param placed: seen by a camera that does not travel, the first frame's centre at the origin.
    :param up: (3,) unit vector, in the first frame's camera axes.
    """
    valid = placed.valid
    stature_m = placed.body.stature(placed.betas)
    contact = placed.contact(up)[valid, : len(SOLES)]
    height_m = -floor_height(placed.soles[valid], contact, up)
    if len(placed.times) > 1:
        step_s = usual_step_s(placed.times)
        if contact.max(axis=1).sum() * step_s < MIN_CONTACT_S:
            height_m = float("nan")
    return Stander(height_m, stature_m, is_known)
