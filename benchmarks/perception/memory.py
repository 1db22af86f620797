# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure the memory for an hour of video: a few seconds of tracking are repeated and processed to
the end.

    python -m scope.benchmarks.perception.memory [--frames 108000] [--people 2]

All people are copies of the sample clip's person, each in a different place. The networks of the
default preset stay loaded, as in a capture; their working memory is not included.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from ...scope_addon.capture.camera.intrinsics import choose_camera
from ...scope_addon.capture.camera.line_segments import Lines
from ...scope_addon.capture.media.video import open_video
from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.perception.observation import Observation
from ...scope_addon.capture.solve import return_freed_memory, solve
from ...scope_addon.capture.tracking.left_right import repair_left_right
from ...scope_addon.capture.tracking.people import people_of
from ...scope_addon.capture.tracking.track import Tracklet, make_track
from ...scope_addon.capture.tracking.tracker import PeopleTracker
from ...scope_addon.capture.world.assemble import Shot
from ...scope_addon.capture.world.camera_path import CameraPath
from ...scope_addon.cli import SAMPLE
from ...solver import load_body

APART_PX = 400.0  # from one person to the next


def replay(frames: int, people: int) -> dict[str, float]:
    """Return the highest memory so far, MiB, after each stage."""
    peaks: dict[str, float] = {}
    body = load_body("scope")
    seen = []
    size = (0, 0)
    tracker = PeopleTracker(CaptureOptions().quality, 2)
    with open_video(SAMPLE) as video:
        camera = choose_camera(video.width, video.height)
        size = (video.width, video.height)
        for frame in video:
            seen.append([o for _, o in tracker.step(frame.image_rgb, time_s=frame.timestamp_s)][0])
    tracklets = [Tracklet() for _ in range(people)]
    fps = 30
    peaks["networks"] = peak_mib()
    for k in range(frames):
        for p, tracklet in enumerate(tracklets):
            tracklet.add(k, moved(seen[k % len(seen)], p * APART_PX))
    peaks["tracking"] = peak_mib()
    times = [k / fps for k in range(frames)]
    found = people_of(times, tracklets)[0][:people]
    tracks = [make_track(range(frames), times, person) for person in found]
    del found, tracklets, tracklet, tracker
    return_freed_memory()
    tracks = [repair_left_right(track, camera) for track in tracks]
    shot = Shot(
        body, camera, CameraPath.static(frames), Lines.none(), Fraction(fps), size, SAMPLE.name
    )
    motions = solve(shot, tracks, lambda *_: None).motions
    peaks["solver"] = peak_mib()
    with tempfile.TemporaryDirectory() as folder:
        for k, motion in enumerate(motions):
            motion.save(Path(folder) / f"person{k}.npz")
    peaks["saving"] = peak_mib()
    return peaks


def moved(observation: Observation, pixels: float) -> Observation:
    """Return a copy of an observation, with new arrays as from a tracker, of a person further to
    the right.
    """
    return replace(observation, keypoints_px=observation.keypoints_px + [pixels, 0.0])


def peak_mib() -> float:
    """Return the process's highest resident memory so far, MiB."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**20


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="memory")
    parser.add_argument(
        "--frames", type=int, default=108_000, help="an hour at 30 a second by default"
    )
    parser.add_argument("--people", type=int, default=2)
    args = parser.parse_args()
    for stage, mib in replay(args.frames, args.people).items():
        print(f"{stage:<16}{mib:8.0f} MiB")


if __name__ == "__main__":
    main()
