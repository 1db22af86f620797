# SPDX-License-Identifier: GPL-3.0-or-later
"""The side view shows everybody over the whole motion, and one person as large as ever."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.ui.view import comparison
from scope.scope_addon.ui.view.side_extent import side_extent

from ...edit.walking import BODY, motion_of, walk

# a level view along -x, in which the walk goes along -y
ALONG_X = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], float)


def people(*clips):
    """Return the captured armatures of some clips."""
    motions = [motion_of(clip) for clip in clips]
    found = [person.armature for person in build_scene(motions, BODY, None, BuildOptions()).people]
    for armature in found:
        armature["scope_body_file"] = "scope"
    bpy.context.view_layer.update()
    return found


def test_one_person_is_shown_from_head_to_foot():
    (alone,) = people(walk(1.0))
    assert side_extent(alone, [alone], ALONG_X) == pytest.approx((1.0, 2.6))


def test_the_view_is_wide_enough_for_the_person_who_walks_away():
    """One stays, the other walks 1.2 m/s for 2 s."""
    first, second = people(walk(2.0, speed=0.0), walk(2.0))
    for followed in (first, second):
        width, height = side_extent(followed, [first, second], ALONG_X)
        assert width == pytest.approx(1.0 + 2 * 2.4, abs=0.05)
        assert height == pytest.approx(2.6, abs=0.05)
    second.matrix_world = Matrix.Translation((0.0, 0.0, 1.0)) @ second.matrix_world
    bpy.context.view_layer.update()
    assert side_extent(first, [first, second], ALONG_X)[1] == pytest.approx(4.6, abs=0.05)


def test_a_person_without_keys_does_not_prevent_the_view():
    first, second = people(walk(1.0), walk(1.0, speed=0.5))
    second.animation_data_clear()
    assert side_extent(first, [first, second], ALONG_X) == pytest.approx((1.0, 2.6))
    assert side_extent(second, [first, second], ALONG_X) == pytest.approx((1.0, 2.6))


@pytest.mark.parametrize("aspect", [0.4, 1.0, 2.5])
@pytest.mark.parametrize("shown", [(1.0, 2.6), (8.0, 2.6)])
def test_width_and_height_both_fit_into_a_viewport_of_any_shape(shown, aspect):
    span = comparison._span(shown, aspect)  # across the longer side
    size = (span, span / aspect) if aspect >= 1.0 else (span * aspect, span)
    assert size[0] >= shown[0] - 1e-9
    assert size[1] >= shown[1] - 1e-9
    assert size[0] == pytest.approx(shown[0]) or size[1] == pytest.approx(shown[1])
