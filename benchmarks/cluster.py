# SPDX-License-Identifier: GPL-3.0-or-later
"""A batch on a cluster of worker processes of this machine: workers killed on the way, scaling, and
what takes time.
"""

from __future__ import annotations

import hashlib
import json
import os
import resource
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import av
from distributed import Client

from ..scope_addon.cli import SAMPLE
from ..scope_addon.motion import Motion

CLIPS = 200
KILLED = 2
WORKERS = 4
FEW = 20  # clips for one worker and for two
# of a clip
FRAMES = 15
FPS = 30


def cluster(quick: bool) -> dict[str, Any]:
    """Measure, and return the figures."""
    count = 16 if quick else CLIPS
    with tempfile.TemporaryDirectory() as folder:
        clips = make_clips(Path(folder) / "clips", count)
        few = Path(folder) / "few"
        few.mkdir()
        for clip in clips[: min(count, FEW)]:
            shutil.copy(clip, few)
        figures: dict[str, Any] = {"scaling": [_run(few, workers) for workers in (1, 2)]}
        figures["killed"] = _run(clips[0].parent, WORKERS, KILLED)
    print(json.dumps(figures, indent=1))
    return figures


def make_clips(folder: Path, count: int) -> list[Path]:
    """Write short clips, all different: parts of the sample clip."""
    folder.mkdir()
    with av.open(str(SAMPLE)) as source:
        pictures = [frame.to_ndarray(format="rgb24") for frame in source.decode(video=0)]
    paths = []
    for k in range(count):
        first = k * 7 % (len(pictures) - FRAMES)
        path = folder / f"clip{k:04}.mp4"
        with av.open(str(path), "w", options={"movflags": "faststart"}) as target:
            stream = target.add_stream(
                "libx264", rate=FPS, options={"crf": "20", "preset": "ultrafast"}
            )
            stream.height, stream.width = pictures[0].shape[:2]
            stream.pix_fmt = "yuv420p"
            target.metadata["comment"] = str(k)  # makes each clip's content its own
            for picture in pictures[first : first + FRAMES]:
                target.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            target.mux(stream.encode())
        paths.append(path)
    assert len({hashlib.sha256(path.read_bytes()).digest() for path in paths}) == count
    return paths


def _run(clips: Path, workers: int, kills: int = 0) -> dict[str, Any]:
    """Capture a folder with one thread per worker, and check what is left.

    :param kills: workers to kill: the first when a quarter of the clips is done, the others later.
    """
    with ExitStack() as stack:
        place = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        out = place / "out"
        file = place / "scheduler.json"
        dask = [sys.executable, "-m", "dask"]
        with (place / "dask.log").open("w") as log:
            for command in (
                ["scheduler", "--port", "0", "--host", "127.0.0.1"],
                ["worker", "--nworkers", str(workers)],
            ):
                threads = ["--nthreads", "1"] if command[0] == "worker" else []
                options = [*threads, "--scheduler-file", str(file), "--no-dashboard"]
                started = subprocess.Popen(
                    [*dask, *command, *options], stdout=log, stderr=log, cwd=place
                )
                stack.callback(started.wait)
                stack.callback(started.terminate)
                while not file.exists():
                    time.sleep(0.1)
        client = stack.enter_context(Client(scheduler_file=str(file), set_as_default=False))
        client.wait_for_workers(workers)
        start = time.monotonic()
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [
            sys.executable,
            "-m",
            "scope.scope_addon",
            "batch",
            str(clips),
            "--out",
            str(out),
            "--json",
            "--quiet",
        ]
        command += ["--formats", "npz", "--quality", "fast", "--scheduler", str(file)]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        total = len(list(clips.iterdir()))
        killed: list[str] = []
        while len(killed) < kills:
            assert process.poll() is None
            if len(list(out.glob("*.npz"))) >= total * (len(killed) + 1) / (kills + 2):
                address, pid = sorted(client.run(os.getpid).items())[0]
                os.kill(pid, signal.SIGKILL)
                killed.append(address)
            time.sleep(0.5)
        stdout, _ = process.communicate()
        seconds = time.monotonic() - start
        driver_s = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]) - sum(before[:2])
        return _checked(json.loads(stdout), out, total, seconds) | {
            "workers": workers,
            "driver_cpu_s": round(driver_s, 1),
        }


def _checked(report: dict[str, Any], out: Path, total: int, seconds: float) -> dict[str, Any]:
    """Check that there is one good output per clip and nothing else; return the figures."""
    entries = report["files"]
    assert {e["status"] for e in entries} == {"done"}, report["counts"]
    assert len({e["name"] for e in entries}) == len(entries) == total
    names = sorted(p.name for p in out.iterdir())
    assert names == sorted([*(f"{e['name']}.npz" for e in entries), "scope-batch.json"]), (
        "other files"
    )
    assert all(Motion.load(out / f"{e['name']}.npz").frames.size == FRAMES for e in entries)
    clip_s = statistics.median(e["seconds"] for e in entries)
    capture_s = statistics.median(
        e["report"]["frames"] / e["report"]["fps"]["total"] for e in entries
    )
    return {
        "clips": total,
        "seconds": round(seconds, 1),
        "clips_per_minute": round(60 * total / seconds, 1),
        "median_clip_s": round(clip_s, 2),
        "median_capture_s": round(capture_s, 2),
        "attempts_lost": sum(row["attempts_lost"] for row in report["workers"]),
        "table": report["workers"],
    }
