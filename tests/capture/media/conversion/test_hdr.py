# SPDX-License-Identifier: GPL-3.0-or-later
"""HDR to SDR: values of the standards' tables, tags, and files as phones write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.media.frame_readers import rgb
from scope.scope_addon.capture.media.hdr import compress, hdr_rgb, pq_code
from scope.scope_addon.capture.media.video import open_video

from ....required import need_encoder
from ..made_video import write_film
from .made_frames import HLG, PQ, coded_frame

# Codes for light in cd/m² on a screen of 1000 cd/m², from tables of ITU-R BT.2408 and BT.2100.
LEVELS = {
    PQ: {0.0: 0.0, 26.0: 0.38, 203.0: 0.58, 1000.0: 0.7518},
    HLG: {0.0: 0.0, 26.0: 0.38, 203.0: 0.75, 1000.0: 1.0},
}


def converted(frame) -> np.ndarray:
    image = hdr_rgb(frame)
    assert image is not None
    return image


def grey(code: float, transfer: int, **tags: int):
    return coded_frame(np.full((8, 8, 3), code), transfer, **tags)


def test_the_curves_are_those_of_the_standards() -> None:
    light = np.array([0.0, 100.0, 1000.0, 10000.0])
    np.testing.assert_allclose(pq_code(light), [7.3e-7, 0.508078, 0.751827, 1.0], atol=1e-6)
    np.testing.assert_allclose(
        compress(np.array([0.0, 50.0, 1000.0, 9000.0])), [0.0, 50.0, 203.0, 203.0], atol=1e-6
    )
    slope = np.diff(compress(np.linspace(0, 1000, 2001)))
    assert (slope > 0).all()  # highlights stay distinct
    assert np.abs(np.diff(slope)).max() < 0.02  # the knee is no edge


@pytest.mark.parametrize(("transfer", "bits"), [(PQ, 10), (HLG, 8)])
def test_greys_have_the_light_that_they_stand_for(transfer: int, bits: int) -> None:
    shown = {
        light: converted(grey(code, transfer, bits=bits))
        for light, code in LEVELS[transfer].items()
    }
    for image in shown.values():
        assert image.dtype == np.uint8
        assert np.ptp(image) <= 1  # grey, and even
    assert shown[0.0].max() == 0
    # under the knee
    assert shown[26.0].mean() == pytest.approx(255 * (26 / 203) ** (1 / 2.4), abs=3)
    assert 225 < shown[203.0].mean() < 240  # leaves room for highlights
    assert shown[1000.0].min() >= 254


# Codes of SDR: skins, grass, jeans, and BT.709's red, which BT.2020 holds well inside.
COLOURS = (
    np.array(
        [[217, 158, 128], [140, 89, 64], [76, 46, 31], [96, 120, 70], [60, 80, 120], [200, 30, 30]]
    )
    / 255
)
# ITU-R BT.2087
TO_2020 = np.array([[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]])


def as_hdr(sdr: np.ndarray, transfer: int, from_709: np.ndarray = TO_2020) -> np.ndarray:
    """Calculate the codes that show SDR colours with white at 203 cd/m²: inverses of what is
    tested, in full.
    """
    light = 203 * sdr**2.4 @ from_709.T
    if transfer == PQ:
        power = (light / 1e4) ** 0.1593017578125
        return ((0.8359375 + 18.8515625 * power) / (1 + 18.6875 * power)) ** 78.84375
    screen = light / 1000
    luminance = screen @ np.array([0.2627, 0.6780, 0.0593])
    scene = screen * np.maximum(luminance, 1e-9)[..., None] ** (1 / 1.2 - 1)
    logarithm = 0.17883277 * np.log(np.maximum(12 * scene - 0.28466892, 1e-9)) + 0.55991073
    return np.where(scene <= 1 / 12, np.sqrt(3 * scene), logarithm)


@pytest.mark.parametrize("transfer", [PQ, HLG])
def test_colours_come_back(transfer: int) -> None:
    patches = np.repeat(as_hdr(COLOURS, transfer), 8, 0)[None].repeat(4, 0)
    error = converted(coded_frame(patches, transfer))[2, 4::8] - 255 * COLOURS
    assert np.abs(error[:-1]).max() < 9, error.round()
    assert np.abs(error[-1]).max() < 40, error.round()


# whites
D65 = (0.3127, 0.3290)
DCI = (0.314, 0.351)
SDR_PRIMARIES = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))  # chromaticities of BT.709
P3_PRIMARIES = ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060))


def xyz(chromaticity: tuple[float, float]) -> np.ndarray:
    x, y = chromaticity
    return np.array([x / y, 1, (1 - x - y) / y])


def to_xyz(primaries: tuple[tuple[float, float], ...], white: tuple[float, float]) -> np.ndarray:
    columns = np.column_stack([xyz(each) for each in primaries])
    return columns * np.linalg.solve(columns, xyz(white))


def adaptation_from_d65(white: tuple[float, float]) -> np.ndarray:
    # Bradford
    cones = np.array(
        [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
    )
    return np.linalg.inv(cones) @ np.diag(cones @ xyz(white) / (cones @ xyz(D65))) @ cones


@pytest.mark.parametrize("transfer", [PQ, HLG])
@pytest.mark.parametrize(("primaries", "white"), [(11, DCI), (12, D65)])
def test_colours_of_p3_come_back(transfer: int, primaries: int, white: tuple[float, float]) -> None:
    to_p3 = (
        np.linalg.inv(to_xyz(P3_PRIMARIES, white))
        @ adaptation_from_d65(white)
        @ to_xyz(SDR_PRIMARIES, D65)
    )
    patches = np.repeat(as_hdr(COLOURS, transfer, to_p3), 8, 0)[None].repeat(4, 0)
    error = converted(coded_frame(patches, transfer, primaries=primaries))[2, 4::8] - 255 * COLOURS
    assert np.abs(error[:-1]).max() < 8, error.round()
    assert np.abs(error[-1]).max() < 25, error.round()


@pytest.mark.parametrize("transfer", [1, 2, 15, 17])
def test_other_frames_are_sdr(transfer: int) -> None:
    frame = grey(0.5, transfer)
    assert hdr_rgb(frame) is None
    assert np.array_equal(rgb(frame), frame.to_ndarray(format="rgb24"))


def picture() -> np.ndarray:
    """Codes of SDR: dark at the left, light at the right, and a light corner, so that every
    rotation differs.
    """
    ramp = np.tile(np.linspace(0.1, 0.7, 64)[:, None], (48, 1, 3))
    ramp[:16, :24] = 0.8, 0.6, 0.5
    return ramp


FILES = {
    "phone.mp4": (HLG, "libx265", "yuv420p10le", {"x265-params": "log-level=none:lossless=1"}),
    "eight bits.mp4": (PQ, "libx264", "yuv420p", {"crf": "5"}),
    "tags of the container.webm": (
        PQ,
        "libvpx-vp9",
        "yuv420p",
        {"crf": "5", "deadline": "realtime"},
    ),
    "editor.mov": (HLG, "prores_ks", "yuv422p10le", {}),
}


@pytest.mark.parametrize("name", FILES)
def test_files_show_what_was_filmed(tmp_path: Path, name: str) -> None:
    transfer, codec, pixels, options = FILES[name]
    need_encoder(codec)
    frames = [coded_frame(as_hdr(picture(), transfer), transfer)] * 3
    path = write_film(tmp_path / name, frames, codec, pixels, options=options)
    with open_video(path) as video:
        frames = list(video)
    assert [f.timestamp_s for f in frames] == pytest.approx([0, 0.04, 0.08], abs=1e-3)
    error = np.abs(frames[1].image_rgb - 255 * picture())
    assert np.median(error) < 5, np.median(error)  # swscale rounds down, as it does for SDR
    assert np.percentile(error, 95) < 12, np.percentile(error, 95)
