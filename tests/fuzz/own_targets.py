# SPDX-License-Identifier: GPL-3.0-or-later
"""What reads messages of Scope's own processes, and what Scope itself has written: damaged disks,
hostile processes.
"""

from __future__ import annotations

import io
import json
import shutil
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from scope.scope_addon.kinematics.face import EXPRESSIONS

BATCH_NAME = "walk"
KEY = "key"
JOINTS = 24
COEFFICIENTS = 10
LARGEST_ARRAYS = 1 << 24


def read_request(path: Path) -> None:
    from scope.scope_addon.job.request import JobRequest, LiveRequest

    text = path.read_bytes().decode("utf-8", "replace")
    (LiveRequest if LiveRequest.is_in(text) else JobRequest).from_json(text)


def read_reply(path: Path) -> None:
    from scope.scope_addon.job.job_progress import JobProgress
    from scope.scope_addon.job.process import parse_message

    progress = JobProgress()
    for line in path.read_bytes().splitlines(keepends=True):
        message = parse_message(line)
        if message and message["event"] == "progress":
            progress.update(message["stage"], message["done"], message["total"])
            assert all("\n" not in text for text in progress.lines())
        if message and message["event"] == "result" and "motions" in message:
            assert all((path.parent / name).parent == path.parent for name in message["motions"])
        if message and message["event"] == "preview":
            assert (path.parent / message["file"]).parent == path.parent
            assert 0 < 4 * message["width"] * message["height"] < 1 << 27


def read_recording(path: Path) -> None:
    from scope.scope_addon.live.journal import fingerprint, read_about, read_records
    from scope.scope_addon.untrusted.body_file import load_body

    about = read_about(path)
    body = load_body("scope")
    records = read_records(path, replace(about, fingerprint=fingerprint(body)), body)
    assert all(np.isfinite(pose.rotations).all() for pose, _ in records)


def read_live_reply(path: Path) -> None:
    from scope.scope_addon.job import live_process
    from scope.scope_addon.job.process import parse_message

    for line in path.read_bytes().splitlines(keepends=True):
        parse_message(line, live_process.LiveProcess.fields)
        pose = live_process.parse_pose(line, JOINTS, COEFFICIENTS)
        assert pose is None or (np.isfinite(pose.rotations).all() and np.isfinite(pose.betas).all())


def read_answer(path: Path) -> None:
    """Read what the process of a user's network answers."""
    from scope.scope_addon.capture.perception.adapters.network_server import receive

    with path.open("rb") as stream, suppress(EOFError, ValueError):  # which its caller expects
        assert (
            sum(array.nbytes for array in receive(stream, LARGEST_ARRAYS)["arrays"])
            <= LARGEST_ARRAYS
        )


def run_network(path: Path) -> None:
    """Open a user's network in its process, and run it on white; it may take 15 s to open and 2 s
    to run.
    """
    from scope.scope_addon.capture.perception.adapters import graph
    from scope.scope_addon.capture.perception.adapters.description import Description

    with patch.multiple(graph, DEFAULT_OPENING_S=15.0, RUN_S=2.0):
        opened = graph.Graph(path, Description(), threads=1)
        opened.run(
            np.full((opened.height, opened.width, 3), 255, np.uint8),
            graph.Normalization(std=(0.01,)),
        )


def read_description(path: Path) -> None:
    from scope.scope_addon.capture.perception.adapters.description import read_description

    read_description(path.with_suffix(".onnx"), ("yolox", "simcc"))


def find_estimates(path: Path) -> None:
    from scope.scope_addon.capture.long_clips.kept_estimates import KeptEstimates

    folder = path.with_name("estimates")
    folder.mkdir(exist_ok=True)
    shutil.copy(path, folder)
    kept = KeptEstimates(folder)
    for key in list(kept._places)[:10]:
        values = kept.find(key)
        assert values is None or np.isfinite(values).all()


