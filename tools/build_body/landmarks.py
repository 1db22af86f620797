# SPDX-License-Identifier: GPL-3.0-or-later
"""What anthropometers measure, on the source mesh in its own pose (standing, arms at 45 degrees),
metres and kilograms.

Surveys measure skin and bone landmarks; the body has joint centres. Their offsets are fractions of
the stature. Mean joint centres over the stature that result, beside those of Winter (Biomechanics
and Motor Control, figure 4.1) and of de Leva (J. Biomechanics 29, 1996), whose shoulders lie higher
than a joint 3 to 4 cm below the acromion (0.80) would:

    hip centre height       stature − sitting height + 0.0535 stature 0.530  (0.530; 0.531)
    shoulder centre height  acromial height − 0.008 stature         0.812  (0.818; 0.827)
    knee centre height      epicondyle height + 0.005 stature       0.287  (0.285; 0.289)
    shoulder centres apart  biacromial breadth − 0.020 stature      0.210  (0.258, skin)
    hip centres apart       0.1 hip breadth + 0.1045 stature        0.125  (0.191, skin; X-ray 0.10)
    shoulder to elbow       acromion to radiale − 0.029 stature     0.162  (0.186, acromion; 0.162)
    elbow to wrist          radiale to stylion + 0.003 stature      0.154  (0.146; 0.154)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .anthropometry import Measured
from .geometry.mesh import split_quads
from .joints import cube_row
from .keypoints import SURFACE
from .source import SourceMesh

# kg/m³: 985 of a person with air in the lungs; the mesh lacks hair, nails and the inside of the
# mouth
DENSITY = 1000.0
# metres above the hip joints of the base mesh
HIP_BAND = (-0.06, 0.02)
WAIST_BAND = (0.108, 0.126)
WAIST_POINTS = 36
FROM_SURVEY = {  # what is matched -> terms of the survey's measurements
    "stature": {"stature": 1.0},
    "hip": {"stature": 1.0535, "sitting": -1.0},
    "shoulder": {"acromion": 1.0, "stature": -0.008},
    "knee": {"epicondyle": 1.0, "stature": 0.005},
    "shoulders": {"biacromial": 1.0, "stature": -0.020},
    "hip_breadth": {"hip_breadth": 1.0},
    "hips": {"hip_breadth": 0.1, "stature": 0.1045},
    "waist": {"waist": 1.0},
    "upper_arm": {"upper_arm": 1.0, "stature": -0.029},
    "forearm": {"forearm": 1.0, "stature": 0.003},
    "foot": {"foot": 1.0},
    "tragion": {"tragion": 1.0},
    "head_breadth": {"head_breadth": 1.0},
}


def wanted(survey: Measured) -> Measured:
    """Return what the mesh must measure, for each name of ``FROM_SURVEY`` whose terms the survey
    has.
    """
    return {
        name: np.sum([share * survey[term] for term, share in terms.items()], axis=0)
        for name, terms in FROM_SURVEY.items()
        if all(term in survey for term in terms)
    }


@dataclass(frozen=True)
class Landmarks:
    """Rows (M, N) over the source vertices, of which ``measure`` needs the positions; and the
    closed skin.
    """

    rows: NDArray[np.float64]
    at: dict[str, slice]
    skin: NDArray[np.intp]  # (F, 3) triangles

    def measure(self, points: NDArray[np.float64]) -> Measured:
        """Measure people, (n,) each.

        :param points: (n, M, 3) the positions of ``rows``.
        """

        def joint(name: str) -> NDArray[np.float64]:
            return points[:, self.at[name]][:, 0]

        def height(name: str) -> NDArray[np.float64]:
            return joint(name)[:, 1] - joint("bottom")[:, 1]

        def apart(a: str, b: str) -> NDArray[np.float64]:
            return np.linalg.norm(joint(a) - joint(b), axis=1)

        ring = points[:, self.at["waist"]]
        return {
            "stature": height("top"),
            "hip": height("hip"),
            "shoulder": height("shoulder"),
            "knee": height("knee"),
            "shoulders": 2.0 * joint("shoulder")[:, 0],
            "hips": 2.0 * joint("hip")[:, 0],
            "hip_breadth": 2.0 * points[:, self.at["hip_breadth"], 0].max(axis=1),
            "waist": 2.0 * np.linalg.norm(np.diff(ring, axis=1), axis=2).sum(axis=1),
            "upper_arm": apart("shoulder", "elbow"),
            "forearm": apart("elbow", "wrist"),
            "foot": joint("toe")[:, 2] - joint("heel")[:, 2],
            "tragion": joint("top")[:, 1] - joint("ear")[:, 1],
            "head_breadth": 2.0 * points[:, self.at["head_breadth"], 0].max(axis=1),
        }

    def weight(
        self, vertices: NDArray[np.floating]
    ) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return the weights in kg (n,) of the closed skins of ``vertices`` (n, N, 3), and their
        gradients (n, N, 3).

        With triangles a, b, c the volume is Σ a · (b × c) / 6, and its derivative by v half the
        area vector around v.
        """
        a, b, c = (vertices[:, self.skin[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        weight = DENSITY / 6.0 * np.einsum("nfx,nfx->n", a, normals)
        gradient = np.zeros_like(vertices)
        for k in range(3):
            gradient += _sum_at(self.skin[:, k], normals, vertices.shape[1])
        return weight, DENSITY / 6.0 * gradient


def _sum_at(
    index: NDArray[np.intp], values: NDArray[np.floating], count: int
) -> NDArray[np.floating]:
    """Return (n, count, 3): the values (n, F, 3) summed over equal indices (F,)."""
    order = np.argsort(index, kind="stable")
    found, starts = np.unique(index[order], return_index=True)
    out = np.zeros((len(values), count, 3), values.dtype)
    out[:, found] = np.add.reduceat(values[:, order], starts, axis=1)
    return out


def make_landmarks(source: SourceMesh) -> Landmarks:
    """Find the landmarks on the base mesh. Everything is on the left; the mesh is symmetric."""
    V = source.vertices
    faces = source.faces[source.face_group == "body"]
    skin = np.unique(faces)
    left = skin[V[skin, 0] >= -1e-6]
    hip, neck = (V[source.cubes[cube]].mean(axis=0) for cube in ("l-upper-leg", "neck"))
    trunk = left[V[left, 0] < hip[0] + 0.12]
    feet = left[V[left, 1] < 0.05 + V[skin, 1].min()]
    found = {
        "top": [skin[V[skin, 1].argmax()]],
        "bottom": [skin[V[skin, 1].argmin()]],
        "heel": [feet[V[feet, 2].argmin()]],
        "toe": [feet[V[feet, 2].argmax()]],
        "waist": _ring(V, trunk, hip[1] + np.array(WAIST_BAND)),
        "hip_breadth": _band(V, trunk, hip[1] + np.array(HIP_BAND)),
        "head_breadth": [v for v in left if V[v, 1] > neck[1] + 0.17 and not _is_ear(V, v, source)],
    }
    cubes = {
        "hip": "l-upper-leg",
        "knee": "l-knee",
        "shoulder": "l-shoulder",
        "elbow": "l-elbow",
        "wrist": "l-hand",
    }
    rows = {name: cube_row(source, cube)[None] for name, cube in cubes.items()}
    rows |= {name: _one_hot(np.array(vertices), len(V)) for name, vertices in found.items()}
    rows["ear"] = np.zeros((1, len(V)))
    rows["ear"][0, list(SURFACE["left_ear"][0])] = 1.0 / len(SURFACE["left_ear"][0])
    stops = np.cumsum([len(row) for row in rows.values()])
    at = {
        name: slice(stop - len(rows[name]), stop)
        for name, stop in zip(rows, stops.tolist(), strict=True)
    }
    return Landmarks(np.concatenate(list(rows.values())), at, split_quads(faces))


def _one_hot(vertices: NDArray[np.intp], count: int) -> NDArray[np.float64]:
    out = np.zeros((len(vertices), count))
    out[np.arange(len(vertices)), vertices] = 1.0
    return out


def _band(
    V: NDArray[np.float64], among: NDArray[np.intp], heights: NDArray[np.float64]
) -> NDArray[np.intp]:
    return among[(V[among, 1] > heights[0]) & (V[among, 1] < heights[1])]


def _ring(
    V: NDArray[np.float64], among: NDArray[np.intp], heights: NDArray[np.float64]
) -> NDArray[np.intp]:
    """Return the vertices of half a ring around the trunk, from front to back: the outermost one of
    each angle.
    """
    band = _band(V, among, heights)
    middle = V[band].mean(axis=0)
    x = V[band, 0]
    z = V[band, 2] - middle[2]
    angle = np.arctan2(x, z)  # 0 in front, π behind
    edges = np.linspace(0.0, np.pi, WAIST_POINTS // 2 + 1)
    chosen: list[int] = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        inside = np.flatnonzero((angle >= low - 1e-6) & (angle <= high + 1e-6))
        if len(inside):
            best = int(band[inside[np.hypot(x, z)[inside].argmax()]])
            if best not in chosen:
                chosen.append(best)
    return np.array(chosen)


def _is_ear(V: NDArray[np.float64], vertex: int, source: SourceMesh) -> bool:
    ear = V[list(SURFACE["left_ear"][0])].mean(axis=0)
    return bool(np.linalg.norm(V[vertex] - ear) < 0.055)
