# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench ablation`: what each part of the pipeline brings, on Pose2Sim, rendered people
and IoU with masks.

Every clip is observed once, and solved again for each row from the same observations, so that what
a part contributes to the camera's estimate is not in its row. The renders and the development
scenes count as far as they have been made. IoU is of the captured body and the masks that the
capture itself asks for, one in six frames or 16 for longer clips; the clips for it are the four
cameras and those of `outline`. Scenes and other clips of less than four masks have none of the
outline.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scope_addon.capture.fitting.ablation import NO_ABLATION, Ablation
from ..scope_addon.capture.media.video import open_video
from ..scope_addon.capture.options import CaptureOptions
from ..scope_addon.capture.overlay.overlay_video import camera_vertices
from ..scope_addon.capture.perception.observation import PersonMask
from ..scope_addon.capture.pipeline import shot_of
from ..scope_addon.capture.stages.clock import StageClock
from ..scope_addon.capture.stages.footage import Listeners
from ..scope_addon.capture.stages.observe import observe
from ..scope_addon.capture.stages.repair import repair
from ..scope_addon.capture.stages.solve import solve
from ..scope_addon.capture.tracking.track import Track
from ..scope_addon.capture.world.assemble import Shot
from ..scope_addon.errors import NoPersonError
from ..scope_addon.motion import Motion
from ..solver import Body, load_body
from .frames import CLIPS, DATA
from .perception.accuracy import CAMERAS, SHOWN, evaluate_motion
from .perception.outline import MORE_CLIPS, SURE, overlap, silhouette
from .perception.render_shots import RENDERS
from .report import table
from .scenes.accuracy import score_people
from .scenes.scene import DEVELOPMENT, FOLDER
from .scenes.statistics import mean_over_people

ALL_PARTS = "all parts"
ROWS: dict[str, dict[str, Any]] = {
    ALL_PARTS: {},
    "without the outline": {"ablation": Ablation(outline=False)},
    "without a shape: the mean body": {"ablation": Ablation(shape=False)},
    "without the stature's own prior": {"ablation": Ablation(stature=False)},
    "without keypoint offsets": {"ablation": Ablation(keypoint_offsets=False)},
    "without the lifting network": {"ablation": Ablation(lifter=False)},
    "lifting network without world landmarks": {"ablation": Ablation(world_landmarks=False)},
    "without 3D keypoints": {"ablation": Ablation(keypoints3d=False)},
    "without the orientation field": {"ablation": Ablation(orientation_field=False)},
    "without the joint prior": {"ablation": Ablation(joint_prior=False)},
    "without the search for mirrored limbs": {"ablation": Ablation(limb_search=False)},
    "without the body's own surface": {"ablation": Ablation(body_surface=False)},
    "without left-right repair": {"ablation": Ablation(left_right=False)},
    "without keypoint-jump repair": {"ablation": Ablation(keypoint_jumps=False)},
    "without the stance": {"ablation": Ablation(stance=False)},
    "without balance in it": {"ablation": Ablation(balance=False)},
    "without the floor in it": {"ablation": Ablation(floor=False)},
    "without contact": {"ablation": Ablation(contact=False)},
    "without smoothing: every frame alone": {"smoothing": False},
}
QUICK_ROWS = 3
ERRORS = ("mpjpe_root", "pa_mpjpe")
# the figures of a clip's people; None of who was not found
People = Sequence[Mapping[str, float] | None]


@dataclass(frozen=True)
class Observed:
    """The observations of a clip: its people before any repair, and what is known of the
    footage.
    """

    shot: Shot
    tracks: tuple[Track, ...]
    timestamps: NDArray[np.float64]  # (T,) seconds

    def solve(self, ablation: Ablation = NO_ABLATION, smoothing: bool = True) -> list[Motion]:
        """Solve the clip without some parts; most prominent person first."""
        shot = replace(self.shot, ablation=ablation, smoothing=smoothing and self.shot.smoothing)
        given = (track if ablation.outline else replace(track, masks=()) for track in self.tracks)
        repaired = (repair(track, shot.camera, ablation) for track in given)
        motions = solve(shot, repaired, lambda *_: None).motions
        return [replace(motion, timestamps=self.timestamps) for motion in motions]


def observe_clip(
    path: Path, body: Body, people: int | str = CaptureOptions().people
) -> Observed | None:
    """Run the networks of the default preset over a clip; None if nobody was found."""
    options = CaptureOptions(people=people)
    with open_video(path, options.wanted) as video:
        try:
            footage, tracks = observe(
                video, body, options, StageClock(), Listeners(lambda *_: None, lambda *_: None)
            )
        except NoPersonError:
            return None
        return Observed(shot_of(video, body, options, footage), tuple(tracks), footage.timestamps)


def mask_iou(
    body: Body, motion: Motion, masks: Sequence[tuple[int, PersonMask]], size: tuple[int, int]
) -> float:
    """Return the median IoU of a captured body and the masks of its track, each with its row; NaN
    without masks.

    :param size: of the image, width and height.
    """
    found = []
    for row, mask in masks:
        if row < len(motion) and motion.valid[row]:
            vertices = camera_vertices(motion, body, row)
            shape = silhouette(body, vertices, motion.intrinsics, motion.dist, size, mask.region)
            found.append(overlap(shape, mask.probability >= SURE))
    return float(np.median([each["iou"] for each in found if each is not None] or [np.nan]))


