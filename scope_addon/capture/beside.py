# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done in threads of its own while the networks are loaded and look at the frames.

From the start, everything is loaded that the solver needs: its kernels (on a new machine they are compiled) and the
lifting network. Then each frame's background is looked at; as soon as somebody has been seen, also the background's
edges, for the focal length. What comes out of it depends on the frames, not on how fast the threads are.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType

from .bars import longer_side_between
from .camera import Camera
from .camera_motion import BackgroundTracker
from .focal_length import better_camera
from .live_body import LiveBody
from .observation import Observation
from .video import Frame

_THREADS = 3  # one for each of the above: a solver that is still compiled holds up no background


class BesideTracking:
    """Takes frames in order. Leaving it on an error, such as a cancel, drops what has not begun; no thread stays."""

    def __init__(self, camera: Camera, width: int, height: int, live: LiveBody) -> None:
        self.background = BackgroundTracker(camera, width, height)
        self._given_camera, self._size = camera, (width, height)
        self._pool = ThreadPoolExecutor(_THREADS, "scope-beside")
        self._looking: Future[None] | None = None
        self._camera: Future[Camera] | None = None
        self._pool.submit(live.load)

    def __enter__(self) -> BesideTracking:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        # Not waited for: on a new machine the solver compiles for a while, and whoever needs it then waits by himself.
        self._pool.shutdown(wait=False, cancel_futures=kind is not None)

    def add(self, frame: Frame, people: list[Observation], is_cut: bool = False) -> None:
        """Begin with this frame, the first of a scene if ``is_cut``.

        Waits for the background of the one before, and raises what went wrong there.
        """
        self.wait()
        points = [o.keypoints_px for o in people]
        self._looking = self._pool.submit(self.background.add, frame.image_rgb, frame.timestamp_s, points, is_cut)

    def wait(self) -> None:
        """Until the frames so far have been looked at."""
        if self._looking is not None:
            self._looking.result()
        if self._camera is None and self.background.has_looked:
            self._camera = self._pool.submit(self._better_camera)

    def camera(self) -> Camera:
        """The camera, with the focal length that the background tells if it was only assumed."""
        return self._camera.result() if self._camera is not None else self._given_camera

    def _better_camera(self) -> Camera:
        longer_px = longer_side_between(self.background.bars, *self._size)
        return better_camera(self._given_camera, self.background.segments, *self._size, longer_px)
