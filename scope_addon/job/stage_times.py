# SPDX-License-Identifier: GPL-3.0-or-later
"""How long each stage of the last captures took, by the kind of capture, for the remaining time of
the next one.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

_WHAT = "stage times"
_FILE = "times.json"
_SETTINGS = (
    "quality",
    "hands",
    "face",
    "people",
    "body",
    "provider",
    "threads",
)  # on which the time of a frame depends
_MAX_KINDS = 50
_LONGEST_S = 86_400.0  # that a stage may take for a frame


def kind_of(values: Mapping[str, Any]) -> str:
    """Return the kind of a capture with these options: those of one kind take about as long for
    each frame.
    """
    return " ".join(f"{name}={values[name]}" for name in _SETTINGS if name in values)


def load_stage_times(folder: Path, kind: str) -> dict[str, float]:
    """Return the seconds for each frame of every stage of the last capture of a kind; empty if
    there was none.

    :param folder: of the cache.
    """
    times: object = _read(folder).get(kind)
    return dict(times) if isinstance(times, dict) and _are_times(times) else {}


def save_stage_times(folder: Path, kind: str, seconds: Mapping[str, float], frames: int) -> None:
    """Note how long a capture took, if the folder can be written to.

    :param seconds: of each stage, of all frames.
    """
    from ...solver.errors import ScopeError
    from ..json_file import save_map

    if frames < 1:
        return
    kinds = {
        name: times for name, times in _read(folder).items() if name != kind and _are_times(times)
    }
    kinds[kind] = {stage: duration / frames for stage, duration in seconds.items()}
    with suppress(ScopeError, OSError):
        save_map(folder / _FILE, _WHAT, kinds=dict(list(kinds.items())[-_MAX_KINDS:]))


def _read(folder: Path) -> dict[str, Any]:
    from ...solver.errors import ScopeError
    from ..json_file import load_map

    with suppress(ScopeError, OSError):
        kinds = load_map(folder / _FILE, _WHAT).get("kinds")
        return kinds if isinstance(kinds, dict) else {}
    return {}


def _are_times(times: object) -> bool:
    return isinstance(times, dict) and all(
        type(seconds) in (int, float) and 0 <= seconds <= _LONGEST_S for seconds in times.values()
    )