def ablation(quick: bool) -> dict[str, Any]:
    """Measure all rows (``quick``: the first three), print the table and return the figures of
    every clip.
    """
    if not DATA.is_dir():
        print(f"{DATA} does not exist: nothing was measured; put the clips there", file=sys.stderr)
        return {}
    body = load_body("scope")
    rows = dict(list(ROWS.items())[: QUICK_ROWS if quick else None])
    clips: dict[str, dict[str, People]] = {}
    for path, truth in _clips():
        print(f"observing {path.stem}", file=sys.stderr, flush=True)
        clips[path.stem] = measure_clip(body, path, truth, rows)
    print(ablation_table(clips, rows), end="\n\n", flush=True)
    return {"clips": clips}


def measure_clip(
    body: Body, path: Path, truth: Path | None, rows: Mapping[str, Mapping[str, Any]]
) -> dict[str, People]:
    """Return the figures of every person of a clip for every row; None for people who were not
    found.

    A figure that the clip does not have is NaN.

    :param truth: of a camera or a render, or of a scene; None: IoU alone.
    """
    scene = _of_scene(path.stem)
    people: int | str = CaptureOptions().people
    if scene and truth is not None:
        with np.load(truth) as data:
            arrays = {key: data[key] for key in data.files}
        people = len(arrays["limbs"])
    observed = observe_clip(path, body, people)
    found: dict[str, People] = {}
    for name, options in rows.items():
        motions = observed.solve(**options) if observed is not None else []
        if scene:
            results = score_people(body, motions, path.stem, arrays)
            found[name] = [
                {key: float(np.nanmean(getattr(r, key))) for key in ERRORS} if r.flips else None
                for r in results
            ]
        elif observed is None:
            found[name] = [None]
        else:
            figures = {
                "iou": mask_iou(
                    body, motions[0], observed.tracks[0].masks, observed.shot.image_size
                )
            }
            if truth is not None:
                errors = evaluate_motion(motions[0], truth)
                # Feet that never stand do not slide.
                figures |= {
                    key: np.nan if errors[key] is None else float(errors[key]) for key in SHOWN
                }
            found[name] = [figures]
    return found


def ablation_table(
    clips: Mapping[str, Mapping[str, People]], rows: Mapping[str, Mapping[str, Any]]
) -> str:
    """Return the means of Pose2Sim's cameras, renders and scenes, and the median IoU, as a Markdown
    table.
    """
    renders, scenes = (
        [name for name in clips if chosen(name)]
        for chosen in (lambda name: (RENDERS / f"{name}.mp4").is_file(), _of_scene)
    )
    others = [name for name in clips if name not in {*renders, *scenes, *CAMERAS}]
    lines = []
    for row in rows:
        cameras = _mean(clips, row, CAMERAS)
        lines.append(
            [
                row,
                _pair(cameras),
                f"{cameras['jitter_rel']:.0f}" if cameras else "–",
                f"{cameras['foot_slide_cm']:.2f}" if cameras else "–",
                _pair(_mean(clips, row, renders)),
                _pair(_mean(clips, row, scenes)),
                _more(clips, row, scenes),
                *(_median_iou(clips, row, some) for some in (CAMERAS, others)),
            ]
        )
    counts = f"{len(renders)} renders", f"{len(scenes)} scenes", "more than with all parts, mm"
    head = ("MPJPE-root / PA-MPJPE mm", "Pose2Sim", "jitter m/s³", "foot sliding cm", *counts)
    return table((*head, "IoU, Pose2Sim", f"IoU, {len(others)} clips"), lines)


def _clips() -> Iterator[tuple[Path, Path | None]]:
    """Yield every clip and its ground truth."""
    for name in CLIPS + MORE_CLIPS:
        path = DATA / name
        truth = path.with_name(f"truth_{path.stem}.npz")
        yield path, truth if truth.is_file() else None
    for path in (*sorted(RENDERS.glob("*.mp4")), *sorted(FOLDER.glob(f"{DEVELOPMENT}_*.mp4"))):
        yield path, path.with_name(f"{path.stem}_truth.npz")


def _of_scene(name: str) -> bool:
    return name.startswith(f"{DEVELOPMENT}_")


def _mean(clips: Mapping[str, Any], row: str, names: Any) -> dict[str, float]:
    people = [
        figures
        for name in names
        if name in clips
        for figures in clips[name][row]
        if figures is not None
    ]
    known = {
        key: [each[key] for each in people if not np.isnan(each[key])]
        for key in (people[0] if people else ())
    }
    return {key: float(np.mean(values)) if values else np.nan for key, values in known.items()}


def _median_iou(clips: Mapping[str, Any], row: str, names: Any) -> str:
    people = [each for name in names if name in clips for each in clips[name][row] if each]
    known = [each["iou"] for each in people if not np.isnan(each.get("iou", np.nan))]
    return f"{np.median(known):.3f}" if known else "–"


def _more(clips: Mapping[str, Any], row: str, names: Sequence[str]) -> str:
    """Return by how much MPJPE-root is larger than with all parts, with a 95 % interval by
    bootstrap over people.
    """
    pairs = [
        (whole["mpjpe_root"], without["mpjpe_root"])
        for name in names
        if ALL_PARTS in clips[name]
        for whole, without in zip(clips[name][ALL_PARTS], clips[name][row], strict=True)
        if whole is not None and without is not None
    ]
    if row == ALL_PARTS or not pairs:
        return ""
    more = mean_over_people([without - whole for whole, without in pairs])
    return f"{more.mean:+.1f} ({more.low:.1f} to {more.high:.1f})"


def _pair(figures: Mapping[str, float]) -> str:
    return f"{figures['mpjpe_root']:.1f} / {figures['pa_mpjpe']:.1f}" if figures else "–"
