# SPDX-License-Identifier: GPL-3.0-or-later
"""How loud a video is, moment by moment, in a few bands of frequency."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...arrays import Float32Array, Float64Array
from ...errors import VideoError
from .frame_readers import film_of, open_with_pyav

RATE_HZ = 16000
STEP = 32  # samples between two moments
STEP_S = STEP / RATE_HZ
_WINDOW = 256  # samples, 16 ms
# Bounds of the bands in hertz: without the hum below, and what codecs of phones leave out above.
_BANDS_HZ = (125.0, 500.0, 1000.0, 2000.0, 4000.0, 7000.0)
_CHUNK = 1 << 18  # samples that are analysed at once
_SILENCE = 1e-9  # power below which nothing is louder than something else
_LONGEST_GAP_S = 60.0  # without samples, from which on the rest of the sound is not used


def loudness(path: Path) -> Float32Array | None:
    """Return the logarithm of the power (T, bands) of a video's sound, every `STEP_S` from the
    video's first image on; None where it has no sound that can be decoded.
    """
    opened = open_with_pyav(path)[1]
    if opened is None:
        return None
    with opened as container:
        try:
            film = film_of(path, container)
        except VideoError:
            return None
        start_s = float((film.start_time or 0) * (film.time_base or 0))
        chunks = [_powers(part) for part in _overlapping(_samples(container, start_s))]
    powers = np.concatenate(chunks) if chunks else np.zeros((0, len(_BANDS_HZ) - 1))
    if not len(powers) or powers.max() <= _SILENCE:
        return None
    return np.log(powers + _SILENCE).astype(np.float32)


def _samples(container, start_s: float) -> Iterator[Float32Array]:  # type: ignore[no-untyped-def]
    """Iterate over the sound, mono, from a time on; gaps are silent, and damage ends it."""
    import av

    stream = next((each for each in container.streams.audio if each.codec_context), None)
    if stream is None:
        return
    resampler = av.AudioResampler(format="flt", layout="mono", rate=RATE_HZ)
    done = 0  # samples
    try:
        for frame in container.decode(stream):
            if frame.time is None:
                return
            position = round((frame.time - start_s) * RATE_HZ)
            for resampled in resampler.resample(frame):
                sound = resampled.to_ndarray()[0]
                missing = position - done
                if missing > _LONGEST_GAP_S * RATE_HZ:
                    return
                if missing > STEP:
                    yield np.zeros(missing, np.float32)
                    done += missing
                # Sound before the first image.
                early = min(max(-position, 0), len(sound)) if done == 0 else 0
                yield sound[early:]
                done += len(sound) - early
                position += len(sound)
    except (av.error.FFmpegError, OSError, ValueError):
        return


def _overlapping(parts: Iterator[Float32Array]) -> Iterator[Float32Array]:
    """Join samples to chunks of which each begins where windows of the one before still end."""
    rest = np.zeros(0, np.float32)
    waiting: list[Float32Array] = []
    count = 0
    for part in parts:
        waiting.append(part)
        count += len(part)
        if count >= _CHUNK:
            chunk = np.concatenate([rest, *waiting])
            used = (len(chunk) - _WINDOW) // STEP * STEP + STEP
            rest = chunk[used:]
            waiting = []
            count = 0
            yield chunk
    chunk = np.concatenate([rest, *waiting])
    if len(chunk) >= _WINDOW:
        yield chunk


def _powers(samples: Float32Array) -> Float64Array:
    """Return the power (n, bands) of windows of samples (N,), every `STEP`."""
    windows = np.lib.stride_tricks.sliding_window_view(samples, _WINDOW)[::STEP]
    spectrum = np.fft.rfft(windows * np.hanning(_WINDOW).astype(np.float32), axis=1)
    power = np.square(np.abs(spectrum)) / _WINDOW
    hertz = np.fft.rfftfreq(_WINDOW, 1.0 / RATE_HZ)
    bands = zip(_BANDS_HZ[:-1], _BANDS_HZ[1:], strict=True)
    each = [power[:, (hertz >= low) & (hertz < high)].mean(axis=1) for low, high in bands]
    return np.stack(each, axis=1)
