# SPDX-License-Identifier: GPL-3.0-or-later
"""Identities: synthetic people who meet, hide, leave and return, and two real clips that cross each
other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.tracking import landmark_estimator
from scope.scope_addon.capture.tracking.people import (
    frames_before_flicker,
    frames_before_merger,
    people_of,
)
from scope.scope_addon.capture.tracking.track import Track, Tracklet, make_track
from scope.scope_addon.capture.tracking.tracker import PeopleTracker

from ..composites import composite
from ..fake_people import FakeDetector, FakeLandmarks, Person, pictures
from ..followed_people import FollowedPeople
from .made_tracklets import seen_at

RED = (200, 40, 40)
BLUE = (40, 60, 200)
FPS = 30


LetSee = Callable[..., dict[str, FakeLandmarks]]


@pytest.fixture
def let_see(monkeypatch: pytest.MonkeyPatch) -> LetSee:
    """``let_see(people, detected=people)``: the networks see these synthetic people; returns those
    of landmarks by quality.
    """

    def replace_networks(
        people: list[Person], detected: list[Person] | None = None
    ) -> dict[str, FakeLandmarks]:
        networks = {"fast": FakeLandmarks(people), "best": FakeLandmarks(people, is_reliable=True)}
        monkeypatch.setattr(
            landmark_estimator,
            "LandmarkNetwork",
            lambda name, *_: networks["best" if "heavy" in name else "fast"],
        )
        monkeypatch.setattr(
            landmark_estimator, "PersonDetector", lambda *_: FakeDetector(detected or people)
        )
        return networks

    return replace_networks


@pytest.fixture
def follow(let_see: LetSee) -> Callable[..., list[Track]]:
    """``follow(people, count, wanted=None, fps=30)``: the tracks of the synthetic people."""

    def run(
        people: list[Person], count: int, wanted: int | None = None, fps: float = FPS
    ) -> list[Track]:
        let_see(people)
        tracker = PeopleTracker("fast", 1, wanted)
        followed = FollowedPeople()
        for t, image in enumerate(pictures(people, count)):
            followed.add(t / fps, tracker.step(image, time_s=t / fps))
        return followed.tracks(wanted or 1)

    return run


def identities(track: Track, people: list[Person]) -> set[int]:
    """Return the indices of the people whom the track follows: in each frame, the person with the
    nearest hips.
    """
    out = set()
    for t in np.flatnonzero(track.seen):
        hips = track.keypoints_px[t, [23, 24]].mean(axis=0)
        places = [person.place(t) for person in people]
        distances = [
            np.inf if place is None else float(np.linalg.norm(place - hips)) for place in places
        ]
        assert min(distances) < 60
        out.add(int(np.argmin(distances)))
    return out


@pytest.mark.parametrize(
    ("colors", "hidden"),
    [((RED, BLUE), 0), ((RED, RED), 20)],
    ids=["different clothes", "same clothes"],
)
def test_identities_survive_a_crossing(
    follow: Callable[..., list[Track]], colors: tuple, hidden: int
) -> None:
    """The person behind is occluded for some frames, in which the network sees the other one in
    both regions.
    """
    meets = 60
    back = Person(
        lambda t: (200 + 6.0 * t, 200),
        colors[0],
        hidden=range(meets - hidden // 2, meets + hidden // 2),
    )
    front = Person(lambda t: (920 - 6.0 * t, 205), colors[1], size_px=110)
    tracks = follow([back, front], 120, wanted=2)
    assert [identities(track, [back, front]) for track in tracks] == [{1}, {0}]
    assert tracks[0].seen.mean() >= 0.98
    # not while the two bodies are indistinguishable
    assert tracks[1].seen.sum() >= 120 - hidden - 22


@pytest.mark.parametrize(("fps", "count"), [(1, 2), (2, 8)])
def test_a_person_who_is_elsewhere_in_each_frame_is_tracked_at_a_low_rate(
    follow: Callable[..., list[Track]], fps: int, count: int
) -> None:
    walks = Person(lambda t: (100 + 90.0 * t, 200), RED)
    (track,) = follow([walks], count, fps=fps)
    assert track.seen.all()


def test_a_person_who_is_lost_in_front_of_another_one_is_found_again(
    follow: Callable[..., list[Track]],
) -> None:
    """Their regions have nearly the same centre, but not the same size: that the one behind is
    tracked is no reason.
    """
    behind = Person(lambda t: (500, 205), BLUE, size_px=80)
    front = Person(lambda t: (max(660 - 3.0 * t, 534), 200), RED, size_px=120, hidden=range(60, 63))
    tracks = follow([behind, front], 120, wanted=2)
    assert [identities(track, [behind, front]) for track in tracks] == [{1}, {0}]
    assert tracks[0].seen[64:].all()


@pytest.mark.parametrize(
    ("fps", "seconds", "wanted", "within_s"),
    [(5, 2, 4, 0.27), (60, 2, 4, 0.27), (5, 5, None, 0.67)],
)
def test_a_newcomer_is_found_equally_soon_at_any_rate(
    follow: Callable[..., list[Track]],
    fps: int,
    seconds: int,
    wanted: int | None,
    within_s: float,
) -> None:
    """At most half a frame later."""
    first = Person(lambda t: (300, 200), BLUE, size_px=70)
    second = Person(lambda t: (900, 200) if t >= fps else None, RED)
    tracks = follow([first, second], seconds * fps, wanted, fps)
    (track,) = (track for track in tracks if identities(track, [first, second]) == {1})
    assert 1 <= track.times[track.seen][0] <= 1 + within_s + 0.5 / fps


def test_a_person_is_recognized_by_appearance_after_a_long_time(
    follow: Callable[..., list[Track]],
) -> None:
    red = Person(lambda t: (200, 200) if not 40 <= t < 140 else None, RED)
    blue = Person(lambda t: (700, 200) if not 30 <= t < 160 else None, BLUE)
    moved = Person(lambda t: (640, 200) if t >= 140 else (200, 200) if t < 40 else None, RED)
    tracks = follow([red, blue], 220, wanted=2)
    assert [identities(track, [red, blue]) for track in tracks] == [{0}, {1}]
    tracks = follow([moved, blue], 220, wanted=2)  # returns where the other person was
    assert [identities(track, [moved, blue]) for track in tracks] == [{0}, {1}]


def test_the_most_prominent_person_of_the_whole_clip_is_kept(
    follow: Callable[..., list[Track]],
) -> None:
    """Neither the first nor the largest one at some time; a gap is not filled with somebody
    else.
    """
    first = Person(lambda t: (200, 200) if t < 60 else None, RED)
    main = Person(lambda t: (900, 200) if t >= 20 else None, BLUE, hidden=range(100, 110))
    (track,) = follow([first, main], 200)
    assert identities(track, [first, main]) == {1}
    assert not track.seen[:20].any()
    assert not track.seen[100:110].any()
    assert track.seen[45:100].all()
    assert track.seen[112:].all()


def test_a_small_person_next_to_the_most_prominent_one_costs_nothing(let_see: LetSee) -> None:
    people = [Person(lambda t: (300, 200), BLUE), Person(lambda t: (900, 200), RED, size_px=40)]
    batches = let_see(people)["best"].batches
    tracker = PeopleTracker("best", 1)
    for image in pictures(people, 100):
        assert len(tracker.step(image)) == 1
    assert sum(batches) <= 104
    tracker = PeopleTracker("best", 1, people=2)
    assert [len(tracker.step(image)) for image in pictures(people, 3)] == [2, 2, 2]
    assert batches[-1] == 2  # both in one batch


def test_nobody_makes_room_for_a_person_who_does_not_come_in(let_see: LetSee) -> None:
    """Somebody looks large to the detector, but is too small to become the most prominent one."""
    first = Person(lambda t: (300, 200), BLUE, size_px=20)
    main = Person(lambda t: (600, 200) if t >= 5 else None, BLUE)
    refused = Person(lambda t: (900, 200) if t >= 30 else None, RED, size_px=35)
    people = [first, main, refused]
    let_see(people, [first, main, replace(refused, size_px=60)])
    tracker = PeopleTracker("fast", 1)
    places = [
        [round(float(seen.region.center_px[0])) for _, seen in tracker.step(image, time_s=t / FPS)]
        for t, image in enumerate(pictures(people, 60))
    ]
    assert places[30:] == [[300, 600]] * 30


@pytest.mark.parametrize(
    ("quality", "jump", "most"), [("best", 0, 8), ("best", 90, 16), ("fast", 90, 8)]
)
def test_pending_estimates_do_not_change_the_result(
    let_see: LetSee, quality: str, jump: int, most: int
) -> None:
    """A prefetched estimate is used where the prediction was right, and repeated where it was not.

    The small networks start early only in regions that are certain: no region is estimated twice.
    """
    people = [Person(lambda t: (200 + 3.0 * t + (jump if t >= 20 else 0), 200), BLUE)]
    network = let_see(people)[quality]
    images = list(pictures(people, 60))
    plain = PeopleTracker(quality, 1)
    early = PeopleTracker(quality, 1)
    expected = [plain.step(image) for image in images]
    network.batches.clear()
    found = [
        early.step(image, upcoming)
        for image, upcoming in zip(images, [*images[1:], None], strict=True)
    ]
    for one, other in zip(expected, found, strict=True):
        np.testing.assert_allclose(one[0][1].keypoints_px, other[0][1].keypoints_px)
        assert [number for number, _ in one] == [number for number, _ in other]
    assert network.begun >= 50
    assert sum(network.batches) <= most


def test_the_fallback_network_prevents_left_right_swaps(follow: Callable[..., list[Track]]) -> None:
    person = Person(lambda t: (300 + t, 200), BLUE, swapped=[*range(40, 70), 80])
    (track,) = follow([person], 120)
    assert (track.keypoints_px[:, 11, 0] > track.keypoints_px[:, 12, 0]).all()


def test_the_reference_network_repairs_swaps_of_most_of_a_clip(
    follow: Callable[..., list[Track]],
) -> None:
    from scope.scope_addon.capture.camera.intrinsics import choose_camera
    from scope.scope_addon.capture.tracking.left_right import repair_left_right

    person = Person(lambda t: (300 + t, 200), BLUE, swapped=range(110))
    (track,) = follow([person], 120)
    left, right = (track.keypoints_px[:, k, 0] for k in (11, 12))
    assert (left < right).sum() == 110
    repaired = repair_left_right(track, choose_camera(1200, 400))
    assert (repaired.keypoints_px[:, 11, 0] > repaired.keypoints_px[:, 12, 0]).all()
    assert len(track.reference_rows) <= 120 // 30 + 3


@pytest.mark.parametrize(
    ("rows", "kept"),
    [
        ([*range(20), 30, 31, 40], 20),
        ([*range(20), *range(30, 34)], 24),  # a tenth of a second
        ([0, 1], 2),
        ([], 0),
    ],
)
def test_a_short_reappearance_is_cut_off(rows: list[int], kept: int) -> None:
    tracklet = Tracklet(rows=list(rows), values=[np.zeros((33, 6), np.float32)] * len(rows))
    assert frames_before_flicker(tracklet, (np.arange(60) / FPS).tolist()) == kept


@pytest.mark.parametrize(
    ("drifting", "goes_on", "kept"),
    [
        (6, 30, 24),
        (11, 30, 19),  # as long as a merger lasts
        (20, 30, 30 - 12),  # whatever was seen before was no drift
        (0, 30, 30),
        (6, 0, 30),  # the other one is not seen after the end, so it is not in front
    ],
)
def test_frames_in_which_a_target_drifts_onto_another_one_are_cut_off(
    drifting: int, goes_on: int, kept: int
) -> None:
    """The place from which the target is followed later is the last one of the person who went
    behind another.
    """
    passes = [500.0 - 4.0 * t for t in range(30 + goes_on)]
    walks = [200.0 + 2.0 * t for t in range(30 - drifting)] + passes[30 - drifting : 30]
    times = (np.arange(60) / FPS).tolist()
    tracklets = [seen_at(walks), seen_at(passes)]
    assert frames_before_merger(tracklets[0], tracklets, times) == kept
    people, _ = people_of(times, [seen_at(walks), seen_at(passes)])
    *_, person = people[:2]
    track = make_track(list(range(60)), times, person)
    assert track.seen.sum() == kept


@pytest.mark.parametrize(
    ("clip_s", "rows", "side", "is_person"),
    [
        (600, [range(1000, 1020)], 100.0, True),
        (60, [range(100, 110)], 100.0, False),
        (600, [range(1000, 1010), range(1013, 1023)], 100.0, True),  # hidden for a moment
        (20, [range(40, 56)], 10.0, False),  # on a poster
        (600, [range(3000)], 10.0, False),
    ],
)
def test_who_is_seen_for_three_seconds_beside_the_main_person_is_kept(
    clip_s: int, rows: list[range], side: float, is_person: bool
) -> None:
    """However long the clip is, but not who is tiny beside the main person's side of 200."""
    rate = 5
    times = (np.arange(clip_s * rate) / rate).tolist()
    main = seen_at([300.0] * len(times))
    passes = [seen_at([700.0] * len(part), part[0], side) for part in rows]
    people, doubtful = people_of(times, [main, *passes])
    assert people == ([[main], passes] if is_person else [[main]])
    assert doubtful == ([] if is_person else [passes])


