# SPDX-License-Identifier: GPL-3.0-or-later
"""HDR frames (HLG, PQ) as SDR images, as a screen of BT.709 and gamma 2.4 shows them.

FFmpeg in PyAV's packages has no zscale, its libplacebo needs a GPU where there is one, and
swscale's own conversion takes eight times as long as the one to RGB. Here, 8-bit RGB passes one
table for all channels and one matrix:

    table:   code -> light on a screen of 1000 cd/m² -> tone curve of ITU-R BT.2390, to `WHITE` ->
             code of gamma 2.4
    matrix:  primaries of BT.2020 or P3 -> BT.709; for HLG also from one gamma per channel to that
             of the luminance

The matrix is that for linear light, but multiplies codes. This is exact for greys, and to the first
order near them; skin is off by up to 6 of 255, saturated colours are by more.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, cast

import cv2
import numpy as np

from ...arrays import Float64Array, Uint8Array

if TYPE_CHECKING:
    import av


# The reference white in cd/m² (ITU-R BT.2408), which becomes the brightest light of SDR.
WHITE = 203.0
PEAK = 1000.0  # cd/m² from which on everything is white
SDR_GAMMA = 2.4  # of the screen (ITU-R BT.1886)
HLG_GAMMA = 1.2  # system gamma of HLG for a screen of `PEAK` (ITU-R BT.2100)
# Code points of ITU-T H.273, which FFmpeg uses.
# transfer characteristics
_PQ = 16
_HLG = 18
# The matrix coefficients; others are taken for BT.2020's.
_YUV_MATRICES = {1: "ITU709", 5: "ITU601", 6: "ITU601"}
_LUMINANCE = np.array([0.2627, 0.6780, 0.0593])  # of the primaries of BT.2020
# BT.2087
_2020_TO_709 = np.array(
    [[1.6605, -0.5876, -0.0729], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1188]]
)
# From the chromaticities of SMPTE RP 431-2 and EG 432-1; the white of DCI-P3 becomes D65, by
# Bradford's adaptation.
_DCI_P3_TO_709 = np.array(
    [[1.1575, -0.1550, -0.0025], [-0.0415, 1.0456, -0.0041], [-0.0181, -0.0786, 1.0967]]
)
_P3_D65_TO_709 = np.array(
    [[1.2249, -0.2249, 0.0], [-0.0421, 1.0421, 0.0], [-0.0196, -0.0786, 1.0982]]
)
# Primaries; others are taken for BT.2020's.
_TO_709 = {1: np.eye(3), 11: _DCI_P3_TO_709, 12: _P3_D65_TO_709}


def hdr_rgb(frame: av.VideoFrame) -> Uint8Array | None:
    """Convert a frame whose transfer characteristic is HLG or PQ to SDR; None for all other frames.

    :return: (H, W, 3) uint8 RGB.
    """
    transfer = frame.color_trc
    if transfer not in (_PQ, _HLG):
        return None
    yuv = _YUV_MATRICES.get(int(frame.colorspace), "BT2020")
    coded = frame.to_ndarray(format="rgb24", src_colorspace=yuv, dst_colorspace=yuv)
    toned = cv2.LUT(coded, _table(transfer))
    return cast(Uint8Array, cv2.transform(toned, _matrix(transfer, int(frame.color_primaries))))


@cache
def _table(transfer: int) -> Uint8Array:
    """Calculate the SDR codes (256,) for the codes of one channel."""
    codes = np.linspace(0.0, 1.0, 256)
    light = pq_light(codes) if transfer == _PQ else PEAK * hlg_light(codes) ** HLG_GAMMA
    return cast(
        Uint8Array, np.rint(255 * (compress(light) / WHITE) ** (1 / SDR_GAMMA)).astype(np.uint8)
    )


@cache
def _matrix(transfer: int, primaries: int) -> Float64Array:
    """Return the matrix (3, 3) for codes of the table; its rows add up to 1."""
    to_709 = _TO_709.get(primaries, _2020_TO_709)
    if transfer == _PQ:
        return to_709
    # The luminance's power of gamma - 1 acts on all channels alike; the table has given each
    # channel its own.
    system_gamma = (np.eye(3) + (HLG_GAMMA - 1) * np.tile(_LUMINANCE, (3, 1))) / HLG_GAMMA
    return cast(Float64Array, to_709 @ system_gamma)


def hlg_light(code: Float64Array) -> Float64Array:
    """Return the scene's light, 0 to 1, for HLG codes (...) from 0 to 1: the inverse OETF of ITU-R
    BT.2100.
    """
    a = 0.17883277
    b = 0.28466892
    c = 0.55991073
    return np.where(code <= 0.5, code**2 / 3, (np.exp((code - c) / a) + b) / 12)


# Constants of PQ.
_M1 = 2610 / 16384
_M2 = 2523 / 32
_C1 = 3424 / 4096
_C2 = 2413 / 128
_C3 = 2392 / 128


def pq_light(code: Float64Array) -> Float64Array:
    """Return the screen's light in cd/m² for PQ codes (...) from 0 to 1: the EOTF of SMPTE ST
    2084.
    """
    power = code ** (1 / _M2)
    return cast(Float64Array, 1e4 * (np.maximum(power - _C1, 0) / (_C2 - _C3 * power)) ** (1 / _M1))


def pq_code(light: Float64Array) -> Float64Array:
    """Return the PQ code for light (...) in cd/m², the inverse of `pq_light`."""
    power = (light / 1e4) ** _M1
    return cast(Float64Array, ((_C1 + _C2 * power) / (1 + _C3 * power)) ** _M2)


def compress(light: Float64Array) -> Float64Array:
    """Compress light (...) of up to `PEAK` to at most `WHITE`, both in cd/m²: the EETF of ITU-R
    BT.2390.

    In PQ codes, as shares of the peak's: the identity up to a knee, from there a cubic Hermite
    spline, which arrives level at the new maximum.
    """
    peak = pq_code(np.array(PEAK))
    share = np.minimum(pq_code(light) / peak, 1.0)
    largest = pq_code(np.array(WHITE)) / peak
    knee = 1.5 * largest - 0.5
    t = (share - knee) / (1 - knee)
    spline = (
        (2 * t**3 - 3 * t**2 + 1) * knee
        + (t**3 - 2 * t**2 + t) * (1 - knee)
        + (3 * t**2 - 2 * t**3) * largest
    )
    return pq_light(np.where(share < knee, share, spline) * peak)
