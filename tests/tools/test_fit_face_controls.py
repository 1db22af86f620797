# SPDX-License-Identifier: GPL-3.0-or-later
"""The expression map of MPFB's rig moves its mesh as the shapes that it was fitted to do."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.retarget.face_controls import built_in
from scope.tools.build_body.source import fetch_wheel
from scope.tools.fit_face_controls.amounts import (
    share_shown,
)
from scope.tools.fit_face_controls.default_rig import CHANNELS as OF_DEFAULT_RIG
from scope.tools.fit_face_controls.default_rig import SkinnedFace
from scope.tools.fit_face_controls.shapes import read_shapes

CHANNELS = [("jaw", "pitch"), ("lip.B", "up"), ("lips.L", "left"), ("lips.R", "left")]


def test_mpfbs_map_moves_its_mesh_as_the_shapes_do():
    shapes = read_shapes(fetch_wheel())
    face = SkinnedFace(shapes)
    amounts = built_in("mpfb").controls

    def moved(*names):
        x = [
            sum(amounts.get(b, {}).get(c, {}).get(name, 0.0) for name in names)
            for b, c in OF_DEFAULT_RIG
        ]
        return face.moved(np.array(x))

    for name, least in (("jawOpen", 0.75), ("mouthSmileRight", 0.7), ("mouthPucker", 0.7)):
        assert share_shown(shapes.moves[name][shapes.skin], moved(name)[shapes.skin]) > least
    ends = [shapes.vertices_at(shapes.rigify[f"lid.{row}.L.002"]["head"])[0] for row in "TB"]
    upper, lower = shapes.vertices[ends] + moved("eyeBlinkLeft")[ends]
    assert abs(upper[1] - lower[1]) < 0.05 * np.ptp(shapes.vertices[ends][:, 1])
    lips = [shapes.vertices_at(shapes.rigify[f"lip.{row}.L"]["head"]) for row in "TB"]
    closed = moved("jawOpen", "mouthClose")
    upper, lower = (closed[lip].mean(axis=0) for lip in lips)
    assert np.linalg.norm(upper - lower) < 0.06 * face.frame.mouth
