# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length of each frame where the lens zooms, from corners of the background.

A camera that rotates and zooms but does not travel moves corners alike at any depth (`Turn`). Each
frame is compared with a key frame; the frame before it becomes the next key frame where one turn no
longer explains the corners that both share, or where too few are left. A link from one key frame to
the next thus ends for lack of corners if the lens zooms, but soon and with a small change of scale
if the camera travels, because near corners pass by far ones.

How a rotation moves the corners of one part of the picture otherwise than those of another depends
on the focal length f: H = K R K⁻¹, K = diag(f, f, 1). The widest turn of each link tells it; what a
lens distorts, or a crop off the centre moves, is alike in all links, so their agreement alone would
promise too much.

Source: Hartley 1997 (focal length of a camera that rotates).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from ....solver.rotations import log
from ...arrays import BoolArray, Float64Array, IndexArray
from ...kinematics.smoothing import interpolated_rotations
from .corner_tracks import SAMPLES_HZ, SLOW_S, CornerTracks
from .intrinsics import Camera
from .odometry import MIN_COMMON_SHARE, Sightings
from .turn import Turn

MIN_ZOOM = 0.06  # logarithm, in a link; cameras that only turn seem to zoom by a tenth of it
# The same in a clip in which the camera also travels; those that travel and do not zoom reach half.
MIN_ZOOM_IN_TRAVEL = 0.15
MIN_CORNERS = 15  # that two sightings share; a person who fills the picture leaves as few
MIN_SHARE = 0.8  # of them that a turn explains
MIN_STEP_SHARE = 0.5  # the same from one sighting to the next, so that a link goes on
BRIEF = 4  # sightings, a third of a second, in which something else than travel hides the corners
TRACKING_STEPS = 4  # of a turn that begins at that of the frame before

# The focal length, see `focal_by_turns`.
MIN_TURN = np.radians(4.0)  # of a link, by the assumed focal length
MIN_TURNS = 2
MIN_TURN_CORNERS = 30  # that its two sightings share
MAX_TURN_ZOOM = 0.01  # logarithm, of links that turn alone
MAX_SPREAD = 0.08  # of the logarithms of the focal length in the links
# Relative error of a focal length however well the links agree: an unknown lens distortion of k1 =
# 0.05 makes it 5 to 10 % wrong.
SYSTEMATIC = 0.08
MIN_LINKED = 0.9  # of the sightings, with the one before
LIMITS = (0.45, 2.3)  # of the true focal length over the assumed one


@dataclass(frozen=True)
class Zoom:
    """What the lens of a camera does that does not travel, in T frames."""

    factors: Float64Array  # (T,) focal length over that of the first frame
    # (T, 3, 3) as far as the focal length of the first frame is right
    R_first_camera: Float64Array
    # False: the camera also travels, or corners are lost, so some of the zoom may be missing
    is_certain: bool


@dataclass(frozen=True)
class _Link:
    """Sightings that are compared with a key sighting, the first of them."""

    first: int
    turns: list[Turn]  # from the key to each of the next sightings
    is_travel: bool  # whether it ended because no turn explained the next sighting

    @property
    def log_zoom(self) -> float:
        """The change of the focal length in the whole link."""
        return float(np.log(self.turns[-1].zoom))


def find_zoom(
    corners: CornerTracks, times: Float64Array, camera: Camera, longer_side_px: float
) -> Zoom | None:
    """Return how the lens zooms; None where it does not, as far as is seen.

    :param times: (T,) seconds.
    :param camera: the lens of the first frame.
    :param longer_side_px: of the image.
    """
    sightings = Sightings.of(corners, camera, longer_side_px)
    links = _without_brief_travel(_links(sightings))
    travels = any(link.is_travel for link in links)
    by_lens = [abs(link.log_zoom) for link in links if not link.is_travel]
    if max(by_lens, default=0.0) < (MIN_ZOOM_IN_TRAVEL if travels else MIN_ZOOM):
        return None
    seen = times[sightings.rows]
    steps = np.full(len(seen) - 1, np.nan)  # of the logarithm of the focal length
    for link in links:
        at = link.first
        end = at + len(link.turns)
        is_zoom = not link.is_travel and abs(link.log_zoom) >= MIN_ZOOM
        log_zooms = np.log([1.0, *(turn.zoom for turn in link.turns)])
        steps[at:end] = np.diff(log_zooms) if is_zoom or not travels else 0.0
    log_zoom = np.concatenate([[0.0], np.cumsum(_without_gaps(steps, np.diff(seen)))])
    known, kept = _with_pauses(seen)
    return Zoom(
        np.exp(np.interp(times, known, log_zoom[kept])),
        _rotations(links, seen, times),
        not travels and not np.isnan(steps).any(),
    )


def _with_pauses(seen: Float64Array) -> tuple[Float64Array, IndexArray]:
    """Return times (m,) at which the camera is known, and which sighting (m,) tells it: corners are
    kept only where they have moved, so after a pause, the last sample shows no motion.

    :param seen: (n,) times of the sightings.
    """
    paused = np.flatnonzero(np.diff(seen) > SLOW_S + 1.0 / SAMPLES_HZ)
    kept = np.insert(np.arange(len(seen)), paused + 1, paused)
    return np.insert(seen, paused + 1, seen[paused + 1] - 1.0 / SAMPLES_HZ), kept


def _rotations(links: list[_Link], seen: Float64Array, times: Float64Array) -> Float64Array:
    """Return the camera's rotations (T, 3, 3) at ``times``, as far as the assumed focal length is
    right.

    :param seen: (n,) times of the sightings.
    """
    R_first_camera = np.tile(np.eye(3), (len(seen), 1, 1))
    for link in links:
        at = link.first
        end = at + len(link.turns)
        rotations = np.array([turn.assumed_rotation.T for turn in link.turns])
        R_first_camera[at + 1 : end + 1] = R_first_camera[at] @ rotations
        R_first_camera[end + 1 :] = R_first_camera[end]
    known, kept = _with_pauses(seen)
    within = np.clip(times, seen[0], seen[-1])
    return interpolated_rotations(R_first_camera[kept], known, within)


