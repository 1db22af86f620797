# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracking of people through a video: detect now and then, and follow each person's landmarks in
between.

The results are tracklets: intervals in which a person was followed from frame to frame. A tracklet
ends where the person is lost, and where their identity is in doubt: behind somebody else, or after
a jump. `people` decides over the whole clip which tracklets are the same person.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...arrays import Uint8Array
from ..perception.adapters.keypoint_network import KeypointNetwork
from ..perception.landmark_network import SHOULDERS, EstimateMemory, LandmarkNetwork, PoseEstimate
from ..perception.observation import Observation, PendingReference, PersonMask
from ..perception.person_detector import FOR_SMALL, IN_PARTS, Detection, possible_regions
from ..perception.region import MARGIN, Crop, Region, bounds
from ..perception.sessions import Execution
from .appearance import appearance
from .frame_clock import FRAME_S, FrameClock
from .landmark_estimator import LandmarkEstimator, ReferenceEstimator, open_networks
from .left_right import looks_swapped, swap_ratio
from .people_removed import remove_people
from .plausibility import (
    DISAGREEMENT_THRESHOLD,
    PRESENCE_THRESHOLD,
    is_center_in_image,
    is_in_image,
    is_plausible,
    is_same_body,
    share_in_image,
    share_within,
)
from .search_schedule import EAGER_S, SearchSchedule
from .tracked_target import TrackedTarget

# A detection with a lower score has to pass stricter limits, see `plausibility`.
SURE_SCORE = 0.9
# The largest share of its keypoints in the bounding box of somebody who is tracked.
MAX_SHARE_WITHIN = 0.5
MAX_INNOVATION = 0.25  # see `TrackedTarget.innovation`: more in one frame may be another person
ESTABLISHED_S = 10 * FRAME_S
NOVELTY_INNOVATION = 0.05  # what being new counts as, see MAX_INNOVATION
# The time for which a lost person is looked for, and preferred to a more prominent one.
MEMORY_S = 60 * FRAME_S
# A person with a smaller share of the largest side will not become the most prominent one.
RIVAL_SIDE = 0.5
# A person this much larger takes the place of the smallest one, when all places are taken.
REPLACING_SIDE = 1.5
MAX_PEOPLE = 12
REFERENCE_S = 30 * FRAME_S  # between two calls of the reference network
REFERENCE_SWAPPED_S = 8 * FRAME_S  # the same where left and right seem to be swapped
# The time for which the largest network replaces a smaller one that lost the person or swapped
# sides.
FALLBACK_S = 15 * FRAME_S
HALF_SWAPPED = 2.0  # `swap_ratio` below which a network may be about to confuse the sides
APPEARANCE_S = 4 * FRAME_S  # between two samples of the appearance
_MIN_REDETECTION_AGE = 6  # frames for which somebody was tracked
_JUST_LOST_FRAMES = 2  # within which a detected body at the prediction continues the tracklet
# Distances of regions in sides, see `Region.resembles`.
_SAME_TARGET = 0.12
_LOST_TARGET = 0.5
_REPLACED_TARGET = 0.35
# Of the regions in which somebody who was lost is looked for, see `redetect_rotated`, and of what
# is found there.
_REDETECTION_ROTATIONS = tuple(k * math.pi / 6 for k in range(12))
_REDETECTION_SCALES = (1.0, 1.35)
_MIN_REDETECTION_PRESENCE = 0.9
_MAX_REDETECTION_INNOVATION = 0.35
CURLED_SPREAD = 0.25
# Of somebody who is detected with a lower score than `SURE_SCORE` after those who are tracked were
# removed. In some 400 frames of one or two people, background and remains had scores of up to 0.85;
# but none of these with both limits and plausible keypoints. The presence counts for somebody who
# is followed as well, and is near the prediction then.
_MIN_HIDDEN_SCORE = 0.8
_MIN_HIDDEN_PRESENCE = 0.95
_MAX_HIDDEN_INNOVATION = 0.15
# A second region of a detection counts if it shows the shoulders nearer to the detected ones by so
# much, in sides. Where there is only one person, both show the same.
_CLEARLY_NEARER = 0.015
LEAVING_SHARE = 0.8  # a lost person with fewer of the keypoints in the image has left it


