# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of a capture: its figures and its warnings. Standard library only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from .notices import Notice, notice_from


@dataclass(frozen=True)
class Report:
    """What a capture says about itself. An imported or live motion has some of it only.

    ``as_json`` is what ``--json`` prints, what a worker sends and what the cache keeps.
    """

    source: str = ""
    frames: int = 0
    people: int = 0
    valid_frames: int = 0  # of the most prominent person, in which it was seen
    per_person: Sequence[Mapping[str, Any]] = ()
    quality: str = ""
    detector: str = ""
    keypoints: str = ""
    execution: str = ""  # what the networks ran on
    body: str = ""
    camera: str = ""  # where its focal length comes from
    camera_turns_deg: float = 0.0
    camera_travels_m: float = 0.0
    up: str = ""  # where the up direction comes from
    up_deviation_deg: float = 0.0
    focal_px: float = 0.0
    focal_deviation: float = 0.0
    frame_rate: Sequence[int] = (0, 1)  # numerator, denominator
    fps: Mapping[str, float] = field(default_factory=dict)  # frames per second, by stage
    reprojection_px: float = 0.0
    iterations: float = 0.0
    cuts_s: Sequence[float] = ()
    views: Sequence[Mapping[str, Any]] = ()  # of several cameras, each one's clock and place
    warnings: Sequence[Notice] = ()

    def as_json(self) -> dict[str, Any]:
        """Return the report as JSON has it: warnings as sentences, and as records beside."""
        figures = {each.name: getattr(self, each.name) for each in fields(self)}
        return figures | warnings_as_json(self.warnings)

    def placed_videos(self, videos: Sequence[str | Path]) -> list[Path]:
        """Return those of the further videos whose cameras could be placed, which are the further
        cameras of the motions.

        :param videos: all of the capture but the first.
        """
        further = zip(self.views[1:], videos, strict=False)  # a worker may say fewer or more
        return [Path(video) for about, video in further if about["is_used"]]

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Report:
        """Read a report, which may lack anything, and have more."""
        figures = {each.name: content[each.name] for each in fields(cls) if each.name in content}
        warnings = [notice_from(record) for record in content.get("notices", ())]
        return cls(**{**figures, "warnings": warnings})


def warnings_as_json(warnings: Sequence[Notice]) -> dict[str, Any]:
    """Return the keys of a report that have its warnings: sentences, and records beside them."""
    return {
        "warnings": [str(warning) for warning in warnings],
        "notices": [warning.as_json() for warning in warnings],
    }
