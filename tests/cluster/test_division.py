# SPDX-License-Identifier: GPL-3.0-or-later
"""Long clips that several workers observe: every window once in the result, whatever becomes of
workers.
"""

from __future__ import annotations

import json
import os
import signal
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scope.scope_addon.cli import PROGRAM, SAMPLE, main
from scope.scope_addon.cluster.runner import MAX_WINDOWS, window_ranges
from scope.scope_addon.job.batch import REPORT_NAME

from ..job.processes import runs, wait_for
from .test_runner import calls, files, run

pytestmark = pytest.mark.skipif(os.name == "nt", reason="sends signals to worker processes")

# Replaces the capture. A clip has as many windows as its text says, each of three frames. The first
# process of the window in the file beside it runs until its standard input ends.
CLIP = """
import json, os, pathlib, sys
clip = pathlib.Path(sys.argv[2])
given = dict(each.split("=", 1) for each in sys.argv if each.startswith("--windows"))
with open(clip.with_suffix(".calls"), "a") as log:
    row = {"pid": os.getpid(), "parent": os.getppid(), "windows": given.get("--windows", "")}
    log.write(json.dumps(row) + "\\n")
windows, count = given.get("--windows", ""), int(clip.read_text("utf-8"))
if windows == "count" and count > 1:
    print(json.dumps({"windows": count})); sys.exit()
if ":" in windows:
    first, end = map(int, windows.split(":"))
    hung, failing = clip.with_suffix(".hangs"), clip.with_suffix(".fails")
    if hung.exists() and first <= int(hung.read_text("utf-8")) < end:
        hung.unlink()
        sys.stdin.read(); sys.exit(130)
    if failing.exists() and first <= int(failing.read_text("utf-8")) < end:
        print("scope: it cannot be decoded", file=sys.stderr); sys.exit(1)
    into = pathlib.Path(given["--windows-folder"])
    outputs = [into / f"window{k:05d}.npz" for k in range(first, end)]
    for k, path in enumerate(outputs):
        path.write_text(f"{first + k} ")
    names = [str(p) for p in outputs]
    print(json.dumps({"frames": 3 * len(outputs), "outputs": names, "warnings": []}))
    sys.exit()
folder = given.get("--windows-folder")
paths = sorted(pathlib.Path(folder).iterdir()) if folder else []
found = "".join(p.read_text("utf-8") for p in paths) if folder else "whole"
outputs = [sys.argv[i + 1] for i, a in enumerate(sys.argv) if a == "-o"]
for path in outputs:
    pathlib.Path(path).write_text(found)
print(json.dumps({"frames": 3 * count, "outputs": outputs, "warnings": []}))
"""


def result(folder: Path, name: str) -> str:
    return (folder.parent / "out" / f"{name}.npz").read_text("utf-8")


def test_windows_become_tasks_of_at_most_some_windows() -> None:
    assert window_ranges(3, 1) == ["0:2", "2:3"]
    assert window_ranges(14, 2) == ["0:4", "4:8", "8:12", "12:14"]
    assert all(
        int(e) - int(b) <= MAX_WINDOWS for b, e in (r.split(":") for r in window_ranges(1000, 2))
    )


def test_a_long_clip_is_captured_in_windows_and_counted_once(cluster: Any, folder: Path) -> None:
    (folder / "a.mp4").write_text("7")
    (folder / "b.mp4").write_text("1")
    status, report = run(cluster, folder, program=CLIP)
    assert status == 0
    assert result(folder, "a") == "0 1 2 3 4 5 6 "
    assert result(folder, "b") == "whole"
    # and no window
    assert files(folder) == ["a.csv", "a.npz", "b.csv", "b.npz", "scope-batch.json"]
    long, short = report["files"]
    assert (long["windows"], "windows" in short) == (7, False)
    rows = report["workers"]
    assert sum(row["windows"] for row in rows) == 7
    assert sum(row["frames"] for row in rows) == report["throughput"]["frames"] == 24
    assert sum(row["clips"] for row in rows) == 2
    status, report = run(cluster, folder, program=CLIP)
    assert report["counts"]["skipped"] == 2


def test_a_part_that_fails_is_left_to_the_capture_of_the_clip(cluster: Any, folder: Path) -> None:
    clip = folder / "a.mp4"
    clip.write_text("4")
    clip.with_suffix(".fails").write_text("1")
    status, report = run(cluster, folder, program=CLIP)
    assert status == 0
    assert result(folder, "a") == "0 2 3 "  # which then observes the missing window itself
    assert sum(row["frames"] for row in report["workers"]) == 12


@pytest.mark.slow
def test_real_windows_of_two_workers_give_the_result_in_one_piece(
    cluster: Any, folder: Path, networks: Path
) -> None:
    (folder / "clip.mp4").write_bytes(SAMPLE.read_bytes())
    options = ["--quality", "fast", "--end", "0.8", "--window-seconds", "0.3", "--formats", "npz"]
    whole = folder.parent / "whole.npz"
    capture = ["capture", str(SAMPLE), "-o", str(whole), *options[:-2], "--threads", "1"]
    assert main(capture) == 0
    argv = ["batch", str(folder), "--out", str(folder.parent / "out"), *options]
    assert main([*argv, "--scheduler", cluster.scheduler_address], program=PROGRAM) == 0
    report = json.loads((folder.parent / "out" / REPORT_NAME).read_text("utf-8"))
    assert report["files"][0]["windows"] == 2
    with np.load(whole) as one, np.load(folder.parent / "out" / "clip.npz") as other:
        assert set(one.files) == set(other.files)
        different = [name for name in one.files if not np.array_equal(one[name], other[name])]
    assert set(different) <= {"source", "report"}


@pytest.mark.slow
def test_the_windows_of_a_killed_worker_are_observed_by_another(cluster: Any, folder: Path) -> None:
    clip = folder / "a.mp4"
    clip.write_text("6")
    clip.with_suffix(".hangs").write_text("4")

    def kill() -> None:
        wait_for(lambda: calls(clip) and not clip.with_suffix(".hangs").exists())
        (hung,) = [
            c
            for c in calls(clip)
            if ":" in c["windows"] and 4 in range(*map(int, c["windows"].split(":")))
        ]
        os.kill(hung["parent"], signal.SIGKILL)
        wait_for(lambda: not runs(hung["pid"]))

    thread = threading.Thread(target=kill)
    thread.start()
    status, report = run(cluster, folder, program=CLIP)
    thread.join()
    assert status == 0
    assert result(folder, "a") == "0 1 2 3 4 5 "
    assert sum(row["attempts_lost"] for row in report["workers"]) == 1
    assert sum(row["frames"] for row in report["workers"]) == 18
    again = [call["windows"] for call in calls(clip) if ":" in call["windows"]]
    assert len(again) == len(set(again)) + 1  # nothing else was repeated
    assert any("a.mp4 (windows" in event["event"] for event in report["log"])
