# SPDX-License-Identifier: GPL-3.0-or-later
"""A long clip of 1080p captured by the command line, killed on the way, and captured again.

    python -m scope.benchmarks.interrupted [--minutes 60] [--kill-at 0.7] [--window-seconds S]

Two people move there and back again, in a file of 1920 x 1080 at 30 frames a second: a shared clip,
encoded once and its packets repeated. The process group is killed with SIGKILL, and the same
command run again. Prints JSON: times, highest memory of all processes together, what was kept, and
what is right or wrong with the motion. It needs ../shared, and Linux.
"""

from __future__ import annotations

import argparse
import json
import os
import pty
import re
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np

from ..scope_addon.capture.media.video import open_video
from ..scope_addon.edit.clip import Clip, clip_from_motion
from ..scope_addon.motion import Motion
from ..solver import load_body
from .frames import CACHE
from .live.clips import write_video
from .live.observed import there_and_back

ROOT = Path(__file__).resolve().parents[1]
CLIP = ROOT.parent / "shared" / "data" / "clips" / "walk_side_static.mp4"
WHOLE = 150  # frames of it before one of the two people jumps off a roof
WIDTH = 1920
HEIGHT = 1080
FPS = 30
# So that packets can be repeated: no frame is predicted from a later one, and a round begins with a
# key frame.
OPTIONS = {
    "preset": "ultrafast",
    "crf": "26",
    "x264-params": "bframes=0:keyint=120:scenecut=0:open-gop=0",
}
STAGE = "finding the person"
_PROGRESS = re.compile(r"\r\x1b\[K(\w[\w ]*?) +\[[#.]*\] (\d+)/(\d+)(?=\r)")
_INTERVAL_S = 0.5  # between two looks at the memory
_BLOCK = 4096  # frames whose soles are computed at a time


def make_clip(path: Path, frames: int, source: Path = CLIP) -> None:
    """Write some frames of a clip, there and back again: one round is encoded, and its packets are
    repeated.
    """
    with open_video(source) as video:
        images = [
            cv2.resize(frame.image_rgb, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA).astype(
                np.uint8
            )
            for frame in islice(video, WHOLE)
        ]
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        once = Path(folder) / "once.mp4"
        write_video(once, [images[k] for k in there_and_back(len(images))], Fraction(FPS), OPTIONS)
        with av.open(str(path), "w") as target:
            stream = None
            for index in range(0, frames, 2 * len(images) - 2):
                with av.open(str(once)) as round_:
                    stream = stream or target.add_stream_from_template(round_.streams.video[0])
                    _append(target, stream, round_, range(index, frames))


def _append(target: Any, stream: Any, round_: Any, numbers: range) -> None:
    """Append the packets of a round, of which each is one frame, as the frames with these
    numbers.
    """
    packets = (packet for packet in round_.demux(video=0) if packet.size)
    for number, packet in zip(numbers, packets, strict=False):
        packet.stream = stream
        packet.time_base = Fraction(1, FPS)
        packet.pts = packet.dts = number
        packet.duration = 1
        target.mux(packet)


class Run:
    """One run of a command on a terminal of its own, in a process group of its own.

    :param kill_at: share of the frames after which everything is killed with SIGKILL.
    """

    def __init__(
        self, command: list[str], environment: dict[str, str], kill_at: float = np.inf
    ) -> None:
        self._kill_at = kill_at
        self.seen = dict[str, tuple[float, int]]()
        # what was said besides the progress
        self.peak_mib = 0.0
        self.said = ""
        self._began = time.monotonic()
        main, terminal = pty.openpty()
        before_s = _children_s()
        with subprocess.Popen(
            command, env=environment, stderr=terminal, start_new_session=True
        ) as self._process:
            os.close(terminal)
            watcher = threading.Thread(target=self._watch_memory)
            watcher.start()
            self._read(main)
            self.status = self._process.wait()
            watcher.join()
        os.close(main)
        self.seconds = time.monotonic() - self._began
        self.processor_s = _children_s() - before_s

    def _read(self, terminal: int) -> None:
        """Note when each stage began and how far it came, until the terminal is closed."""
        text = ""
        while True:
            try:
                text += os.read(terminal, 1 << 16).decode("utf-8", "replace")
            except OSError:  # the last process with it has ended
                self.said += text.partition("\r\x1b[K")[0]
                return
            for stage, done, total in _PROGRESS.findall(text):
                self._note(stage, int(done), int(total))
            text = _PROGRESS.sub("", text)
            at = max(text.rfind("\r"), 0)  # the last line may not be complete
            self.said = self.said + text[:at]
            text = text[at:]

    def _note(self, stage: str, done: int, total: int) -> None:
        place = time.monotonic() - self._began, done
        self.seen.setdefault(f"{stage} from", place)
        self.seen[stage] = place
        if stage == STAGE and done >= self._kill_at * total:
            # what it had written before is still read, when its group may be gone
            self._kill_at = np.inf
            os.killpg(self._process.pid, signal.SIGKILL)

    def _watch_memory(self) -> None:
        while self._process.poll() is None:
            self.peak_mib = max(self.peak_mib, memory_mib(self._process.pid))
            time.sleep(_INTERVAL_S)


