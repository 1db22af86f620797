# SPDX-License-Identifier: GPL-3.0-or-later
"""How long captures took is kept by their kind, whatever is in the file."""

import json

import pytest
from scope.scope_addon.job.job_progress import kind_of, load_stage_times, save_stage_times


def test_times_of_a_frame_are_kept_for_each_kind(tmp_path):
    best, fast = (
        kind_of({"quality": quality, "hands": "off", "start": 3}) for quality in ("best", "fast")
    )
    assert best == kind_of({"quality": "best", "hands": "off", "start": 7})
    save_stage_times(tmp_path, best, {"solving": 3.0, "writing": 0.5}, 100)
    save_stage_times(tmp_path, fast, {"solving": 1.0}, 100)
    assert load_stage_times(tmp_path, best) == {"solving": 0.03, "writing": 0.005}
    assert load_stage_times(tmp_path, fast) == {"solving": 0.01}
    save_stage_times(tmp_path, best, {"solving": 4.0}, 100)
    assert load_stage_times(tmp_path, best) == {"solving": 0.04}
    assert load_stage_times(tmp_path, "another") == {}


def test_kinds_that_were_not_captured_for_long_are_forgotten(tmp_path):
    for k in range(60):
        save_stage_times(tmp_path, str(k), {"solving": 1.0}, 10)
    assert load_stage_times(tmp_path, "5") == {}
    assert load_stage_times(tmp_path, "59") == {"solving": 0.1}


@pytest.mark.parametrize(
    "kinds",
    [
        3,
        [],
        {"kind": 3},
        *({"kind": {"solving": time}} for time in (-1, 1e999, None)),
    ],
)
def test_damaged_times_are_none(tmp_path, kinds):
    content = {"format": "scope stage times", "version": 1, "kinds": kinds}
    (tmp_path / "times.json").write_text(json.dumps(content))
    assert load_stage_times(tmp_path, "kind") == {}
    save_stage_times(tmp_path, "kind", {"solving": 1.0}, 10)
    assert load_stage_times(tmp_path, "kind") == {"solving": 0.1}


def test_a_folder_that_cannot_be_written_to_is_no_error(tmp_path):
    save_stage_times(tmp_path / "missing" / "folder", "kind", {"solving": 1.0}, 10)
    save_stage_times(tmp_path, "kind", {"solving": 1.0}, 0)
    assert load_stage_times(tmp_path, "kind") == {}
