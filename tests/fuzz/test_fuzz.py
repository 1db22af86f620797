# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged inputs of every reader give one sentence or none: past findings and new ones; more by
./scripts/fuzz.
"""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import pytest
from scope.scope_addon.capture.media.heif import read_layout
from scope.scope_addon.exif import Exif, animation_length, read_exif
from scope.scope_addon.job.job_progress import load_stage_times
from scope.solver.errors import ScopeError

from .fuzz import CORPUS, check, inputs, random_inputs, seeds
from .own_targets import KEY
from .targets import TARGETS

COUNT = {
    "picture": 20,
    "video": 25,
    "body": 15,
    "motion": 25,
    "smpl_motion": 20,
    "network_run": 2,
}  # of inputs, in some 3 s of CPU


@pytest.mark.parametrize("name", TARGETS)
def test_damaged_inputs_raise_nothing_but_ours(tmp_path: Path, name: str) -> None:
    for path in islice(inputs(name, tmp_path, seed=1), COUNT.get(name, 60)):
        check(name, path)


@pytest.mark.parametrize("name", TARGETS)
def test_random_bytes_raise_nothing_but_ours(tmp_path: Path, name: str) -> None:
    for path in random_inputs(name, tmp_path, seed=1, count=15_000):
        check(name, path)


def is_metadata(path: Path) -> bool:
    return path.name.startswith(("heif-", "exif-"))


def is_of_earlier_captures(path: Path) -> bool:
    return path.name.startswith("times-")


@pytest.mark.parametrize(
    "path",
    [
        path
        for path in sorted(CORPUS.iterdir())
        if not (is_metadata(path) or is_of_earlier_captures(path))
    ],
    ids=lambda path: path.name,
)
def test_past_findings_are_refused(path: Path) -> None:
    """Each once crashed, hung, took all memory, ran code or gave a message of several lines."""
    with pytest.raises(ScopeError) as caught:
        TARGETS[path.name.partition("-")[0]].read(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "path", sorted(filter(is_metadata, CORPUS.iterdir())), ids=lambda path: path.name
)
def test_hostile_metadata_count_as_absent(path: Path) -> None:
    """They claim 4 billion items, tags or bytes, or contain themselves."""
    data = path.read_bytes()
    assert read_layout(data) is None
    assert (read_exif(data), animation_length(data)) == (Exif(), 1)


@pytest.mark.parametrize(
    "path", sorted(filter(is_of_earlier_captures, CORPUS.iterdir())), ids=lambda path: path.name
)
def test_hostile_times_of_earlier_captures_count_as_absent(tmp_path: Path, path: Path) -> None:
    """They have times that no sum holds, numbers that no float holds, names that UTF-8 lacks, or
    nest without end.
    """
    (tmp_path / "times.json").write_bytes(path.read_bytes())
    assert load_stage_times(tmp_path, KEY) == {}
    check("times", tmp_path / "times.json")


@pytest.mark.parametrize("name", TARGETS)
def test_what_is_damaged_was_whole(tmp_path: Path, name: str) -> None:
    """Otherwise all would be refused at the door."""
    target = TARGETS[name]
    for data in seeds(name):
        accepted = []
        for suffix in target.suffixes:
            path = tmp_path / f"input{suffix}"
            path.write_bytes(data)
            try:
                target.read(path)
            except ScopeError as error:
                accepted.append(str(error))
            else:
                break
        else:
            pytest.fail(f"{data[:40]!r}: {accepted}")
