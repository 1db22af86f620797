# SPDX-License-Identifier: GPL-3.0-or-later
"""Two captures are not called the same where they failed or were not recorded."""

import json
import subprocess

import pytest
from scope.benchmarks import same_captures


def run(monkeypatch, *arguments):
    monkeypatch.setattr("sys.argv", ["same_captures", *map(str, arguments)])
    return same_captures.main()


def test_a_capture_that_fails_ends_it_with_what_the_capture_said(monkeypatch, tmp_path):
    failed = subprocess.CompletedProcess([], 3, "", "scope: no video\n")
    monkeypatch.setattr(same_captures.subprocess, "run", lambda *_, **__: failed)
    file = tmp_path / "record.json"
    with pytest.raises(SystemExit, match=r"scope: no video\nsample: .* status 3"):
        run(monkeypatch, "record", file, "sample")
    file.write_text(json.dumps({"sample": {"status": "3"}}))
    with pytest.raises(SystemExit, match=r"scope: no video\nsample: .* status 3"):
        run(monkeypatch, "compare", file, "sample")


@pytest.mark.parametrize("name", ["face", "nothing"])
def test_a_capture_that_there_is_not_is_named(monkeypatch, tmp_path, capsys, name):
    file = tmp_path / "record.json"
    file.write_text(json.dumps({"sample": {}, "nothing": {}}))
    monkeypatch.setattr(same_captures, "digests", lambda *_: {})
    with pytest.raises(SystemExit):
        run(monkeypatch, "compare", file, name)
    assert f"there is no capture {name!r}; choose of sample" in capsys.readouterr().err
