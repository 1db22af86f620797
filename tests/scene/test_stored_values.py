# SPDX-License-Identifier: GPL-3.0-or-later
"""Custom properties that somebody has changed are read as if they were not there."""

import math

import bpy
import pytest
from scope.scope_addon.scene.stored_values import (
    smoothing_of,
    start_frame,
    stored_number,
    stored_numbers,
    stored_text,
)

OTHERS = {
    "text": "abc",
    "list": [1.0, 2.0],
    "texts": ["a", "b"],
    "group": {"a": 1},
    "bytes": b"abc",
    "nothing": None,
    "nan": math.nan,
    "infinite": math.inf,
    "huge": 1e300,
}


@pytest.fixture
def obj():
    return bpy.data.objects.new("obj", None)


def put(obj, name, value):
    if value is None:
        obj.pop(name, None)
    else:
        obj[name] = value


def test_what_is_no_number_counts_as_missing(obj):
    for kind, value in OTHERS.items():
        for name in ("n", "scope_start", "scope_smoothing"):
            put(obj, name, value)
        assert stored_number(obj, "n", 5.0, -1e6, 1e6) == 5.0, kind
        assert (start_frame(obj), smoothing_of(obj)) == (0.0, 1.0), kind


def test_a_number_has_limits(obj):
    for value, found in ((3, 3.0), (-2.5, -2.5), (-7.0, 5.0), (11, 5.0)):
        obj["n"] = value
        assert stored_number(obj, "n", 5.0, -5.0, 10.0) == found


def test_a_list_has_finite_numbers_only(obj):
    for values in ([1, 2], [1.5, -2.5], []):
        put(obj, "n", values)
        assert stored_numbers(obj, "n") == values
    others = [value for kind, value in OTHERS.items() if kind != "list"]
    for value in (*others, [0.0, math.nan], [0.0, math.inf], [1e300]):
        put(obj, "n", value)
        assert stored_numbers(obj, "n") == []


def test_a_text_is_a_text(obj):
    for value in OTHERS.values():
        put(obj, "n", value)
        assert stored_text(obj, "n") == (value if isinstance(value, str) else "")
