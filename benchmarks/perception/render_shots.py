# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the held-out shots that build/bench/renders lacks: ``python -m
scope.benchmarks.perception.render_shots``.

Runs as a separate process, because Blender's module prints on standard output and can hang at exit.
NAME.mp4 and NAME_truth.npz of a shot are kept while the ground truth is unchanged.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.atomic_write import atomic_path
from ...solver import Body, load_body
from ...tools.render_sample.truth import Shot, write_truth
from ..frames import CACHE, DATA, ROOT
from .held_out import draw_shot, held_out_takes

RENDERS = CACHE / "renders"
MOTIONS = ROOT / "build" / "mocap" / "motions.npz"
NEW_PERFORMERS = MOTIONS.with_name("new_performers.npz")
# between two versions of a clip's ground truth
SAME = ("joints_cam", "betas", "intrinsics", "frame_index")
SAME_M = 1e-3


def video_and_truth(name: str) -> tuple[Path, Path]:
    """Return the paths of a take's rendered clip and its ground truth."""
    return RENDERS / f"{name}.mp4", RENDERS / f"{name}_truth.npz"


def shots(body: Body) -> dict[str, Shot]:
    """Return the shot of every held-out take, by the take's name."""
    return {take.name: draw_shot(body, take) for take in held_out_takes(fitted_motions())}


def fitted_motions() -> Path:
    """Return the file of all recordings fitted by the default body, which is made if it is
    missing.
    """
    if not MOTIONS.is_file():
        print(
            f"fitting the body to the recordings in {DATA / 'mocap'}, once",
            file=sys.stderr,
            flush=True,
        )
        command = ("scope.tools.mocap.fit_body", str(DATA / "mocap"), "-o", str(MOTIONS))
        subprocess.run([sys.executable, "-m", *command], check=True, stdout=subprocess.DEVNULL)
    return MOTIONS


def fitted_new_performers() -> Path:
    """Return the file of the performers that nothing was trained on, fitted by the default body,
    made if it is missing.

    :raises subprocess.CalledProcessError: when a package with their recordings cannot be
        downloaded; it says why.
    """
    if not NEW_PERFORMERS.is_file():
        print(
            "downloading the recordings of new performers, and fitting the body to them, once",
            file=sys.stderr,
            flush=True,
        )
        command = ("scope.tools.mocap.new_performers", "-o", str(NEW_PERFORMERS))
        subprocess.run([sys.executable, "-m", *command], check=True, stdout=subprocess.DEVNULL)
    return NEW_PERFORMERS


def render_missing(body: Body) -> None:
    """Render what is not there or not true any more."""
    for name, shot in shots(body).items():

        def render(path: Path, scratch: Path, shot: Shot = shot) -> None:
            from ...tools.render_sample.clip import render_clip

            render_clip(body, shot, path, scratch)

        render_if_changed(
            *video_and_truth(name), SAME, partial(write_truth, body=body, shot=shot), render
        )


def render_if_changed(
    video: Path,
    truth: Path,
    keys: Sequence[str],
    write: Callable[[Path], None],
    render: Callable[[Path, Path], None],
) -> None:
    """Render a clip unless it is there and its ground truth has not changed.

    :param keys: the arrays of the ground truth that are compared, floats to `SAME_M`.
    :param write: writes the ground truth to a path.
    :param render: renders the clip to a path, with a folder for what it needs meanwhile.
    """
    video.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=video.parent, prefix=".frames") as scratch:
        drawn = Path(scratch) / truth.name
        write(drawn)
        if video.is_file() and truth.is_file() and _same(drawn, truth, keys):
            return
        print(f"rendering {video.stem}", file=sys.stderr, flush=True)
        truth.unlink(missing_ok=True)  # a video without ground truth is rendered again
        with atomic_path(video) as part:
            render(part, Path(scratch))
        os.replace(drawn, truth)


def _same(drawn: Path, kept: Path, keys: Sequence[str]) -> bool:
    with np.load(drawn) as a, np.load(kept) as b:
        return all(key in b and _alike(a[key], b[key]) for key in keys)


def _alike(a: NDArray[Any], b: NDArray[Any]) -> bool:
    if a.dtype.kind != "f":
        return np.array_equal(a, b)
    return a.shape == b.shape and np.allclose(a, b, rtol=0, atol=SAME_M)


if __name__ == "__main__":
    render_missing(load_body("scope"))
    sys.stderr.flush()
    os._exit(0)
