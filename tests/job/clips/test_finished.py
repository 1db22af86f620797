# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of complete results: read only if everything is as it was left."""

import json
import os
import sys

import pytest
from scope.scope_addon.job.finished_clip import (
    finished_file,
    read_finished,
    remove_finished,
    write_finished,
)

KEY = "0123456789abcdef" * 4


@pytest.fixture
def written(tmp_path):
    """A record of one result."""
    (tmp_path / "below").mkdir()
    result = tmp_path / "below" / "a[1].npz"
    result.write_text("result")
    report = {"frames": 3, "warnings": ["dark"], "outputs": [str(result)]}
    record = finished_file(tmp_path, "below/a[1]", KEY)
    write_finished(record, report)
    return record, result, report


def test_a_record_has_the_report(written, tmp_path):
    record, result, report = written
    assert record.parent == result.parent
    assert record.name.startswith(".")
    assert read_finished(record, tmp_path) == report
    assert read_finished(finished_file(tmp_path, "below/a[1]", KEY[::-1]), tmp_path) is None


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_a_record_has_names_that_are_no_text(tmp_path):
    result = tmp_path / os.fsdecode(b"caf\xe9.npz")
    result.write_text("result")
    report = {"warnings": [], "outputs": [str(result)]}
    record = finished_file(tmp_path, result.stem, KEY)
    write_finished(record, report)
    assert read_finished(record, tmp_path) == report


def test_changed_and_missing_results_do_not_count(written, tmp_path):
    record, result, _ = written
    status = result.stat()
    result.write_text("longer result")
    os.utime(result, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert read_finished(record, tmp_path) is None
    result.write_text("damage")  # as long as the result
    os.utime(result, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert read_finished(record, tmp_path) is None
    result.write_text("result")
    assert read_finished(record, tmp_path) is not None
    result.unlink()
    assert read_finished(record, tmp_path) is None


def test_results_elsewhere_do_not_count(written, tmp_path):
    (tmp_path / "other").mkdir()
    assert read_finished(written[0], tmp_path / "other") is None


@pytest.mark.parametrize(
    "text",
    ["{", "[]", '{"report": {"outputs": 3, "warnings": []}, "content": {}}', '{"a":' * 10**5],
)
def test_a_damaged_record_does_not_count(written, tmp_path, text):
    written[0].write_text(text)
    assert read_finished(written[0], tmp_path) is None


@pytest.mark.parametrize("change", [{"outputs": []}, {"outputs": [3]}, {"warnings": None}])
def test_a_record_of_something_else_does_not_count(written, tmp_path, change):
    record, _, _ = written
    found = json.loads(record.read_text("utf-8"))
    found["report"] |= change
    record.write_text(json.dumps(found))
    assert read_finished(record, tmp_path) is None


def test_only_the_clips_own_records_are_removed(written, tmp_path):
    record, result, report = written
    others = [
        finished_file(tmp_path, "below/a1", KEY),
        finished_file(tmp_path, "below/a[1].finished-b", KEY),
        record.with_name(".a[1].finished-notes.json"),
    ]
    for other in others:
        write_finished(other, report)
    write_finished(finished_file(tmp_path, "below/a[1]", KEY[::-1]), report)
    remove_finished(tmp_path, "below/a[1]")
    assert sorted(os.listdir(result.parent)) == sorted(
        [result.name, *(other.name for other in others)]
    )


def test_a_record_that_cannot_be_written_is_left_out(tmp_path):
    write_finished(finished_file(tmp_path / "missing", "a", KEY), {"outputs": [], "warnings": []})
    write_finished(finished_file(tmp_path, "a" * 250, KEY), {"outputs": [], "warnings": []})
    remove_finished(tmp_path / "missing", "a")
    assert list(tmp_path.iterdir()) == []
