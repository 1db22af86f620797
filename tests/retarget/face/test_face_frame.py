# SPDX-License-Identifier: GPL-3.0-or-later
"""Axes and lengths of a face by its bones at rest, whatever the rig, its size and how it is
turned.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.retarget.face_controls import RestBone, measure_face
from scope.solver.errors import InputError

# Looks along -y, with the person's left along +x, as Blender's characters do; metres.
EYES = ((0.03, 0.0, 1.70), (-0.03, 0.0, 1.70))
MOUTH = ((0.02, -0.01, 1.62), (-0.02, -0.01, 1.62))
LIDS = ((0.03, -0.01, 1.706), (0.03, -0.01, 1.694))
NAMES = [
    ("ORG-eye.L", "ORG-eye.R", "lips.L", "lips.R"),
    ("ORG-eye.L", "ORG-eye.R", "lip_end.L.001", "lip_end.R.001"),
    ("eye.L", "eye.R", "levator05.L", "levator05.R"),
]


def bones(
    names: tuple[str, ...], size: float = 1.0, R: np.ndarray | None = None
) -> dict[str, RestBone]:
    places = zip((*names, "lid.T.L.002", "lid.B.L.002"), (*EYES, *MOUTH, *LIDS), strict=True)
    turned = np.eye(3) if R is None else R
    return {name: RestBone(size * turned @ np.array(place), turned) for name, place in places}


@pytest.mark.parametrize("names", NAMES)
def test_axes_are_left_up_and_forward_of_the_person(names: tuple[str, ...]) -> None:
    frame = measure_face(bones(names))
    up = np.array([0.0, 0.01, 0.08]) / np.hypot(0.01, 0.08)  # from the mouth to the eyes
    np.testing.assert_allclose(frame.axes[:, 0], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(frame.axes[:, 1], up, atol=1e-12)
    assert frame.axes[1, 2] < -0.99
    assert (frame.mouth, frame.eyes, frame.lids) == pytest.approx((0.04, 0.06, 0.012))


def test_controls_are_moved_by_the_length_of_what_is_around_them() -> None:
    frame = measure_face(bones(NAMES[0]))
    lengths = {
        name: frame.length(name)
        for name in ("lid.T.L", "brow.T.R.001", "nose.L", "lips.R", "jaw_master")
    }
    expected = {
        "lid.T.L": 0.012,
        "brow.T.R.001": 0.06,
        "nose.L": 0.06,
        "lips.R": 0.04,
        "jaw_master": 0.04,
    }
    assert lengths == pytest.approx(expected)


def test_faces_that_cannot_be_measured_say_why() -> None:
    for missing, says in (("ORG-eye.R", "eyes"), ("lips.L", "corners of the mouth")):
        with pytest.raises(InputError, match=f"no bones for the {says}"):
            measure_face({name: bone for name, bone in bones(NAMES[0]).items() if name != missing})
    with pytest.raises(InputError, match="in one place"):
        measure_face(bones(NAMES[0], 0.0))
