# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench stills`: captures of single frames of the clips with ground truth, each as an
image by itself.

Nothing before or after the image helps: no motion, no contact, no up direction of a whole clip.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from ..scope_addon.capture.options import CaptureOptions
from ..scope_addon.capture.pipeline import capture
from ..scope_addon.errors import NoPersonError
from ..scope_addon.motion import Motion
from ..solver import Body, load_body
from ..solver.body_file import ASSETS
from .frames import DATA
from .perception.accuracy import CAMERAS, evaluate_motion
from .perception.perception import PRESETS
from .perception.render_shots import RENDERS
from .report import table
from .scenes.accuracy import score_people
from .scenes.scene import FOLDER, SPLITS
from .scenes.statistics import mean_over_people

# images, evenly spaced in time, none of them the first or the last
PER_CLIP = 5
PER_SCENE = 1
QUICK = 1
Pair = tuple[float, float]  # MPJPE-root and PA-MPJPE in mm; NaN of people who are not found


class Clip(NamedTuple):
    """Footage with its ground truth, and whether that is of a scene."""

    video: Path
    truth: Path
    is_scene: bool = False


def stills(quick: bool) -> dict[str, Any]:
    """Capture and measure all images with every preset; print a table and return the errors of
    every person.

    Rendered clips are measured as far as they are there: `renders` and `scenes` make them.
    ``quick``: one image of each camera and the sample, and the default preset.
    """
    if not DATA.is_dir():
        print(f"{DATA} does not exist: nothing was measured; put the clips there", file=sys.stderr)
        return {}
    body = load_body("scope")
    figures = dict[str, dict[str, dict[str, list[Pair]]]]()
    for quality in (CaptureOptions().quality,) if quick else PRESETS[::-1]:  # best first
        figures[quality] = {}
        for group, clips in list(_groups().items())[: 2 if quick else None]:
            figures[quality][group] = {}
            for clip in clips:
                count = QUICK if quick else PER_SCENE if clip.is_scene else PER_CLIP
                print(f"{quality}: {clip.video.stem}", file=sys.stderr, flush=True)
                figures[quality][group][clip.video.stem] = errors_of_clip(
                    body, clip, count, quality
                )
    print(errors_table(figures), end="\n\n", flush=True)
    return figures


def errors_of_clip(body: Body, clip: Clip, count: int, quality: str) -> list[Pair]:
    """Capture some frames of a clip as images; return the errors of every person in each."""
    with np.load(clip.truth) as file:
        truth = {key: file[key] for key in file.files}
    known = np.arange(truth["limbs"].shape[1]) if clip.is_scene else truth["frame_index"]
    chosen = known[np.linspace(0, len(known) - 1, count + 2).astype(int)[1:-1]]
    options = CaptureOptions(quality=quality, people=len(truth["limbs"]) if clip.is_scene else 1)
    found: list[Pair] = []
    for frame, image in frames_as_images(clip.video, chosen.tolist()):
        try:
            motions = [
                replace(each, frames=np.array([frame]))
                for each in capture(image, body, options).motions
            ]
        except NoPersonError:
            motions = []
        found += (
            _scene_errors(body, motions, clip, truth, frame)
            if clip.is_scene
            else [_errors(motions, clip)]
        )
    return found


def frames_as_images(video: Path, frames: Sequence[int]) -> Iterator[tuple[int, Path]]:
    """Write some frames of a clip to lossless images, one at a time; yield their indices and the
    image's path.

    :raises ValueError: the clip has no such frame.
    """
    reader = cv2.VideoCapture(str(video))
    with tempfile.TemporaryDirectory() as folder:
        for index in range(max(frames) + 1):
            ok, image = reader.read()
            if not ok:
                raise ValueError(f"{video} has no frame {index}")
            if index in frames:
                path = Path(folder) / f"{index}.png"
                cv2.imwrite(str(path), image)
                yield index, path


def errors_table(figures: dict[str, dict[str, dict[str, list[Pair]]]]) -> str:
    """Return means over clips with 95 % intervals, medians over people, and how many were not
    found.

    :param figures: by preset, group and clip.
    """
    rows = []
    for quality, groups in figures.items():
        for group, clips in groups.items():
            people = [pair for each in clips.values() for pair in each]
            missed = int(np.isnan(people).any(axis=1).sum()) if people else 0
            cells = *_mean_and_median(clips, 0), *_mean_and_median(clips, 1)
            rows.append([f"{quality}, {group}", len(people), *cells, missed])
    names = ("MPJPE-root mm", "median", "PA-MPJPE mm", "median")
    return table(("preset, images", "people", *names, "not found"), rows)


def _mean_and_median(clips: dict[str, list[Pair]], k: int) -> tuple[str, str]:
    """Return the mean over clips of their people who were found, and the median over these
    people.
    """
    found = [
        each[np.isfinite(each)]
        for each in (np.reshape(pairs, (-1, 2))[:, k] for pairs in clips.values())
    ]
    found = [each for each in found if len(each)]
    if not found:
        return "", ""
    return mean_over_people(
        [float(each.mean()) for each in found]
    ).text, f"{np.median(np.concatenate(found)):.1f}"


def _errors(motions: list[Motion], clip: Clip) -> Pair:
    if not motions:
        return np.nan, np.nan
    figures = evaluate_motion(motions[0], clip.truth)
    return float(figures["mpjpe_root"]), float(figures["pa_mpjpe"])


def _scene_errors(
    body: Body, motions: list[Motion], clip: Clip, truth: dict[str, Any], frame: int
) -> list[Pair]:
    """Return the errors of the people of a scene of whom something can be seen in a frame."""
    results = score_people(body, motions, clip.video.stem, truth)
    visible = [
        r for r, hidden in zip(results, truth["hidden"][:, frame], strict=True) if not hidden.all()
    ]
    return [(float(r.mpjpe_root[frame]), float(r.pa_mpjpe[frame])) for r in visible]


def _groups() -> dict[str, list[Clip]]:
    """Return the clips of each group that are there."""
    pose2sim = DATA / "pose2sim"
    groups = {
        "Pose2Sim": [
            Clip(pose2sim / f"{name}.mp4", pose2sim / f"truth_{name}.npz") for name in CAMERAS
        ]
    }
    groups["sample"] = _rendered([ASSETS / "sample" / "sample.mp4"])
    groups["renders"] = _rendered(RENDERS.glob("*.mp4"))
    for split in SPLITS:
        groups[f"scenes, {split}"] = _rendered(FOLDER.glob(f"{split}_*.mp4"), is_scene=True)
    return {name: clips for name, clips in groups.items() if clips}


def _rendered(videos: Iterable[Path], is_scene: bool = False) -> list[Clip]:
    """Return the videos that have ground truth beside them."""
    clips = [
        Clip(video, video.with_name(f"{video.stem}_truth.npz"), is_scene)
        for video in sorted(videos)
    ]
    return [clip for clip in clips if clip.truth.is_file()]
