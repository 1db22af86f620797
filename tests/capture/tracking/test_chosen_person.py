# SPDX-License-Identifier: GPL-3.0-or-later
"""Who is captured: the one who moves rather than a spectator, or whom the user chose by a place."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.background_record import BackgroundRecord
from scope.scope_addon.capture.frame_observer import Observed
from scope.scope_addon.capture.observe import _warnings_about_people
from scope.scope_addon.capture.options import CaptureOptions, parse_person
from scope.scope_addon.capture.tracking.chosen_person import (
    ChosenPerson,
    find_chosen,
    needed_turn,
    place_of,
)
from scope.scope_addon.capture.tracking.people import people_of
from scope.scope_addon.capture.tracking.track import Track, Tracklet, make_track
from scope.scope_addon.capture.tracking.tracker import MAX_PEOPLE
from scope.scope_addon.errors import UsageError

TIMES = (np.arange(90) / 30).tolist()
LIMBS = [15, 16, 27, 28]


def person(x: float, side: float = 200.0, swing: float = 0.0, rows: range = range(90)) -> Tracklet:
    """Somebody at x, 300 whose hands and feet swing by a share of the region's side."""
    rng = np.random.default_rng(int(x))
    body = rng.uniform(-0.3, 0.3, (33, 2)) * side
    values = []
    for row in rows:
        points = body + [x, 300.0] + rng.normal(scale=0.003 * side, size=(33, 2))
        points[LIMBS, 0] += swing * side * np.sin(2 * np.pi * row / 30)
        values.append(np.column_stack([points, np.ones((33, 4))]).astype(np.float32))
    centers = [np.array([x, 300.0])] * len(rows)
    return Tracklet(list(rows), values, centers, [side] * len(rows))


def first_x(people: list[list[Tracklet]]) -> float:
    return float(people[0][0].centers_px[0][0])


def test_who_moves_is_preferred_to_a_larger_spectator() -> None:
    spectator = person(900.0, side=240.0)
    dancer = person(200.0, side=200.0, swing=0.15)
    assert first_x(people_of(TIMES, [spectator, dancer])[0]) == 200.0


def test_a_place_chooses_whoever_is_there_then() -> None:
    people = [[person(200.0)], [person(600.0, rows=range(30, 90))], [person(900.0)]]
    assert find_chosen(ChosenPerson(890.0, 310.0, 1.0), people, [], TIMES) is people[2]
    assert find_chosen(ChosenPerson(600.0, 300.0, 1.0), people, [], TIMES) is people[1]
    assert find_chosen(ChosenPerson(210.0, 290.0, None), people, [], TIMES) is people[0]
    for each in people:
        assert find_chosen(place_of(each, TIMES), people, [], TIMES) is each


def test_who_may_be_a_mistake_is_chosen_where_nobody_else_is() -> None:
    people = [[person(200.0)]]
    doubtful = [[person(210.0)], [person(600.0)]]
    assert find_chosen(ChosenPerson(212.0, 300.0, 1.0), people, doubtful, TIMES) is people[0]
    assert find_chosen(ChosenPerson(600.0, 300.0, 1.0), people, doubtful, TIMES) is doubtful[1]


def observed_of(tracklets: list[Tracklet], times_s: list[float]) -> Observed:
    T = len(times_s)
    turns = np.tile(np.eye(3), (T, 1, 1))
    background = BackgroundRecord(np.array(times_s), turns, np.ones(T, bool), [])
    return Observed(list(range(T)), times_s, [], dict(enumerate(tracklets)), background)


def test_a_place_finds_somebody_though_all_may_be_mistakes() -> None:
    """Whoever is seen for a second of a minute."""
    times_s = (np.arange(1800) / 30).tolist()
    observed = observed_of([person(600.0, rows=range(30))], times_s)
    assert observed.tracks(1) == ([], [])
    (track,), _ = observed.tracks(1, ChosenPerson(600.0, 300.0, 0.5))
    assert track.seen.sum() == 30
    with pytest.raises(UsageError, match="people are then at 600,300"):
        observed.tracks(1, ChosenPerson(200.0, 300.0, 0.5))