def load_window(path: Path) -> None:
    from scope.scope_addon.capture.frame_observer import Window
    from scope.scope_addon.capture.long_clips import window_file

    folder = path.with_name("windows")
    folder.mkdir(exist_ok=True)
    shutil.copy(path, folder / window_file.window_name(1))
    window_file.load_window(folder, Window(1, 1.0, 2.0, 4.0))


def find_capture(path: Path) -> None:
    from scope.scope_addon.job.cache import REPORT, Cache

    folder = path.with_name("captures") / KEY
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(path, folder / REPORT)
    (folder / "person1.npz").touch()
    found = Cache(path.parent).find(KEY)
    assert found is None or all(motion.parent == folder for motion in found.motions)
    # which the panel shows
    assert found is None or 0 <= float(found.report.get("fps", {}).get("total", 0.0))


def load_times(path: Path) -> None:
    """Load the times of earlier captures, show a capture's remaining time by them, and keep those
    of this one.
    """
    from scope.scope_addon.job.job_progress import (
        STAGES,
        JobProgress,
        load_stage_times,
        save_stage_times,
    )

    folder = path.with_name("times")
    folder.mkdir(exist_ok=True)
    shutil.copy(path, folder / "times.json")
    now = [0.0]
    progress = JobProgress(lambda: now[0], load_stage_times(folder, KEY))
    for stage in STAGES:
        for done in range(0, 600, 30):
            now[0] += 0.5
            progress.update(stage, done, 600)
            assert len(progress.lines()) < 3
    save_stage_times(folder, KEY, progress.seconds, progress.frames)
    kept = load_stage_times(folder, KEY)
    assert not kept or kept["solving"] == progress.seconds["solving"] / progress.frames


def read_batch_report(path: Path) -> None:
    from scope.scope_addon.job.batch import REPORT_NAME, Batch

    folder = path.with_name("batch")
    folder.mkdir(exist_ok=True)
    shutil.copy(path, folder / REPORT_NAME)
    batch = Batch(folder, folder, ["scope"], {}, [".npz"])
    for entry in batch._previous_entries({"a": folder / "a.mp4"}, "clips").values():
        batch._is_finished("a", entry)


def requests(_: Path) -> list[bytes]:
    from scope.scope_addon.job.request import LiveRequest
    from scope.scope_addon.options import Place, options_at

    values = {option.name: option.default for option in options_at(Place.WORKER)}
    return [
        json.dumps({"footage": "walk.mp4", **values}, default=str).encode(),
        LiveRequest("0").to_json().encode(),
    ]


def _lines(messages: list[dict[str, Any]]) -> list[bytes]:
    return [json.dumps(message).encode() + b"\n" for message in messages]


def replies(_: Path) -> list[bytes]:
    return _lines(
        [
            {"event": "progress", "stage": "solving", "done": 3, "total": 10},
            {"event": "preview", "file": "preview.rgba", "width": 320, "height": 180, "frame": 7},
            {
                "event": "result",
                "motions": ["person1.npz"],
                "report": {
                    "fps": {"total": 9.5},
                    "notices": [{"code": "other", "values": {"text": "dark"}}],
                },
            },
            {"event": "error", "message": "the footage is too short"},
        ]
    )


def live_replies(_: Path) -> list[bytes]:
    pose: dict[str, Any] = {
        "event": "pose",
        "person": 0,
        "frame": 3,
        "presence": "seen",
        "positions": [[0.0, 0.0, 1.0]],
    }
    pose |= {"rotations": [[1.0, 0.0, 0.0, 0.0]] * JOINTS, "betas": [0.1] * COEFFICIENTS}
    status: dict[str, Any] = {
        "event": "status",
        "presence": "seen",
        "rate": 29.5,
        "latency_ms": 60.0,
        "recorded_s": 2.5,
    }
    return _lines([pose, status, {"event": "notice", "text": "interrupted"}, {"event": "ended"}])


