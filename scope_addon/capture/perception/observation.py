# SPDX-License-Identifier: GPL-3.0-or-later
"""The networks' estimates of one person in one frame."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass

from ...arrays import Float32Array, Float64Array, FloatArray
from .region import Region

PendingReference = Future[Float64Array | None]
"""Pending world landmarks (33, 3) of the reference network, or None if it finds nobody."""


@dataclass(frozen=True)
class PersonMask:
    """Which pixels of a region show its person: ``probability`` (256, 256) in the crop of
    ``region``.

    ``image_size``: width and height of the image in pixels; beyond its border the mask says
    nothing. ``zoom``: the focal length over that of the camera.
    """

    region: Region
    probability: FloatArray
    image_size: tuple[int, int]
    zoom: float = 1.0


@dataclass(frozen=True)
class Observation:
    """Estimate of one person in one frame.

    ``keypoints_px`` (33, 2) pixels of the frame; ``keypoints_confidence`` (33,) 0..1;
    ``world_landmarks`` (33, 3) metres, the hip centre at 0, in camera axes (x right, y down, z
    forward), or all 0 where depth is unknown; ``presence``: the network's probability that there is
    a person; ``region``: the network's input region; ``acquired``: the person was not tracked from
    the previous frame; ``appearance``: see `appearance`, in some frames; ``reference_landmarks``:
    pending result of the heavy network, to replace ``world_landmarks``, in few frames. Order:
    `KEYPOINT_NAMES`. ``hands`` (2, 21, 7), if requested: pixels, confidence and world landmarks of
    the left and right hand, and the probability that the landmarks are a left hand's, see
    `hand_tracker`; zeros where not seen, the confidence negative where `confirmed` decides later.
    The tracker fills a hand in up to a third of a second later, if it is found again, so the array
    has to be kept itself. ``face``, if requested: see `face_record`. ``mask``: the person's
    outline, in few frames.
    """

    keypoints_px: Float64Array
    keypoints_confidence: Float64Array
    world_landmarks: Float64Array
    presence: float
    region: Region
    acquired: bool
    appearance: Float64Array | None = None
    reference_landmarks: PendingReference | None = None
    hands: Float32Array | None = None
    mask: PersonMask | None = None
    face: Float64Array | None = None