def memory_mib(group: int) -> float:
    """Return the memory that all processes of a group take, MiB: a page that n of them share counts
    1/n for each.
    """
    kib = 0
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if os.getpgid(int(folder.name)) == group:
                lines = (folder / "smaps_rollup").read_text("utf-8").splitlines()
                kib += next((int(line.split()[1]) for line in lines if line.startswith("Pss:")), 0)
        except OSError:  # it has ended
            continue
    return kib / 2**10


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def checked(path: Path, frames: int) -> dict[str, Any]:
    """Return what is right or wrong with a motion file."""
    motion = Motion.load(path)
    body = load_body("scope")
    clip = clip_from_motion(body, motion, raw=False)
    lowest = np.empty(len(motion))
    for begin in range(0, len(motion), _BLOCK):
        part = slice(begin, begin + _BLOCK)
        some = Clip(clip.times[part], clip.rotations[part], clip.root[part])
        lowest[part] = some.soles(body, motion.betas)[..., 2].min(axis=1)
    arrays = (
        motion.poses,
        motion.trans,
        motion.poses_raw,
        motion.trans_raw,
        motion.betas,
        motion.joints_cam,
    )
    return {
        "frames": len(motion),
        "all_frames": motion.frames.tolist() == list(range(frames)),
        "largest_error_of_times_s": float(
            np.abs(motion.timestamps - np.arange(len(motion)) / FPS).max()
        ),
        "finite": all(bool(np.isfinite(array).all()) for array in arrays),
        "valid": float(motion.valid.mean()),
        "stature_m": float(body.stature(motion.betas)),
        "lowest_sole_cm_percentiles_0_1_50_99": [
            round(100 * float(v), 2) for v in np.percentile(lowest, (0, 1, 50, 99))
        ],
        "reprojection_px_median": float(np.median(motion.residual_px[motion.valid])),
    }


def files_below(*folders: Path) -> dict[str, int]:
    """Return the files in folders, with their sizes in bytes."""
    return {
        str(path): path.stat().st_size
        for each in folders
        for path in sorted(each.rglob("*"))
        if path.is_file()
    }


def interrupted(
    clip: Path, frames: int, kill_at: float, folder: Path, given: list[str]
) -> dict[str, Any]:
    """Capture a clip, killed on the way, and again; return the figures.

    :param given: further arguments.
    """
    places = {name: folder / name for name in ("tmp", "caches", "out")}
    for place in places.values():
        place.mkdir()
    environment = dict(os.environ, TMPDIR=str(places["tmp"]), XDG_CACHE_HOME=str(places["caches"]))
    out = places["out"] / "walk.npz"
    command = [
        str(ROOT / "scripts" / "capture"),
        str(clip),
        "--quality",
        "fast",
        "-o",
        str(out),
        *given,
    ]
    figures: dict[str, Any] = {"frames": frames, "load_at_start": os.getloadavg()}
    for name, share in (("killed", kill_at), ("again", np.inf)):
        run = Run(command, environment, share)
        left = files_below(*places.values())
        figures[name] = {
            "status": run.status,
            "seconds": run.seconds,
            "processor_seconds": run.processor_s,
            "peak_mib": run.peak_mib,
            "stages": run.seen,
            "said": run.said[-1000:],
            "left": {
                "files": len(left),
                "windows": sum("windows-" in path for path in left),
                "bytes": sum(left.values()),
            },
            "load": os.getloadavg(),
        }
        print(json.dumps({name: figures[name]}, indent=1), flush=True)
    return figures | {"files_at_the_end": list(left), "motion": checked(out, frames)}


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="interrupted")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument(
        "--kill-at", type=float, default=0.7, help="share of the frames that are tracked"
    )
    parser.add_argument(
        "--window-seconds", type=float, help="for a short clip; two minutes by default"
    )
    args = parser.parse_args()
    given = [] if args.window_seconds is None else ["--window-seconds", f"{args.window_seconds:g}"]
    frames = round(60 * FPS * args.minutes)
    clip = CACHE / f"walk_{WIDTH}x{HEIGHT}_{frames}.mp4"
    if not clip.exists():
        make_clip(clip, frames)
    with tempfile.TemporaryDirectory(dir=CACHE) as folder:
        json.dump(
            interrupted(clip, frames, args.kill_at, Path(folder), given), sys.stdout, indent=1
        )


if __name__ == "__main__":
    main()