def recordings(folder: Path) -> list[bytes]:
    from scope.scope_addon.capture.camera.intrinsics import Camera
    from scope.scope_addon.live.journal import About, Journal, fingerprint
    from scope.scope_addon.live.pose import Presence
    from scope.scope_addon.untrusted.body_file import load_body

    from ..live.test_vmc import pose_of

    body = load_body("scope")
    about = About("scope", fingerprint(body), "fake", "30", (64, 48), 1.0, (3, 0.5), 1, "")
    journal = Journal(folder / "seed.recording", about, body, print)
    for k, presence in enumerate((Presence.SEEN, Presence.LOST, Presence.SEEN)):
        pose = replace(pose_of(body, presence=presence), index=k, timestamp_s=k / 30)
        journal.add(pose, Camera(np.eye(3), np.zeros(5), "given"))
    journal.close()
    assert journal.path is not None
    return [journal.path.read_bytes()]


def answers(_: Path) -> list[bytes]:
    from scope.scope_addon.capture.perception.adapters.network_server import send

    stream = io.BytesIO()
    send(stream, {"providers": ["CPU"]}, [np.ones((2, 3), np.float32), np.zeros(0)])
    return [stream.getvalue()]


def expression_maps(folder: Path) -> list[bytes]:
    from scope.scope_addon.retarget.expression_map import guess_expression_map, save_expression_map
    from scope.scope_addon.retarget.face_controls import FOLDER

    path = folder / "seed.json"
    save_expression_map(guess_expression_map(EXPRESSIONS), path)
    return [path.read_bytes(), (FOLDER / "rigify.json").read_bytes()]


def descriptions(_: Path) -> list[bytes]:
    return [
        json.dumps(
            {"type": "simcc", "input_size": [192, 256], "mean": [1, 2, 3], "keypoints": "coco17"}
        ).encode()
    ]


def windows(folder: Path) -> list[bytes]:
    from scope.scope_addon.capture.camera.background_record import BackgroundRecord
    from scope.scope_addon.capture.frame_observer import Observed, Window
    from scope.scope_addon.capture.long_clips.window_file import save_window
    from scope.scope_addon.capture.perception.region import Region
    from scope.scope_addon.capture.tracking.track import Tracklet

    times = 1.0 + np.arange(6) / 2
    background = BackgroundRecord(times, np.tile(np.eye(3), (6, 1, 1)), np.ones(6, bool), [1.0])
    values = [np.ones((33, 6), np.float32)] * 6
    centers = [np.ones(2)] * 6
    people = {0: Tracklet(list(range(6)), values, centers, [9.0] * 6)}
    observed = Observed(
        list(range(6)),
        times.tolist(),
        [],
        people,
        background,
        window=Window(1, 1.0, 2.0, 4.0),
        first=2,
        anchor=5,
        checksums=[1] * 6,
        anchor_regions=[Region((1.0, 2.0), 9.0, 0.0)],
        picture_changes=[1.0] * 6,
    )
    return [save_window(folder, observed).read_bytes()]


def estimates(folder: Path) -> list[bytes]:
    path = folder / "seed.npz"
    np.savez(path, keys=np.arange(48, dtype=np.uint8).reshape(3, 16), values=np.ones((3, 5)))
    return [path.read_bytes()]


def cached_reports(_: Path) -> list[bytes]:
    return [json.dumps({"motions": ["person1.npz"], "report": {"fps": {"total": 9.5}}}).encode()]


def times(folder: Path) -> list[bytes]:
    from scope.scope_addon.job.job_progress import save_stage_times

    for kind in ("other", KEY):
        save_stage_times(
            folder, kind, {"finding the person": 9.0, "solving": 0.5, "writing": 0.25}, 100
        )
    return [(folder / "times.json").read_bytes()]


def batch_reports(_: Path) -> list[bytes]:
    entry = {
        "name": BATCH_NAME,
        "status": "done",
        "outputs": ["walk.npz"],
        "hash": "0a",
        "warnings": [],
    }
    return [json.dumps({"folder": "clips", "files": [entry], "exit_status": 0}).encode()]
