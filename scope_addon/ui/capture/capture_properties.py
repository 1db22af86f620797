# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel offers and what it shows, kept with each scene and saved in the .blend."""

from __future__ import annotations

import math

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from .capture_operators import state

_FIXED: set[str] = set()  # not animatable: a keyframe on a setting would only confuse
# Paths may begin with "//", the .blend's folder; since 4.5 Blender wants to be told.
_PATH = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()

# The numbers are what a .blend stores; they must never change.
QUALITIES = (
    ("FAST", "Fast", "Smallest network: for a first look or a slow computer", 0),
    ("BALANCED", "Balanced", "A little less exact than the best, and faster", 1),
    ("BEST", "Best", "Largest network, most exact", 2),
)
PEOPLE = (
    ("LARGEST", "One", "The most prominent person", 0),
    ("ALL", "Everyone", "Everybody who is seen well enough", 1),
    ("COUNT", "At Most", "The most prominent ones, as many as you say", 2),
)
BODIES = (
    ("SCOPE", "Body", "The built-in body with SMPL's 24 joints", 0),
    ("SCOPE_H", "Body with Hands", "The built-in body with SMPL+H's 52 joints: fingers that you can animate", 1),
    ("FILE", "From File", "Your own SMPL, SMPL+H, SMPL-X or STAR file", 2),
)
LENSES = (
    ("AUTO", "Automatic", "Read from the file where the camera wrote it, assumed otherwise", 0),
    ("FOCAL", "Focal Length", "You know the focal length in 35 mm film terms", 1),
    ("FOV", "Field of View", "You know the field of view along the picture's longer side", 2),
    ("FILE", "Calibration", "You have calibrated the camera: focal lengths, centre and distortion from a file", 3),
)
FRAME_RATES = (
    ("AUTO", "Automatic", "Set the scene's frame rate to the footage's while nothing in the scene is animated yet", 0),
    ("SET", "Set from Footage", "Set the scene's frame rate to the footage's", 1),
    ("KEEP", "Keep", "Leave the scene's frame rate; the motion keeps its speed, with keys between frames", 2),
    ("RESAMPLE", "Resample to Scene", "Leave the scene's frame rate; one key on each of its frames", 3),
)
SHAPES = (
    ("KEYED", "Shape Keys", "The body's shape as shape keys with one keyframe each", 0),
    ("PER_FRAME", "Shape Keys per Frame", "The same, with a keyframe on every frame", 1),
    ("BAKED", "In the Mesh", "No shape keys: the shape is the mesh, for engines that limit shape keys to 0..1", 2),
)


