# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames per second from video to motion file, by stage, compared with MediaPipe's pipeline with
the same network.

Short clips are looped until start-up no longer matters. Loading the networks is not timed on either
side. Scope and MediaPipe alternate, so that other load on the machine affects both alike.
"""

from __future__ import annotations

import subprocess
import tarfile
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from ...scope_addon.atomic_write import atomic_path
from ...scope_addon.capture.media.video import open_video
from ...scope_addon.capture.media.video_range import VideoRange
from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.pipeline import Capture, capture
from ...solver import Body
from ..frames import CACHE, DATA, ROOT
from ..solver.peers import make_environment

COMPLEXITY = {"fast": 0, "balanced": 1, "best": 2}  # MediaPipe's names for the same networks
NETWORKS = {"fast": "lite", "balanced": "full", "best": "heavy"}
PEER = "mediapipe==0.10.14"


def looped(clip: str, frames: int, fps: float | None = None) -> Path:
    """Return the clip repeated to at least ``frames`` frames, at its own or another rate; cached in
    build/bench.
    """
    target = CACHE / f"{Path(clip).stem}_{frames}{'' if fps is None else f'_{fps:g}fps'}.mp4"
    if target.exists():
        return target
    CACHE.mkdir(parents=True, exist_ok=True)
    source = cv2.VideoCapture(str(DATA / clip))
    pictures = []
    while (got := source.read())[0]:
        pictures.append(got[1])
    size = pictures[0].shape[1::-1]
    with atomic_path(target) as temporary:
        rate = fps or source.get(cv2.CAP_PROP_FPS)
        writer = cv2.VideoWriter(str(temporary), cv2.VideoWriter.fourcc(*"mp4v"), rate, size)
        for k in range(frames):
            writer.write(pictures[k % len(pictures)])
        writer.release()
    return target


def decoding(video: Path) -> float:
    """Return frames per second of decoding alone."""
    with open_video(video) as footage:
        since = time.perf_counter()
        count = sum(1 for _ in footage)
    return count / (time.perf_counter() - since)


def end_to_end(
    body: Body, video: Path, quality: str, people: int | str = "largest"
) -> dict[str, float]:
    """Return frames per second and CPU time per frame: file to motion files; by stage, what the
    main thread waits.
    """
    cpu = time.process_time()
    result = capture(video, body, CaptureOptions(quality=quality, people=people))
    frames = result.report.frames
    saving = _save_all(result)
    rates = result.report.fps
    return {
        "end_to_end": frames / (frames / rates["total"] + saving),
        "networks": rates["networks"],
        "solver": rates["solver"],
        "cpu_ms_per_frame": 1e3 * (time.process_time() - cpu) / frames,
        "frames": frames,
        "people": result.report.people,
    }


def warm_up(body: Body) -> None:
    """Compile and cache everything that the first capture would."""
    capture(
        DATA / "clips/run_moving_camera.mp4",
        body,
        CaptureOptions(quality="fast", wanted=VideoRange(0, 1.0)),
    )


def mediapipe(video: Path, quality: str, frames: int) -> float | str:
    """Return MediaPipe's frames per second with the preset's network, or why there is no figure."""
    try:
        python = make_environment("mediapipe", PEER)
        _bring_network(python, NETWORKS[quality])
        command = [
            python,
            Path(__file__).with_name("mediapipe_run.py"),
            video,
            COMPLEXITY[quality],
            frames,
        ]
        done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=True)
        return float(done.stdout.strip().splitlines()[-1])
    except (OSError, subprocess.CalledProcessError, ValueError, IndexError) as error:
        reason = (getattr(error, "stderr", "") or str(error)).strip().splitlines()
        return "skipped: " + (reason[-1] if reason else type(error).__name__)


def side_by_side(
    body: Body, video: Path, quality: str, frames: int, rounds: int
) -> dict[str, float | str | None]:
    """Return medians of both over turns taken, and their ratio."""
    ours: list[dict[str, float]] = []
    theirs: list[float | str] = []
    for _ in range(rounds):
        ours.append(end_to_end(body, video, quality))
        theirs.append(mediapipe(video, quality, frames))
    found: dict[str, float | str | None] = {
        key: float(np.median([o[key] for o in ours])) for key in ours[0]
    }
    measured = [t for t in theirs if isinstance(t, float)]
    mediapipe_fps = float(np.median(measured)) if measured else None
    found["over_mediapipe"] = (
        float(np.median([o["end_to_end"] for o in ours])) / mediapipe_fps if mediapipe_fps else None
    )
    found["mediapipe"] = theirs[0] if mediapipe_fps is None else mediapipe_fps
    return found


def _save_all(result: Capture) -> float:
    since = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        for k, motion in enumerate(result.motions):
            motion.save(Path(folder) / f"person{k}.npz")
    return time.perf_counter() - since


def _bring_network(python: Path, name: str) -> None:
    """Copy the networks that MediaPipe's wheel lacks, and that it would download, from the
    capture's own package.
    """
    folder = next(
        (python.parent.parent / "lib").glob("python*/site-packages/mediapipe/modules/pose_landmark")
    )
    target = folder / f"pose_landmark_{name}.tflite"
    if not target.exists():
        packages = sorted((ROOT / "build" / "downloads").glob("mediapipe-pose-*.tgz"))
        if not packages:
            raise OSError(f"{target.name} is not in build/downloads: run convert_networks --force")
        with tarfile.open(packages[0]) as package, target.open("wb") as out:
            member = package.extractfile(f"package/{target.name}")
            if member is None:
                raise OSError(
                    f"{packages[0]} has no file package/{target.name}: run convert_networks --force"
                )
            out.write(member.read())
