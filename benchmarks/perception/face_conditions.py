# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces under hard conditions: the same people do the same, and one thing differs at a time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.perception.face_record import parts
from ...scope_addon.capture.tracking.expression_fit import fitted
from ...scope_addon.capture.tracking.expression_motion import expression_motion
from ...tools.calibrate_face.observe import SeenFaces, seen_faces
from ...tools.render_faces.truth import SIZE, WIDTH_M
from ..report import table
from .faces import SHOWN, Found, faces, measure, render_missing, rows_of, smoothed

FACE_M = 0.155  # from the hairline to the chin, on average of the people
CONDITIONS: tuple[tuple[str, str, float], ...] = (  # label, set, face in pixels; 0: as rendered
    ("plain", "talk_plain", 0.0),
    ("60 pixels", "talk_plain", 60.0),
    ("40 pixels", "talk_plain", 40.0),
    ("turned by 45° to 60°", "talk_turned_away", 0.0),
    ("head in motion", "talk_in_motion", 0.0),
    ("thin glasses", "talk_thin_glasses", 0.0),
    ("thick frames", "talk_thick_glasses", 0.0),
    ("thick frames, reflections, Cycles", "talk_reflections", 0.0),
    ("dark glasses", "talk_dark_glasses", 0.0),
    ("beard", "talk_beard", 0.0),
)
LONG = "talk_half_minute"
PIECE_S = 5.0


def faces_and_conditions(quick: bool) -> dict[str, Any]:
    """Print and return the figures of `faces`, and unless ``quick``, those by condition."""
    figures = faces(quick)
    return figures if quick else figures | {"by condition": conditions()}


def conditions() -> dict[str, Any]:
    """Render what is missing, measure the capture by condition, print the table, return the figures
    by condition.
    """
    figures: dict[str, Any] = {}
    for label, name, pixels in CONDITIONS:
        render_missing(name)
        scale = pixels * WIDTH_M / (FACE_M * SIZE) if pixels else 1.0
        seen = seen_faces(name, scale)
        figures[label] = measure(seen, scale, _capture) | _confidence(seen, scale)
    render_missing(LONG)
    seen = seen_faces(LONG)
    for label, piece in (
        ("30 s in one piece", seen),
        ("the same in pieces of 5 s", in_pieces(seen, PIECE_S)),
    ):
        figures[label] = measure(piece, 1.0, _capture) | _confidence(piece, 1.0)
    keys = [key for key in SHOWN if key != "rest"]
    columns = ("condition", *(SHOWN[key] for key in keys), "confidence", "size, px")
    rows = [
        [label, *(row[key] for key in (*keys, "confidence", "size"))]
        for label, row in figures.items()
    ]
    print(table(columns, rows), end="\n\n", flush=True)
    return figures


def in_pieces(seen: SeenFaces, seconds: float) -> SeenFaces:
    """Return a set in which every piece of so many seconds counts as another person's clip."""
    piece = (seen.truth["seconds"] / seconds + 1e-6).astype(int)
    person = seen.truth["person"] * (piece.max() + 1) + piece
    return replace(seen, truth=seen.truth | {"person": person})


def _capture(rows: NDArray[np.float64], times: NDArray[np.float64]) -> Found:
    return smoothed(fitted(rows), times)


def _confidence(seen: SeenFaces, scale: float) -> dict[str, float]:
    """Return the mean confidence, and the mean size of the box of the landmarks in pixels."""
    person = seen.truth["person"]
    sure = np.empty(len(seen.presence))
    size = np.empty(len(seen.presence))
    for p in np.unique(person):
        rows = np.flatnonzero(person == p)
        found = rows_of(seen, rows, scale)
        sure[rows] = expression_motion(found, seen.truth["seconds"][rows], smoothing=True)[
            "expression_confidence"
        ]
        size[rows] = parts(found)[1]
    return {"confidence": float(sure.mean()), "size": float(size.mean())}