@pytest.mark.parametrize(("glimpse", "counts"), [(1, False), (2, False), (3, True)])
def test_a_glimpse_is_not_where_somebody_was_who_is_found_later(glimpse: int, counts: bool) -> None:
    """At 30 frames per second, three of them may be somebody; fewer only where others continue
    them, or are all that there is.
    """
    times = (np.arange(60) / FPS).tolist()
    tracklets = [seen_at([450.0] * glimpse, 2), seen_at([300.0] * 36, 24)]
    (person, *_), _ = people_of(times, tracklets)
    assert (person[0].centers_px[0][0] == 450.0) == counts
    continued = [seen_at([300.0] * glimpse, 24 - glimpse), seen_at([310.0] * 36, 24)]
    (person, *_), _ = people_of(times, continued)
    assert sum(len(tracklet.rows) for tracklet in person) == 36 + glimpse
    (person,), _ = people_of(times[:glimpse], [seen_at([300.0] * glimpse)])
    assert len(person[0].rows) == glimpse


@pytest.mark.slow
@pytest.mark.usefixtures("networks")
def test_identities_of_real_people_are_not_switched_where_they_cross(shared: Path) -> None:
    """The same man twice, so that appearance does not help; occluded for a third of a second where
    the clips cross.
    """
    tracker = PeopleTracker("fast", threads=2, people=2)
    followed = FollowedPeople()
    places = []
    hidden = []
    for t, (image, at, is_hidden) in enumerate(composite(shared, ("cam2", "cam3"), crossing=True)):
        followed.add(t / 15, tracker.step(image, time_s=t / 15))
        places.append(at)
        hidden.append(is_hidden)
    truth = np.array(places)
    visible = ~np.array(hidden)
    assert visible.sum() >= 18
    assert not visible.all()
    tracks = followed.tracks(2)
    assert len(tracks) == 2
    found = []
    for track in tracks:
        trunk = track.keypoints_px[:, [11, 12, 23, 24]].mean(axis=1)
        distance = np.linalg.norm(trunk[:, None] - truth, axis=-1)
        rows = track.seen & visible & np.isfinite(truth).all(axis=(1, 2))
        people = np.unique(distance[rows].argmin(axis=1))
        assert len(people) == 1, "switched"
        assert np.percentile(distance[rows].min(axis=1), 90) < 40
        found.append(int(people[0]))
    assert sorted(found) == [0, 1]
    for track, person in zip(tracks, found, strict=True):
        assert track.seen[visible].mean() >= (0.98 if person == 1 else 0.9)
