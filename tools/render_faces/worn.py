# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person wears on the face: glasses, or a beard."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from .beard import Beard, grow_beard
from .glasses import STYLES, Mesh, glasses

Triple = tuple[float, float, float]
Faces = list[tuple[int, ...]]

# Linear colour, how much of the light is stopped, roughness, and whether it is metal.
WORN: dict[str, tuple[Triple, float, float, bool]] = {
    "thin frame": ((0.35, 0.33, 0.3), 1.0, 0.3, True),
    "thick frame": ((0.012, 0.01, 0.01), 1.0, 0.35, False),
    "clear lenses": ((0.9, 0.9, 0.9), 0.06, 0.03, True),
    "dark lenses": ((0.006, 0.006, 0.007), 1.0, 0.08, False),
    "beard": ((0.0, 0.0, 0.0), 1.0, 0.6, False),  # in the hair's colour
}


@dataclass(frozen=True)
class Worn:
    """Meshes by their materials' names: those that keep their form, and hairs, which move with the
    skin.
    """

    rigid: dict[str, Mesh]
    beard: Beard | None = None

    @property
    def faces(self) -> dict[str, Faces]:
        """Return the faces of each mesh."""
        hairs = {} if self.beard is None else {"beard": self.beard.faces}
        return {name: mesh.faces for name, mesh in self.rigid.items()} | hairs

    def vertices(self, face: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return the vertices of each mesh on a face (V, 3) with an expression; metres, model
        frame.
        """
        hairs = {} if self.beard is None else {"beard": self.beard.vertices(face)}
        return {name: mesh.vertices for name, mesh in self.rigid.items()} | hairs


def put_on(what: str, body: Body, face: NDArray[np.float64], rng: np.random.Generator) -> Worn:
    """Fit a style of glasses, or a beard, to a face (V, 3) at rest; metres, model frame."""
    if not what:
        return Worn({})
    if what == "beard":
        return Worn({}, grow_beard(body, rng))
    style = STYLES[what]
    parts = glasses(STYLES[what], body, face)
    frame = "thin frame" if what == "thin glasses" else "thick frame"
    return Worn(
        {frame: parts["frame"], "dark lenses" if style.dark else "clear lenses": parts["lenses"]}
    )