def test_who_has_chosen_a_person_is_told_of_others_but_not_to_choose_one(tmp_path: Path) -> None:
    observed = observed_of([person(200.0), person(600.0), person(900.0)], TIMES)
    video = SimpleNamespace(path=tmp_path / "walk.mp4", wanted=CaptureOptions().wanted)
    chosen = ChosenPerson(600.0, 300.0, 1.0)
    said = {}
    for options in (CaptureOptions(people=2), CaptureOptions(people=2, chosen=chosen)):
        tracks, others = observed.tracks(2, options.chosen)
        assert len(others) == 1
        warning, *_ = _warnings_about_people(video, options, tracks, others)  # type: ignore[arg-type]
        said[options.chosen] = warning.code
    assert tracks[0].keypoints_px[0, :, 0].mean() == pytest.approx(600.0, abs=30.0)
    assert said == {None: "left_out", chosen: "left_out_of_views"}


@pytest.mark.parametrize(
    ("rows", "side", "most", "codes"),
    [
        (range(900, 935), 200.0, MAX_PEOPLE, ["seen_briefly"]),
        (range(900, 935), 200.0, 1, []),  # nobody else was asked for
        (range(900, 910), 200.0, MAX_PEOPLE, []),  # perhaps a mistake
        (range(900, 935), 8.0, MAX_PEOPLE, []),  # on a poster
    ],
)
def test_who_is_seen_for_a_second_of_a_minute_is_said_to_be_left_out(
    tmp_path: Path, rows: range, side: float, most: int, codes: list[str]
) -> None:
    times_s = (np.arange(1800) / 30).tolist()
    main = person(200.0, rows=range(1800))
    observed = observed_of([main, person(600.0, side=side, rows=rows)], times_s)
    video = SimpleNamespace(path=tmp_path / "walk.mp4", wanted=CaptureOptions().wanted)
    tracks, others = observed.tracks(most)
    said = _warnings_about_people(video, CaptureOptions(people=most), tracks, others)  # type: ignore[arg-type]
    said = [each for each in said if each.code != "turned_footage"]  # these bodies are random
    assert len(tracks) == 1
    assert [each.code for each in said] == codes
    assert [each.values["place"] for each in said] == ["600,300@30.57"] * len(codes)


def test_a_place_without_a_person_is_refused_and_says_where_people_are() -> None:
    people = [[person(200.0)], [person(600.0, rows=range(60, 90))]]
    with pytest.raises(
        UsageError, match=r"nobody was found there at 0\.50 s; people are .*200,300"
    ):
        find_chosen(ChosenPerson(600.0, 300.0, 0.5), people, [], TIMES)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (" 640 , 36.5@2.5", ChosenPerson(640, 36.5, 2.5)),
        ("1,2@01:02.5", ChosenPerson(1, 2, 62.5)),
    ],
)
def test_places_are_read(text: str, place: ChosenPerson) -> None:
    assert parse_person(text) == place


@pytest.mark.parametrize("text", ["1,2,3", "1,2@x", "-1,2", "1,2@00:00:01:10"])
def test_other_texts_are_no_places(text: str) -> None:
    with pytest.raises(UsageError):
        parse_person(text)


def seen_turned(angles_deg: np.ndarray) -> Track:
    """A track whose trunk points upwards, turned clockwise by these angles."""
    tracklet = person(400.0, rows=range(len(angles_deg)))
    for values, angle in zip(tracklet.values, np.radians(angles_deg), strict=True):
        values[[23, 24], :2] = 400.0
        values[[11, 12], :2] = 400.0 + 100.0 * np.array([np.sin(angle), -np.cos(angle)])
    return make_track(list(range(len(angles_deg))), TIMES, [tracklet])


@pytest.mark.parametrize(("angle", "turn"), [(0, 0), (100, 270), (-80, 90), (-170, 180), (50, 0)])
def test_somebody_who_lies_all_the_time_needs_a_turn_of_the_picture(angle: int, turn: int) -> None:
    noise = np.random.default_rng(0).normal(scale=5.0, size=60)
    assert needed_turn(seen_turned(angle + noise)) == turn
