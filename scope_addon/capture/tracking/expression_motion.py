# SPDX-License-Identifier: GPL-3.0-or-later
"""Expression weights and gaze over time: calm at rest, sharp in a blink, and back to rest where no
face is seen.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import BoolArray, Float64Array, FloatArray, unit_vectors
from ...kinematics.face import EXPRESSIONS
from ...kinematics.smoothing import gaussian_smooth
from ...motion import FACE_KEYS
from ...scene_gaps import usual_step_s
from ..perception.face_record import CONTOURS, eye_light_of, noise_of_size, parts

CALM_HZ = 2.0  # cut-off frequency at rest
NOISE = 0.05  # deviation of a weight from the calm motion that counts as noise, of a large face
GAZE_NOISE = 0.06
# The time in which an expression goes to rest after the face was last seen, and comes back before
# it is seen again.
RELEASE_S = 0.5
CLOSED = 0.5  # weight of a blink above which an eye is closed, and its iris not seen
# With less light around the eyes, they are not seen; small eyes in thick frames have 0.45.
DARK_GLASSES = 0.4
# The time over which the median of that light is taken: a passing hand or shadow is no glasses.
GLASSES_S = 1.0
SURE_OF_MOUTH = 0.5  # times the confidence of a face whose eyes are not seen
MIN_S = 2.0  # of a face, from which it is known how the network sees its open eyes
MAX_OPEN = 0.65  # weight of a blink that may be an open eye
_EYES = [k for k, name in enumerate(EXPRESSIONS) if name.startswith("eye")]
_BLINKS = [EXPRESSIONS.index(f"eyeBlink{side}") for side in ("Left", "Right")]
_FORWARD = np.array([0.0, 0.0, 1.0])


def expression_motion(
    rows: FloatArray, times: Float64Array, smoothing: bool
) -> dict[str, NDArray[Any]]:
    """Return a motion file's arrays about the face, named as `FACE_KEYS`.

    :param rows: (T, RECORD) see `face_record`.
    :param times: (T,) seconds.
    :param smoothing: False keeps the networks' weights and directions where the face is seen.
    """
    confidence, size, weights, directions, contours = parts(np.asarray(rows, float))
    seen = confidence > 0
    eyes_seen = seen & ~behind_glasses(eye_light_of(rows), seen, times)
    weights = with_open_eyes(weights, eyes_seen, times)
    open_eyes = eyes_seen[:, None] & (weights[:, _BLINKS] < CLOSED)
    eyes = released(weights[:, _EYES], eyes_seen, times, np.zeros(len(_EYES)))
    weights = released(weights, seen, times, np.zeros(len(EXPRESSIONS)))
    weights[:, _EYES] = eyes
    sure = np.where(eyes_seen, confidence, SURE_OF_MOUTH * confidence)
    if smoothing and len(rows) > 2:
        noise = np.where(seen, noise_of_size(size), 1.0)
        weights = np.clip(calmed(weights, times, NOISE * noise[:, None]), 0.0, 1.0)
        sure = np.where(seen, np.clip(gaussian_smooth(sure, times, CALM_HZ), 0.0, 1.0), 0.0)
    gaze = np.empty_like(directions)
    for k in range(len(_BLINKS)):
        gaze[:, k] = released(directions[:, k], open_eyes[:, k], times, _FORWARD)
        if smoothing and len(rows) > 2:
            gaze[:, k] = calmed(gaze[:, k], times, np.array(GAZE_NOISE))
    values = (
        weights.astype(np.float32),
        np.array(EXPRESSIONS),
        sure.astype(np.float32),
        unit_vectors(gaze).astype(np.float32),
        contours.astype(np.float32),
        np.array(CONTOURS, np.int64),
    )
    return dict(zip(FACE_KEYS, values, strict=True))


def behind_glasses(light: FloatArray, seen: BoolArray, times: Float64Array) -> BoolArray:
    """Return (T,) where the eyes are behind dark glasses, by the median of the `eye_light` (T,)
    over `GLASSES_S`.

    :param seen: (T,) where the face was seen.
    """
    rows = np.flatnonzero(seen)
    starts = np.searchsorted(times[rows], times[rows] - GLASSES_S / 2)
    ends = np.searchsorted(times[rows], times[rows] + GLASSES_S / 2, side="right")
    out = np.zeros(len(seen), bool)
    out[rows] = [
        np.median(light[rows[a:b]]) < DARK_GLASSES for a, b in zip(starts, ends, strict=True)
    ]
    return out


def with_open_eyes(weights: FloatArray, seen: BoolArray, times: Float64Array) -> FloatArray:
    """Take from the blinks what the network sees in this person's open eyes, as narrow ones, or
    those behind glasses.

    With the median m of a blink's weight over the clip, in most of which eyes are open: w' = max(0,
    (w − m) / (1 − m)). Weights of faces that are seen for less than `MIN_S` stay, and those of eyes
    that are closed for half of the clip.

    :param weights: (T, 52).
    :param seen: (T,) where the face was seen.
    :param times: (T,) seconds.
    """
    if len(times) < 2 or seen.sum() * usual_step_s(times) < MIN_S:
        return weights
    out = weights.copy()
    for blink in _BLINKS:
        rest = float(np.median(weights[seen, blink]))
        if rest < MAX_OPEN:
            out[:, blink] = np.maximum(0.0, (weights[:, blink] - rest) / (1.0 - rest))
    return out


def released(
    values: FloatArray, seen: BoolArray, times: Float64Array, rest: Float64Array
) -> Float64Array:
    """Fill the frames without measurement: from the last value to rest and from rest to the next
    one.

    With the times since the last and until the next measurement, both values count by s(t) = (1 +
    cos(π t / τ)) / 2 for t < τ = `RELEASE_S`; what remains of their sum to 1 is rest.

    :param values: (T, n).
    :param seen: (T,) which were measured.
    :param times: (T,) seconds.
    :param rest: (n,).
    """
    T = len(values)
    out = np.tile(rest, (len(values), 1)).astype(float)
    rows = np.flatnonzero(seen)
    if not len(rows):
        return out
    place = np.searchsorted(rows, np.arange(T), side="right")
    last = rows[np.maximum(place - 1, 0)]
    following = rows[np.minimum(place, len(rows) - 1)]
    since = np.where(place > 0, times - times[last], np.inf)
    until = np.where(place < len(rows), times[following] - times, np.inf)
    shares = [0.5 * (1 + np.cos(np.pi * np.minimum(t / RELEASE_S, 1.0))) for t in (since, until)]
    total = np.maximum(shares[0] + shares[1], 1.0)
    for share, source in zip(shares, (last, following), strict=True):
        out += (share / total)[:, None] * (values[source] - rest)
    out[seen] = values[seen]
    return out


def calmed(values: FloatArray, times: Float64Array, noise: Float64Array) -> Float64Array:
    """Remove noise from values (T, n) without phase, and without rounding what moves quickly.

    With the calm motion c, a low-pass of x, and d = x − c: y = c + d · d² / (d² + noise²). What
    deviates by less than the noise follows c; a blink deviates by much more and stays as it is.

    :param noise: (T, 1) or ().
    """
    calm = gaussian_smooth(values, times, CALM_HZ)
    deviation = values - calm
    return calm + deviation**3 / (deviation**2 + noise**2)
