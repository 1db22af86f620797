# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench ablation`: what each part of the pipeline brings, on Pose2Sim, rendered people
and IoU with masks.

Every clip is observed once, and solved again for each row from the same observations, with a part
of the product replaced from here; so what a part contributes to the camera's estimate is not in its
row. The renders and the development scenes count as far as they have been made. IoU is of the
captured body and the masks that the capture itself asks for, one in six frames or 16 for longer
clips; the clips for it are the four cameras and those of `outline`. Scenes and other clips of less
than four masks have none of the outline.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from ..scope_addon.capture import repair as repair_module
from ..scope_addon.capture import solve as solve_module
from ..scope_addon.capture.fitting import prepared_track
from ..scope_addon.capture.fitting.frame_measurements import DEPTH_SIGMA_M, Measurer
from ..scope_addon.capture.fitting.prepared_track import Stance
from ..scope_addon.capture.fitting.stature import FIXED, with_population
from ..scope_addon.capture.fitting.weights import WEIGHTS
from ..scope_addon.capture.media.video import open_video
from ..scope_addon.capture.observe import observe
from ..scope_addon.capture.options import CaptureOptions
from ..scope_addon.capture.overlay_video import camera_vertices
from ..scope_addon.capture.perception.lifter import Lifted, default_lifter, windows_around
from ..scope_addon.capture.perception.observation import PersonMask
from ..scope_addon.capture.pipeline import shot_of
from ..scope_addon.capture.repair import repair
from ..scope_addon.capture.solve import solve
from ..scope_addon.capture.tracking.track import Track
from ..scope_addon.capture.world import clip_fit
from ..scope_addon.capture.world import stance as stance_module
from ..scope_addon.capture.world.assemble import Shot
from ..scope_addon.capture.world.clip_window import ClipWindow
from ..scope_addon.capture.world.placement import PlacedTrack
from ..scope_addon.clock import StageClock
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

# An attribute of a module or class of the product, and what stands there instead.
Replacement = tuple[ModuleType | type, str, Any]


def _weights(**changed: Any) -> tuple[Replacement, ...]:
    """Return the replacement of the solver's weights by ones of which some differ."""
    return ((prepared_track, "WEIGHTS", replace(WEIGHTS, **changed)),)


def landmarks_as_lifted(
    measurer: Measurer, track: Track, pixels: NDArray[np.floating[Any]], scale: float
) -> Lifted:
    """Return the landmark network's world landmarks in place of the lifting network's points."""
    sigma = np.full(track.confidence.shape, DEPTH_SIGMA_M)
    return Lifted(track.world_landmarks, sigma, sigma).scaled(scale)


def _lift_without_landmarks(
    measurer: Measurer, track: Track, pixels: NDArray[np.floating[Any]], scale: float
) -> Lifted:
    """Return the points of the lifting network, which is given the keypoints in the image alone."""
    windows = windows_around(track.times, track.seen)
    rays = measurer.rays(pixels)
    return default_lifter().lift(rays, track.confidence, None, windows).scaled(scale)


def _upright(
    placed: PlacedTrack, *_: Any
) -> tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]]:
    """Return rotations (T, 3, 3) that leave a body as it is, and the points (T, 3) about which."""
    frames = len(placed.root)
    return np.broadcast_to(np.eye(3), (frames, 3, 3)), np.zeros((frames, 3))


def _stance_without(field: str) -> Replacement:
    """Return the replacement of the stance by one in which an array of it is zero everywhere."""

    def stance_on_ground(*given: Any) -> Stance:
        stance = stance_module.stance_on_ground(*given)
        return replace(stance, **{field: np.zeros_like(getattr(stance, field))})

    return solve_module, "stance_on_ground", stance_on_ground


def _as_given(first: Any, *_: Any) -> Any:
    return first


WITHOUT_OFFSETS: Replacement = (prepared_track, "with_keypoint_offsets", _as_given)
LANDMARKS_AS_LIFTED: Replacement = (prepared_track, "lift", landmarks_as_lifted)
ALL_PARTS = "all parts"
ROWS: dict[str, dict[str, Any]] = {
    ALL_PARTS: {},
    "without the outline": {"outline": False},
    "without a shape: the mean body": {"replacements": _weights(shape=FIXED)},
    "without the stature's own prior": {
        "replacements": ((prepared_track, "with_unknown_stature", with_population),)
    },
    "without keypoint offsets": {"replacements": (WITHOUT_OFFSETS,)},
    "without the lifting network": {"replacements": (LANDMARKS_AS_LIFTED,)},
    "lifting network without world landmarks": {
        "replacements": ((prepared_track, "lift", _lift_without_landmarks),)
    },
    "without 3D keypoints": {"replacements": _weights(keypoints3d=0.0)},
    "without the orientation field": {"replacements": _weights(orientation_field=0.0)},
    "without the joint prior": {"replacements": _weights(joint_prior=0.0)},
    "without the search for mirrored limbs": {
        "replacements": ((clip_fit, "search_limbs", lambda *_: None),)
    },
    "without the body's own surface": {
        "replacements": ((ClipWindow, "with_body_surface", lambda window, *_: (window, False)),)
    },
    "without left-right repair": {
        "replacements": (
            (repair_module, "repair_left_right", _as_given),
            (repair_module, "repair_limb_swaps", _as_given),
        )
    },
    "without keypoint-jump repair": {
        "replacements": ((repair_module, "repair_keypoint_jumps", _as_given),)
    },
    "without the stance": {"replacements": ((solve_module, "ground_all", lambda *_: None),)},
    "without balance in it": {"replacements": ((stance_module, "balancing_rotations", _upright),)},
    "without the floor in it": {"replacements": (_stance_without("contact"),)},
    "without contact": {
        "replacements": (
            _stance_without("resting"),
            (solve_module, "raise_body", _as_given),
        )
    },
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

    def solve(
        self,
        replacements: Sequence[Replacement] = (),
        outline: bool = True,
        smoothing: bool = True,
    ) -> list[Motion]:
        """Solve the clip with some parts replaced; most prominent person first.

        :param outline: False: the people's masks are left out.
        :param smoothing: False: every frame is fitted alone.
        """
        shot = replace(self.shot, smoothing=smoothing and self.shot.smoothing)
        given = self.tracks if outline else [replace(track, masks=()) for track in self.tracks]
        with replaced(replacements):
            repaired = [repair(track, shot.camera) for track in given]
            motions = solve(shot, repaired, lambda *_: None).motions
        return [replace(motion, timestamps=self.timestamps) for motion in motions]


@contextmanager
def replaced(replacements: Sequence[Replacement]) -> Iterator[None]:
    """Let other things stand in some places of the product within the context.

    :raises AttributeError: the product has no such place.
    """
    with ExitStack() as stack:
        for owner, name, value in replacements:
            stack.enter_context(mock.patch.object(owner, name, value))
        yield


def observe_clip(
    path: Path, body: Body, people: int | str = CaptureOptions().people
) -> Observed | None:
    """Run the networks of the default preset over a clip; None if nobody was found."""
    options = CaptureOptions(people=people)
    with open_video(path, options.wanted) as video:
        try:
            footage, tracks = observe(
                video, body, options, StageClock(), lambda *_: None, lambda *_: None
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