@dataclass(frozen=True)
class _DetectedBody:
    """A plausible body, and whether its detection is independent evidence of it."""

    estimate: PoseEstimate
    is_sure: bool
    detection: Detection

    def is_beside(self, other: PoseEstimate) -> bool:
        """Return whether the shoulders were detected where this body has them, and not where the
        other one has them.
        """
        is_confirmed = self.detection.has_shoulders_of(_detection_of(self.estimate))
        return is_confirmed and self.detection.is_beside(_detection_of(other))

    def is_less_spread_than(self, other: _DetectedBody) -> bool:
        """Return whether the other one covers this one, and its keypoints are more spread out."""
        share = share_within(self.estimate, other.estimate)
        return share > MAX_SHARE_WITHIN and self.estimate.spread < other.estimate.spread


class _Sighting(NamedTuple):
    """The estimate of somebody who is tracked, in the next frame."""

    target: TrackedTarget
    estimate: PoseEstimate
    is_swapped: bool  # whether left and right are, since the frame before
    innovation: float  # see `TrackedTarget.innovation`


class PeopleTracker:
    """Tracks the people of a video. Frames are given in order; call `reset` before another video.

    :param quality: ``fast``, ``balanced`` or ``best``.
    :param people: how many people are wanted at most; None: only the most prominent one of the
        clip. Then only those who may turn out to be that one are tracked.
    :param detector: an ONNX file of the user's that replaces the built-in detector; see `adapters`.
    :param keypoints: the same for the landmark network.
    :param crop: the part of the picture that the networks are given; None: all of it. Everything
        else is in pixels of the whole picture.
    :raises UsageError: the quality is unknown.
    :raises SetupError: a built-in network is missing.
    :raises ModelFileError: a user's network cannot be used.
    """

    def __init__(
        self,
        quality: str,
        threads: int,
        people: int | None = None,
        *,
        detector: Path | None = None,
        keypoints: Path | None = None,
        execution: Execution | None = None,
        crop: Crop | None = None,
    ) -> None:
        self._crop = crop
        self._networks = networks = open_networks(quality, threads, detector, keypoints, execution)
        self._estimator = LandmarkEstimator(networks)
        self._reference = ReferenceEstimator(networks.reference) if networks.reference else None
        self._people = people
        self._largest_only = people is None
        self._max_live = 2 if people is None else min(people + 1, MAX_PEOPLE)
        self.reset()

    def remember_in(self, memory: EstimateMemory | None) -> None:
        """Let the built-in landmark networks look for estimates in a memory, and put new ones
        there.
        """
        for network in (self._networks.landmarks, self._networks.reference):
            if isinstance(network, LandmarkNetwork):
                network.memory = memory

    def restarted(self, regions: Sequence[Region] = ()) -> PeopleTracker:
        """Return a tracker with the same networks that has seen nothing.

        :param regions: in which people are known to be in its first frame; they are followed before
            it searches.
        """
        tracker = copy.copy(self)
        tracker._estimator = LandmarkEstimator(self._networks)
        tracker.reset()
        tracker._given = [tracker._moved(region, -1) for region in regions]
        return tracker

    def reset(self) -> None:
        """Start again: the next frame begins with a detection, and tracklet numbers with 0."""
        self._tracklets = 0
        self._given: list[Region] = []
        self._clock = FrameClock()
        self._schedule = SearchSchedule(self._clock, self._people)
        self.forget()

    def forget(self) -> None:
        """Forget everybody, for the next frame shows another scene. Tracklet numbers continue."""
        self._live: list[TrackedTarget] = []
        self._lost: list[TrackedTarget] = []
        self._schedule.forget()

    @property
    def mask_network(self) -> LandmarkNetwork | None:
        """The network that gives person masks; only the largest one, whose preset is not made for
        speed.
        """
        return self._networks.begins_early if self._networks.prefetches else None

    def step(
        self,
        image_rgb: Uint8Array,
        upcoming_rgb: Uint8Array | None = None,
        time_s: float | None = None,
        upcoming_with_masks: bool = False,
    ) -> list[tuple[int, Observation]]:
        """Track everybody in the next frame.

        The detector runs when somebody was lost and, for people who enter, now and then. With
        ``upcoming_rgb``, the networks start on that frame before this call returns. The largest
        network estimates both frames at once, the second one in predicted regions; that result
        counts only if this frame confirms the prediction.

        :param image_rgb: (H, W, 3) RGB.
        :param upcoming_rgb: (H, W, 3) the frame after it.
        :param time_s: when the frame is shown; None: a thirtieth of a second after the one before.
        :param upcoming_with_masks: whether the people of the frame after it need masks; only
            `mask_network` gives them, and not to people whom it was not already following.
        :return: tracklet number and observation of each person.
        """
        if self._crop is not None:
            image_rgb = self._crop.cut(image_rgb)
            upcoming_rgb = None if upcoming_rgb is None else self._crop.cut(upcoming_rgb)
        self._clock.advance(time_s)
        self._estimator.advance(upcoming_with_masks)
        self._update_live(image_rgb, upcoming_rgb)
        self._start_given(image_rgb)
        self._estimator.begin_upcoming(upcoming_rgb, self._live)
        self._redetect(image_rgb)
        if self._schedule.is_due(image_rgb, self._live, self._lost):
            self._search(image_rgb)
        references = self._begin_references(image_rgb)
        return [
            (f.tracklet, self._in_picture(self._observe(image_rgb, f, references.get(f.tracklet))))
            for f in self._live
        ]

    def _moved(self, region: Region, sign: int) -> Region:
        """Return a region of the cropped picture in the whole one, or reversely with sign −1."""
        if self._crop is None:
            return region
        return region.moved(np.array([sign * self._crop.x, sign * self._crop.y], float))

    def _in_picture(self, observation: Observation) -> Observation:
        """Return an observation of the cropped picture in pixels of the whole one; without its
        mask, which does not know what lies beyond the crop.
        """
        if self._crop is None:
            return observation
        return replace(
            observation,
            keypoints_px=observation.keypoints_px + [self._crop.x, self._crop.y],
            region=self._moved(observation.region, 1),
            mask=None,
        )

    def _update_live(self, image_rgb: Uint8Array, upcoming_rgb: Uint8Array | None) -> None:
        """Track everybody from the frame before to this one; people who are not found are lost."""
        for lost in self._lost:
            lost.frames_lost += 1
        self._lost = [lost for lost in self._lost if self._clock.is_within(MEMORY_S, lost.seen_s)]
        found = self._estimator.estimate_live(image_rgb, upcoming_rgb, self._live)
        checked = [
            self._with_fallback(image_rgb, target, estimate)
            for target, estimate in zip(self._live, found, strict=True)
        ]
        seen = []
        for target, (estimate, is_swapped) in zip(self._live, checked, strict=True):
            target.is_occluded = estimate is not None and target.becomes_occluded(estimate)
            if estimate is not None and not target.is_occluded:
                innovation = target.innovation(estimate)
                seen.append(_Sighting(target, estimate, is_swapped, innovation))
        # Two targets on one body: one person went behind another. The body belongs to the target
        # with the smaller innovation; if these are similar, a target that was found just now was a
        # mistake.
        seen.sort(key=self._doubt)
        kept: list[TrackedTarget] = []
        accepted: list[PoseEstimate] = []
        for target, estimate, is_swapped, innovation in seen:
            if any(is_same_body(estimate, other) for other in accepted):
                continue
            accepted.append(estimate)
            if innovation > MAX_INNOVATION:
                kept.append(self._start(estimate))
                self._lose(target)
            else:
                self._update(target, estimate, is_swapped)
                kept.append(target)
        for target in self._live:
            if target in kept or target in self._lost:
                continue
            behind = self._estimate_behind(image_rgb, target, kept)
            if behind is None:
                self._lose(target)
            else:
                self._update(target, behind, looks_swapped(target.estimate, behind))
                kept.append(target)
        self._live = sorted(kept, key=lambda f: f.tracklet)

    def _estimate_behind(
        self, image_rgb: Uint8Array, target: TrackedTarget, kept: list[TrackedTarget]
    ) -> PoseEstimate | None:
        """Estimate a person who may be behind those who are still tracked, with these removed; None
        if too little of the person is seen.
        """
        predicted = target.prefetch_region
        front = [f for f in kept if f.estimate.next_region.is_near(predicted)]
        if self._largest_only or not front:
            return None
        rest_rgb = self._without(image_rgb, front)
        if rest_rgb is None:
            return None
        (estimate,) = self._estimator.estimate(rest_rgb, [predicted], sure=False)
        is_seen = (
            estimate is not None
            and estimate.presence >= _MIN_HIDDEN_PRESENCE
            and target.innovation(estimate) <= _MAX_HIDDEN_INNOVATION
            and not _is_tracked(estimate, kept)
        )
        return estimate if is_seen else None

    def _without(self, image_rgb: Uint8Array, people: Sequence[TrackedTarget]) -> Uint8Array | None:
        """Return the image without these people; None if the landmark network is the user's, which
        has no masks.
        """
        network = self._networks.landmarks
        if not isinstance(network, LandmarkNetwork):
            return None
        regions = [f.estimate.next_region for f in people]
        masks = [network.mask(image_rgb, region) for region in regions]
        return remove_people(image_rgb, list(zip(regions, masks, strict=True)))

    def _start_given(self, image_rgb: Uint8Array) -> None:
        """Start a tracklet for everybody in the given regions, also for those who would lose
        against others.
        """
        regions = self._given
        self._given = []
        for estimate in self._estimator.estimate(image_rgb, regions) if regions else ():
            if estimate is not None and not _is_tracked(estimate, self._live):
                self._live.append(self._start(estimate))

    def _doubt(self, seen: _Sighting) -> tuple[bool, float]:
        """Return what grows with the doubt whether a body is a target's: being new counts as
        NOVELTY_INNOVATION, and less and less while a person becomes established.
        """
        novelty = NOVELTY_INNOVATION * (1 - min(seen.target.tracked_s / ESTABLISHED_S, 1.0))
        return seen.innovation > MAX_INNOVATION, seen.innovation + novelty

    def _update(self, target: TrackedTarget, estimate: PoseEstimate, is_swapped: bool) -> None:
        target.update(estimate, is_swapped, self._clock.time_s, self._clock.step_s)

    def _with_fallback(
        self, image_rgb: Uint8Array, target: TrackedTarget, estimate: PoseEstimate | None
    ) -> tuple[PoseEstimate | None, bool]:
        """Replace the estimate by the largest network's for a while after a smaller one lost the
        person or the sides.

        :return: the estimate, and whether left and right are swapped in it.
        """
        ratio = np.inf if estimate is None else swap_ratio(target.estimate, estimate)
        swapped = ratio < 1.0
        if self._networks.fallback is None:
            return estimate, swapped
        if estimate is None or ratio < HALF_SWAPPED or target.becomes_occluded(estimate):
            target.fallback_s = self._clock.time_s
        if self._clock.has_passed(FALLBACK_S, self._clock.time_s - target.fallback_s):
            return estimate, swapped
        region = target.estimate.next_region
        if not is_in_image(region, image_rgb):
            return estimate, swapped
        (stronger,) = self._networks.fallback.estimate(image_rgb, [region])
        if not is_plausible(stronger):
            return estimate, swapped
        return stronger, looks_swapped(target.estimate, stronger)

    def _redetect(self, image_rgb: Uint8Array) -> None:
        """Look for everybody who was just lost, in rotated regions."""
        recent = [
            f
            for f in self._lost
            if self._clock.is_within(EAGER_S, f.seen_s) and f.age >= _MIN_REDETECTION_AGE
        ]
        for lost in recent:
            if len(self._live) >= self._max_live:
                return
            estimate = redetect_rotated(self._networks.landmarks, image_rgb, lost, self._live)
            if estimate is not None:
                self._resume(lost, estimate)

    def _search(self, image_rgb: Uint8Array) -> None:
        """Start a tracklet for everybody who is detected and not tracked yet; small people only if
        nobody else is.
        """
        closely = self._schedule.begin(image_rgb, self._live, self._lost)
        turned = []
        if self._schedule.begin_turned(self._live):
            turned = self._networks.detector.detect_turned(image_rgb)
        self._start_detected(
            image_rgb,
            self._networks.detector.detect(image_rgb, closely=closely),
            SURE_SCORE,
            self._estimate_detected(image_rgb, turned, math.inf),
        )
        if self._schedule.begin_thorough(self._live):
            beside_larger = self._networks.detector.detect_smaller(image_rgb, IN_PARTS)
            self._start_detected(image_rgb, beside_larger, SURE_SCORE)
            self._search_behind(image_rgb)
        if self._schedule.begin_small(image_rgb, self._live, self._lost):
            small = self._networks.detector.detect_smaller(image_rgb, FOR_SMALL)
            self._start_detected(image_rgb, small, math.inf)

    def _search_behind(self, image_rgb: Uint8Array) -> None:
        """Start a tracklet for everybody who is seen once those who are tracked are removed."""
        rest_rgb = self._without(image_rgb, self._live)
        if rest_rgb is None:
            return
        found = self._networks.detector.detect(rest_rgb, closely=True)
        found = [detection for detection in found if detection.score >= _MIN_HIDDEN_SCORE]
        for body in self._estimate_detected(rest_rgb, found, SURE_SCORE):
            if body.is_sure or body.estimate.presence >= _MIN_HIDDEN_PRESENCE:
                # Nobody else is in this picture, so this body is not a part of theirs.
                self._add(replace(body, is_sure=True))

    def _start_detected(
        self,
        image_rgb: Uint8Array,
        found: list[Detection],
        sure_score: float,
        turned: Sequence[_DetectedBody] = (),
    ) -> None:
        """Start a tracklet for every plausible body that is not tracked yet.

        :param sure_score: the score from which a detection is independent evidence of a body.
        :param turned: what was detected in turned pictures. The same body at the wrong turn can be
            plausible, but its keypoints are less spread out.
        """
        upright = self._estimate_detected(image_rgb, found, sure_score)
        for body in upright:
            if not any(body.is_less_spread_than(other) for other in turned):
                self._add(body)
        for body in sorted(turned, key=lambda body: -body.estimate.spread):
            self._add(body)

    def _estimate_detected(
        self, image_rgb: Uint8Array, found: list[Detection], sure_score: float
    ) -> list[_DetectedBody]:
        """Return every plausible body that is not tracked yet, those that are sure first.

        Each is estimated twice: the landmarks give a better region than the detector.

        :param sure_score: see `_start_detected`.
        """
        detections = [d for d in self._ranked(found) if self._may_be_new(d)]
        detections = detections[: 3 if self._largest_only else 2 * self._max_live]
        if not detections:
            return []
        bodies = []
        first = self._estimate_first(image_rgb, detections, found)
        likely = [k for k, e in enumerate(first) if e.presence >= PRESENCE_THRESHOLD]
        for sure in (True, False):
            chosen = [k for k in likely if (detections[k].score >= sure_score) == sure]
            regions = [first[k].next_region for k in chosen]
            estimates = self._estimator.estimate(image_rgb, regions, sure)
            for k, estimate in zip(chosen, estimates, strict=True):
                if estimate is not None:
                    bodies.append(_DetectedBody(estimate, sure, detections[k]))
        return bodies

    def _estimate_first(
        self, image_rgb: Uint8Array, detections: list[Detection], found: list[Detection]
    ) -> list[PoseEstimate]:
        """Estimate each detection, in that of its regions which shows the detected shoulders best.

        :param found: everybody who was detected, with those who are tracked.
        """
        regions = [possible_regions(detection, found) for detection in detections]
        estimates = iter(self._networks.landmarks.estimate(image_rgb, list(chain(*regions))))
        out = []
        for detection, tried in zip(detections, regions, strict=True):
            best = next(estimates)
            least = _shoulders_off(detection, best) - _CLEARLY_NEARER
            for other in islice(estimates, len(tried) - 1):
                if _shoulders_off(detection, other) < least:
                    best = other
            out.append(best)
        return out

    def _ranked(self, detections: list[Detection]) -> list[Detection]:
        """Sort detections: those that may be a lost person first, then by score times size."""

        def rank(detection: Detection) -> tuple[bool, float]:
            region = detection.region
            may_be_lost = any(
                region.resembles(f.predicted_region, _LOST_TARGET) for f in self._lost
            )
            return may_be_lost, detection.score * region.side_px

        return sorted(detections, key=rank, reverse=True)

    def _may_be_new(self, detection: Detection) -> bool:
        """Return whether nobody who is tracked was detected, and the region's size matters.

        Somebody who is lost in front of or behind another person may be in nearly the same region
        as that person.
        """
        region = detection.region
        lost = min((region.difference(f.predicted_region) for f in self._lost), default=math.inf)
        for f in self._live:
            tracked = f.estimate.next_region
            is_same = region.resembles(tracked, _SAME_TARGET) and region.difference(tracked) <= lost
            if is_same and not detection.is_beside(_detection_of(f.estimate)):
                return False
        return self._is_rival(region)

    def _is_rival(self, region: Region) -> bool:
        """Return whether whoever is in a region may become the most prominent one, if only that one
        is wanted.
        """
        largest_px = max((f.estimate.region.side_px for f in self._live), default=0.0)
        return not self._largest_only or region.side_px >= RIVAL_SIDE * largest_px

    def _add(self, body: _DetectedBody) -> None:
        """Start a tracklet, unless the body is tracked already or enough people of at least its
        size are.
        """
        estimate = body.estimate
        if _is_tracked(estimate, self._live):
            return
        if any(f.is_occluded_by(estimate) for f in self._lost):
            return
        # The legs of somebody who is tracked, with or without the background, can look like another
        # person.
        overlaps = (
            max(share_within(estimate, f.estimate), share_within(f.estimate, estimate))
            for f in self._live
            if not body.is_beside(f.estimate)
        )
        if not body.is_sure and any(share > MAX_SHARE_WITHIN for share in overlaps):
            return
        if not self._is_rival(estimate.region):
            return
        if len(self._live) >= self._max_live:
            smallest = min(self._live, key=lambda f: f.estimate.region.side_px)
            if estimate.region.side_px < REPLACING_SIDE * smallest.estimate.region.side_px:
                return
            self._live.remove(smallest)
        just_lost = (
            f for f in self._lost if f.frames_lost <= _JUST_LOST_FRAMES and not f.is_occluded
        )
        nearest = min(just_lost, key=lambda f: f.innovation(estimate), default=None)
        if nearest is not None and nearest.innovation(estimate) <= MAX_INNOVATION:
            self._resume(nearest, estimate)
            return
        self._lost = [
            f
            for f in self._lost
            if not estimate.region.resembles(f.predicted_region, _REPLACED_TARGET)
        ]
        self._live.append(self._start(estimate))

    def _resume(self, lost: TrackedTarget, estimate: PoseEstimate) -> None:
        """Continue the tracklet of a lost person who was found again."""
        self._update(lost, estimate, looks_swapped(lost.estimate, estimate))
        lost.frames_lost = 0
        self._lost.remove(lost)
        self._live.append(lost)

    def _start(self, estimate: PoseEstimate) -> TrackedTarget:
        self._tracklets += 1
        return TrackedTarget(self._tracklets - 1, estimate, np.zeros(2), self._clock.time_s)

    def _lose(self, target: TrackedTarget) -> None:
        target.frames_lost = 1
        target.pending = None
        self._lost.append(target)

    def _begin_references(self, image_rgb: Uint8Array) -> dict[int, PendingReference]:
        """Ask the reference network about the people whose left and right are due or in doubt; by
        tracklet.
        """
        if self._reference is None:
            return {}
        calls = {}
        for target in self._live:
            interval_s = REFERENCE_SWAPPED_S if target.swapped else REFERENCE_S
            if self._clock.has_passed(interval_s, target.tracked_s - target.reference_s):
                target.reference_s = target.tracked_s
                target.swapped = False
                calls[target.tracklet] = self._reference.submit(image_rgb, target.estimate.region)
        return calls

    def _observe(
        self, image_rgb: Uint8Array, target: TrackedTarget, reference: PendingReference | None
    ) -> Observation:
        e = target.estimate
        samples_appearance = self._clock.has_passed(
            APPEARANCE_S, target.tracked_s - target.appearance_s
        )
        if samples_appearance:
            target.appearance_s = target.tracked_s
        return Observation(
            e.keypoints_px,
            e.keypoints_confidence,
            e.world_landmarks,
            e.presence,
            e.region,
            acquired=target.age == 0,
            appearance=appearance(image_rgb, e.keypoints_px) if samples_appearance else None,
            reference_landmarks=reference,
            mask=None
            if e.mask is None
            else PersonMask(e.region, e.mask, (image_rgb.shape[1], image_rgb.shape[0])),
        )


