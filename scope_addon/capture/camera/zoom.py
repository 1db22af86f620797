# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length of each frame where the lens zooms, from corners of the background.

A camera that rotates and zooms but does not travel moves corners alike at any depth (`Turn`). Each
frame is compared with a key frame; the frame before it becomes the next key frame where one turn no
longer explains the corners that both share, or where too few are left. A link from one key frame to
the next thus ends for lack of corners if the lens zooms, but soon and with a small change of scale
if the camera travels, because near corners pass by far ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from ...arrays import Float64Array
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
    R_first_camera = np.tile(np.eye(3), (len(seen), 1, 1))
    for link in links:
        at = link.first
        end = at + len(link.turns)
        is_zoom = not link.is_travel and abs(link.log_zoom) >= MIN_ZOOM
        log_zooms = np.log([1.0, *(turn.zoom for turn in link.turns)])
        steps[at:end] = np.diff(log_zooms) if is_zoom or not travels else 0.0
        rotations = np.array([turn.assumed_rotation.T for turn in link.turns])
        R_first_camera[at + 1 : end + 1] = R_first_camera[at] @ rotations
        R_first_camera[end + 1 :] = R_first_camera[end]
    log_zoom = np.concatenate([[0.0], np.cumsum(_without_gaps(steps, np.diff(seen)))])
    # Corners are kept only where they have moved: after a pause, the last sample shows no motion.
    paused = np.flatnonzero(np.diff(seen) > SLOW_S + 1.0 / SAMPLES_HZ)
    kept = np.insert(np.arange(len(seen)), paused + 1, paused)
    known = np.insert(seen, paused + 1, seen[paused + 1] - 1.0 / SAMPLES_HZ)
    within = np.clip(times, seen[0], seen[-1])
    return Zoom(
        np.exp(np.interp(within, known, log_zoom[kept])),
        interpolated_rotations(R_first_camera[kept], known, within),
        not travels and not np.isnan(steps).any(),
    )


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
