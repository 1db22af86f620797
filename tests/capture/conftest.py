# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames of the real clips, read by plain OpenCV and not by the code under test; exact lifting."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.benchmarks.ablation import LANDMARKS_AS_LIFTED, replaced
from scope.scope_addon.arrays import Float64Array, Uint8Array
from scope.scope_addon.capture.observe import ObserveFrames, observe_in_one_pass
from scope.scope_addon.capture.perception.region import Region

Frames = Callable[..., Iterator[np.ndarray]]


@pytest.fixture(scope="session")
def frames(shared: Path) -> Frames:
    """``frames("clips/NAME", stop=None, every=1, start=0)``: RGB frames in order, one of ``every``
    from ``start``.
    """

    def read(
        name: str, stop: int | None = None, every: int = 1, start: int = 0
    ) -> Iterator[np.ndarray]:
        video = cv2.VideoCapture(str(shared / "data" / f"{name}.mp4"))
        video.set(cv2.CAP_PROP_POS_FRAMES, start)
        index = start
        while stop is None or index < stop:
            if not video.grab():
                assert index > start, f"{name} cannot be read"
                return
            # the others are decoded, but not converted
            if (index - start) % every == 0:
                ok, image = video.retrieve()
                assert ok
                yield cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
            index += 1

    return read


class RememberedEstimates(dict[bytes, Float64Array]):
    """Estimates of the landmark networks by what these were given."""

    def key(self, network: str, crop_rgb: Uint8Array, region: Region) -> bytes:
        return repr((network, region)).encode() + crop_rgb.tobytes()

    def find(self, key: bytes) -> Float64Array | None:
        return self.get(key)

    def add(self, key: bytes, values: Float64Array) -> None:
        self[key] = values


@pytest.fixture(scope="module")
def observe_frames() -> ObserveFrames:
    """For captures of the same frames: the networks run in the first one alone."""
    return partial(observe_in_one_pass, memory=RememberedEstimates())


@pytest.fixture(scope="module")
def exact_lifting() -> Iterator[None]:
    """World landmarks, which are exact in made tracks, replace the lifting network's points."""
    with replaced([LANDMARKS_AS_LIFTED]):
        yield


@pytest.fixture(scope="session")
def first_frame(frames: Frames) -> Callable[..., np.ndarray]:
    """``first_frame("clips/NAME", skip=0)``."""
    return lambda name, skip=0: next(frames(name, start=skip))
