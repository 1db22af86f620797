# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed edge loops of the quad mesh, the borders between materials."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

MAX_LENGTH = 400


class QuadLoops:
    """Finds edge loops: at a vertex with four quads, a loop continues along the opposite edge."""

    def __init__(self, faces: NDArray[np.intp]) -> None:
        """Index the mesh: ``faces`` (F, 4)."""
        self.faces_at: dict[int, list[int]] = defaultdict(list)
        self.quads: list[list[int]] = faces.tolist()
        for f, quad in enumerate(self.quads):
            for v in quad:
                self.faces_at[v].append(f)
        self.face_sets = [frozenset(quad) for quad in self.quads]
        self._ending: set[tuple[int, int]] = set()  # directed edges that lead to a pole or a border

    def neighbours(self, v: int) -> list[int]:
        """Return the vertices that share an edge with ``v``, in ascending order."""
        found = set()
        for f in self.faces_at[v]:
            quad = self.quads[f]
            k = quad.index(v)
            found |= {quad[k - 1], quad[(k + 1) % 4]}
        return sorted(found)

    def walk(self, start: int, second: int) -> list[int] | None:
        """Return the edge loop through an edge as a list of vertices, or None if it meets a pole or
        a border.
        """
        loop = [start, second]
        while len(loop) <= MAX_LENGTH:
            previous, here = loop[-2:]
            ahead = [] if (previous, here) in self._ending else self._ahead(previous, here)
            if len(ahead) != 1:
                self._ending.update(zip(loop, loop[1:], strict=False))
                return None
            if ahead[0] == start:
                return loop
            loop.append(ahead[0])
        return None

    def _ahead(self, previous: int, here: int) -> list[int]:
        """Return the end of the edge opposite to the one from ``previous`` to ``here``, if there is
        just one.
        """
        around = self.faces_at[here]
        if len(around) != 4:
            return []
        beside = set().union(*(self.face_sets[f] for f in around if previous in self.face_sets[f]))
        return [v for v in self.neighbours(here) if v not in beside]

    def nearest(
        self,
        vertices: NDArray[np.float64],
        point: NDArray[np.float64],
        normal: NDArray[np.float64],
        radius: float,
    ) -> list[int]:
        """Return the closed loop around a limb that stays nearest to a plane.

        :param vertices: (V, 3) metres; ``point``, ``normal``: the plane, across the limb at its
            axis.
        :param radius: metres; only loops within this distance of ``point`` count.
        """
        offset = vertices - point
        height = offset @ normal
        candidates = np.flatnonzero(
            (np.abs(height) < 0.03) & (np.linalg.norm(offset, axis=1) < radius)
        )
        best = None
        best_cost = np.inf
        done = set()
        for v in candidates.tolist():
            for other in self.neighbours(v):
                if (v, other) in done or abs(height[v] - height[other]) > 0.02:
                    continue
                loop = self.walk(v, other)
                if loop is None:
                    continue
                round_trip = loop[1:] + loop[:1]
                done |= set(zip(loop, round_trip, strict=True)) | set(
                    zip(round_trip, loop, strict=True)
                )
                ring = offset[loop]
                across = ring - np.outer(ring @ normal, normal)
                angles = np.unwrap(np.arctan2(*(across @ _plane_axes(normal)).T))
                turns_around = abs(angles[-1] - angles[0]) > np.pi
                cost = np.abs(height[loop]).mean()
                if (
                    turns_around
                    and np.linalg.norm(ring, axis=1).max() < radius
                    and cost < best_cost - 1e-9
                ):
                    best = loop
                    best_cost = cost
        if best is None:
            raise ValueError(f"no closed edge loop within {radius} m of {np.round(point, 3)}")
        return best

    def beyond(self, loop: list[int], seed: int) -> NDArray[np.bool_]:
        """Return (F,) bool: the faces reached from face ``seed`` without crossing ``loop``."""
        border = {frozenset(edge) for edge in zip(loop, loop[1:] + loop[:1], strict=True)}
        reached = np.zeros(len(self.quads), bool)
        queue = [seed]
        reached[seed] = True
        while queue:
            quad = self.quads[queue.pop()]
            for k in range(4):
                edge = frozenset((quad[k - 1], quad[k]))
                if edge in border:
                    continue
                for f in self.faces_at[quad[k]]:
                    if not reached[f] and edge <= self.face_sets[f]:
                        reached[f] = True
                        queue.append(f)
        return reached


def _plane_axes(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return two axes (3, 2) that span the plane."""
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)], axis=1)
