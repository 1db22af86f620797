# SPDX-License-Identifier: GPL-3.0-or-later
"""Live captures on a simulated machine, whose frames take a known time, whatever else this one
does.

A frame comes when it is due, and the newest one is taken that the pace allows, as in a live
capture. Its networks and fit then take `Costs.frame_s`, more or less, and each call of the largest
network `Costs.largest_s` in addition. While estimates or the reference network run beside it,
everything takes `Costs.shared` times as long, and what they find is known when they are done. So
the pattern of processed frames is the same in every run; only the clock is simulated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.camera.intrinsics import choose_camera
from ...scope_addon.capture.media.video import open_video
from ...scope_addon.capture.perception.landmark_network import LandmarkNetwork, PoseEstimate
from ...scope_addon.capture.perception.observation import Observation
from ...scope_addon.capture.perception.region import Region
from ...scope_addon.capture.tracking.tracker import PeopleTracker
from ...scope_addon.live.newest_frame import Pace
from ...scope_addon.live.people import LivePeople
from ...scope_addon.live.recording import Recording
from ...scope_addon.live.run import Statistics
from ...scope_addon.live.source import FileSource
from ...scope_addon.motion import Motion
from ...solver import Body


@dataclass(frozen=True)
class Costs:
    """Seconds that a machine of two cores without a graphics card takes beside decoding 1080p at 60
    frames/s.
    """

    frame_s: float = 0.0185
    spread: float = 0.12  # standard deviation of its logarithm
    largest_s: float = 0.042
    reference_s: float = 0.06  # in the background, as the next one
    estimate_s: float = 0.1
    first_estimate_s: float = 0.3  # in the first frame
    shared: float = 1.5


class EveryFrame(Pace):
    """No pace: whichever frame is the newest."""

    def is_due(self, time_s: float) -> bool:
        """See `Pace`."""
        return True


class _Later(Future[Any]):
    """A result that is known from a time of the simulated clock on."""

    def __init__(self, machine: _Machine, due_s: float, result: Any) -> None:
        super().__init__()
        self._machine = machine
        self._due_s = due_s
        self.set_result(result)

    def done(self) -> bool:
        return self._machine.now_s >= self._due_s


class _Machine(Executor):
    """The simulated clock, and the executor of the estimates, whose results come later."""

    def __init__(self, costs: Costs) -> None:
        self._costs = costs
        self._random = np.random.default_rng(1)
        self.now_s = self._busy_until_s = 0.0
        self._largest_calls = 0
        self._is_first = True

    def submit(self, function: Any, /, *args: Any, **named: Any) -> Future[Any]:
        return self.later(self._costs.estimate_s, function(*args, **named))

    def later(self, seconds: float, result: Any) -> Future[Any]:
        """Return a result that takes some seconds in the background."""
        self._busy_until_s = max(self.now_s, self._busy_until_s) + seconds
        return _Later(self, self._busy_until_s, result)

    def call_largest(self) -> None:
        """Note that the frame has asked the largest network."""
        self._largest_calls += 1

    def spend(self) -> float:
        """Let the time of a frame pass, and return it."""
        costs = self._costs
        seconds = costs.frame_s * float(np.exp(self._random.normal(0.0, costs.spread)))
        seconds += costs.largest_s * self._largest_calls
        seconds *= costs.shared if self.now_s < self._busy_until_s else 1.0
        seconds += costs.first_estimate_s if self._is_first else 0.0
        self._largest_calls = 0
        self._is_first = False
        self.now_s += seconds
        return seconds


class _Counted:
    """The largest network, whose calls count."""

    def __init__(self, network: LandmarkNetwork, machine: _Machine) -> None:
        self._network = network
        self._machine = machine

    def estimate(
        self, image_rgb: NDArray[np.uint8], regions: Sequence[Region]
    ) -> list[PoseEstimate]:
        self._machine.call_largest()
        return self._network.estimate(image_rgb, regions)


class _Tracker:
    """A tracker whose reference network answers by the simulated clock."""

    def __init__(self, tracker: PeopleTracker, machine: _Machine, costs: Costs) -> None:
        networks = tracker._networks
        if networks.fallback is not None:
            counted = cast(LandmarkNetwork, _Counted(networks.fallback, machine))
            tracker._networks = replace(networks, fallback=counted)
        self._tracker = tracker
        self._machine = machine
        self._costs = costs

    def step(
        self, image_rgb: NDArray[np.uint8], upcoming_rgb: None, time_s: float
    ) -> list[tuple[int, Observation]]:
        """See `PeopleTracker.step`."""
        return [
            (k, self._answered(o)) for k, o in self._tracker.step(image_rgb, upcoming_rgb, time_s)
        ]

    def _answered(self, observation: Observation) -> Observation:
        if (reference := observation.reference_landmarks) is None:
            return observation
        later = self._machine.later(self._costs.reference_s, reference.result())
        return replace(observation, reference_landmarks=later)


def simulated(
    body: Body,
    video: Path,
    quality: str,
    make_pace: Callable[[], Pace] = Pace,
    costs: Costs | None = None,
) -> tuple[Motion, dict[str, Any]]:
    """Return the recording of a video played in real time on a simulated machine, and how many
    poses there were.

    :param make_pace: of the frames.
    """
    costs = costs or Costs()
    machine = _Machine(costs)
    pace = make_pace()
    statistics = Statistics()
    received = 0
    source = FileSource(video)
    recording = Recording(Path(), body, source)
    tracker = cast(PeopleTracker, _Tracker(PeopleTracker(quality, 1), machine, costs))
    with open_video(video) as footage:
        size = footage.width, footage.height
        camera = choose_camera(*size, metadata_focal_mm=footage.focal_35mm)
        people = LivePeople(body, tracker, camera, size, executor=machine)
        recording.begin(people.sessions[0], size)
        newest = None
        for frame in footage:
            if newest is not None and frame.timestamp_s > machine.now_s:
                pace.take(newest.timestamp_s)
                recording.send(people.step(newest)[0], 0.0)
                pace.add_duration(machine.spend())
                statistics.add(newest.timestamp_s, machine.now_s)
                newest = None
            received += 1
            machine.now_s = (
                max(machine.now_s, frame.timestamp_s) if newest is None else machine.now_s
            )
            newest = frame if pace.is_due(frame.timestamp_s) else newest
    assert recording.camera is not None
    median_ms, p95_ms = statistics.latency_ms()
    told = {
        "poses": statistics.poses,
        "dropped": received - statistics.poses,
        "poses_per_second": statistics.rate,
        "latency_ms": {"median": median_ms, "p95": p95_ms},
    }
    return recording.motion(recording.camera), told
