# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures the clips of a data set as a user would; what is done is kept, so that an interrupted
run goes on.

A clip's folder of results holds ``person1.npz``, …, and, written last, ``clip.json``: the options
of the capture, how many people were found, or why there is none.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.atomic_write import atomic_path, reason
from ...scope_addon.capture.media.video_range import VideoRange
from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.pipeline import capture
from ...scope_addon.errors import NoPersonError, OutputError
from ...scope_addon.job.request import code_version
from ...scope_addon.motion import Motion
from ...solver.body import Body
from ...solver.errors import InputError
from .clips import Clip

_ROOT = Path(__file__).resolve().parents[2]
_RECORD = "clip.json"


@dataclass(frozen=True)
class Settings:
    """How clips are captured: ``body`` names it, or is its file; ``camera``: whether the intrinsics
    are given.
    """

    quality: str
    body: str
    camera: bool
    threads: int = 0


@dataclass(frozen=True)
class Captured:
    """The people that were found in a clip, or ``problem``: why it could not be captured;
    ``program``: by which.
    """

    motions: list[Motion]
    problem: str = ""
    program: str = ""


def captured_clip(
    clip: Clip,
    intrinsics: NDArray[np.float64] | None,
    body: Body,
    settings: Settings,
    folder: Path,
    say: Callable[[str], None],
) -> Captured:
    """Return the result of a clip: the one that is kept if the options are the same, else by
    capturing it.

    :param intrinsics: (3, 3), used if the settings say so.
    :param folder: of this clip's results.
    :raises OutputError: the result cannot be written.
    """
    kept = _read(folder, settings)
    if kept is not None:
        return kept
    say(f"{clip.name}: {len(clip.pictures)} frames" if len(clip.pictures) > 1 else clip.name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        forget(folder)
    except OSError as error:
        raise OutputError(
            f"cannot write in {folder}: {reason(error)}; choose another with --results"
        ) from error
    problem = ""
    motions = []
    try:
        motions = _capture(clip, intrinsics if settings.camera else None, body, settings)
    except NoPersonError:
        pass
    except InputError as error:  # of footage that cannot be decoded, or that is not of the camera
        problem = str(error)
    for number, motion in enumerate(motions, 1):
        motion.save(folder / f"person{number}.npz")
    program = code_version(_ROOT)
    record = {
        "options": _options(settings),
        "people": len(motions),
        "problem": problem,
        "program": program,
    }
    try:
        with atomic_path(folder / _RECORD) as temporary:
            temporary.write_text(json.dumps(record, indent=1), encoding="utf-8")
    except OSError as error:
        raise OutputError(
            f"cannot write {folder / _RECORD}: {reason(error)}; free some space"
        ) from error
    return Captured(motions, problem, program)


def _options(settings: Settings) -> dict[str, Any]:
    """Return what decides a result; a body's file by its content."""
    options = asdict(settings)
    del options["threads"]
    if Path(settings.body).is_file():
        options["body"] = hashlib.sha256(Path(settings.body).read_bytes()).hexdigest()
    return options


def _read(folder: Path, settings: Settings) -> Captured | None:
    """Return the result of an earlier run; None if there is none by these options, or it cannot be
    read.
    """
    try:
        record = json.loads((folder / _RECORD).read_text(encoding="utf-8"))
        if record["options"] != _options(settings):
            return None
        motions = [Motion.load(folder / f"person{k + 1}.npz") for k in range(int(record["people"]))]
        return Captured(motions, str(record["problem"]), str(record["program"]))
    except (OSError, ValueError, KeyError, TypeError, InputError):
        return None


def results_of(results: Path, clip: Clip) -> Path:
    """Return the folder for the results of a clip."""
    return results / re.sub(r"[^\w.-]+", "_", clip.name)


def forget(folder: Path) -> None:
    """Have the next run capture a clip again.

    :raises OutputError: its record cannot be removed.
    """
    try:
        (folder / _RECORD).unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"cannot remove {folder / _RECORD}: {reason(error)}") from error


def _capture(
    clip: Clip, intrinsics: NDArray[np.float64] | None, body: Body, settings: Settings
) -> list[Motion]:
    rate = Fraction(clip.rate).limit_denominator(1000)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        footage = clip.pictures[0]
        wanted = VideoRange()
        if len(clip.pictures) > 1:
            footage = _numbered(clip.pictures, folder / "frames")
            wanted = VideoRange(fps=rate)
        options = CaptureOptions(
            quality=settings.quality,
            people="largest" if clip.alone else "all",
            calibration=None
            if intrinsics is None
            else _calibration(intrinsics, folder / "camera.json"),
            wanted=wanted,
            threads=settings.threads,
        )
        return capture(footage, body, options).motions


def _numbered(pictures: list[Path], folder: Path) -> Path:
    """Return a folder of links to pictures, whose names are numbers from 0: data sets name theirs
    in many ways.
    """
    folder.mkdir()
    for k, picture in enumerate(pictures):
        os.symlink(picture.resolve(), folder / f"{k:06d}{picture.suffix.lower()}")
    return folder


def _calibration(K: NDArray[np.float64], path: Path) -> Path:
    path.write_text(json.dumps({"intrinsics": K.tolist()}), encoding="utf-8")
    return path
