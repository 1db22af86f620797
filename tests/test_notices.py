# SPDX-License-Identifier: GPL-3.0-or-later
"""Sentences of notices, the times in them, and their records."""

from __future__ import annotations

import ast
import json
import string
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import scope
from scope.scope_addon.capture_report import Report
from scope.scope_addon.notices import (
    OTHER,
    PHRASES,
    SENTENCES,
    Notice,
    TimeText,
    notice,
)

ROOT = Path(scope.__file__).resolve().parent / "scope_addon"
CUTS = notice("cuts", footage="walk.mp4", times=[2.04, 4.1])
# A record that another process wrote, and which makes no sentence of ours.
DAMAGED: list[Any] = [
    None,
    3,
    {},
    {"code": "cuts"},
    {"code": "unheard_of", "values": {}},
    {"code": ["cuts"], "values": {}},
    {"code": "cuts", "values": {"footage": "walk.mp4"}},
    {"code": "cuts", "values": {"footage": "walk.mp4", "times": "soon"}},
    {"code": "cuts", "values": {"footage": "walk.mp4", "times": ["soon"]}},
    {"code": "footage_drifts", "values": {"frames": 10**400}},
    {"code": "scene_unit", "values": {"unit_m": [], "scale": {}}},
    {"code": "review", "values": {"person": 0, "reason": "unheard of"}},
]


def fields(sentence: str) -> dict[str, str]:
    """The names in a sentence's braces, with what stands after the colon."""
    parsed = string.Formatter().parse(sentence)
    return {name: spec or "" for _, name, spec, _ in parsed if name is not None}


@pytest.mark.parametrize(
    ("times_s", "text"),
    [
        ([2.04], "at 2.0 s"),
        ([2.0, 4.12], "at 2.0 s and at 4.1 s"),
        ([1.0, 2.0, 3.0, 4.0], "at 1.0 s, at 2.0 s, at 3.0 s and at 4.0 s"),
        ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "at 1.0 s, at 2.0 s, at 3.0 s, at 4.0 s and 2 more times"),
    ],
)
def test_times_are_listed_up_to_the_fourth(times_s: list[float], text: str) -> None:
    said = str(notice("cuts", footage="walk.mp4", times=times_s))
    assert said.startswith(f"walk.mp4 cuts to another scene {text}: capture each scene separately")


def test_times_stand_apart_from_the_text_around_them() -> None:
    times = [part for part in CUTS.parts() if isinstance(part, TimeText)]
    assert times == [("at 2.0 s", 2.0), ("at 4.1 s", 4.1)]


@pytest.mark.parametrize(("person", "who"), [(0, "the person"), (2, "person 2")])
def test_a_person_is_counted_only_among_several(person: int, who: str) -> None:
    said = str(notice("unseen_frames", footage="a.mp4", person=person, unseen=1, total=1))
    assert said == f"a.mp4: {who} was not seen in 1 of 1 frame; these are filled in"


def test_a_sentence_is_written_in_the_language_of_the_translation() -> None:
    german = {
        SENTENCES["step"]: "{footage}, {person:who}: {height_cm:.0f} cm {side:phrase}, "
        "{times:times}",
        "person {number}": "Person {number}",
        "below": "darunter",
        "at {seconds} s": "bei {seconds} s",
    }
    step = notice("step", footage="a.mp4", person=2, height_cm=17.6, side="below", times=[1.0])
    assert step.text(german.__getitem__) == "a.mp4, Person 2: 18 cm darunter, bei 1.0 s"


@pytest.mark.parametrize(
    "made",
    [CUTS, notice(OTHER, text="it is dark"), notice("guessed_bones", rig="Rex", bones=["a"])],
)
def test_a_notice_is_read_from_json_as_it_was_written(made: Notice) -> None:
    report = json.loads(json.dumps(Report(warnings=[made]).as_json()))
    assert report["warnings"] == [str(made)]
    assert Report.from_json(report).warnings == [made]


@pytest.mark.parametrize("record", DAMAGED)
def test_a_damaged_record_says_so(record: Any) -> None:
    (found,) = Report.from_json({"notices": [record]}).warnings
    assert found.code == OTHER
    assert str(found).startswith("a warning of this result is damaged")


def test_every_notice_that_is_made_has_the_values_of_its_sentence() -> None:
    made = list(calls())
    assert {code for code, _ in made} == set(SENTENCES)
    for code, names in made:
        wanted = set(fields(SENTENCES[code]))
        assert names - {"**"} <= wanted, code
        assert "**" in names or names == wanted, code


def calls() -> Iterator[tuple[str, set[str]]]:
    """Code and names of the values of each notice in the source; ``**`` for further ones."""
    for path in ROOT.rglob("*.py"):
        text = path.read_text("utf-8")
        for node in ast.walk(ast.parse(text)) if "notice(" in text else ():
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "notice":
                for code in codes(node.args[0]):
                    yield code, {keyword.arg or "**" for keyword in node.keywords}


def codes(argument: ast.expr) -> list[str]:
    if isinstance(argument, ast.Constant):
        return [str(argument.value)]
    if isinstance(argument, ast.IfExp):
        return codes(argument.body) + codes(argument.orelse)
    return [OTHER] if getattr(argument, "id", "") == "OTHER" else []


def test_phrases_and_ways_to_write_values_are_known() -> None:
    known = {"", "g", ".0f", ".1f", ".2f", ".5g"}
    known |= {"who", "whose", "frames", "times", "phrase", "names"}
    assert {spec for text in SENTENCES.values() for spec in fields(text).values()} == known
    assert not any(fields(phrase) for phrase in PHRASES.values())