def _forget_failure(_settings: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """What went wrong with other footage is no news of this one."""
    state.message = ""


class SCOPE_PG_warning(bpy.types.PropertyGroup):
    """One line of the result."""

    text: StringProperty()
    spans: StringProperty()  # scene frames it is about: "12-18,40"


class SCOPE_PG_result(bpy.types.PropertyGroup):
    """What the last capture of this scene found."""

    footage: StringProperty()
    collection: PointerProperty(type=bpy.types.Collection)
    people: IntProperty()
    frames: IntProperty()
    valid_frames: IntProperty()
    reprojection_px: FloatProperty()
    frames_per_second: FloatProperty()
    camera: StringProperty()
    execution: StringProperty()
    resolution: IntVectorProperty(size=2)
    pixel_aspect: FloatVectorProperty(size=2)
    warnings: CollectionProperty(type=SCOPE_PG_warning)


class SCOPE_PG_settings(bpy.types.PropertyGroup):
    """What the user chose."""

    footage: StringProperty(
        name="Footage",
        subtype="FILE_PATH",
        options=_PATH,
        update=_forget_failure,
        description="Video or picture of a person to capture",
    )
    quality: EnumProperty(
        name="Quality", items=QUALITIES, default="BEST", options=_FIXED, description="Speed against accuracy"
    )
    people: EnumProperty(
        name="People", items=PEOPLE, default="LARGEST", options=_FIXED, description="Who is captured"
    )
    people_count: IntProperty(
        name="At Most", default=2, min=1, max=12, options=_FIXED, description="How many people are captured at most"
    )
    body: EnumProperty(
        name="Body", items=BODIES, default="SCOPE", options=_FIXED, description="The body that is fitted to the person"
    )
    body_file: StringProperty(
        name="Body File",
        subtype="FILE_PATH",
        options=_PATH,
        description="SMPL, SMPL+H, SMPL-X or STAR model (.npz or .pkl); the one in the preferences when empty",
    )
    hands: BoolProperty(
        name="Hands",
        default=False,
        options=_FIXED,
        description="Capture the fingers too, on the body with hands; takes longer",
    )
    # Not of unit LENGTH: a scene in other units would show, and take, something else than people's heights.
    height_cm: FloatProperty(
        name="Height (cm)",
        default=0.0,
        min=0.0,
        max=260.0,
        step=100,
        precision=0,
        options=_FIXED,
        description="How tall the person is in centimetres, of several people the most prominent one: all sizes and "
        "ways follow from it. 0: found from the footage, usually within a tenth",
    )
    lens: EnumProperty(
        name="Lens",
        items=LENSES,
        default="AUTO",
        options=_FIXED,
        description="Where the camera's focal length comes from",
    )
    focal_mm: FloatProperty(
        name="Focal Length",
        default=26.0,
        min=4.0,
        max=2000.0,
        soft_max=200.0,
        options=_FIXED,
        description="35 mm equivalent focal length in millimetres; a telephone's main camera has about 26",
    )
    fov: FloatProperty(
        name="Field of View",
        subtype="ANGLE",
        default=math.radians(65.0),
        min=math.radians(2.0),
        max=math.radians(170.0),
        options=_FIXED,
        description="Angle of view along the longer side of the picture",
    )
    calibration_file: StringProperty(
        name="Calibration",
        subtype="FILE_PATH",
        options=_PATH,
        description="JSON with OpenCV's intrinsics (3x3), and if need be dist (five numbers) and size (width, height)",
    )
    use_range: BoolProperty(
        name="Part of the Video",
        default=False,
        options=_FIXED,
        description="Capture only a part of the video",
    )
    range_start: FloatProperty(
        name="From",
        default=0.0,
        min=0.0,
        step=10,
        precision=2,
        subtype="TIME_ABSOLUTE",
        unit="TIME_ABSOLUTE",
        options=_FIXED,
        description="Seconds into the video from which on it is captured",
    )
    range_end: FloatProperty(
        name="To",
        default=10.0,
        min=0.0,
        step=10,
        precision=2,
        subtype="TIME_ABSOLUTE",
        unit="TIME_ABSOLUTE",
        options=_FIXED,
        description="Seconds into the video up to which it is captured",
    )
    smoothing: BoolProperty(
        name="Smooth",
        default=True,
        options=_FIXED,
        description="Take the jitter out of the motion; off keeps every frame as it was solved, feet not held",
    )
    frame_rate: EnumProperty(
        name="Frame Rate",
        items=FRAME_RATES,
        default="AUTO",
        options=_FIXED,
        description="What happens to the scene's frame rate",
    )
    start_frame: IntProperty(
        name="First Frame", default=1, min=0, options=_FIXED, description="Scene frame on which the footage begins"
    )
    set_frame_range: BoolProperty(
        name="Set Frame Range",
        default=True,
        options=_FIXED,
        description="Let the scene play from the first to the last captured frame",
    )
    shape: EnumProperty(
        name="Shape", items=SHAPES, default="KEYED", options=_FIXED, description="How the person's body shape is stored"
    )
    with_markers: BoolProperty(
        name="Markers",
        default=True,
        options=_FIXED,
        description="Put markers on the timeline where the motion deserves a look",
    )
    with_camera: BoolProperty(
        name="Camera with Footage",
        default=True,
        options=_FIXED,
        description="Add the camera the footage was seen with, the footage behind the scene",
    )
    result: PointerProperty(type=SCOPE_PG_result)


CLASSES = (SCOPE_PG_warning, SCOPE_PG_result, SCOPE_PG_settings)


def attach() -> None:
    """Give every scene its settings."""
    bpy.types.Scene.scope = PointerProperty(type=SCOPE_PG_settings)


def detach() -> None:
    """Take the settings away; their values stay in the .blend until it is saved without the extension."""
    del bpy.types.Scene.scope