@dataclass(frozen=True)
class TurnedLens:
    """What the turns of a camera tell of it that neither travels nor zooms, in T frames."""

    ratio: float  # of the focal length to the assumed one
    deviation: float  # its relative error, one standard deviation
    known: BoolArray  # (T,) False where too few corners are seen in two successive sightings
    R_first_camera: Float64Array  # (T, 3, 3) as far as the assumed focal length is right


def focal_by_turns(
    corners: CornerTracks, times: Float64Array, camera: Camera, longer_side_px: float
) -> TurnedLens | None:
    """Return what the turns of a camera tell that neither travels nor zooms; None of any other, and
    where it turns too little to tell.

    :param times: (T,) seconds.
    :param camera: the lens that is assumed.
    :param longer_side_px: of the image.
    """
    sightings = Sightings.of(corners, camera, longer_side_px)
    links = _links(sightings)
    is_linked = np.zeros(len(sightings.rows), bool)  # to the sighting before
    is_linked[:1] = True
    for link in links:
        is_linked[link.first + 1 : link.first + 1 + len(link.turns)] = True
    if not is_linked.size or is_linked.mean() < MIN_LINKED or any(x.is_travel for x in links):
        return None
    logs = []
    for link in links:
        angles = [float(np.linalg.norm(log(turn.assumed_rotation))) for turn in link.turns]
        widest = int(np.argmax(angles))
        turn = link.turns[widest]
        shared = len(sightings.common(link.first, link.first + 1 + widest)[0])
        if angles[widest] < MIN_TURN or shared < MIN_TURN_CORNERS:
            continue
        if abs(np.log(turn.zoom)) > MAX_TURN_ZOOM:
            return None
        logs.append(np.log(turn.focal))
    if len(logs) < MIN_TURNS:
        return None
    middle = float(np.median(logs))
    spread = float(1.48 * np.median(np.abs(np.array(logs) - middle)))
    ratio = float(np.exp(middle))
    if spread > MAX_SPREAD or not LIMITS[0] < ratio < LIMITS[1]:
        return None
    deviation = float(np.hypot(SYSTEMATIC, 1.25 * spread / np.sqrt(len(logs))))
    known = np.ones(len(times), bool)
    for k in np.flatnonzero(~is_linked):
        known[sightings.rows[k - 1] + 1 : sightings.rows[k] + 1] = False
    return TurnedLens(ratio, deviation, known, _rotations(links, times[sightings.rows], times))


def _without_gaps(steps: Float64Array, seconds: Float64Array) -> Float64Array:
    """Return the changes (n,) from each sighting to the next; where corners were lost (NaN) for a
    moment, the lens went on zooming at the speed between those before and after.
    """
    lost = np.isnan(steps)
    known = np.flatnonzero(~lost)
    gaps = np.flatnonzero(lost)
    after = np.searchsorted(known, gaps)
    is_inside = (after > 0) & (after < len(known))
    bridged = gaps[is_inside]
    after = after[is_inside]
    is_brief = known[after] - known[after - 1] <= BRIEF
    bridged = bridged[is_brief]
    out = np.where(lost, 0.0, steps)
    speeds = steps[known] / seconds[known]
    out[bridged] = np.interp(bridged, known, speeds) * seconds[bridged]
    return out


def _without_brief_travel(links: list[_Link]) -> list[_Link]:
    """Return the links; those that travel ended, but only for a moment, do not count as travel."""
    out: list[_Link] = []
    for is_travel, run in groupby(links, lambda link: link.is_travel):
        together = list(run)
        is_brief = sum(len(link.turns) for link in together) <= BRIEF
        out += [replace(link, is_travel=is_travel and not is_brief) for link in together]
    return out


def _links(sightings: Sightings) -> list[_Link]:
    """Return the links of a clip in order; sightings that share too few corners are in none."""
    links = []
    key = 0
    turns: list[Turn] = []
    turn = Turn.none()
    log_zoom_of_key = 0.0
    while key + len(turns) + 1 < len(sightings.rows):
        k = key + len(turns) + 1
        _, in_key, in_k = sightings.common(key, k)
        share = 0.0
        if len(in_key) >= MIN_CORNERS:
            # Lines of sight by the key's lens: one focal length then suits all links.
            scale = np.exp(-log_zoom_of_key)
            tolerance = scale * sightings.tolerance
            rays_key = scale * sightings.rays[key][in_key]
            rays_k = scale * sightings.rays[k][in_k]
            turn = turn.refined(rays_key, rays_k, tolerance, TRACKING_STEPS)
            share = float(turn.explains(rays_key, rays_k, tolerance).mean())
        is_seen = len(in_key) >= max(MIN_CORNERS, MIN_COMMON_SHARE * len(sightings.rays[key]))
        if share >= MIN_SHARE and is_seen:
            turns.append(turn)
            continue
        if not turns and share >= MIN_STEP_SHARE:
            turns.append(turn)
        turn = Turn.none()
        if turns:
            link = _Link(key, turns, is_travel=is_seen)
            if abs(link.log_zoom) >= MIN_ZOOM_IN_TRAVEL:
                link = replace(link, is_travel=False)
            links.append(link)
            log_zoom_of_key += link.log_zoom
            if not link.is_travel:
                turn = Turn.none(turns[-1].focal)
        key += max(1, len(turns))
        turns = []
    if turns:
        links.append(_Link(key, turns, is_travel=False))
    return links
