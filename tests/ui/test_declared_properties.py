# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's properties agree with the declared options, and with the values that .blend files
store.
"""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest
from scope.scope_addon import options as declarations
from scope.scope_addon.options import OPTIONS, Option, Place, Property, Section, option, options_at
from scope.scope_addon.scene.character.body_mesh import MODES
from scope.scope_addon.scene.timing import RATE_POLICIES
from scope.scope_addon.ui import capture_panel
from scope.scope_addon.ui.capture_job import capture_request
from scope.scope_addon.ui.declared_properties import (
    choices_of,
    draw_section,
    option_values,
    property_name,
    with_options,
)
from scope.scope_addon.ui.preferences import SCOPE_AP_preferences

# A .blend stores these numbers: a file that was saved with an earlier version must open with the
# same settings.
STORED = {
    "quality": {"FAST": 0, "BALANCED": 1, "BEST": 2},
    "people": {"LARGEST": 0, "ALL": 1, "COUNT": 2},
    "body": {"SCOPE": 0, "SCOPE_H": 1, "FILE": 2},
    "hands": {"OFF": 0, "ON": 1, "AUTO": 2},
    "lens": {"AUTO": 0, "FOCAL": 1, "FOV": 2, "FILE": 3, "CAMERA": 4},
    "frame_rate": {"AUTO": 0, "SET": 1, "KEEP": 2, "RESAMPLE": 3},
    "shape": {"KEYED": 0, "BAKED": 2},
    "provider": {"AUTO": 0, "CPU": 1, "CUDA": 2, "TENSORRT": 3, "DIRECTML": 4, "COREML": 5},
}
# Number of the property's units in one of the option's.
UNITS = {("m", "cm"): 100.0, ("degrees", "radians"): math.pi / 180, ("", "s"): 1.0}
PLACES = [(each, place) for place in (Place.PANEL, Place.PREFERENCES) for each in options_at(place)]
IDS = [each.name for each, _ in PLACES]


def properties(place):
    owner = bpy.context.scene.scope if place is Place.PANEL else SCOPE_AP_preferences
    return owner.bl_rna.properties


@pytest.mark.parametrize("name", STORED)
def test_stored_numbers_stay(name):
    place = Place.PREFERENCES if name == "provider" else Place.PANEL
    found = properties(place)[property_name(option(name))]
    assert {item.identifier: item.value for item in found.enum_items} == STORED[name]


@pytest.mark.parametrize(("declared", "place"), PLACES, ids=IDS)
def test_defaults_and_ranges_of_the_properties_are_within_the_options(declared, place):
    found = properties(place)[property_name(declared)]
    if choices := choices_of(declared):
        assert set(declared.values) <= {choice.value for choice in choices}
        assert found.default == declared.default.upper()
    elif declared.blender.default is None and found.type in ("BOOLEAN", "INT", "FLOAT"):
        assert found.default == declared.default
    if found.type not in ("INT", "FLOAT"):
        return
    scale = UNITS[declared.unit, declared.blender.unit] if declared.blender.unit else 1.0
    assert found.hard_min <= found.default <= found.hard_max
    # 0: no height or speed is given
    if declared.minimum is not None and declared.name not in ("heights_m", "speed"):
        assert found.hard_min >= declared.minimum * scale
    if declared.maximum is not None:
        assert found.hard_max <= declared.maximum * scale * (1 + 1e-6)


def test_an_unchanged_panel_requests_the_defaults(footage):
    scene = bpy.context.scene
    scene.scope.footage = str(footage)
    defaults = {each.name: each.default for each in options_at(Place.WORKER)}
    assert capture_request(scene).values == defaults
    assert option_values(None, Place.PREFERENCES).items() <= defaults.items()


@pytest.mark.parametrize(
    ("settings", "name", "value"),
    [
        ({"people": "COUNT", "people_count": 3}, "people", 3),
        ({"people": "ALL", "people_count": 3}, "people", "all"),
        ({"lens": "FOCAL", "focal_mm": 35.0}, "focal_mm", 35.0),
        ({"focal_mm": 35.0}, "focal_mm", None),
        ({"lens": "FOV", "fov": math.radians(50)}, "fov_deg", pytest.approx(50)),
        ({"lens": "FILE", "calibration_file": "/a/lens.json"}, "calibration", "/a/lens.json"),
        ({"calibration_file": "/a/lens.json"}, "calibration", None),
        ({"range_start": 2.0}, "start", None),
        ({"height_cm": 110.0}, "body", "scope_child"),
        ({"height_cm": 182.0}, "heights_m", pytest.approx((1.82,))),
        ({"hands": "ON"}, "body", "scope_h"),
        ({"hands": "AUTO"}, "body", "scope_h"),
        ({"body": "FILE", "body_file": "/a/smpl.npz"}, "body", "/a/smpl.npz"),
        ({"smoothing": False}, "smoothing", False),
    ],
)
def test_settings_of_the_panel_are_sent_to_the_worker(footage, settings, name, value):
    scene = bpy.context.scene
    scene.scope.footage = str(footage)
    for key, setting in settings.items():
        setattr(scene.scope, key, setting)
    assert capture_request(scene).values[name] == value


def test_choices_of_the_scene_are_those_that_building_supports():
    assert set(option("shape").values) == set(MODES)
    assert set(option("frame_rate").values) - {"auto"} <= set(RATE_POLICIES)


def test_a_new_option_appears_in_the_panel(monkeypatch):
    extra = Option(
        "stride",
        int,
        1,
        Place.WORKER | Place.PANEL,
        "capture every Nth frame",
        minimum=1,
        blender=Property(maximum=10),
    )
    monkeypatch.setattr(declarations, "OPTIONS", (*OPTIONS, extra))

    @with_options(Place.PANEL)
    class ExtendedSettings(bpy.types.PropertyGroup):
        """Only declared options."""

    bpy.utils.register_class(ExtendedSettings)
    bpy.types.Scene.scope_extended = bpy.props.PointerProperty(type=ExtendedSettings)
    try:
        settings = bpy.context.scene.scope_extended
        found = settings.bl_rna.properties["stride"]
        assert (found.name, found.description) == ("Stride", "Capture every Nth frame")
        assert (found.default, found.hard_min, found.hard_max) == (1, 1, 10)
        settings.stride = 4
        assert option_values(settings, Place.PANEL)["stride"] == 4
    finally:
        del bpy.types.Scene.scope_extended
        bpy.utils.unregister_class(ExtendedSettings)


def test_a_section_draws_its_options_in_their_order():
    drawn = []
    layout = SimpleNamespace(prop=lambda settings, name: drawn.append(name))
    draw_section(layout, bpy.context.scene.scope, Section.SCENE)
    assert drawn == ["frame_rate", "start_frame", "set_frame_range", "with_camera", "with_markers"]


def test_every_option_of_the_panel_is_drawn_once():
    """By its section, or by name in the code of the capture panel, not by both."""
    source = Path(capture_panel.__file__).read_text(encoding="utf-8")
    for each in options_at(Place.PANEL):
        named = f'settings, "{property_name(each)}"' in source
        assert named != (each.blender.section is not None), each.name
