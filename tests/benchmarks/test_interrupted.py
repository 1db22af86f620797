# SPDX-License-Identifier: GPL-3.0-or-later
"""The clip that is captured, and the run that is killed, by what they do to a few frames and a
small program.
"""

from __future__ import annotations

import sys
from pathlib import Path

import av
import numpy as np
import pytest

pytest.importorskip("pty", reason="the benchmark reads a terminal")
from scope.benchmarks import interrupted
from scope.scope_addon.capture.media.video import open_video

from ..job.processes import wait_for

PROGRAM = """
import subprocess, sys, time
from scope.scope_addon.command_line.terminal import ProgressBar
code = "import time; x = b'x' * 50_000_000; print('in', flush=True); time.sleep(600)"
child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
child.stdout.readline()
print("a warning", file=sys.stderr)
bar = ProgressBar(sys.stderr, show=sys.stderr.isatty())
bar("reading", 3, 3)
for k in range(1, 101):
    bar("finding the person", k, 100)
    if k == int(sys.argv[1]):
        time.sleep(600)
child.kill()
"""


def test_a_clip_goes_there_and_back_again_at_an_even_rate(tmp_path: Path) -> None:
    source = tmp_path / "source.mp4"
    greys = [40, 90, 140, 190]
    with av.open(str(source), "w") as target:
        stream = target.add_stream("libx264", rate=30)
        stream.width = 64
        stream.height = 36
        stream.pix_fmt = "yuv420p"
        for grey in greys:
            image = np.full((36, 64, 3), grey, np.uint8)
            target.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        target.mux(stream.encode())
    clip = tmp_path / "clip.mp4"
    interrupted.make_clip(clip, 15, source)
    with open_video(clip) as video:
        assert (video.width, video.height, video.frame_count) == (1920, 1080, 15)
        frames = list(video)
    np.testing.assert_allclose(
        [frame.timestamp_s for frame in frames], np.arange(15) / 30, atol=1e-6
    )
    expected = [greys[k] for k in (0, 1, 2, 3, 2, 1, 0, 1, 2, 3, 2, 1, 0, 1, 2)]
    np.testing.assert_allclose([frame.image_rgb.mean() for frame in frames], expected, atol=4)
    with open_video(clip) as video:
        assert next(video.frames_from(8 / 30)).image_rgb.mean() == pytest.approx(140, abs=4)


class RunThatIsWatched(interrupted.Run):
    """It is not killed before the memory of its child was seen, which happens twice a second."""

    def _note(self, stage: str, done: int, total: int) -> None:
        if done >= 40:
            wait_for(lambda: self.peak_mib > 50)
        super()._note(stage, done, total)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_a_run_is_killed_with_its_children_at_a_share_of_the_frames() -> None:
    environment = {"PYTHONPATH": ":".join(sys.path)}
    run = RunThatIsWatched([sys.executable, "-c", PROGRAM, "60"], environment, kill_at=0.4)
    assert run.status == -9
    assert run.seen["finding the person from"][1] == 1
    assert 40 <= run.seen["finding the person"][1] < 60
    assert run.seen["reading"][1] == 3
    assert run.said.strip() == "a warning"
    whole = interrupted.Run([sys.executable, "-c", PROGRAM, "0"], environment)
    assert whole.status == 0
    assert whole.seen["finding the person"][1] >= 99  # what follows the last number is no line
