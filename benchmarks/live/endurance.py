# SPDX-License-Identifier: GPL-3.0-or-later
"""A long live capture: memory, the camera's height over the floor, size and dropped frames over
time.

``played`` plays a repeated file in real time, with a client of the JSON lines, on this machine.
``observed`` goes through as many frames without waiting, from what the networks found in two
rounds: whatever drifts is then the calibration's doing, also for a machine that processes only some
frames per second.
"""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, cast

import numpy as np

from ...scope_addon.capture.camera.intrinsics import choose_camera
from ...scope_addon.capture.media.frame import Frame
from ...scope_addon.capture.media.video import open_video
from ...scope_addon.capture.tracking.tracker import PeopleTracker
from ...scope_addon.cli import SAMPLE
from ...scope_addon.live.json_lines import JsonServer
from ...scope_addon.live.people import LivePeople
from ...scope_addon.live.pose import LivePose, Presence
from ...scope_addon.live.run import Listeners, LiveOptions, LiveProgress, run_live
from ...solver import Body
from .clips import FPS, RepeatedFile, there_and_back_clip
from .observed import Observing, Repeating, there_and_back

QUALITY = "fast"
SLOW_RATE = 4.8  # poses/s of a machine that is busy with other things
UNEVEN = 0.25  # by how much its frames are apart, more or less
# of the rows of the table; 3.5 s: just settled
TIMES_S = (3.5, 10.0, 60.0, 300.0, 900.0, 1800.0, 2700.0, 3600.0)
SETTLED_S = 5.0  # from which on nothing is to drift


class World:
    """Notes the world of the poses of one person, each second.

    :param say: is told of each row of the table.
    """

    def __init__(self, body: Body, say: Callable[[dict[str, float]], None]) -> None:
        self._body = body
        self._say = say
        self.people: LivePeople | None = None
        self.rows: list[dict[str, float]] = []
        self._all: list[dict[str, float]] = []
        self._poses = 0
        self._lost = 0

    def begin(self, people: LivePeople, _size: tuple[int, int]) -> None:
        """Note where the poses come from."""
        self.people = people

    def send(self, pose: LivePose, latency_ms: float) -> None:
        """Note the world of a pose."""
        self._poses += 1
        self._lost += pose.presence is not Presence.SEEN
        if not pose.is_known or (self._all and pose.timestamp_s < self._all[-1]["time_s"] + 1.0):
            return
        assert self.people is not None
        camera = self.people.sessions[0].camera
        up = pose.T_world_camera[2, :3]
        self._all.append(
            {
                "time_s": pose.timestamp_s,
                "poses": self._poses,
                "not_seen": self._lost,
                "memory_mb": memory_mb(),
                "height_m": float(pose.T_world_camera[2, 3]),
                "tilt_deg": float(np.degrees(np.arctan2(np.hypot(up[0], up[2]), -up[1]))),
                "stature_m": float(self._body.stature(pose.betas)),
                "focal_px": float(camera.intrinsics[0, 0]) if camera is not None else float("nan"),
            }
        )
        if len(self.rows) < len(TIMES_S) and pose.timestamp_s >= TIMES_S[len(self.rows)]:
            self.rows.append(self._all[-1])
            self._say(self._all[-1])

    def drift(self) -> dict[str, float]:
        """Return by how much each of the values moved after the first seconds, and of the height
        after a minute.
        """
        late = [row for row in self._all if row["time_s"] >= SETTLED_S]
        if not late:
            return {}
        spans = {
            key: float(np.ptp([row[key] for row in late]))
            for key in ("height_m", "tilt_deg", "stature_m")
        }
        minute = [row["height_m"] for row in late if row["time_s"] >= 60.0]
        return spans | {"height_after_a_minute_m": float(np.ptp(minute)) if minute else 0.0}

    def figures(self) -> dict[str, Any]:
        """Return the rows of the table, the last second, and the drift."""
        return {"rows": [*self.rows, *self._all[-1:]], "drift": self.drift()}


def memory_mb() -> float:
    """Return the memory of this process, MB; NaN on systems that do not tell it as Linux does."""
    path = Path("/proc/self/statm")
    if not path.exists():
        return float("nan")
    return int(path.read_text("utf-8").split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def played(body: Body, minutes: float, say: Callable[[dict[str, float]], None]) -> dict[str, Any]:
    """Play the sample clip there and back in real time, and return the figures."""
    source = RepeatedFile(there_and_back_clip(len(there_and_back(150)) / FPS), 60 * minutes)
    world = World(body, say)
    told = []
    load = []

    def progress(state: LiveProgress) -> None:
        told.append(state)
        load.append(os.getloadavg()[0])

    with ExitStack() as stack:
        server = stack.enter_context(JsonServer(body, "127.0.0.1", 0))
        threading.Thread(target=_read, args=(server.port,), daemon=True).start()
        report = run_live(
            source,
            body,
            LiveOptions(quality=QUALITY),
            [server, world],
            Listeners(progress=progress, camera=world.begin),
        )
    return (
        report
        | world.figures()
        | {"load": float(np.median(load)) if load else None, "cores": os.cpu_count()}
    )


def observed(
    body: Body,
    minutes: float,
    poses_per_second: float | None,
    say: Callable[[dict[str, float]], None],
) -> dict[str, Any]:
    """Go through as many frames without waiting, and return the figures.

    :param poses_per_second: of a slow machine; None: every frame is processed.
    """
    with open_video(SAMPLE) as video:
        pictures = [frame.image_rgb for frame in video]
    order = there_and_back(len(pictures))
    observing = Observing(QUALITY, os.cpu_count() or 1)
    for k in range(2 * len(order)):
        observing.step(pictures[order[k % len(order)]], time_s=k / FPS)
    tracker = Repeating(observing.found)
    size = pictures[0].shape[1], pictures[0].shape[0]
    people = LivePeople(body, cast(PeopleTracker, tracker), choose_camera(*size), size)
    world = World(body, say)
    random = np.random.default_rng(1)
    frame = 0
    world.begin(people, size)
    began_s = time.process_time()
    while frame < 60 * minutes * FPS:
        tracker.seek(frame)
        world.send(
            people.step(Frame(frame, frame / FPS, pictures[order[frame % len(order)]]))[0], 0.0
        )
        step = (
            1.0
            if poses_per_second is None
            else FPS / poses_per_second * random.uniform(1 - UNEVEN, 1 + UNEVEN)
        )
        frame += max(round(step), 1)
    return world.figures() | {
        "poses_per_second": poses_per_second,
        "cpu_s": time.process_time() - began_s,
    }


def _read(port: int) -> None:
    """Read the lines of JSON until they end, as a client does."""
    with socket.create_connection(("127.0.0.1", port)) as client:
        while client.recv(1 << 16):
            pass
