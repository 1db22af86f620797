# SPDX-License-Identifier: GPL-3.0-or-later
"""Follows people through a video: detect now and then, and let each person's landmarks say where to look next.

What comes out are tracklets: unbroken stretches in which somebody was followed from frame to frame. A tracklet ends
where the person is lost, and also where it is in doubt that it is still the same person: behind somebody else, or
after a leap. Which tracklets are one person is decided over the whole clip, see `people`.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from ....solver.errors import ShapeError
from ...errors import SetupError
from ..perception.adapters.detectors.box_detector import BoxDetector
from ..perception.adapters.keypoints.keypoint_network import KeypointNetwork
from ..perception.execution import Execution
from ..perception.landmark_network import LandmarkNetwork, PoseEstimate
from ..perception.observation import PendingReference, Observation
from ..perception.person_detector import Detection, PersonDetector
from ..perception.region import Region, bounds, inside
from ..perception.sessions import landmark_network_name
from .appearance import appearance
from .left_right import looks_swapped
from .tracked_target import SETTLED_FRAMES, Followed, apart

PRESENCE_THRESHOLD = 0.5
# See PoseEstimate.spread and .disagreement. Hands fool the detector with scores up to 0.86 and the landmark networks
# with spreads up to 0.36, rarely 0.46: whoever is found with less certainty has to look more like a person.
SPREAD_THRESHOLD = 0.38
DISAGREEMENT_THRESHOLD = 0.25
SURE_SCORE = 0.9
UNSURE_SPREAD_THRESHOLD = 0.47
UNSURE_DISAGREEMENT_THRESHOLD = 0.18
SMALLEST_SIDE_PX = 24.0
LARGEST_SIDE = 6.0  # in longer sides of the image

SAME_BODY = 0.1  # mean distance of the keypoints, in sides of the region, below which two bodies are one
MOST_WITHIN = 0.5  # share of keypoints that somebody found with little certainty may have in another's box
LEAP = 0.25  # the same, from where motion foretold: more in one frame may be another person
FRAME_S = 1 / 30  # from one frame to the next where their times are not told
SEARCH_S = 8 * FRAME_S  # between two looks for others who have come into the picture
SEARCH_LARGEST_S = 20 * FRAME_S
OPENING_S = 2.0  # of the clip: who is there from the start may well be the most prominent person over all of it
SMALL_SHARE = 0.39  # of the picture's longer side
SEARCH_MISSED_S = 4 * FRAME_S  # while somebody is remembered who was lost, and for rivals in the opening
ESTABLISHED_S = 10 * FRAME_S
NEW_SURPRISE = 0.05  # what being new is as good as, see LEAP
EAGER_S = 15 * FRAME_S  # how long a lost person is looked for in every frame
MEMORY_S = 60 * FRAME_S  # how long now and then, and preferred over a stronger one
RIVAL_SIDE = 0.5  # who is smaller than this share of the largest will not be the most prominent person
MOST_PEOPLE = 12
JUDGE_S = 30 * FRAME_S  # between two looks of the strong network that tells left from right
JUDGE_AGAIN_S = 8 * FRAME_S  # the same where left and right seem to have changed places
# How long the strong network stands in for a smaller one that loses the person, or left and right.
DOUBT_S = 15 * FRAME_S
MOST_JUDGED = 2  # looks of it that wait, each with its frame
APPEARANCE_S = 4 * FRAME_S  # between two looks at the clothes
# How the region is turned and sized in which somebody who was just lost is looked for, and what is believed there.
_TURNS = tuple(k * math.pi / 6 for k in range(12))
_TURNED_SIZES = (1.0, 1.35)
_TURNED_PRESENCE = 0.9
_TURNED_LEAP = 0.35  # mean distance of the keypoints from where they were foretold, in sides of the region
CURLED_SPREAD = 0.25
LEAST_CONFIDENT, CONFIDENT = 4, 0.3  # keypoints that must be surer than this: less is left of somebody who has gone
LEAVING_SHARE = 0.8  # with fewer of the keypoints in the picture, somebody who is lost has left it
# How far the region that was foretold for a frame may lie from the one that the frame before gives: centre and size in
# sides, turn in radians. The networks were trained on regions that are off by more.
# The strong network alone looks ahead: the others are less steady where the region is foretold, and gain less.
FORETOLD_CENTER, FORETOLD_SIDE, FORETOLD_TURN = 0.08, 0.12, 0.15


class PeopleTracker:
    """The people of a video. Frames are given in order; `reset` before another video.

    :param people: how many people are wanted at most; None: only the most prominent one of the clip. Then only those
        who may turn out to be it are followed.
    :param detector, keypoints: ONNX files of the user's that take the place of ours; see `adapters`.
    """

    def __init__(
        self,
        quality: str,
        threads: int,
        people: int | None = None,
        folder: Path | None = None,
        *,
        detector: Path | None = None,
        keypoints: Path | None = None,
        execution: Execution | None = None,
    ) -> None:
        self._detector: PersonDetector | BoxDetector = (
            BoxDetector(detector, threads, execution) if detector else PersonDetector(threads, folder, execution)
        )
        name, strongest = landmark_network_name(quality), landmark_network_name("best")
        self._landmarks: LandmarkNetwork | KeypointNetwork
        self._judge: LandmarkNetwork | None = None
        if keypoints:
            self._landmarks = KeypointNetwork(keypoints, threads, execution)
            with suppress(SetupError):  # without ours, whichever reading is the steadiest
                self._judge = LandmarkNetwork(strongest, 1, folder, execution)
        else:
            self._landmarks = LandmarkNetwork(name, threads, folder, execution)
            if name != strongest:
                self._judge = LandmarkNetwork(strongest, 1, folder, execution)
        self._judging: list[PendingReference] = []
        self._judges = ThreadPoolExecutor(1, "scope-judge")
        self._begins_early = not keypoints
        self._looks_ahead = self._begins_early and self._judge is None
        self._stand_in = None if keypoints else self._judge  # the user's networks are the user's choice
        self._largest_only = people is None
        self._wanted = people or 1
        self._most = 2 if people is None else min(people + 1, MOST_PEOPLE)
        self.reset()

    def reset(self) -> None:
        """Begin anew: the next frame starts with a detection, and numbers with 0."""
        self._tracklets = 0
        self._time_s, self._step_s = -math.inf, FRAME_S
        self._begun_s = 0.0
        self.forget()

    def forget(self) -> None:
        """Forget everybody, for the next frame shows another scene. Numbers go on."""
        self._live: list[Followed] = []
        self._lost: list[Followed] = []
        self._searched_s = self._closely_s = -math.inf

    def step(
        self, image_rgb: np.ndarray, upcoming_rgb: np.ndarray | None = None, time_s: float | None = None
    ) -> list[tuple[int, Observation]]:
        """Everybody in the next frame, (H, W, 3) uint8 RGB, each with the number of the tracklet.

        The detector runs when somebody was lost and, for those who come in, now and then. With ``upcoming_rgb``, the
        frame after it, the look at that one begins before this call ends. The strong network looks at both at once, in
        the second one where motion foretells people: what is found there counts only if this frame then says to look
        at the same place. ``time_s``: when the frame is shown; without it, a thirtieth of a second after the one
        before.
        """
        if image_rgb.ndim != 3 or image_rgb.shape[2] != 3 or image_rgb.dtype != np.uint8:
            raise ShapeError(f"A frame must be (H, W, 3) uint8 RGB, but got {image_rgb.shape} {image_rgb.dtype}.")
        self._go_to(time_s)
        self._follow(image_rgb, upcoming_rgb)
        self._begin_upcoming(upcoming_rgb)
        self._look_round(image_rgb)
        if self._search_is_due(image_rgb):
            self._search(image_rgb)
        judged = self._ask_judge(image_rgb)
        return [(f.tracklet, self._observe(image_rgb, f, judged.get(f.tracklet))) for f in self._live]

    def _go_to(self, time_s: float | None) -> None:
        """The clock, to the frame at hand."""
        before, is_first = self._time_s, self._time_s == -math.inf
        if time_s is None:
            time_s = 0.0 if is_first else before + FRAME_S
        if is_first:
            self._begun_s = time_s
        elif time_s > before:
            self._step_s = time_s - before
        self._time_s = time_s

    def _has_passed(self, interval_s: float, elapsed_s: float) -> bool:
        """Whether this frame is the one nearest to the end of an interval, or a later one."""
        return elapsed_s + self._step_s / 2 >= interval_s

    def _is_missed(self, lost: Followed, for_s: float) -> bool:
        """Whether somebody was lost so short a time ago; the frame nearest to the end counts."""
        return self._time_s - lost.seen_s - self._step_s / 2 <= for_s

    def _follow(self, image_rgb: np.ndarray, upcoming_rgb: np.ndarray | None) -> None:
        """Move everybody who was seen in the frame before on to this one; the others are lost."""
        for lost in self._lost:
            lost.lost += 1
        self._lost = [lost for lost in self._lost if self._is_missed(lost, MEMORY_S)]
        found = self._look_ahead(image_rgb, upcoming_rgb)
        settled = [self._settled(image_rgb, f, e) for f, e in zip(self._live, found, strict=True)]
        seen = []
        for f, (e, swap) in zip(self._live, settled, strict=True):
            f.is_hidden = e is not None and f.goes_behind(e)
            if e is not None and not f.is_hidden:
                seen.append((f, e, swap, f.surprise(e)))
        # Two on one body: somebody went behind somebody else. It belongs to whom it does not surprise; but of a body
        # that has long been followed and one that was found just now, as little surprised, the latter was a mistake.
        seen.sort(key=lambda entry: (entry[3] > LEAP, entry[3] + self._newness(entry[0])))
        kept: list[Followed] = []
        accepted: list[PoseEstimate] = []
        for followed, estimate, swapped, surprise in seen:
            if any(same_body(estimate, other) for other in accepted):
                continue
            accepted.append(estimate)
            if surprise > LEAP:
                kept.append(self._start(estimate))
                self._lose(followed)
            else:
                followed.go_on(estimate, swapped, self._time_s, self._step_s)
                kept.append(followed)
        for followed in self._live:
            if followed not in kept and followed not in self._lost:
                self._lose(followed)
        self._live = sorted(kept, key=lambda f: f.tracklet)

    def _newness(self, followed: Followed) -> float:
        """Falls from NEW_SURPRISE to 0 while somebody becomes established."""
        return NEW_SURPRISE * (1 - min(followed.followed_s / ESTABLISHED_S, 1.0))

    def _look_ahead(self, image_rgb: np.ndarray, upcoming_rgb: np.ndarray | None) -> list[PoseEstimate | None]:
        """Everybody who is followed in this frame, while the looks at the upcoming one begin."""
        foreseen = [f.foreseen for f in self._live]
        for f in self._live:
            f.foreseen = None
            if upcoming_rgb is None or not self._looks_ahead or f.age < SETTLED_FRAMES:
                continue
            if _is_in_image(f.expected, upcoming_rgb):
                f.foreseen = cast(LandmarkNetwork, self._landmarks).begin(upcoming_rgb, f.expected)
        found: dict[int, PoseEstimate | None] = {}
        for f, look in zip(self._live, foreseen, strict=True):
            estimate = look.result() if look is not None else None
            if estimate is not None and _same_place(estimate.region, f.estimate.next_region):
                found[f.tracklet] = estimate if believable(estimate) else None
        missing = [f for f in self._live if f.tracklet not in found]
        looked = self._look(image_rgb, [f.estimate.next_region for f in missing])
        found |= {f.tracklet: estimate for f, estimate in zip(missing, looked, strict=True)}
        return [found[f.tracklet] for f in self._live]

    def _begin_upcoming(self, upcoming_rgb: np.ndarray | None) -> None:
        """Begin to look at everybody in the next frame, where they will be looked for, beside the rest of this one."""
        if upcoming_rgb is None or not self._begins_early:
            return
        for f in self._live:
            if f.foreseen is None and _is_in_image(f.estimate.next_region, upcoming_rgb):
                f.foreseen = cast(LandmarkNetwork, self._landmarks).begin(upcoming_rgb, f.estimate.next_region)

    def _settled(
        self, image_rgb: np.ndarray, followed: Followed, estimate: PoseEstimate | None
    ) -> tuple[PoseEstimate | None, bool]:
        """The estimate, or the strong network's for a while once a smaller one loses the person or left and right.

        And whether left and right changed places in it.
        """
        swapped = estimate is not None and looks_swapped(followed.estimate, estimate)
        if self._stand_in is None:
            return estimate, swapped
        if estimate is None or swapped or followed.goes_behind(estimate):
            followed.doubt_s = self._time_s
        if self._has_passed(DOUBT_S, self._time_s - followed.doubt_s):
            return estimate, swapped
        region = followed.estimate.next_region
        if not _is_in_image(region, image_rgb):
            return estimate, swapped
        (stronger,) = self._stand_in.estimate(image_rgb, [region])
        if not believable(stronger):
            return estimate, swapped
        return stronger, looks_swapped(followed.estimate, stronger)

    def _look_round(self, image_rgb: np.ndarray) -> None:
        """Whoever was lost a moment ago is where motion foretold, but turned: a somersault, a fall, a handstand.

        A body that curls up or hangs upside down looks less like one, so what is found must lie where it was foretold.
        Whoever has gone behind somebody or something is not looked for: what shows there is somebody or something else.
        Nor is who walked out of the picture.
        """
        for lost in [f for f in self._lost if self._is_missed(f, EAGER_S) and f.age > 5]:
            if len(self._live) >= self._most:
                return
            if lost.is_hidden or _share_in_picture(lost.estimate, image_rgb) < LEAVING_SHARE:
                continue
            if any(f.estimate.next_region.is_near(lost.foretold) for f in self._live):
                continue
            turned = [
                replace(lost.foretold, rotation=lost.foretold.rotation + turn, side_px=lost.foretold.side_px * size)
                for size in _TURNED_SIZES
                for turn in _TURNS
            ]
            regions = [region for region in turned if _is_in_image(region, image_rgb)]
            found = [e for e in self._landmarks.estimate(image_rgb, regions) if e.presence >= _TURNED_PRESENCE]
            found = [e for e in found if e.spread >= CURLED_SPREAD and e.disagreement <= DISAGREEMENT_THRESHOLD]
            found = [e for e in found if _shows(e, image_rgb) and not any(same_body(e, f.estimate) for f in self._live)]
            nearest = min(found, key=lost.surprise, default=None)
            if nearest is not None and lost.surprise(nearest) <= _TURNED_LEAP:
                lost.go_on(nearest, looks_swapped(lost.estimate, nearest), self._time_s, self._step_s)
                lost.lost = 0
                self._lost.remove(lost)
                self._live.append(lost)

    def _search_is_due(self, image_rgb: np.ndarray) -> bool:
        return self._has_passed(self._search_every_s(image_rgb), self._time_s - self._searched_s)

    def _search_every_s(self, image_rgb: np.ndarray) -> float:
        """Seconds between two looks for others, just now; 0: in every frame."""
        if not self._live or any(self._is_missed(f, EAGER_S) for f in self._lost):
            return 0.0
        if self._lost or self._looks_for_rivals(image_rgb):
            return SEARCH_MISSED_S
        if self._largest_only:
            return SEARCH_LARGEST_S
        # As many as are wanted are followed: whoever comes in now counts only if they become more prominent.
        complete = len(self._live) >= self._wanted and self._time_s >= self._begun_s + OPENING_S
        return SEARCH_LARGEST_S if complete else SEARCH_S

    def _looks_for_rivals(self, image_rgb: np.ndarray) -> bool:
        """Whether somebody half as large as the most prominent person would be too small for a plain look just now."""
        if not self._largest_only or self._time_s >= self._begun_s + OPENING_S:
            return False
        sides = [f.estimate.next_region.side_px for f in self._live]
        return bool(sides) and max(sides) < SMALL_SHARE * max(image_rgb.shape[:2])

    def _search(self, image_rgb: np.ndarray) -> None:
        """Start a tracklet for every believable body that the detector finds and that is not followed yet.

        Each is looked at twice: the landmarks know better than the detector where the body lies.
        """
        self._searched_s = self._time_s
        detections = [d for d in self._ranked(self._detect(image_rgb)) if self._may_be_new(d.region)]
        detections = detections[: 3 if self._largest_only else 2 * self._most]
        if not detections:
            return
        first = self._landmarks.estimate(image_rgb, [d.region for d in detections])
        likely = [k for k, e in enumerate(first) if e.presence >= PRESENCE_THRESHOLD]
        for sure in (True, False):
            chosen = [k for k in likely if (detections[k].score >= SURE_SCORE) == sure]
            for estimate in self._look(image_rgb, [first[k].next_region for k in chosen], sure):
                if estimate is not None:
                    self._add(estimate, sure)

    def _detect(self, image_rgb: np.ndarray) -> list[Detection]:
        """Closely, if somebody small may be there; where frames are few, a little less often, for what each costs."""
        closely = not self._largest_only or self._looks_for_rivals(image_rgb)
        if closely:
            every_s = self._search_every_s(image_rgb) * max(1.0, math.sqrt(self._step_s / FRAME_S))
            closely = self._has_passed(every_s, self._time_s - self._closely_s)
        if closely:
            self._closely_s = self._time_s
        return self._detector.detect(image_rgb, closely=closely)

    def _ranked(self, detections: list[Detection]) -> list[Detection]:
        """Whoever may have been lost a moment ago first, then by score times size."""

        def rank(detection: Detection) -> tuple[bool, float]:
            region = detection.region
            return any(region.resembles(f.foretold, 0.5) for f in self._lost), detection.score * region.side_px

        return sorted(detections, key=rank, reverse=True)

    def _may_be_new(self, region: Region) -> bool:
        """Not somebody who is followed already, and of a size that matters."""
        if any(region.resembles(f.estimate.next_region, 0.12) for f in self._live):
            return False
        largest = max((f.estimate.region.side_px for f in self._live), default=0.0)
        return not self._largest_only or region.side_px >= RIVAL_SIDE * largest

    def _add(self, estimate: PoseEstimate, sure: bool) -> None:
        """Start a tracklet, unless the body is followed already or there are enough of at least its size."""
        if any(same_body(estimate, f.estimate) for f in self._live):
            return
        if any(f.is_hidden_by(estimate) for f in self._lost):
            return
        # The legs of somebody who is followed, or they and what is behind them, can look like somebody of their own.
        others = [f.estimate for f in self._live]
        if not sure and any(max(_share_within(estimate, e), _share_within(e, estimate)) > MOST_WITHIN for e in others):
            return
        if len(self._live) >= self._most:
            weakest = min(self._live, key=lambda f: f.estimate.region.side_px)
            if estimate.region.side_px < 1.5 * weakest.estimate.region.side_px:
                return
            self._live.remove(weakest)
        if self._largest_only and self._live and estimate.region.side_px < RIVAL_SIDE * self._largest_side():
            return
        self._lost = [f for f in self._lost if not estimate.region.resembles(f.foretold, 0.35)]
        self._live.append(self._start(estimate))

    def _largest_side(self) -> float:
        return max(f.estimate.region.side_px for f in self._live)

    def _start(self, estimate: PoseEstimate) -> Followed:
        self._tracklets += 1
        return Followed(self._tracklets - 1, estimate, np.zeros(2), self._time_s)

    def _lose(self, followed: Followed) -> None:
        followed.lost, followed.foreseen = 1, None
        self._lost.append(followed)

    def _ask_judge(self, image_rgb: np.ndarray) -> dict[int, PendingReference]:
        """World landmarks of the strong network, by tracklet, for those whose left and right are due or in doubt.

        Nothing here waits for them, so it looks in a thread of its own, beside the next frames.
        """
        if self._judge is None:
            return {}
        looks = {}
        for followed in self._live:
            every_s = JUDGE_AGAIN_S if followed.swapped else JUDGE_S
            if not self._has_passed(every_s, followed.followed_s - followed.judged_s):
                continue
            followed.judged_s, followed.swapped = followed.followed_s, False
            self._judging = [look for look in self._judging if not look.done()]
            if len(self._judging) >= MOST_JUDGED:
                self._judging[0].result()
            look = self._judges.submit(self._judgement, image_rgb, followed.estimate.region)
            self._judging.append(look)
            looks[followed.tracklet] = look
        return looks

    def _judgement(self, image_rgb: np.ndarray, region: Region) -> np.ndarray | None:
        assert self._judge is not None
        (estimate,) = self._judge.estimate(image_rgb, [region])
        return estimate.world_landmarks if believable(estimate) else None

    def _observe(self, image_rgb: np.ndarray, followed: Followed, judged: PendingReference | None) -> Observation:
        e = followed.estimate
        look = self._has_passed(APPEARANCE_S, followed.followed_s - followed.clothes_s)
        if look:
            followed.clothes_s = followed.followed_s
        return Observation(
            e.keypoints_px,
            e.keypoints_confidence,
            e.world_landmarks,
            e.presence,
            e.region,
            acquired=followed.age == 0,
            appearance=appearance(image_rgb, e.keypoints_px) if look else None,
            reference_landmarks=judged,
        )

    def _look(self, image_rgb: np.ndarray, regions: list[Region], sure: bool = True) -> list[PoseEstimate | None]:
        """The landmarks in each region, or None where they are not a body in this image; one batch."""
        useful = [k for k, region in enumerate(regions) if _is_in_image(region, image_rgb)]
        estimates = self._landmarks.estimate(image_rgb, [regions[k] for k in useful])
        out: list[PoseEstimate | None] = [None] * len(regions)
        for k, estimate in zip(useful, estimates, strict=True):
            out[k] = estimate if believable(estimate, sure) else None
        return out


def believable(estimate: PoseEstimate, sure: bool = True) -> bool:
    """Whether landmarks are those of a body; ``sure``: there is good reason to expect one here."""
    return (
        estimate.presence >= PRESENCE_THRESHOLD
        and (estimate.keypoints_confidence >= CONFIDENT).sum() >= LEAST_CONFIDENT
        and estimate.spread >= (SPREAD_THRESHOLD if sure else UNSURE_SPREAD_THRESHOLD)
        and estimate.disagreement <= (DISAGREEMENT_THRESHOLD if sure else UNSURE_DISAGREEMENT_THRESHOLD)
    )


def same_body(a: PoseEstimate, b: PoseEstimate) -> bool:
    """Whether two estimates describe one body in the image."""
    return apart(a.keypoints_px, b.keypoints_px) < SAME_BODY * min(a.region.side_px, b.region.side_px)


def _share_within(a: PoseEstimate, b: PoseEstimate) -> float:
    """Share of a's keypoints that lie in the box round b's."""
    return float(inside(a.keypoints_px, [bounds(b.keypoints_px)]).mean())


def _shows(estimate: PoseEstimate, image_rgb: np.ndarray) -> bool:
    """Whether the middle of the body lies in the image; landmarks can also be imagined beside it."""
    height, width = image_rgb.shape[:2]
    x, y = estimate.keypoints_px.mean(axis=0)
    return bool(0 <= x < width and 0 <= y < height)


def _share_in_picture(estimate: PoseEstimate, image_rgb: np.ndarray) -> float:
    """Share of the keypoints that lie in the image."""
    height, width = image_rgb.shape[:2]
    return float(((estimate.keypoints_px >= 0) & (estimate.keypoints_px < [width, height])).all(axis=1).mean())


def _same_place(a: Region, b: Region) -> bool:
    """Whether it makes no difference which of two regions a landmark network looks at."""
    turn = math.remainder(a.rotation - b.rotation, 2 * math.pi)
    return (
        math.dist(a.center_px, b.center_px) <= FORETOLD_CENTER * b.side_px
        and abs(a.side_px - b.side_px) <= FORETOLD_SIDE * b.side_px
        and abs(turn) <= FORETOLD_TURN
    )


def _is_in_image(region: Region, image_rgb: np.ndarray) -> bool:
    height, width = image_rgb.shape[:2]
    x, y = region.center_px
    reach = region.side_px / 2
    outside = x + reach < 0 or y + reach < 0 or x - reach > width or y - reach > height
    return not outside and SMALLEST_SIDE_PX <= region.side_px <= LARGEST_SIDE * max(height, width)
