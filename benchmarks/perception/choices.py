# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench choices`: cross-validate weights and thresholds over cameras.

Every weight, deviation or share that was chosen by measuring is set to values around the shipped
one. For each of the four pose2sim cameras in turn, the value that is best for the other three is
evaluated on the camera that was left out and compared with the shipped value. A value that is
overfitted to the clips on which it was chosen loses there.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.fitting import prepared_track
from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.perception import lifter
from ...scope_addon.capture.world import balance, stance
from ...scope_addon.kinematics import standing
from ...solver import load_body
from ..frames import DATA
from ..report import table
from .accuracy import CAMERAS, evaluate_camera


@dataclass(frozen=True)
class Choice:
    """A constant of the pipeline, ``module.name`` or its field ``field``, and alternative
    values.
    """

    what: str
    module: ModuleType
    name: str
    others: tuple[float, ...]
    field: str = ""

    @property
    def shipped(self) -> float:
        """The shipped value."""
        value = getattr(self.module, self.name)
        return float(getattr(value, self.field) if self.field else value)

    @contextmanager
    def set_to(self, value: float) -> Iterator[None]:
        """Set another value while the context lasts."""
        before: Any = getattr(self.module, self.name)
        setattr(
            self.module, self.name, replace(before, **{self.field: value}) if self.field else value
        )
        try:
            yield
        finally:
            setattr(self.module, self.name, before)


CHOICES = (
    Choice("weight of 2D keypoints", prepared_track, "WEIGHTS", (5e4, 2e5), "keypoints2d"),
    Choice("weight of 3D keypoints", prepared_track, "WEIGHTS", (2.5, 25.0), "keypoints3d"),
    Choice(
        "weight of the orientation field",
        prepared_track,
        "WEIGHTS",
        (250.0, 1000.0),
        "orientation_field",
    ),
    Choice("weight of the joint prior", prepared_track, "WEIGHTS", (2.0, 8.0), "joint_prior"),
    Choice("weight of the shape prior", prepared_track, "WEIGHTS", (1.0, 10.0), "shape"),
    Choice(
        "weight of the floor under standing feet", prepared_track, "WEIGHTS", (5e3, 2e4), "floor"
    ),
    Choice("share lifted with world landmarks", lifter, "WORLD_SHARE", (0.5, 1.0)),
    Choice("speed at which balance is doubted, m/s", balance, "STANDING_M_S", (0.25, 1.0)),
    Choice("deviation of feet from the floor, m", stance, "FLOOR_SIGMA_M", (0.015, 0.06)),
    Choice("depth error that a still foot may have, m", standing, "WRONG_DEPTH_M", (0.2, 0.8)),
)


def left_out(errors: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the value that the other cameras choose, and its error on the camera left out.

    :param errors: (V, C) error with each value on each camera.
    :return: (C,) index of the value and (C,) its error.
    """
    others = (errors.sum(axis=1, keepdims=True) - errors) / (errors.shape[1] - 1)
    chosen = others.argmin(axis=0)
    return chosen, errors[chosen, np.arange(errors.shape[1])]


def choices(quick: bool) -> dict[str, Any]:
    """Measure all choices (``quick``: the first three), print the tables and return the figures."""
    if not DATA.is_dir():
        print(f"{DATA} does not exist: nothing was measured; put the clips there", file=sys.stderr)
        return {}
    body = load_body("scope")

    def errors() -> NDArray[np.float64]:
        found = [evaluate_camera(body, camera, CaptureOptions()) for camera in CAMERAS]
        return np.array([[f["mpjpe_root"], f["pa_mpjpe"]] for f in found])

    shipped = errors()
    print(f"As shipped, MPJPE-root / PA-MPJPE mm: {_each(shipped)}\n", flush=True)
    figures: dict[str, dict[str, Any]] = {"shipped": {"errors": shipped.tolist()}}
    rows = []
    summary = []
    for choice in CHOICES[:3] if quick else CHOICES:
        values = [choice.shipped, *choice.others]
        found = [shipped]
        for value in choice.others:
            with choice.set_to(value):
                found.append(errors())
            rows.append(
                [f"{choice.what}: {value:g} instead of {choice.shipped:g}", *_cells(found[-1])]
            )
        chosen, there = left_out(np.array(found)[:, :, 0])
        named = ", ".join(f"{values[k]:g}" for k in chosen)
        summary.append([choice.what, f"{values[0]:g}", named, shipped[:, 0].mean(), there.mean()])
        figures[choice.what] = {
            "values": values,
            "errors": np.array(found).tolist(),
            "left_out": there.tolist(),
        }
    print(table(("MPJPE-root / PA-MPJPE mm", *CAMERAS, "mean"), rows), end="\n\n")
    head = (
        "choice",
        "shipped",
        "chosen without each camera",
        "shipped, MPJPE-root mm",
        "chosen, on those left out",
    )
    print(table(head, summary), end="\n\n", flush=True)
    return figures


def _cells(errors: NDArray[np.float64]) -> list[str]:
    return [f"{a:.1f} / {b:.1f}" for a, b in (*errors, errors.mean(axis=0))]


def _each(errors: NDArray[np.float64]) -> str:
    return ", ".join(
        f"{name} {cell}" for name, cell in zip((*CAMERAS, "mean"), _cells(errors), strict=True)
    )
