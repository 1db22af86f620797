# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of files: what is written, of imported motions, rigs, the scene, the report."""

from __future__ import annotations

from pathlib import Path

from .record import Argument, Choice, Option, Place, Property, Section

SHAPES = (
    Choice("keyed", "Shape Keys", "The body's shape as shape keys with one keyframe each", 0),
    Choice(
        "baked",
        "In the Mesh",
        "No shape keys: the shape is applied to the mesh, for engines that limit shape keys to "
        "0..1",
        2,
    ),
)
ROOTS = (
    Choice("bone", "In Bones", "The pelvis moves through the scene", 0),
    Choice(
        "object",
        "On Object",
        "Root motion: an empty carries position and heading, the rig moves relative to it",
        1,
    ),
    Choice("in-place", "In Place", "No root motion: the character stays in place", 2),
)
BVH_UNITS = (
    Choice("cm", "Centimetres", "One unit is a centimetre, as most tools expect", 0),
    Choice("m", "Metres", "One unit is a metre", 1),
)
SKELETONS = (
    Choice("scope", "Scope", "The names of the body's joints", 0),
    Choice("mixamo", "Mixamo", "Names of Mixamo's characters", 1),
    Choice("ue5", "Unreal 5", "Names of Unreal's mannequins", 2),
    Choice("vrm", "VRM", "Names of VRM's humanoid table", 3),
    Choice("unity", "Unity", "Names of Unity's humanoid table", 4),
)
FRAME_RATES = (
    Choice(
        "auto",
        "Automatic",
        "Set the scene's frame rate to the footage's unless something in the scene is animated",
        0,
    ),
    Choice("set", "Set from Footage", "Set the scene's frame rate to the footage's", 1),
    Choice(
        "keep",
        "Keep",
        "Leave the scene's frame rate; the motion keeps its speed, with keys between frames",
        2,
    ),
    Choice(
        "resample",
        "Resample to Scene",
        "Leave the scene's frame rate; one key on each of its frames",
        3,
    ),
)

_FILES = Place.COMMAND_LINE | Place.IMPORT

OUTPUT_OPTIONS = (
    Option(
        "shape",
        str,
        "keyed",
        _FILES | Place.PANEL,
        "how the person's body shape is stored",
        choices=SHAPES,
        argument=Argument(
            "--shape-keys",
            help="shape keys, or baked into the mesh for engines that clamp morph targets",
        ),
    ),
    Option(
        "take",
        str,
        "",
        Place.PANEL,
        "name of the next capture, its actions and the exported animation; if empty, the footage's "
        "name",
    ),
    Option(
        "bvh_unit",
        str,
        "cm",
        _FILES | Place.EXPORT,
        "unit of length in .bvh files",
        choices=BVH_UNITS,
        blender=Property(label="Unit"),
    ),
    Option(
        "skeleton",
        str,
        "scope",
        _FILES,
        "names of the bones of Scope's own body in .glb, .fbx, .bvh and .usdc files; the rest pose "
        "is a T-pose",
        choices=SKELETONS,
    ),
    Option(
        "deform_bones",
        bool,
        False,
        _FILES | Place.EXPORT,
        "leave out bones of a rig that deform nothing, such as controls, in .glb, .fbx and .usdc "
        "files; except in .glb, those with deforming bones below them stay",
        blender=Property(label="Only Deform Bones"),
    ),
    Option(
        "file_per_person",
        bool,
        False,
        Place.COMMAND_LINE,
        "write a separate file for each person, in every format",
    ),
    Option(
        "retarget",
        Path,
        None,
        _FILES,
        "retarget the motion to the rig in this .blend, .fbx, .glb, .gltf or .vrm file; given "
        "several times, each rig has an output of its own, in the same order",
        argument=Argument(metavar="RIG", repeated=True),
    ),
    Option(
        "rig_object",
        str,
        "",
        _FILES,
        "name of the armature, if RIG contains several",
        argument=Argument(metavar="NAME", repeated=True),
    ),
    Option(
        "bone_map",
        Path,
        None,
        _FILES,
        "bone assignments, a JSON file saved in the panel",
        argument=Argument(metavar="FILE", repeated=True),
    ),
    Option(
        "expression_map",
        Path,
        None,
        _FILES,
        "shape keys that follow the captured expressions, a JSON file saved in the panel",
        argument=Argument(metavar="FILE", repeated=True),
    ),
    Option(
        "retarget_root",
        str,
        "bone",
        _FILES,
        "root motion of the rig: in its pelvis bone, on its object, or none (in-place)",
        choices=ROOTS,
    ),
    Option(
        "frame_rate",
        str,
        "auto",
        Place.PANEL,
        "how the scene's frame rate is set",
        choices=FRAME_RATES,
        blender=Property(section=Section.SCENE),
    ),
    Option(
        "start_frame",
        int,
        1,
        Place.PANEL,
        "scene frame at which the footage starts",
        minimum=0,
        blender=Property(label="First Frame", section=Section.SCENE),
    ),
    Option(
        "set_frame_range",
        bool,
        True,
        Place.PANEL,
        "set the scene's frame range to the captured frames",
        blender=Property(section=Section.SCENE),
    ),
    Option(
        "with_camera",
        bool,
        True,
        Place.PANEL,
        "add the estimated camera, with the footage in its background",
        blender=Property(label="Camera with Footage", section=Section.SCENE),
    ),
    Option(
        "with_markers",
        bool,
        True,
        Place.PANEL,
        "add timeline markers where the motion should be reviewed",
        blender=Property(label="Markers", section=Section.SCENE),
    ),
)

_REPORTING = _FILES | Place.LIVE

REPORT_OPTIONS = (
    Option(
        "json",
        bool,
        False,
        _REPORTING,
        "print a machine-readable report on stdout",
        argument=Argument(inherited=False),
    ),
    Option(
        "quiet",
        bool,
        False,
        _REPORTING,
        "no progress bar",
        argument=Argument(inherited=False),
    ),
)

UP_AXES = (
    Choice("auto", "Automatic", "The axis along which the person is upright", 0),
    Choice("z", "Z", "Z points up, as in AMASS", 1),
    Choice("y", "Y", "Y points up, as in AIST++ and most engines", 2),
    Choice(
        "camera",
        "Camera (-Y)",
        "Y points down, as in the camera's axes of pose estimation networks",
        3,
    ),
)

IMPORT_OPTIONS = (
    Option(
        "up_axis",
        str,
        "auto",
        Place.IMPORT,
        "which way is up in the file; files written by Scope have z up",
        choices=UP_AXES,
        argument=Argument("--up"),
        blender=Property(label="Up"),
    ),
    Option(
        "motion_rate",
        float,
        0.0,
        Place.IMPORT,
        "frames per second, if the file does not state them; 0: 30",
        unit="frames per second",
        minimum=0.0,
        maximum=1000.0,
        argument=Argument(
            "--rate",
            "N",
            help="frames per second, if the file does not state them",
            default_text="30",
        ),
        blender=Property(label="Frame Rate"),
    ),
)
