# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile what a capture and its corrections need, before the first one.

Most computers need this only while an extension is built: its machine code comes with it. Where
none does (another processor or Python), it runs once in the background, after the extension has
been enabled.
"""

from __future__ import annotations

import gc

import numpy as np

from ...solver.body_file import ASSETS
from ..capture.fitting.rasterizer import fill_silhouette
from ..capture.media.video_range import VideoRange
from ..capture.options import CaptureOptions
from ..capture.pipeline import capture
from ..clock import Progress
from ..edit.corrected_motion import with_corrections
from ..edit.corrections import Pin
from ..machine_code.code_cache import compiled_kernels
from ..untrusted.body_file import load_body
from .preview import load_rasterizer
from .request import ROOT

_GARBAGE = 10_000, 20, 20  # objects between two searches, and searches between two thorough ones
_SECONDS = 0.3  # of the sample clip: a few frames, so that every stage has its work


def warm_up(progress: Progress) -> int:
    """Capture the beginning of the sample clip and correct it; return how many kernels had to be
    compiled.

    From then on, this process looks for garbage less often: it took a twelfth of the time of
    compiling.

    :raises ScopeError: the sample cannot be captured.
    """
    gc.freeze()
    gc.set_threshold(*_GARBAGE)
    load_rasterizer()
    # of the preset best
    fill_silhouette(np.zeros((1, 1), np.bool_), np.zeros((1, 2)), np.zeros((0, 3), np.int32))
    options = CaptureOptions(quality="fast", wanted=VideoRange(end_s=_SECONDS), threads=1)
    body = load_body("scope")
    motion = capture(ASSETS / "sample" / "sample.mp4", body, options, progress).motions[0]
    pins = (Pin(0, "left_wrist", position=(0.5, 0.0, 1.2)), Pin(0, "right_ankle", pixel=(0.0, 0.0)))
    with_corrections(motion, body, pins)
    return compiled_kernels(ROOT)
