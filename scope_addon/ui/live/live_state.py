# SPDX-License-Identifier: GPL-3.0-or-later
"""The running live capture, the message of the last one, and what cameras have told. Never
saved.
"""

from __future__ import annotations

from typing import Any, ClassVar


class _State:
    """The running live capture, the message of the last one, and what cameras have told."""

    job: Any = None  # a LiveJob; named here, its module would import this one again
    asking: Any = None  # a FormatsProcess, while a camera is asked for its formats
    cameras: ClassVar[dict[int, Any]] = {}  # that were asked, each a Camera, by number
    scene_uid = 0  # of the scene that the job or the message belongs to
    message = ""  # why the last live capture failed


state = _State()


def stop_job() -> None:
    """End the process in any state; the scene stays as it is."""
    if state.job is not None:
        state.job.close()
    state.job = None