def _is_tracked(estimate: PoseEstimate, live: Sequence[TrackedTarget]) -> bool:
    """Return whether a body is that of somebody who is tracked."""
    return any(is_same_body(estimate, target.estimate) for target in live)


def _shoulders_off(detection: Detection, estimate: PoseEstimate) -> float:
    """Return how far a body's shoulders are from the detected ones, in sides of the region."""
    off_px = math.dist(detection.points_px[2], estimate.keypoints_px[SHOULDERS].mean(axis=0))
    return off_px / detection.region.side_px


def _detection_of(estimate: PoseEstimate) -> Detection:
    """Return what the detector would find of a body, with the shoulders of its keypoints."""
    region = estimate.next_region
    hips_px = np.array(region.center_px)
    top_px = hips_px + region.R_image_crop @ [0.0, -region.side_px / (2 * MARGIN)]
    shoulders_px = estimate.keypoints_px[SHOULDERS].mean(axis=0)
    points_px = np.stack([hips_px, top_px, shoulders_px, top_px])
    return Detection(estimate.presence, bounds(estimate.keypoints_px), points_px)


def redetect_rotated(
    landmarks: LandmarkNetwork | KeypointNetwork,
    image_rgb: Uint8Array,
    lost: TrackedTarget,
    live: Sequence[TrackedTarget],
) -> PoseEstimate | None:
    """Look for a lost person at the predicted position, in rotated regions.

    A body that is curled up or upside down looks less like a body, so the estimate has to be near
    the prediction. An occluded person is not looked for, because something else is visible there;
    neither is one who has walked out of the image, or who is predicted near somebody else.

    :param image_rgb: (H, W, 3).
    :return: the estimate with the smallest innovation, or None.
    """
    if lost.is_occluded or share_in_image(lost.estimate, image_rgb) < LEAVING_SHARE:
        return None
    predicted = lost.predicted_region
    if any(target.estimate.next_region.is_near(predicted) for target in live):
        return None
    candidates = [
        replace(
            predicted, rotation=predicted.rotation + rotation, side_px=predicted.side_px * scale
        )
        for scale in _REDETECTION_SCALES
        for rotation in _REDETECTION_ROTATIONS
    ]
    regions = [region for region in candidates if is_in_image(region, image_rgb)]
    found = [
        e
        for e in landmarks.estimate(image_rgb, regions)
        if e.presence >= _MIN_REDETECTION_PRESENCE
        and e.spread >= CURLED_SPREAD
        and e.disagreement <= DISAGREEMENT_THRESHOLD
        and is_center_in_image(e, image_rgb)
        and not _is_tracked(e, live)
        and lost.innovation(e) <= _MAX_REDETECTION_INNOVATION
    ]
    return min(found, key=lost.innovation, default=None)
