# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames in HDR and of two fields, and files of them, made with PyAV."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from ....required import package

av = package("av")
# transfer characteristics of ITU-T H.273
PQ = 16
HLG = 18
BT2020 = 9  # primaries, and matrix of YUV


def coded_frame(
    code: np.ndarray, transfer: int, bits: int = 10, matrix: int = BT2020, primaries: int = BT2020
):
    """Make a frame 4:4:4 from R'G'B' codes (H, W, 3) from 0 to 1, by the equations of ITU-R
    BT.2020, video range.
    """
    y = code @ np.array([0.2627, 0.6780, 0.0593])
    planes = (
        219 * y + 16,
        224 * (code[..., 2] - y) / 1.8814 + 128,
        224 * (code[..., 0] - y) / 1.4746 + 128,
    )
    frame = av.VideoFrame(code.shape[1], code.shape[0], "yuv444p10le" if bits == 10 else "yuv444p")
    for plane, values in zip(frame.planes, planes, strict=True):
        kind = np.uint16 if bits == 10 else np.uint8
        rows = np.zeros((plane.height, plane.line_size // kind().itemsize), kind)
        rows[:, : plane.width] = np.rint(values * 2 ** (bits - 8))
        plane.update(rows.tobytes())
    frame.color_trc = transfer
    frame.color_primaries = primaries
    frame.colorspace = matrix
    frame.color_range = 1
    return frame


def with_fields(pictures: list[np.ndarray], order: str = "tff", pixels: str = "yuv420p") -> list:
    """Make frames marked as interlaced, each of two successive pictures (H, W, 3) uint8.

    :param order: "tff", if the even lines are filmed first, or "bff".
    """
    frames = []
    for first, second in zip(pictures[::2], pictures[1::2], strict=True):
        woven = second.copy()
        start = 0 if order == "tff" else 1
        woven[start::2] = first[start::2]
        frames.append(av.VideoFrame.from_ndarray(woven, format="rgb24").reformat(format=pixels))
    return marked(frames, order)


def marked(frames: list, order: str) -> list:
    """Return copies of frames that say "tff", "bff" or "prog"; frame k is shown at k / 25 s."""
    graph = av.filter.Graph()
    buffer = graph.add_buffer(template=frames[0], time_base=Fraction(1, 25))
    graph.link_nodes(buffer, graph.add("setfield", order), graph.add("buffersink")).configure()
    result = []
    for k, frame in enumerate(frames):
        frame.pts = k
        frame.time_base = Fraction(1, 25)
        graph.vpush(frame)
        result.append(graph.vpull())
    return result
